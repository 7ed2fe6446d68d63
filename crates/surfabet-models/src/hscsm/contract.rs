//! Sparse-coded surface patches as a model like the others.

use surfabet_entropy::Coder;

use super::channels::dictionary::HscsmDictionary;
use super::coding::Streams;
use super::model::{Channel, HscsmHeader, HscsmModel};
use super::options::HscsmOptions;
use super::report::HscsmFigures;
use crate::contract::{Source, SurfaceModel, exactly, own_methods};
use crate::summary::Summary;

impl SurfaceModel for HscsmModel {
    const METHOD: &'static str = "hscsm";
    const STREAMS: usize = 5;
    const KEEPS_THICKNESS: bool = false;
    type Options = HscsmOptions;
    type Header = HscsmHeader;
    type Figures = Option<HscsmFigures>;
    type Vocabulary = HscsmDictionary;

    fn header(&self) -> HscsmHeader {
        self.header()
    }

    fn code<C: Coder>(
        source: Source<'_, Self>,
        streams: &mut [C],
    ) -> Result<Option<Self>, C::Error> {
        let [poses, masks, dictionaries, depth, color] = exactly(streams);
        let mut streams = Streams { poses, masks, dictionaries, depth, color };
        match source {
            Source::Model(model) => model.write(&mut streams).map(|()| None),
            Source::Streams { header, vocabulary, .. } => {
                Self::read(header, vocabulary, &mut streams).map(Some)
            }
        }
    }

    fn vocabulary(&self) -> Option<HscsmDictionary> {
        Some(self.dictionary())
    }

    fn shares_vocabulary(&self) -> bool {
        self.shares_vocabulary()
    }

    fn summary(&self) -> Summary {
        let mut summary = Summary::default()
            .with("levels", self.levels().len())
            .with("colour", self.has_color())
            .with("intensity", self.has_intensity())
            .with("patches", self.len());
        let entries = |channel: &Channel| channel.dictionary.n_atoms();
        for (j, level) in self.levels().iter().enumerate() {
            summary = summary
                .with(format!("level {j}: resolution (m)"), level.pixel_size)
                .with(format!("level {j}: pixels per side"), u64::from(level.pixels))
                .with(format!("level {j}: patches"), level.len())
                .with(format!("level {j}: area (m2)"), level.covered_area())
                .with(format!("level {j}: set pixels"), level.set_pixels())
                .with(format!("level {j}: depth dictionary entries"), entries(&level.depth))
                .with(
                    format!("level {j}: colour dictionary entries"),
                    level.color.as_ref().map_or(0, entries),
                );
        }
        summary
    }

    own_methods!();
}
