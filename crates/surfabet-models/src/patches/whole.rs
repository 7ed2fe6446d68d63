//! A model of patches with the points beside them, with instances or without: the smaller of two.

use surfabet_geom::Progress;

use super::coding::Geometry;
use super::constants::WORTH;
use super::far_points::{Completeness, FoldedInput, with_points_within, with_share_of_points};
use super::instances::Instances;
use super::model::{Attributes, Lattice, PatchModel};
use super::surface::leaf::Leaf;
use crate::contract::SurfaceModel;
use crate::error::Result;
use crate::report::AttributeFigures;

/// Bytes that instances take beside their stream: an entry in the table of sections, their number.
const SECTION: f64 = 12.0;

/// What a model is made of, but for the points beside the patches.
pub(super) struct Described {
    pub geometry: Geometry,
    pub attributes: Attributes,
    pub figures: Vec<AttributeFigures>,
    pub instances: Instances,
}

impl Described {
    /// Bits of all attributes.
    pub fn attribute_bits(&self) -> f64 {
        8.0 * self.figures.iter().map(|of| of.bytes).sum::<f64>()
    }
}

/// A model with what the report says of its attributes.
pub(super) struct Whole {
    pub model: PatchModel,
    pub attribute_cells: usize,
    pub attributes: Vec<AttributeFigures>,
}

impl Whole {
    /// Bytes of all streams, and of what else instances take.
    fn bytes(&self) -> f64 {
        let section = if self.model.header().n_instances > 0 { SECTION } else { 0.0 };
        self.model.price().iter().sum::<f64>() + section
    }
}

/// What is asked of a model as a whole.
pub(super) struct Wanted<'a> {
    pub lattice: Lattice,
    /// The input, metres about the origin.
    pub positions: &'a [[f32; 3]],
    /// Patches of other models that count as decoded too.
    pub near: &'a [Leaf],
    pub max_error: Option<f64>,
    pub completeness: Completeness,
}

impl Wanted<'_> {
    /// The model of what was described, or that of what recurs where that takes so many fewer bytes that a little more error is paid for.
    ///
    /// # Errors
    /// As [`with_points_within`].
    pub fn smaller(
        &self,
        coded: Described,
        recurring: Option<(Described, Vec<u16>)>,
        progress: &dyn Progress,
    ) -> Result<Whole> {
        let coded = self.bare(coded)?;
        let Some((recurring, fold)) = recurring else { return self.complete(coded, &[], progress) };
        let recurring = self.bare(recurring)?;
        if recurring.bytes() > WORTH * coded.bytes() {
            return self.complete(coded, &[], progress);
        }
        let recurring = self.complete(recurring, &fold, progress)?;
        // Points beside the patches only add to what these take.
        if recurring.bytes() <= WORTH * coded.bytes() {
            return Ok(recurring);
        }
        let coded = self.complete(coded, &[], progress)?;
        Ok(if recurring.bytes() <= WORTH * coded.bytes() { recurring } else { coded })
    }

    /// Without points beside the patches.
    fn bare(&self, described: Described) -> Result<Whole> {
        let Described { geometry, attributes, figures, instances } = described;
        let attribute_cells = attributes.cells.len();
        let n_points = self.positions.len() as u64;
        let model = PatchModel::new(n_points, self.lattice, geometry, attributes)?
            .with_instances(instances)
            .with_max_error_forward(self.completeness.forward);
        Ok(Whole { model, attribute_cells, attributes: figures })
    }

    /// With the points beside the patches that the bound or the completeness asks for.
    fn complete(&self, whole: Whole, fold: &[u16], progress: &dyn Progress) -> Result<Whole> {
        let Self { positions, near, max_error, completeness, .. } = *self;
        let of = FoldedInput { positions, fold };
        let Whole { model, .. } = whole;
        let model = match max_error {
            // The tile next to this one may choose other patches than `near`: they bound nothing.
            Some(bound) => with_points_within(model, of, bound, completeness.forward, progress),
            None => with_share_of_points(model, of, near, completeness, progress),
        };
        Ok(Whole { model: model?, ..whole })
    }
}
