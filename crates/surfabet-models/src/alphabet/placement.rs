//! An occurrence in integers, as the file holds it, and the pose that these integers stand for.

use super::lattice::{UNITS, cell_center, offset_step, slope_steps};
use crate::scans::{Upright, upright_frame};
use crate::vector;

/// One occurrence of a word in integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Placement {
    /// Its radius is `2^scale` times the smallest.
    pub scale: u8,
    /// The cell that it belongs to.
    pub cell: [i32; 3],
    /// The axis that its normal is nearest to.
    pub axis: u8,
    /// Components of the normal along the next two axes, in steps of the component along `axis`.
    pub slopes: [i16; 2],
    /// From the cell's middle along the normal, in steps of half a sigma.
    pub offset: i32,
    /// Which word; 0 is the plane.
    pub word: u16,
    /// Which sensor saw it.
    pub view: u16,
}

/// Position, orientation and size of an occurrence, lengths in units, with the deviation allowed there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WordPose {
    /// Middle of the word.
    pub center: [f64; 3],
    /// Rows: right, up, normal.
    pub rows: [[f64; 3]; 3],
    /// Radius of the word.
    pub radius: f64,
    /// Level of sigma.
    pub level: u32,
}

impl Placement {
    /// The normal as an integer vector, from the axis that it is nearest to.
    pub fn normal(&self, level: u32) -> [i64; 3] {
        let mut normal = [0; 3];
        let axis = usize::from(self.axis);
        normal[axis] = i64::from(slope_steps(u32::from(self.scale), level));
        normal[(axis + 1) % 3] = i64::from(self.slopes[0]);
        normal[(axis + 2) % 3] = i64::from(self.slopes[1]);
        normal
    }

    /// Whether `axis` is the axis that the normal is nearest to.
    pub fn slopes_fit(&self, level: u32) -> bool {
        let steps = slope_steps(u32::from(self.scale), level);
        self.slopes.iter().all(|&s| i32::from(s).abs() <= steps)
    }

    /// The pose, where sigma has `level` and `sensor` is where the surface was seen from.
    pub fn pose(&self, level: u32, sensor: Option<[i64; 3]>) -> WordPose {
        let scale = u32::from(self.scale);
        let middle = cell_center(self.cell, scale).map(|c| c as f64);
        let towards = self.normal(level).map(|c| c as f64);
        let length = vector::length(towards);
        let along = towards.map(|c| c / length);
        let offset = (i64::from(self.offset) * offset_step(level)) as f64;
        let center: [f64; 3] = std::array::from_fn(|a| middle[a] + offset * along[a]);
        // Words are seen from outside; without a sensor the sign carries no meaning.
        let seen = sensor
            .map_or(1.0, |s| (0..3).map(|a| along[a] * (s[a] as f64 - center[a])).sum::<f64>());
        let normal = if seen < 0.0 { along.map(|c| -c) } else { along };
        let rows = upright_frame(normal, Upright::WorldX, [0.0; 3]);
        let radius = (UNITS << scale) as f64;
        WordPose { center, rows, radius, level }
    }
}

impl WordPose {
    /// Right, up and height of a point in the frame of the word.
    pub fn to_word(&self, point: [f64; 3]) -> [f64; 3] {
        let d: [f64; 3] = std::array::from_fn(|a| point[a] - self.center[a]);
        self.rows.map(|r| r[0] * d[0] + r[1] * d[1] + r[2] * d[2])
    }

    /// The point with these coordinates in the frame of the word.
    pub fn to_scene(&self, local: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| {
            self.center[a] + (0..3).map(|k| self.rows[k][a] * local[k]).sum::<f64>()
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn frames_are_rigid_and_face_the_sensor(
            axis in 0_u8..3,
            slopes in prop::array::uniform2(-40_i16..=40),
            offset in -20_i32..=20,
            point in prop::array::uniform3(-9000.0_f64..9000.0),
            sensor in prop::array::uniform3(-9000_i64..9000),
        ) {
            let placement =
                Placement { scale: 1, cell: [3; 3], axis, slopes, offset, word: 0, view: 0 };
            let pose = placement.pose(8, Some(sensor));
            let local = pose.to_word(point);
            let back = pose.to_scene(local);
            for a in 0..3 {
                prop_assert!((back[a] - point[a]).abs() < 1e-6);
            }
            let squared = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>();
            let apart = std::array::from_fn(|a| point[a] - pose.center[a]);
            prop_assert!((squared(local) - squared(apart)).abs() <= 1e-9 * squared(apart));
            let [.., height] = pose.to_word(sensor.map(|c| c as f64));
            prop_assert!(height > -1e-6, "the sensor is {height} in front");
        }
    }
}
