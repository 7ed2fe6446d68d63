//! Patches on a lattice as a model like the others.

use surfabet_entropy::Coder;
use surfabet_geom::{PointCloud, Progress};

use super::attributes::MAX_ATTRIBUTES;
use super::learn::PatchesFigures;
use super::model::{PatchModel, PatchesHeader, Streams};
use super::options::PatchesOptions;
use crate::contract::{DecodeOptions, NoVocabulary, Source, SurfaceModel, exactly, own_methods};
use crate::error::Result;
use crate::region::Region;
use crate::summary::Summary;

/// Memory that a cell takes while it is read, for the geometry and for each attribute.
const BYTES_PER_CELL: u64 = 64;

/// Memory that the number of a patch of an instance takes.
const BYTES_PER_COPY: u64 = 8;

impl SurfaceModel for PatchModel {
    const METHOD: &'static str = "patches";
    const STREAMS: usize = 4 + MAX_ATTRIBUTES;
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
    ) -> std::result::Result<Option<Self>, C::Error> {
        let (first, attributes) = streams.split_at_mut(Self::STREAMS - MAX_ATTRIBUTES);
        let [geometry, color, extra, instances] = exactly(first);
        let attributes = exactly(attributes);
        let streams = Streams { geometry, color, extra, instances, attributes };
        match source {
            Source::Model(model) => model.write(streams).map(|()| None),
            Source::Streams { header, budget, .. } => {
                let each = BYTES_PER_CELL * (1 + header.attributes.len() as u64);
                let limits = [budget.most(each), budget.most(BYTES_PER_COPY)];
                Self::read(header, limits, streams).map(Some)
            }
        }
    }

    fn summary(&self) -> Summary {
        let mut summary = Summary::default()
            .with("levels", u64::from(self.lattice().levels))
            .with("colour", self.has_color())
            .with("intensity", self.has_intensity())
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
        if !self.instances().all.is_empty() {
            summary = summary
                .with("instances", self.header().n_instances)
                .with("patches of instances", self.instances().n_patches());
        }
        for header in self.header().attributes {
            summary = summary.with(format!("attribute {}", header.name), header.in_words());
        }
        if let Some(bound) = self.max_error() {
            summary = summary.with("max error (m)", bound);
        }
        match self.max_error_forward() {
            Some(bound) => summary.with("max error forward (m)", bound),
            None => summary,
        }
    }

    fn decode_within(
        &self,
        region: &Region,
        options: DecodeOptions,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        self.decode_part(Some(region), options, progress)
    }

    own_methods!();
}
