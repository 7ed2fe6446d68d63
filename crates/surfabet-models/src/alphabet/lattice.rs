//! The integers that poses are made of, and the deviation sigma allowed at each cell.
//!
//! Lengths are in units of a 256th of the smallest radius. A word of scale l has the radius `2^l` times the smallest
//! and belongs to a cubic cell whose side is that radius. The steps of its pose follow from sigma at the middle of the
//! cell, which follows from the distance to the sensor: all in integers, so that every platform reads the same.

/// Units per smallest radius, and per side of the smallest cell.
pub const UNITS: i64 = 256;

/// Largest scale: radii up to 128 times the smallest.
pub const MAX_SCALE: u32 = 7;

/// Largest coordinate of a cell.
pub const MAX_CELL: i32 = 1 << 24;

/// Fractional bits of [`SigmaRule::per_range`].
const RANGE_BITS: u32 = 40;

/// One step of a normal moves the rim of a word by this many hundredths of sigma. Rounding the normal then moves the
/// surface about as much as rounding the offset does: 0.165 and 0.144 sigma, root mean square. Part of the format.
const TILT_STEP: i64 = 70;

/// Steps of a normal from an axis to the next at most.
pub const MAX_SLOPE: i32 = 255;

/// Largest offset of an occurrence either way, steps.
pub const MAX_OFFSET: i32 = 1 << 20;

/// Sigma squared as a function of the squared distance from the sensor (eq. 13), in units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SigmaRule {
    /// `(scale * tan(alpha / 2))^2`, times 2^40; zero where no sensor is known.
    pub per_range: u64,
    /// What does not depend on range: `(scale * noise)^2` in square units.
    pub constant: u64,
}

impl SigmaRule {
    /// Sigma per metre of range, sigma that does not depend on range (metres), and the size of a unit (metres).
    pub fn new(per_range: f64, constant: f64, unit: f64) -> Self {
        Self {
            per_range: (per_range * per_range * (1_u64 << RANGE_BITS) as f64).round() as u64,
            constant: (constant / unit).powi(2).round() as u64,
        }
    }

    /// Level of sigma at a point: `floor(log2(sigma^2))` with `sigma^2 = per_range * range^2 + constant`.
    pub fn level(&self, point: [i64; 3], sensor: Option<[i64; 3]>) -> u32 {
        let squared: u128 = sensor
            .map_or(0, |from| (0..3).map(|a| u128::from(point[a].abs_diff(from[a])).pow(2)).sum());
        // Coordinates are below 2^41, so that the square has at most 84 bits; the product stays below 2^128.
        let grown = (squared.min(1 << 83) * u128::from(self.per_range.min(1 << 44))) >> RANGE_BITS;
        (grown + u128::from(self.constant)).clamp(1, 1 << 62).ilog2()
    }
}

/// Sigma of a level in units, `2^(level / 2)`: at most the true sigma, and more than the true one over the root of two.
pub fn sigma(level: u32) -> f64 {
    let whole = (1_u64 << (level / 2)) as f64;
    if level % 2 == 1 { whole * std::f64::consts::SQRT_2 } else { whole }
}

/// Sigma of a level, rounded down to whole units.
fn whole_sigma(level: u32) -> i64 {
    (1_i128 << level).isqrt() as i64
}

/// Step of the offset along the normal, units: half of sigma.
pub fn offset_step(level: u32) -> i64 {
    (whole_sigma(level) / 2).max(1)
}

/// Steps of a normal from an axis to the diagonal: the radius over the step of the rim, rounded.
pub fn slope_steps(scale: u32, level: u32) -> i32 {
    let steps = ((UNITS << scale) * 100 + TILT_STEP * whole_sigma(level) / 2)
        / (TILT_STEP * whole_sigma(level));
    steps.clamp(1, i64::from(MAX_SLOPE)) as i32
}

/// Middle of a cell, units.
pub fn cell_center(cell: [i32; 3], scale: u32) -> [i64; 3] {
    let side = UNITS << scale;
    cell.map(|c| i64::from(c) * side + side / 2)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_level_is_that_of_equation_13(
            point in prop::array::uniform3(-1_000_000_i64..1_000_000),
            sensor in prop::array::uniform3(-1_000_000_i64..1_000_000),
            per_range in 0.0005_f64..0.2,
            noise in 0.0_f64..0.1,
        ) {
            let unit = 0.001;
            let rule = SigmaRule::new(per_range, noise, unit);
            let squared: f64 = (0..3).map(|a| ((point[a] - sensor[a]) as f64).powi(2)).sum();
            let exact = (per_range * per_range * squared + (noise / unit).powi(2)).sqrt().max(1.0);
            let found = sigma(rule.level(point, Some(sensor)));
            // Rounded down to half octaves, and the squares to whole numbers.
            prop_assert!(found <= exact * 1.001 + 1.0, "{found} {exact}");
            prop_assert!(found * 1.415 >= exact * 0.999 - 1.0, "{found} {exact}");
        }

        #[test]
        fn steps_follow_sigma(level in 0_u32..=62, scale in 0_u32..=MAX_SCALE) {
            let step = offset_step(level) as f64;
            prop_assert!(step >= 1.0 && step <= 0.5 * sigma(level).max(2.0) + 1e-9);
            let steps = slope_steps(scale, level);
            prop_assert!((1..=MAX_SLOPE).contains(&steps));
            let radius = (UNITS << scale) as f64;
            // One step moves the rim by 0.7 sigma, where there is more than one and fewer than all.
            if (4..MAX_SLOPE).contains(&steps) && level > 8 {
                let rim = radius / f64::from(steps);
                prop_assert!((0.55..0.85).contains(&(rim / sigma(level))), "{rim}");
            }
        }
    }

    #[test]
    fn hostile_rules_have_a_level() {
        let rule = SigmaRule { per_range: u64::MAX, constant: u64::MAX };
        assert_eq!(rule.level([i64::MAX / 4; 3], Some([-(1 << 41); 3])), 62);
        assert_eq!(SigmaRule { per_range: 0, constant: 0 }.level([0; 3], None), 0);
    }
}
