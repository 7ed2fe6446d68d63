//! Planes as a model like the others.

use surfabet_entropy::Coder;

use super::coding::Streams;
use super::learn::PlanesFigures;
use super::model::{MAX_MODEL_TILES, PlaneModel, PlanesHeader};
use super::options::PlanesOptions;
use crate::contract::{NoVocabulary, Source, SurfaceModel, exactly, own_methods};
use crate::summary::Summary;

/// Memory that a tile takes, as stored and as restored.
const BYTES_PER_TILE: u64 = 32;

impl SurfaceModel for PlaneModel {
    const METHOD: &'static str = "planes";
    const STREAMS: usize = 5;
    const KEEPS_THICKNESS: bool = true;
    type Options = PlanesOptions;
    type Header = PlanesHeader;
    type Figures = Option<PlanesFigures>;
    type Vocabulary = NoVocabulary;

    fn header(&self) -> PlanesHeader {
        self.header().clone()
    }

    fn code<C: Coder>(
        source: Source<'_, Self>,
        streams: &mut [C],
    ) -> Result<Option<Self>, C::Error> {
        let [poses, masks, sizes, colors, intensities] = exactly(streams);
        let mut streams = Streams { poses, masks, sizes, colors, intensities };
        match source {
            Source::Model(model) => model.write(&mut streams).map(|()| None),
            Source::Streams { header, budget, .. } => {
                let most = budget.most(BYTES_PER_TILE).min(MAX_MODEL_TILES);
                Self::read(header, most, &mut streams).map(Some)
            }
        }
    }

    fn summary(&self) -> Summary {
        let patches = self.patches();
        let tiles: usize = patches.iter().map(|p| p.tiles.supported().len()).sum();
        let supported: usize = patches.iter().map(|p| p.tiles.n_supported()).sum();
        let area: f64 = patches.iter().map(|p| p.tiles.area()).sum();
        // As planar as section III asks for: within half the grid size.
        let limit = 0.5 * self.grid_size();
        let planar = patches.iter().filter(|p| p.standard_deviation <= limit).count();
        Summary::default()
            .with("planes", self.len())
            .with("of these planar", planar)
            .with("colour", self.has_color())
            .with("intensity", self.has_intensity())
            .with("grid size (m)", self.grid_size())
            .with("area (m2)", area)
            .with("tiles", tiles)
            .with("of these supported", supported)
            .with("outliers", self.header().n_outliers)
    }

    own_methods!();
}
