//! The pose of a feature or an occurrence, in the integers that a file stores.
//!
//! The paper's six degrees of freedom are five here: the upright rule gives the rotation about the normal. Only where
//! "up" is the view direction, which the decoder does not know, a sixth is kept.

use surfabet_geom::{morton, octahedral};

use crate::error::Result;
use crate::extent::too_small;
use crate::scans::{Upright, upright_frame};

/// Bits of each coordinate of a normal's octahedral code: 0.64 degrees at most, 1.1 mm at a radius of 0.1 m.
pub(super) const NORMAL_BITS: u32 = 8;

/// Number of rotations about the normal that a pose can store.
pub(super) const ROLLS: u32 = 256;

/// Position steps per radius.
const STEPS_PER_RADIUS: f64 = 32.0;

/// Largest coordinate of a position, in steps: 100 km at a radius of 0.1 m.
pub const MAX_POSITION: i32 = 1 << 25;

/// Position steps per side of the cells that order poses: one radius.
pub(super) const CELL: i32 = 32;

/// The pose of a feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct BicPose {
    /// In steps of a 32nd of the radius from the scene's origin.
    pub position: [i32; 3],
    /// Octahedral code of the normal.
    pub normal: [i8; 2],
    /// Rotation about the normal, in 256ths of a turn; zero unless up is the view direction.
    pub roll: u8,
}

/// A pose in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub origin: [f32; 3],
    /// Right, up, normal.
    pub rows: [[f32; 3]; 3],
}

impl Frame {
    /// A point of the frame, in the scene.
    #[inline]
    pub fn place(&self, q: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|a| {
            self.origin[a]
                + (self.rows[0][a] * q[0] + self.rows[1][a] * q[1] + self.rows[2][a] * q[2])
        })
    }

    /// A point of the scene, in the frame.
    #[inline]
    pub fn local(&self, p: [f32; 3]) -> [f32; 3] {
        let d: [f32; 3] = std::array::from_fn(|a| p[a] - self.origin[a]);
        self.rows.map(|row| row[0] * d[0] + row[1] * d[1] + row[2] * d[2])
    }
}

/// Metres per step of a position.
pub(super) fn position_step(radius: f64) -> f64 {
    radius / STEPS_PER_RADIUS
}

impl BicPose {
    /// The nearest pose that can be stored; `view` is the direction from the sensor.
    pub(super) fn quantize(
        point: [f32; 3],
        normal: [f32; 3],
        view: [f64; 3],
        rule: Upright,
        radius: f64,
    ) -> Result<Self> {
        let step = position_step(radius);
        let steps = point.map(|c| (f64::from(c) / step).round());
        if steps.iter().any(|c| c.abs() > f64::from(MAX_POSITION)) {
            let extent = point.iter().fold(0.0, |m: f64, c| m.max(f64::from(c.abs())));
            let least = radius * extent / (f64::from(MAX_POSITION) * step);
            return Err(too_small("radius", radius, least, extent));
        }
        // Codes of 8 bits are within ±127.
        let code = octahedral::encode(normal, NORMAL_BITS).map(|c| c as i8);
        let mut pose = Self { position: steps.map(|c| c as i32), normal: code, roll: 0 };
        if rule == Upright::ViewDirection {
            let [right, up, normal] = pose.frame(rule, radius).rows.map(|r| r.map(f64::from));
            let wanted = upright_frame(normal, rule, view)[1];
            let along = |axis: [f64; 3]| -> f64 { (0..3).map(|a| axis[a] * wanted[a]).sum() };
            let turns = along(right).atan2(along(up)) / std::f64::consts::TAU;
            pose.roll = (turns * f64::from(ROLLS)).round().rem_euclid(f64::from(ROLLS)) as u8;
        }
        Ok(pose)
    }

    /// The pose in metres.
    pub(super) fn frame(&self, rule: Upright, radius: f64) -> Frame {
        let step = position_step(radius);
        let normal = octahedral::decode(self.normal.map(i32::from), NORMAL_BITS).map(f64::from);
        // The roll starts from world x.
        let rule = if rule == Upright::ViewDirection { Upright::WorldX } else { rule };
        let [right, up, normal] = upright_frame(normal, rule, [0.0; 3]);
        let angle = f64::from(self.roll) / f64::from(ROLLS) * std::f64::consts::TAU;
        let (sine, cosine) = angle.sin_cos();
        let turn = |a: [f64; 3], b: [f64; 3], s: f64| -> [f32; 3] {
            std::array::from_fn(|i| (cosine * a[i] + s * b[i]) as f32)
        };
        Frame {
            origin: self.position.map(|c| (f64::from(c) * step) as f32),
            rows: [turn(right, up, -sine), turn(up, right, sine), normal.map(|c| c as f32)],
        }
    }

    /// The lower goes first where occurrences are thinned (eq. 3): numbers as good as drawn, so that whatever changes
    /// one occurrence is carried on by few others, and that follow from the pose, so that a decoder has them too.
    pub(super) fn precedence(&self) -> u64 {
        let [x, y, z] = self.position.map(i64::from);
        let [u, v] = self.normal.map(i64::from);
        let numbers = [x, y, z, u, v, i64::from(self.roll)];
        numbers.into_iter().fold(0, |hash, number| mix(hash ^ number as u64))
    }

    /// The cell of one radius that the pose lies in.
    pub(super) fn cell(&self) -> [i32; 3] {
        self.position.map(|c| c.div_euclid(CELL))
    }

    /// Sort key of poses: the Morton code of the cell, counted from the `low` one, so that neighbours in space are
    /// neighbours in the list; then their own numbers.
    pub(super) fn order(&self, low: [i32; 3]) -> (u64, Self) {
        // Cells are within ±2^20, so that differences that are not negative have 21 bits.
        let cell = self.cell();
        let from_low = |a: usize| i64::from(cell[a]) - i64::from(low[a]);
        (morton::encode(std::array::from_fn(|a| from_low(a) as u64)), *self)
    }
}

/// The lowest cell in each axis.
pub(super) fn low_cell(poses: &[BicPose]) -> [i32; 3] {
    let low = poses.iter().map(BicPose::cell);
    low.reduce(|a, b| std::array::from_fn(|i| a[i].min(b[i]))).unwrap_or_default()
}

/// The finaliser of SplitMix64 (G. L. Steele et al.: Fast splittable pseudorandom number generators, OOPSLA 2014).
pub(super) fn mix(value: u64) -> u64 {
    let z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn poses_are_kept_to_their_steps(
            point in prop::array::uniform3(-50.0_f32..50.0),
            normal in prop::array::uniform3(-1.0_f32..1.0),
            view in prop::array::uniform3(-1.0_f64..1.0),
            rule in prop::sample::select(vec![Upright::WorldX, Upright::WorldZ, Upright::ViewDirection]),
        ) {
            let length = normal.iter().map(|c| c * c).sum::<f32>().sqrt();
            prop_assume!(length > 0.1);
            let pose = BicPose::quantize(point, normal, view, rule, 0.1).unwrap();
            let frame = pose.frame(rule, 0.1);
            let step = 0.1 / 32.0 + 2e-5;
            prop_assert!((0..3).all(|a| (frame.origin[a] - point[a]).abs() <= 0.5 * step));
            let cosine: f32 = (0..3).map(|a| frame.rows[2][a] * normal[a] / length).sum();
            prop_assert!(f64::from(cosine) >= octahedral::max_error(NORMAL_BITS).cos() - 1e-5);
            let stored = frame.rows[2].map(f64::from);
            let wanted = upright_frame(stored, rule, view);
            let turn: f64 = (0..3).map(|a| f64::from(frame.rows[1][a]) * wanted[1][a]).sum();
            prop_assert!(turn >= (std::f64::consts::PI / f64::from(ROLLS)).cos() - 1e-4);
            let p = [0.03_f32, -0.07, 0.01];
            let back = frame.local(frame.place(p));
            prop_assert!((0..3).all(|a| (back[a] - p[a]).abs() < 2e-5));
        }
    }

    #[test]
    fn a_scene_beyond_the_lattice_is_refused() {
        let far = [1e7, 0.0, 0.0];
        let found = BicPose::quantize(far, [0.0, 0.0, 1.0], [0.0; 3], Upright::WorldX, 0.001);
        assert!(
            matches!(found, Err(crate::Error::InvalidParameter(error)) if error.name == "radius")
        );
    }
}
