//! Prediction of the next occurrence from those coded before: planes that go on through its cell.

use super::coarse_cells::CoarseCells;
use crate::alphabet::lattice::{MAX_OFFSET, UNITS, cell_center, offset_step, slope_steps};
use crate::alphabet::placement::Placement;

/// Planes predicted at most. Part of the format.
pub(in crate::alphabet) const MAX_PREDICTIONS: usize = 6;

/// Fractional bits of the length of an integer normal.
const LENGTH_BITS: u32 = 8;

/// The plane `normal . x = constant` of an occurrence coded before, which predicts others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::alphabet) struct PredictedPlane {
    placement: Placement,
    /// Not of unit length; its component along the occurrence's axis is positive.
    normal: [i64; 3],
    /// Times 2^8.
    constant: i128,
}

/// The planes of all occurrences coded so far.
#[derive(Debug, Clone)]
pub(in crate::alphabet) struct PlanePredictor {
    planes: CoarseCells<PredictedPlane>,
}

/// Length of a vector times 2^8, rounded down.
fn length(v: [i64; 3]) -> i128 {
    let squared: i128 = v.iter().map(|&c| i128::from(c) * i128::from(c)).sum();
    (squared << (2 * LENGTH_BITS)).isqrt()
}

/// Inner product.
fn dot(a: [i64; 3], b: [i64; 3]) -> i128 {
    (0..3).map(|k| i128::from(a[k]) * i128::from(b[k])).sum()
}

impl PlanePredictor {
    pub fn new(scales: u32) -> Self {
        Self { planes: CoarseCells::new(scales) }
    }

    /// Adds the plane of an occurrence where sigma has `level`.
    pub fn insert(&mut self, placement: Placement, level: u32) {
        let scale = u32::from(placement.scale);
        let middle = cell_center(placement.cell, scale);
        let normal = placement.normal(level);
        let along = i128::from(placement.offset) * i128::from(offset_step(level));
        let constant = (dot(normal, middle) << LENGTH_BITS) + along * length(normal);
        self.planes.insert(placement.cell, scale, PredictedPlane { placement, normal, constant });
    }

    /// The planes that pass within one side of the middle of a cell, those of the nearest occurrences first; of planes
    /// that round to the same pose, the first.
    pub fn predict(&self, cell: [i32; 3], scale: u32, level: u32) -> Vec<PredictedPlane> {
        let middle = cell_center(cell, scale);
        let side = UNITS << scale;
        let mut near: Vec<(i128, PredictedPlane)> = Vec::new();
        for plane in self.planes.around(cell, scale) {
            let off = plane.constant - (dot(plane.normal, middle) << LENGTH_BITS);
            if off.abs() <= length(plane.normal) * i128::from(side) {
                let from = cell_center(plane.placement.cell, u32::from(plane.placement.scale));
                let apart: [i64; 3] = std::array::from_fn(|a| from[a] - middle[a]);
                near.push((dot(apart, apart), *plane));
            }
        }
        near.sort_by_key(|(apart, plane)| (*apart, plane.placement));
        let mut found: Vec<(Placement, PredictedPlane)> = Vec::new();
        for (_, plane) in near {
            let slopes = plane.slopes(scale, level);
            let rounded = Placement { cell, scale: scale as u8, slopes, ..plane.placement };
            let offset = plane.offset(&rounded, level);
            let rounded = Placement { offset, word: 0, view: 0, ..rounded };
            if found.iter().all(|(other, _)| *other != rounded) {
                found.push((rounded, plane));
            }
            if found.len() == MAX_PREDICTIONS {
                break;
            }
        }
        found.into_iter().map(|(_, plane)| plane).collect()
    }
}

impl PredictedPlane {
    /// The axis that the normal is nearest to.
    pub fn axis(&self) -> u8 {
        self.placement.axis
    }

    /// The slopes of the plane in the steps of another scale and level: `normal[k] / normal[axis] * steps`, rounded.
    pub fn slopes(&self, scale: u32, level: u32) -> [i16; 2] {
        let steps = i64::from(slope_steps(scale, level));
        let axis = usize::from(self.placement.axis);
        let of = |k: usize| {
            let [over, under] = [self.normal[(axis + k) % 3] * steps, self.normal[axis]];
            (2 * over + under).div_euclid(2 * under) as i16
        };
        [of(1), of(2)]
    }

    /// Offset of the plane along the normal m of `placement` from the middle c of its cell, in its steps:
    /// `(constant - normal . c) |m| / (normal . m)` over the step, rounded. Of `placement`, axis and slopes are known.
    pub fn offset(&self, placement: &Placement, level: u32) -> i32 {
        let middle = cell_center(placement.cell, u32::from(placement.scale));
        let normal = placement.normal(level);
        let across = dot(self.normal, normal) * i128::from(offset_step(level));
        let rest = self.constant - (dot(self.normal, middle) << LENGTH_BITS);
        // `rest` and the length carry the fraction once each.
        let over = rest * length(normal);
        let under = across << (2 * LENGTH_BITS);
        if under == 0 {
            return 0;
        }
        let rounded = (2 * over + under).div_euclid(2 * under);
        rounded.clamp(-i128::from(MAX_OFFSET), i128::from(MAX_OFFSET)) as i32
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// An occurrence of scale 1 in the cell (9, 9, 9).
    fn occurrence(axis: u8, slopes: [i16; 2], offset: i32) -> Placement {
        Placement { scale: 1, cell: [9; 3], axis, slopes, offset, word: 0, view: 0 }
    }

    proptest! {
        #[test]
        fn a_plane_goes_on_in_its_own_cell_and_in_the_next(
            axis in 0_u8..3,
            slopes in prop::array::uniform2(-9_i16..=9),
            offset in -20_i32..=20,
        ) {
            // Sigma of 16 units: offsets in steps of 8, and 46 steps of a normal from an axis to the diagonal.
            let level = 8;
            let given = occurrence(axis, slopes, offset);
            let mut predictor = PlanePredictor::new(3);
            predictor.insert(given, level);
            let own = predictor.predict(given.cell, 1, level);
            prop_assert_eq!(own.len(), 1);
            prop_assert_eq!((own[0].axis(), own[0].slopes(1, level)), (axis, slopes));
            prop_assert_eq!(own[0].offset(&given, level), offset);
            // Along an axis across the normal's, the plane has risen by the slope times the side of a cell.
            let mut next = given;
            next.cell[(usize::from(axis) + 1) % 3] += 1;
            let normal = given.normal(level).map(|c| c as f64);
            let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
            let risen = normal[(usize::from(axis) + 1) % 3] * (UNITS << 1) as f64 / length;
            let exact = f64::from(offset) - risen / offset_step(level) as f64;
            let off = f64::from(own[0].offset(&next, level)) - exact;
            prop_assert!(off.abs() <= 0.51, "{off}");
        }
    }

    #[test]
    fn of_equal_planes_one_is_predicted_and_of_far_ones_none() {
        let mut predictor = PlanePredictor::new(3);
        for cell in [[9, 9, 9], [10, 9, 9]] {
            predictor.insert(Placement { cell, ..occurrence(2, [0, 0], 3) }, 8);
        }
        assert_eq!(predictor.predict([9, 10, 9], 1, 8).len(), 1);
        // Two cells above, the plane is more than a side from the middle.
        assert_eq!(predictor.predict([9, 9, 11], 1, 8).len(), 0);
    }
}
