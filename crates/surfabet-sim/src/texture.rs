//! Procedural colours, evaluated at a point in the frame of its instance: congruent instances look the same.
//!
//! Mostly smooth at the scale of a centimetre, as painted and wooden surfaces are, with sharp edges where
//! tiles, stripes and prints have them.

use crate::pose::Vec3;

/// Red, green, blue, 0 to 1.
pub(crate) type Rgb = [f64; 3];

/// How a surface is coloured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Texture {
    /// Paint, with faint mottling of about a decimetre.
    Paint(Rgb),
    /// Wood with the grain along an axis (0, 1, 2) of the instance: light, dark.
    Wood(Rgb, Rgb, usize),
    /// Square tiles: colour, colour of every second tile, edge length; joints of 6 mm.
    Tiles(Rgb, Rgb, f64),
    /// Floor boards of the given width along x, each of its own shade: light, dark.
    Boards(Rgb, Rgb, f64),
    /// Soft vertical stripes of wallpaper: two colours and the period.
    Wallpaper(Rgb, Rgb, f64),
    /// Sharp stripes across an axis: two colours, period, axis.
    Stripes(Rgb, Rgb, f64, usize),
    /// A print in the x-z plane of the instance, composed from a seed.
    Print(u64),
    /// Sky above, green below, as through a window in the x-z plane: height of the horizon.
    View(f64),
}

/// A bijective scrambling of 64 bits (the finaliser of SplitMix64, Steele et al. 2014).
fn scramble(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A number in 0..1 that depends on three integers and a salt.
fn hash(cell: [i64; 3], salt: u64) -> f64 {
    let bits = cell.iter().fold(salt, |h, &c| scramble(h ^ c as u64));
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// Smooth noise in 0..1 with features of unit size (value noise on the integer lattice, cubic fade).
fn noise(p: Vec3, salt: u64) -> f64 {
    let base = p.map(f64::floor);
    let fade = (p - base).map(|t| t * t * (3.0 - 2.0 * t));
    let cell = [base.x as i64, base.y as i64, base.z as i64];
    let mut sum = 0.0;
    for corner in 0..8 {
        let bit = |a: usize| (corner >> a) & 1;
        let weight: f64 =
            (0..3).map(|a| if bit(a) == 1 { fade[a] } else { 1.0 - fade[a] }).product();
        sum += weight * hash(std::array::from_fn(|a| cell[a] + bit(a) as i64), salt);
    }
    sum
}

/// The colour at share `t` of the way from `a` to `b`.
pub(crate) fn mix(a: Rgb, b: Rgb, t: f64) -> Rgb {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t)
}

fn scale(a: Rgb, factor: f64) -> Rgb {
    a.map(|c| c * factor)
}

/// 0 up to `low`, 1 from `high` on, smooth between.
fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The two coordinates of `p` in the plane most nearly perpendicular to `n`.
fn in_plane(p: &Vec3, n: &Vec3) -> (f64, f64) {
    match n.iamax() {
        0 => (p.y, p.z),
        1 => (p.x, p.z),
        _ => (p.x, p.y),
    }
}

impl Texture {
    /// The colour at `p` with normal `n`, both in the frame of the instance.
    pub(crate) fn color(&self, p: &Vec3, n: &Vec3) -> Rgb {
        match *self {
            Self::Paint(color) => scale(color, 0.97 + 0.05 * noise(p * 9.0, 1)),
            Self::Wood(light, dark, axis) => wood(light, dark, axis, p),
            Self::Tiles(color, second, size) => tiles(color, second, size, in_plane(p, n)),
            Self::Boards(light, dark, width) => boards(light, dark, width, p),
            Self::Wallpaper(a, b, period) => {
                let (u, _) = in_plane(p, n);
                let wave = 0.5 + 0.5 * (std::f64::consts::TAU * u / period).sin();
                scale(mix(a, b, wave), 0.97 + 0.05 * noise(p * 7.0, 7))
            }
            Self::Stripes(a, b, period, axis) => {
                if (p[axis] / period).rem_euclid(1.0) < 0.5 {
                    a
                } else {
                    b
                }
            }
            Self::Print(seed) => print(seed, p),
            Self::View(horizon) => view(horizon, p),
        }
    }
}

/// Two octaves of noise, drawn out along the grain.
fn wood(light: Rgb, dark: Rgb, axis: usize, p: &Vec3) -> Rgb {
    let mut q = p * 45.0;
    q[axis] = p[axis] * 4.0;
    let grain = 0.65 * noise(q, 2) + 0.35 * noise(q * 2.3, 3);
    mix(light, dark, smoothstep(0.2, 0.85, grain))
}

/// A chequerboard with joints, each tile with a shade of its own.
fn tiles(color: Rgb, second: Rgb, size: f64, (u, v): (f64, f64)) -> Rgb {
    let (i, j) = ((u / size).floor(), (v / size).floor());
    let joint = |w: f64| {
        let offset = (w / size).rem_euclid(1.0) * size;
        offset.min(size - offset) < 0.003
    };
    if joint(u) || joint(v) {
        return [0.55, 0.54, 0.52];
    }
    let shade = 0.94 + 0.08 * hash([i as i64, j as i64, 0], 4);
    let odd = (i + j).rem_euclid(2.0) > 0.5;
    scale(if odd { second } else { color }, shade)
}

/// Rows of boards of 1.2 m along x, shifted against each other, with dark gaps between the rows.
fn boards(light: Rgb, dark: Rgb, width: f64, p: &Vec3) -> Rgb {
    let row = (p.y / width).floor();
    let length = 1.2;
    let along = p.x + length * hash([row as i64, 0, 0], 5);
    let board = [row as i64, (along / length).floor() as i64, 1];
    let edge = (p.y / width - row).min(row + 1.0 - p.y / width) * width;
    let shade = hash(board, 6);
    let offset = Vec3::new(0.0, 3.0 * shade, 7.0 * shade);
    let grain = wood(light, dark, 0, &(p + offset));
    scale(grain, (0.88 + 0.2 * shade) * if edge < 0.0015 { 0.6 } else { 1.0 })
}

/// A disc and squares over a ground whose colour changes upwards.
fn print(seed: u64, p: &Vec3) -> Rgb {
    let cell = |size: f64| [(p.x / size).floor() as i64, (p.z / size).floor() as i64, 0];
    let pick = |k: i64| std::array::from_fn(|c| hash([k, c as i64, 2], seed));
    let ground = mix([0.93, 0.90, 0.84], pick(0), 0.25 + 1.2 * (p.z + 0.3).clamp(0.0, 0.5));
    let (x, z) = (p.x - 0.2 * (hash([5, 0, 0], seed) - 0.5), p.z);
    let disc = 0.09 + 0.05 * hash([6, 0, 0], seed);
    if x.hypot(z) < disc {
        return mix(pick(1), [1.0, 0.85, 0.3], 0.5);
    }
    if hash(cell(0.11), seed) > 0.72 {
        return mix(pick(2), ground, 0.3 * hash(cell(0.11), seed ^ 1));
    }
    ground
}

/// Sky above a wavy line of trees.
fn view(horizon: f64, p: &Vec3) -> Rgb {
    let sky = mix([0.80, 0.88, 0.97], [0.45, 0.65, 0.93], smoothstep(0.0, 0.8, p.z - horizon));
    let trees = 0.12 * noise(Vec3::new(p.x * 7.0, 0.0, 0.0), 8);
    let green = mix([0.24, 0.40, 0.18], [0.40, 0.55, 0.25], noise(p * 12.0, 9));
    mix(green, sky, smoothstep(-0.01, 0.01, p.z - horizon - trees))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_and_stays_between_its_bounds() {
        let mut last = noise(Vec3::new(0.0, 0.3, -0.7), 1);
        for i in 1..5000 {
            let value = noise(Vec3::new(f64::from(i) * 0.01, 0.3, -0.7), 1);
            assert!((0.0..=1.0).contains(&value));
            // The cubic fade has a slope of at most 1.5.
            assert!((value - last).abs() <= 0.015 + 1e-12);
            last = value;
        }
    }

    #[test]
    fn joints_of_tiles_lie_on_multiples_of_their_size() {
        let tiles = Texture::Tiles([1.0; 3], [0.0; 3], 0.2);
        let at = |x: f64| tiles.color(&Vec3::new(x, 0.1, 0.0), &Vec3::z());
        assert_eq!(at(0.401), at(-0.199));
        assert_ne!(at(0.41), at(0.401));
        assert_ne!(at(0.41), at(0.61));
    }
}
