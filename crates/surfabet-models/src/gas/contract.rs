//! A gas as a model like the others.

use surfabet_entropy::Coder;

use super::coding::Streams;
use super::finish::GasFigures;
use super::model::{GasHeader, GasModel};
use super::options::GasOptions;
use crate::contract::{NoVocabulary, Source, SurfaceModel, exactly, own_methods};
use crate::summary::Summary;

impl SurfaceModel for GasModel {
    const METHOD: &'static str = "gas";
    const STREAMS: usize = 6;
    const KEEPS_THICKNESS: bool = true;
    type Options = GasOptions;
    type Header = GasHeader;
    type Figures = Option<GasFigures>;
    type Vocabulary = NoVocabulary;

    fn header(&self) -> GasHeader {
        self.header().clone()
    }

    fn code<C: Coder>(
        source: Source<'_, Self>,
        streams: &mut [C],
    ) -> Result<Option<Self>, C::Error> {
        let [topology, positions, normals, sizes, colors, intensities] = exactly(streams);
        let mut streams = Streams { topology, positions, normals, sizes, colors, intensities };
        match source {
            Source::Model(model) => model.write(&mut streams).map(|()| None),
            Source::Streams { header, .. } => Self::read(header, &mut streams).map(Some),
        }
    }

    fn summary(&self) -> Summary {
        let components = self.components().into_iter().max().map_or(0, |last| u64::from(last) + 1);
        Summary::default()
            .with("neurons", self.len())
            .with("edges", self.edges().len())
            .with("components", components)
            .with("colour", self.has_color())
            .with("intensity", self.has_intensity())
            .with("mean error (m)", self.mean_error())
            .with("position step (m)", self.position_step())
    }

    own_methods!();
}
