//! Patches on a lattice as a model like the others.

use surfabet_entropy::Coder;

use super::learn::PatchesFigures;
use super::model::{PatchModel, PatchesHeader};
use super::options::PatchesOptions;
use crate::contract::{NoVocabulary, Source, SurfaceModel, exactly, own_methods};
use crate::summary::Summary;

/// Memory that a cell of colour takes while it is read.
const BYTES_PER_CELL: u64 = 64;

impl SurfaceModel for PatchModel {
    const METHOD: &'static str = "patches";
    const STREAMS: usize = 3;
    const KEEPS_THICKNESS: bool = true;
    type Options = PatchesOptions;
    type Header = PatchesHeader;
    type Figures = Option<PatchesFigures>;
    type Vocabulary = NoVocabulary;

    fn header(&self) -> PatchesHeader {
        self.header()
    }

    fn code<C: Coder>(
        source: Source<'_, Self>,
        streams: &mut [C],
    ) -> Result<Option<Self>, C::Error> {
        let [geometry, color, extra] = exactly(streams);
        match source {
            Source::Model(model) => model.write(geometry, color, extra).map(|()| None),
            Source::Streams { header, budget, .. } => {
                let max_cells = budget.most(BYTES_PER_CELL);
                Self::read(header, max_cells, geometry, color, extra).map(Some)
            }
        }
    }

    fn summary(&self) -> Summary {
        let mut summary = Summary::default()
            .with("levels", u64::from(self.lattice().levels))
            .with("colour", self.has_color())
            .with("patches", self.len());
        let lattice = self.lattice();
        for (j, of) in (0..lattice.levels).zip(self.level_sizes()) {
            let pixel = lattice.pixel_of(j);
            summary = summary
                .with(format!("level {j}: resolution (m)"), pixel)
                .with(format!("level {j}: patches"), of.patches)
                .with(format!("level {j}: area (m2)"), of.set_pixels as f64 * pixel * pixel);
        }
        summary = summary.with("extra points", self.header().n_extra);
        match self.max_error() {
            Some(bound) => summary.with("max error (m)", bound),
            None => summary,
        }
    }

    own_methods!();
}
