//! The integers that poses are made of, and the deviation allowed at each.
//!
//! Space is counted in units of a 256th of the smallest radius. A word of scale l has the radius `2^l` times the
//! smallest and stands in a cubic cell whose side is that radius. How finely the pose is said follows from the
//! deviation sigma at the cell, which follows from the sensor's distance: all in integers, so that every platform
//! reads the same.

/// Units per smallest radius, and per side of the smallest cell.
pub const UNITS: i64 = 256;

/// Largest scale: radii up to 128 times the smallest.
pub const MAX_SCALE: u32 = 7;

/// Largest coordinate of a cell.
pub const MAX_CELL: i32 = 1 << 24;

/// Fractional bits of [`SigmaRule::per_range`].
const RANGE_BITS: u32 = 40;

/// Angle of one step of a normal times the radius, over sigma, in hundredths: at the rim of a word, rounding of the
/// normal weighs like rounding of the offset.
const TILT_STEP: i64 = 70;

/// Steps of a normal from an axis to the next at most.
pub const MAX_SLOPE: i32 = 255;

/// Sigma squared as a function of the squared distance from the sensor (eq. 13), in units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SigmaRule {
    /// `(scale * tan(alpha / 2))^2`, times 2^40; zero where no sensor is known.
    pub per_range: u64,
    /// What does not depend on range: `(scale * noise)^2` in square units.
    pub constant: u64,
}

impl SigmaRule {
    /// From lengths in metres and the size of a unit.
    pub fn new(per_range: f64, constant: f64, unit: f64) -> Self {
        Self {
            per_range: (per_range * per_range * (1_u64 << RANGE_BITS) as f64).round() as u64,
            constant: (constant / unit).powi(2).round() as u64,
        }
    }

    /// Level of sigma at a point: the logarithm of sigma squared to base two, rounded down.
    pub fn level(&self, point: [i64; 3], sensor: Option<[i64; 3]>) -> u32 {
        let squared: u128 = sensor
            .map_or(0, |from| (0..3).map(|a| u128::from(point[a].abs_diff(from[a])).pow(2)).sum());
        // Coordinates are below 2^41, so that the square has 84 bits and the rule at most 44 above its fraction.
        let grown = (squared.min(1 << 83) * u128::from(self.per_range.min(1 << 44))) >> RANGE_BITS;
        (grown + u128::from(self.constant)).clamp(1, 1 << 62).ilog2()
    }
}

/// Sigma of a level in units; at most the true one, and above it over the root of two.
pub fn sigma(level: u32) -> f64 {
    let whole = (1_u64 << (level / 2)) as f64;
    if level % 2 == 1 { whole * std::f64::consts::SQRT_2 } else { whole }
}

/// Sigma of a level in whole units.
fn whole_sigma(level: u32) -> i64 {
    (1_i128 << level).isqrt() as i64
}

/// Step of the offset along the normal, units: half of sigma.
pub fn offset_step(level: u32) -> i64 {
    (whole_sigma(level) / 2).max(1)
}

/// Steps of a normal from an axis to the diagonal, for words of a scale.
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
