//! A part of the world: a box along its axes.

use surfabet_base::parallel;
use surfabet_geom::PointCloud;

use crate::error::{Error, Result};
use crate::vector::dot;

/// Points of one task.
const BLOCK: usize = 1 << 14;

/// A box along the axes of the world, with its faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    low: [f64; 3],
    high: [f64; 3],
}

impl Region {
    /// The box from `low` to `high`, world coordinates, metres; sides may be infinite.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for corners that are not numbers, or whose order is wrong.
    pub fn new(low: [f64; 3], high: [f64; 3]) -> Result<Self> {
        // False for what is not a number, too.
        if !(0..3).all(|a| low[a] <= high[a]) {
            let given = format!("from {low:?} to {high:?}");
            let requirement = "two corners, none of whose coordinates is larger in the first";
            return Err(Error::invalid("box", given, requirement));
        }
        Ok(Self { low, high })
    }

    /// Lower and upper corner, metres.
    pub fn corners(&self) -> [[f64; 3]; 2] {
        [self.low, self.high]
    }

    /// True for a position in the box or on its faces.
    pub fn contains(&self, p: [f64; 3]) -> bool {
        (0..3).all(|a| self.low[a] <= p[a] && p[a] <= self.high[a])
    }

    /// The points of a cloud that lie in the box, in their order.
    ///
    /// # Errors
    /// None: all of them are points of the cloud.
    pub fn crop(&self, cloud: &PointCloud) -> Result<PointCloud> {
        Ok(cloud.select(&self.numbers_in(cloud))?)
    }

    /// Numbers of the points of a cloud that lie in the box, growing.
    pub fn numbers_in(&self, cloud: &PointCloud) -> Vec<usize> {
        let numbers: Vec<usize> = (0..cloud.len()).collect();
        let of_blocks = parallel::map_chunks(&numbers, BLOCK, |numbers| {
            let inside = numbers.iter().copied().filter(|&i| self.contains(cloud.world(i)));
            inside.collect::<Vec<usize>>()
        });
        of_blocks.concat()
    }

    /// False only where this box and another have no point in common. The other lies from `low` to `high` along axes that
    /// are the columns of `rotation`, about `origin`.
    pub fn meets(&self, origin: [f64; 3], rotation: [[f64; 3]; 3], other: [[f64; 3]; 2]) -> bool {
        let half = |a: usize| 0.5 * (self.high[a] - self.low[a]);
        if (0..3).any(|a| !half(a).is_finite()) {
            return self.meets_bounds(origin, rotation, other);
        }
        let axes: [[f64; 3]; 3] = std::array::from_fn(|a| std::array::from_fn(|k| rotation[k][a]));
        let [low, high] = other;
        let extent: [f64; 3] = std::array::from_fn(|a| 0.5 * (high[a] - low[a]));
        let middle: [f64; 3] = std::array::from_fn(|k| {
            let of = |a: usize| axes[a][k] * 0.5 * (low[a] + high[a]);
            origin[k] + (0..3).map(of).sum::<f64>()
        });
        let between: [f64; 3] =
            std::array::from_fn(|k| middle[k] - 0.5 * (self.low[k] + self.high[k]));
        // Two boxes are apart exactly where their shadows are, along an axis of either or across one of each.
        let apart = |axis: [f64; 3]| {
            let own: f64 = (0..3).map(|k| axis[k].abs() * half(k)).sum();
            let of_other: f64 = (0..3).map(|a| dot(axis, axes[a]).abs() * extent[a]).sum();
            // Rounding must not part boxes that touch.
            let length = axis.iter().map(|c| c.abs()).sum::<f64>();
            let slack = 1e-9 * (1.0 + own + of_other + dot(between, axis).abs()) * length;
            dot(between, axis).abs() > own + of_other + slack
        };
        let world = |k: usize| std::array::from_fn(|i| f64::from(u8::from(i == k)));
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        !(0..3).any(|k| {
            apart(world(k)) || apart(axes[k]) || (0..3).any(|a| apart(cross(world(k), axes[a])))
        })
    }

    /// As [`Region::meets`] with the box around the other one, for regions without end.
    fn meets_bounds(
        &self,
        origin: [f64; 3],
        rotation: [[f64; 3]; 3],
        [low, high]: [[f64; 3]; 2],
    ) -> bool {
        (0..3).all(|k| {
            let along = |c: [f64; 3], a: usize| rotation[k][a] * c[a];
            let least: f64 = (0..3).map(|a| along(low, a).min(along(high, a))).sum();
            let most: f64 = (0..3).map(|a| along(low, a).max(along(high, a))).sum();
            let slack = 1e-9 * (1.0 + least.abs() + most.abs());
            origin[k] + most + slack >= self.low[k] && origin[k] + least - slack <= self.high[k]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    #[test]
    fn corners_in_the_wrong_order_are_refused() {
        assert!(Region::new([0.0; 3], [1.0, 0.0, 2.0]).is_ok());
        let error = Region::new([0.0; 3], [1.0, -1.0, 2.0]).unwrap_err().to_string();
        assert!(error.contains("box is from [0.0, 0.0, 0.0] to [1.0, -1.0, 2.0]"), "{error}");
        assert!(Region::new([f64::NAN, 0.0, 0.0], [1.0; 3]).is_err());
    }

    proptest! {
        /// A point that both boxes hold proves that they meet.
        #[test]
        fn boxes_with_a_point_in_common_meet(
            corner in prop::array::uniform3(-3.0..3.0), side in prop::array::uniform3(0.0..2.0),
            low in prop::array::uniform3(-3.0..3.0), extent in prop::array::uniform3(0.0..2.0),
            turn in prop::array::uniform3(-3.0..3.0), at in prop::array::uniform3(0.0..=1.0),
            endless: bool,
        ) {
            let add = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| a[i] + b[i]);
            let (mut first, mut last) = (corner, add(corner, side));
            if endless {
                (first[1], last[2]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
            let region = Region::new(first, last).unwrap();
            let matrix = Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
            let rotation = std::array::from_fn(|k| std::array::from_fn(|a| matrix[(k, a)]));
            let origin = [0.3, -0.2, 0.1];
            let inside: [f64; 3] = std::array::from_fn(|a| low[a] + at[a] * extent[a]);
            let world = std::array::from_fn(|k: usize| {
                origin[k] + (0..3).map(|a: usize| matrix[(k, a)] * inside[a]).sum::<f64>()
            });
            if region.contains(world) {
                prop_assert!(region.meets(origin, rotation, [low, add(low, extent)]));
            }
        }

        /// Balls in the middles of two boxes that reach their farthest corners are apart: so are the boxes.
        #[test]
        fn boxes_far_apart_do_not_meet(
            side in prop::array::uniform3(0.0_f64..1.0), turn in prop::array::uniform3(-3.0_f64..3.0),
            direction in prop::array::uniform3(-1.0_f64..1.0),
        ) {
            let length = dot(direction, direction).sqrt();
            prop_assume!(length > 0.1);
            let region = Region::new([-0.5; 3], [0.5; 3]).unwrap();
            let matrix = Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
            let rotation: [[f64; 3]; 3] =
                std::array::from_fn(|k| std::array::from_fn(|a| matrix[(k, a)]));
            // Half diagonals of sides of at most 1: 0.87 each.
            let origin = direction.map(|c| c / length * 1.8);
            let half: [f64; 3] = side.map(|c| 0.5 * c);
            prop_assert!(!region.meets(origin, rotation, [half.map(|c| -c), half]));
        }
    }
}
