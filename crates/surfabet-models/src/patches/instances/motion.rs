//! Where an instance stands: mirrored, turned about one axis of the lattice, and shifted.

use std::f64::consts::TAU;

use crate::vector::dot;

/// Steps of a shift per finest pixel: a sixteenth of a pixel off at most, less than depths are rounded by.
pub(super) const SHIFT_STEPS: i32 = 8;

/// Steps of an angle per turn: at 500 pixels from its middle a part is a tenth of a pixel off at most.
const ANGLE_STEPS: f64 = 16384.0;

/// Largest angle beside quarter turns: an eighth of a turn.
pub(super) const MAX_ANGLE: i32 = 2048;

/// Largest shift: beyond the width of the lattice.
pub(super) const MAX_SHIFT: i32 = 1 << 28;

/// Where an instance stands, in the integers that a file stores.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Place {
    /// Whether its sources are mirrored first, along the axis after the one that it turns about.
    pub mirrored: bool,
    /// Quarter turns, 0 to 3.
    pub quarters: u8,
    /// Angle beside them, in steps of 2^-14 of a turn.
    pub angle: i32,
    /// Shift along the three axes, in eighths of a finest pixel.
    pub shift: [i32; 3],
}

impl Place {
    /// The place that is nearest to a motion: mirrored or not, then turned by an angle (radians) and shifted (finest pixels).
    pub(in crate::patches) fn nearest(mirrored: bool, angle: f64, shift: [f64; 3]) -> Self {
        let steps = (angle / TAU * ANGLE_STEPS).round() as i64;
        let quarter = i64::from(2 * MAX_ANGLE);
        let quarters = (2 * steps + quarter).div_euclid(2 * quarter);
        Self {
            mirrored,
            quarters: quarters.rem_euclid(4) as u8,
            angle: (steps - quarters * quarter) as i32,
            shift: shift.map(|c| (c * f64::from(SHIFT_STEPS)).round() as i32),
        }
    }
}

/// A rigid motion, mirrored or not, of positions in finest pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// The linear part.
    pub rows: [[f32; 3]; 3],
    /// What is added then, finest pixels.
    pub shift: [f32; 3],
}

impl Motion {
    /// The motion to a place, about an axis of the lattice.
    pub fn new(place: Place, axis: u8) -> Self {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3].map(usize::from);
        // Quarter turns are exact.
        let (mut cos, mut sin) = match place.angle {
            0 => (1.0, 0.0),
            angle => {
                let angle = f64::from(angle) / ANGLE_STEPS * TAU;
                (angle.cos(), angle.sin())
            }
        };
        for _ in 0..place.quarters {
            (cos, sin) = (-sin, cos);
        }
        let facing = if place.mirrored { -1.0 } else { 1.0 };
        let mut rows = [[0.0; 3]; 3];
        rows[usize::from(axis)][usize::from(axis)] = 1.0;
        rows[u][u] = (facing * cos) as f32;
        rows[u][v] = -sin as f32;
        rows[v][u] = (facing * sin) as f32;
        rows[v][v] = cos as f32;
        Self { rows, shift: place.shift.map(|c| c as f32 / SHIFT_STEPS as f32) }
    }

    /// A direction, moved.
    pub fn of_direction(&self, p: [f32; 3]) -> [f32; 3] {
        self.rows.map(|row| dot(row, p))
    }

    /// A position, moved.
    pub fn of_position(&self, p: [f32; 3]) -> [f32; 3] {
        let turned = self.of_direction(p);
        std::array::from_fn(|a| turned[a] + self.shift[a])
    }

    /// The position that is moved to `p`.
    pub fn source_of(&self, p: [f32; 3]) -> [f32; 3] {
        let back: [f32; 3] = std::array::from_fn(|a| p[a] - self.shift[a]);
        std::array::from_fn(|a| (0..3).map(|k| self.rows[k][a] * back[k]).sum())
    }

    /// The same in double precision.
    pub fn exact_source_of(&self, p: [f64; 3]) -> [f64; 3] {
        let back: [f64; 3] = std::array::from_fn(|a| p[a] - f64::from(self.shift[a]));
        std::array::from_fn(|a| (0..3).map(|k| f64::from(self.rows[k][a]) * back[k]).sum())
    }

    /// A box around what is moved out of a box, from its lowest to its highest corner.
    pub fn of_bounds(&self, [low, high]: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
        let along = |a: usize, corner: fn(f64, f64) -> f64| {
            let of = |k: usize| {
                let row = f64::from(self.rows[a][k]);
                corner(row * low[k], row * high[k])
            };
            f64::from(self.shift[a]) + (0..3).map(of).sum::<f64>()
        };
        [std::array::from_fn(|a| along(a, f64::min)), std::array::from_fn(|a| along(a, f64::max))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_quarter_turn_takes_one_axis_to_the_next() {
        let place = Place { quarters: 1, shift: [8, -4, 1], ..Place::default() };
        let motion = Motion::new(place, 2);
        assert_eq!(motion.of_position([1.0, 0.0, 5.0]), [1.0, 0.5, 5.125]);
        assert_eq!(motion.of_direction([0.0, 1.0, 0.0]), [-1.0, 0.0, 0.0]);
        // Mirrored before it is turned.
        let motion = Motion::new(Place { mirrored: true, ..place }, 2);
        assert_eq!(motion.of_direction([1.0, 0.0, 0.0]), [0.0, -1.0, 0.0]);
        // About another axis: y to z.
        assert_eq!(Motion::new(place, 0).of_direction([0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
    }

    proptest! {
        #[test]
        fn the_nearest_place_is_near(
            mirrored: bool, angle in -7.0_f64..7.0, shift in prop::array::uniform3(-1e3_f64..1e3),
            p in prop::array::uniform3(-100.0_f64..100.0),
        ) {
            let place = Place::nearest(mirrored, angle, shift);
            prop_assert!(place.quarters < 4 && place.angle.abs() <= MAX_ANGLE);
            let motion = Motion::new(place, 2);
            let x = if mirrored { -p[0] } else { p[0] };
            let expected = [
                angle.cos() * x - angle.sin() * p[1] + shift[0],
                angle.sin() * x + angle.cos() * p[1] + shift[1],
                p[2] + shift[2],
            ];
            let moved = motion.of_position(p.map(|c| c as f32));
            for a in 0..3 {
                prop_assert!((f64::from(moved[a]) - expected[a]).abs() < 0.1);
            }
            let back = motion.source_of(moved);
            for a in 0..3 {
                prop_assert!((f64::from(back[a]) - p[a]).abs() < 1e-2);
            }
        }

        #[test]
        fn a_moved_box_holds_what_is_moved(
            angle in 0.0_f64..(4.0 * FRAC_PI_2), part in prop::array::uniform3(0.0_f64..1.0),
        ) {
            let motion = Motion::new(Place::nearest(true, angle, [3.0, 4.0, 5.0]), 1);
            let (low, high) = ([-3.0, 2.0, 5.0], [1.0, 9.0, 6.0]);
            let p: [f64; 3] = std::array::from_fn(|a| low[a] + part[a] * (high[a] - low[a]));
            let moved = motion.of_position(p.map(|c| c as f32));
            let [least, most] = motion.of_bounds([low, high]);
            for a in 0..3 {
                prop_assert!((least[a] - 1e-4..=most[a] + 1e-4).contains(&f64::from(moved[a])));
            }
        }
    }
}
