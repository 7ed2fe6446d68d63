//! Patches: mask, depth of the middle, shapes and thickness.

use surfabet_entropy::Coder;

use super::geometry::{Walk, bypass_flag};
use super::models::{beside_context, depth_context, pixel_context, shape_context};
use super::surroundings::{Prediction, SquarePlace};
use crate::patches::model::{LatticePatch, MAX_DEPTH, MAX_THICKNESS, PATCH_PIXELS};
use crate::patches::surface::basis::N_SHAPES;

impl<C: Coder> Walk<'_, C> {
    /// The patch at a square. `beside` are the states of the pixels left of it and above.
    pub(super) fn patch(
        &mut self,
        place: &SquarePlace,
        beside: [usize; 2],
        prediction: &Prediction,
        given: &LatticePatch,
    ) -> Result<LatticePatch, C::Error> {
        let mask = self.mask(place, beside, given.mask)?;
        let mut patch = LatticePatch { mask, ..LatticePatch::default() };
        let difference = given.coefficients[0] - prediction.depth;
        let model = &mut self.models.depth[depth_context(place.level, prediction.neighbours)];
        let depth = i64::from(self.coder.sint(model, difference)?) + i64::from(prediction.depth);
        if depth.abs() > i64::from(MAX_DEPTH) {
            return Err(self.coder.corrupt(format!("a patch at depth {depth}")));
        }
        patch.coefficients[0] = depth as i32;
        self.shapes(place.level, given, &mut patch)?;
        let difference = i32::from(given.thickness) - prediction.thickness;
        let model = &mut self.models.thickness[usize::from(prediction.neighbours > 0)];
        let thickness =
            i64::from(prediction.thickness) + i64::from(self.coder.sint(model, difference)?);
        if !(0..=i64::from(MAX_THICKNESS)).contains(&thickness) {
            return Err(self
                .coder
                .corrupt(format!("a half thickness of {thickness} quarter pixels")));
        }
        patch.thickness = thickness as u8;
        Ok(patch)
    }

    /// Mask of a patch: whether all pixels are set, else pixel by pixel.
    fn mask(
        &mut self,
        place: &SquarePlace,
        beside: [usize; 2],
        given: u64,
    ) -> Result<u64, C::Error> {
        let level = place.level;
        let full = &mut self.models.full[beside_context(level, beside)];
        if self.coder.bit(full, given == u64::MAX)? {
            return Ok(u64::MAX);
        }
        let mut mask = 0_u64;
        for bit in 0..64_i32 {
            let (column, row) = (bit % PATCH_PIXELS, bit / PATCH_PIXELS);
            let states = [(-1, 0), (0, -1), (-1, -1), (1, -1)]
                .map(|(du, dv)| self.pixel_state(place, mask, column + du, row + dv));
            let model = &mut self.models.mask[pixel_context(level, states)];
            let set = self.coder.bit(model, given >> bit & 1 != 0)?;
            mask |= u64::from(set) << bit;
        }
        if mask == 0 {
            return Err(self.coder.corrupt("a patch without pixels".into()));
        }
        Ok(mask)
    }

    /// State of the pixel at a column and row of a patch: of its own mask so far, or beyond its border.
    fn pixel_state(&self, place: &SquarePlace, mask: u64, column: i32, row: i32) -> usize {
        if (0..PATCH_PIXELS).contains(&column) && row >= 0 {
            return (mask >> (PATCH_PIXELS * row + column) & 1) as usize;
        }
        let doublings = self.lattice.doublings(place.level);
        // The finest pixel next to the border, at the middle of the column or row.
        let finest = |x: i32| match x {
            x if x < 0 => -1,
            x if x >= PATCH_PIXELS => PATCH_PIXELS << doublings,
            x => (x << doublings) + (1 << doublings) / 2,
        };
        self.around.state(place, [place.corner[0] + finest(column), place.corner[1] + finest(row)])
    }

    /// Coefficients of the shapes after the constant one: the number of the last that is not zero, all before it, its
    /// magnitude and sign.
    fn shapes(
        &mut self,
        level: u32,
        given: &LatticePatch,
        patch: &mut LatticePatch,
    ) -> Result<(), C::Error> {
        let last = (1..N_SHAPES).rev().find(|&k| given.coefficients[k] != 0).unwrap_or(0);
        let last = self.coder.symbol(&mut self.models.last[level as usize], last as u32)? as usize;
        for k in 1..last {
            let model = &mut self.models.shapes[shape_context(level, k)];
            patch.coefficients[k] = self.coder.sint(model, given.coefficients[k])?;
        }
        if last > 0 {
            let given = given.coefficients[last];
            let magnitude = given.unsigned_abs().saturating_sub(1);
            let magnitude =
                self.coder.uint(&mut self.models.last_shape[level as usize], magnitude)?;
            let negative = bypass_flag(self.coder, given < 0)?;
            if magnitude >= MAX_DEPTH as u32 {
                return Err(self.coder.corrupt(format!("a coefficient of {magnitude} steps")));
            }
            let value = magnitude as i32 + 1;
            patch.coefficients[last] = if negative { -value } else { value };
        }
        if let Some(c) = patch.coefficients.iter().find(|c| c.unsigned_abs() > MAX_DEPTH as u32) {
            return Err(self.coder.corrupt(format!("a coefficient of {c} steps")));
        }
        Ok(())
    }
}
