//! What the occurrences said so far suggest for the next one: planes that go on.

use crate::alphabet::coding::coarse_cells::Nearby;
use crate::alphabet::lattice::{UNITS, cell_center, offset_step, slope_steps};
use crate::alphabet::placement::Placement;

/// Planes suggested at most.
pub(in crate::alphabet) const MAX_SUGGESTED: usize = 6;

/// Fractional bits of the length of an integer normal.
const LENGTH_BITS: u32 = 8;

/// An occurrence said already.
#[derive(Debug, Clone, Copy)]
struct Said {
    placement: Placement,
    middle: [i64; 3],
    normal: [i64; 3],
    /// `normal . x` over the plane, times 2^8.
    constant: i128,
}

/// A plane suggested for a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::alphabet) struct Suggested {
    pub placement: Placement,
    normal: [i64; 3],
    constant: i128,
}

/// The occurrences said so far.
#[derive(Debug, Clone)]
pub(in crate::alphabet) struct Neighbors {
    nearby: Nearby<Said>,
}

fn length(v: [i64; 3]) -> i128 {
    let squared: i128 = v.iter().map(|&c| i128::from(c) * i128::from(c)).sum();
    (squared << (2 * LENGTH_BITS)).isqrt()
}

fn dot(a: [i64; 3], b: [i64; 3]) -> i128 {
    (0..3).map(|k| i128::from(a[k]) * i128::from(b[k])).sum()
}

impl Neighbors {
    pub fn new(scales: u32) -> Self {
        Self { nearby: Nearby::new(scales) }
    }

    pub fn add(&mut self, placement: Placement, level: u32) {
        let scale = u32::from(placement.scale);
        let middle = cell_center(placement.cell, scale);
        let normal = placement.normal(level);
        let along = i128::from(placement.offset) * i128::from(offset_step(level));
        let constant = (dot(normal, middle) << LENGTH_BITS) + along * length(normal);
        let said = Said { placement, middle, normal, constant };
        self.nearby.add(placement.cell, scale, said);
    }

    /// The planes that pass through a cell, those of the nearest occurrences first, and no two alike.
    pub fn suggested(&self, cell: [i32; 3], scale: u32, level: u32) -> Vec<Suggested> {
        let middle = cell_center(cell, scale);
        let side = UNITS << scale;
        let mut near: Vec<(i128, Said)> = Vec::new();
        for said in self.nearby.about(cell, scale) {
            // Within one side of the cell's middle.
            let off = said.constant - (dot(said.normal, middle) << LENGTH_BITS);
            if off.abs() <= length(said.normal) * i128::from(side) {
                let apart: [i64; 3] = std::array::from_fn(|a| said.middle[a] - middle[a]);
                near.push((dot(apart, apart), *said));
            }
        }
        near.sort_by_key(|(apart, said)| (*apart, said.placement));
        let mut found: Vec<(Placement, Suggested)> = Vec::new();
        for (_, said) in near {
            let suggested = Suggested {
                placement: said.placement,
                normal: said.normal,
                constant: said.constant,
            };
            let slopes = suggested.slopes(scale, level);
            let trial = Placement { cell, scale: scale as u8, slopes, ..said.placement };
            let offset = suggested.offset(&trial, level);
            let trial = Placement { offset, word: 0, view: 0, ..trial };
            if found.iter().all(|(other, _)| *other != trial) {
                found.push((trial, suggested));
            }
            if found.len() == MAX_SUGGESTED {
                break;
            }
        }
        found.into_iter().map(|(_, suggested)| suggested).collect()
    }
}

impl Suggested {
    /// The slopes of the plane in the steps of another scale and level.
    pub fn slopes(&self, scale: u32, level: u32) -> [i16; 2] {
        let steps = i64::from(slope_steps(scale, level));
        let axis = usize::from(self.placement.axis);
        let of = |k: usize| {
            let [over, under] = [self.normal[(axis + k) % 3] * steps, self.normal[axis]];
            (2 * over + under).div_euclid(2 * under) as i16
        };
        [of(1), of(2)]
    }

    /// Where the plane crosses the normal through the middle of `trial`'s cell, in steps of its offset; the axis and
    /// slopes of `trial` are known.
    pub fn offset(&self, trial: &Placement, level: u32) -> i32 {
        let middle = cell_center(trial.cell, u32::from(trial.scale));
        let normal = trial.normal(level);
        let across = dot(self.normal, normal) * i128::from(offset_step(level));
        let rest = self.constant - (dot(self.normal, middle) << LENGTH_BITS);
        // Both lengths carry the fraction; it cancels in the quotient but for one.
        let over = rest * length(normal);
        let under = across << (2 * LENGTH_BITS);
        if under == 0 {
            return 0;
        }
        let rounded = (2 * over + under).div_euclid(2 * under);
        rounded.clamp(-(1 << 20), 1 << 20) as i32
    }
}
