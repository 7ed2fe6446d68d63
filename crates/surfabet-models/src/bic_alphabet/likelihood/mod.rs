//! The likelihood of a scene given decoded points (eq. 6 to 13), so that a few points more or less change it exactly.
//!
//! Gaussians are rounded to units of 2^-22 and summed as integers, logarithms likewise: sums do not depend on the
//! order, so what was added can be taken away again without a trace, and a state reached step by step is the same, to
//! the bit, as one computed at once. The factor 1/M (eq. 9) is kept apart.

use rayon::prelude::*;
use surfabet_geom::{Aabb, BoxTree, Union, arrange};

use crate::bic_alphabet::pose::Frame;
use crate::scans::Scene;

/// Points per block: one vector of single precision.
pub(crate) const LANES: usize = 8;

/// Bits of a Gaussian's fraction.
const KERNEL_BITS: u32 = 22;

/// Bits of a logarithm's fraction: the sum over 2^28 points stays below 2^63.
const LOG_BITS: u32 = 30;

/// Half the square of three sigma: the neighbourhood of eq. 10.
const REACH: f32 = 4.5;

/// Decoded points that are scattered together.
const CHUNK: usize = 64;

/// Features per unit of parallel work.
const BATCH: usize = 512;

/// Points that lie together, as a box with the largest distance at which any of them feels a decoded point.
#[derive(Debug, Clone, Copy)]
struct Block {
    aabb: Aabb,
    reach: f32,
}

impl Block {
    const EMPTY: Self = Self { aabb: Aabb::EMPTY, reach: 0.0 };
}

impl Union for Block {
    fn union(self, other: Self) -> Self {
        Self { aabb: self.aabb.union(other.aabb), reach: self.reach.max(other.reach) }
    }
}

/// The points of a scene in blocks.
#[derive(Debug, Clone)]
pub(crate) struct Samples {
    /// Coordinates per block.
    positions: Vec<[[f32; LANES]; 3]>,
    /// `1 / (2 sigma^2)` per lane.
    narrow: Vec<[f32; LANES]>,
    blocks: BoxTree<Block>,
    len: usize,
    /// Sum of ln(sqrt(2 pi) sigma), the normaliser of eq. 12.
    normalizer: f64,
    /// What a point without neighbours counts, as a logarithm.
    floor: i64,
}

/// Which blocks an occurrence at each feature can reach.
#[derive(Debug, Clone)]
pub(crate) struct Reaches {
    starts: Vec<u32>,
    blocks: Vec<u32>,
}

impl Reaches {
    #[inline]
    pub fn of(&self, feature: u32) -> &[u32] {
        let f = feature as usize;
        &self.blocks[self.starts[f] as usize..self.starts[f + 1] as usize]
    }
}

/// exp(-e) for `e` up to [`REACH`], in units of 2^-22; zero beyond.
#[inline(always)]
fn kernel(e: f32) -> u32 {
    // exp(-e / 16) = 1 + y q(y) with the q that has the least relative error up to REACH, 3e-8; then four squarings:
    // 1e-6 relative.
    let y = e * (1.0 / 16.0);
    let q = ((0.036_303_406 * y - 0.165_411_64) * y + 0.499_882_13) * y - 0.999_996_5;
    let p1 = 1.0 + y * q;
    let p2 = p1 * p1;
    let p4 = p2 * p2;
    let p8 = p4 * p4;
    let p16 = p8 * p8;
    let inside = if e <= REACH { p16 } else { 0.0 };
    // Adding 2^23 leaves the rounded integer in the mantissa.
    let shifted = inside * (1 << KERNEL_BITS) as f32 + (1 << 23) as f32;
    shifted.to_bits() & ((1 << 23) - 1)
}

impl Samples {
    pub fn new(scene: &Scene, floor: f64) -> Self {
        let mut order: Vec<u32> = (0..scene.len() as u32).collect();
        arrange(&mut order, &scene.positions, LANES);
        let n_blocks = order.len().div_ceil(LANES);
        // Lanes beyond the last point are out of everything's reach.
        let mut positions = vec![[[1e30; LANES]; 3]; n_blocks];
        let mut narrow = vec![[1.0; LANES]; n_blocks];
        let mut blocks = vec![Block::EMPTY; n_blocks];
        for (b, members) in order.chunks(LANES).enumerate() {
            for (lane, &i) in members.iter().enumerate() {
                let (p, sigma) = (scene.positions[i as usize], scene.sigma[i as usize]);
                for a in 0..3 {
                    positions[b][a][lane] = p[a];
                }
                narrow[b][lane] = 0.5 / (sigma * sigma);
                // Slightly more, so that rounding never loses a neighbour.
                let own = Block { aabb: Aabb::point(p), reach: 3.001 * sigma };
                blocks[b] = blocks[b].union(own);
            }
        }
        let root = std::f64::consts::TAU.sqrt();
        let normalizer = scene.sigma.iter().map(|&s| (root * f64::from(s)).ln()).sum();
        let floor = f64::from(KERNEL_BITS) * std::f64::consts::LN_2 - 0.5 * floor * floor;
        let floor = (floor * (1_u64 << LOG_BITS) as f64).round() as i64;
        let blocks = BoxTree::new(blocks);
        Self { positions, narrow, blocks, len: order.len(), normalizer, floor }
    }

    /// Number of points, N.
    pub fn len(&self) -> usize {
        self.len
    }

    pub fn n_blocks(&self) -> usize {
        self.blocks.leaves().len()
    }

    /// The blocks that points within `radius` of each frame can reach.
    pub fn reaches(&self, frames: &[Frame], radius: f32) -> Reaches {
        let parts: Vec<(Vec<u32>, Vec<u32>)> = frames
            .par_chunks(BATCH)
            .map(|frames| {
                let (mut counts, mut found) = (Vec::with_capacity(frames.len()), Vec::new());
                for frame in frames {
                    let before = found.len();
                    let near = |block: &Block| {
                        let limit = radius + block.reach;
                        block.aabb.squared_distance(frame.origin) <= limit * limit
                    };
                    self.blocks.leaves_where(near, &mut found);
                    counts.push((found.len() - before) as u32);
                }
                (counts, found)
            })
            .collect();
        let mut starts = vec![0];
        let mut end = 0;
        for count in parts.iter().flat_map(|(counts, _)| counts) {
            end += count;
            starts.push(end);
        }
        Reaches { starts, blocks: parts.into_iter().flat_map(|(_, found)| found).collect() }
    }

    /// Adds the Gaussians of some decoded points, or takes them away, from the sums of all points that feel them;
    /// `touched` is told each block that may have changed.
    pub fn scatter(
        &self,
        decoded: &[[f32; 3]],
        reach: &[u32],
        add: bool,
        sums: &mut [[i64; LANES]],
        mut touched: impl FnMut(u32),
    ) {
        let blocks = self.blocks.leaves();
        // So many Gaussians of at most 2^22 fit 32 bits.
        for decoded in decoded.chunks(CHUNK) {
            let mut columns = [[f32::INFINITY; CHUNK]; 3];
            for (k, p) in decoded.iter().enumerate() {
                for a in 0..3 {
                    columns[a][k] = p[a];
                }
            }
            let padded = decoded.len().next_multiple_of(LANES);
            for &b in reach {
                let at = b as usize;
                let block = &blocks[at];
                let limit = block.reach * block.reach;
                let mut distances = [0.0_f32; CHUNK];
                for k in 0..padded {
                    distances[k] = block.aabb.squared_distance(columns.each_ref().map(|c| c[k]));
                }
                // Whether a point is near is a toss-up, so it is counted without a branch.
                let mut near = [0_u8; CHUNK];
                let mut n_near = 0;
                for (k, &distance) in distances[..decoded.len()].iter().enumerate() {
                    near[n_near] = k as u8;
                    n_near += usize::from(distance <= limit);
                }
                if n_near == 0 {
                    continue;
                }
                let ([x, y, z], narrow) = (&self.positions[at], &self.narrow[at]);
                let mut values = [0_u32; LANES];
                for &k in &near[..n_near] {
                    let p = decoded[usize::from(k)];
                    for lane in 0..LANES {
                        let (dx, dy, dz) = (x[lane] - p[0], y[lane] - p[1], z[lane] - p[2]);
                        values[lane] += kernel((dx * dx + dy * dy + dz * dz) * narrow[lane]);
                    }
                }
                touched(b);
                let sign = if add { 1 } else { -1 };
                for lane in 0..LANES {
                    sums[at][lane] += sign * i64::from(values[lane]);
                }
            }
        }
    }

    /// Number of points in a block.
    #[inline]
    pub fn lanes(&self, block: usize) -> usize {
        LANES.min(self.len - block * LANES)
    }

    /// Logarithm of a sum of Gaussians, as an integer.
    #[inline]
    pub fn log(&self, sum: i64) -> i64 {
        if sum > 0 {
            ((sum as f64).ln() * (1_u64 << LOG_BITS) as f64).round() as i64
        } else {
            self.floor
        }
    }

    /// ln L (eq. 6) from the sum of the logarithms over all points and the number M of decoded points.
    pub fn log_likelihood(&self, logs: i64, decoded: i64) -> f64 {
        let n = self.len as f64;
        let sum = logs as f64 / (1_u64 << LOG_BITS) as f64;
        let units = f64::from(KERNEL_BITS) * std::f64::consts::LN_2;
        sum - n * units - self.normalizer - n * (decoded as f64).ln()
    }

    /// The state without decoded points.
    pub fn nothing(&self) -> Sums {
        Sums {
            sums: vec![[0; LANES]; self.n_blocks()],
            logs: vec![[self.floor; LANES]; self.n_blocks()],
            total: self.floor * self.len as i64,
        }
    }
}

/// Sums of Gaussians per point, their logarithms, and the sum of these.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Sums {
    pub sums: Vec<[i64; LANES]>,
    pub logs: Vec<[i64; LANES]>,
    pub total: i64,
}

/// BIC (eq. 4) with `parameters` numbers in the alphabet.
pub(crate) fn bic(log_likelihood: f64, parameters: usize, n: usize) -> f64 {
    -2.0 * log_likelihood + parameters as f64 * (n as f64).ln()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::scans::Deviation;

    /// Eq. 6 to 12 by a plain double loop.
    fn plain(scene: &Scene, decoded: &[[f32; 3]], floor: f64) -> f64 {
        let gaussian = |d: [f32; 3], sigma: f64, r: [f32; 3]| {
            let squared: f64 = (0..3).map(|a| f64::from(d[a] - r[a]).powi(2)).sum();
            let e = squared / (2.0 * sigma * sigma);
            if e <= 4.5 { (-e).exp() / (std::f64::consts::TAU.sqrt() * sigma) } else { 0.0 }
        };
        let each = scene.positions.iter().zip(&scene.sigma).map(|(&d, &sigma)| {
            let sigma = f64::from(sigma);
            let sum: f64 = decoded.iter().map(|&r| gaussian(d, sigma, r)).sum();
            let least = (-0.5 * floor * floor).exp() / (std::f64::consts::TAU.sqrt() * sigma);
            (if sum > 0.0 { sum } else { least }).ln() - (decoded.len() as f64).ln()
        });
        each.sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn it_is_that_of_a_plain_double_loop(
            positions in prop::collection::vec(prop::array::uniform3(-1.0_f32..1.0), 1..200),
            decoded in prop::collection::vec(prop::array::uniform3(-1.0_f32..1.0), 1..100),
            floor in 3.0_f64..10.0,
        ) {
            let (cloud, _) = PointCloud::from_positions(positions);
            let scene = Scene::new(&cloud, Deviation::default(), 0.0, &Silent).unwrap();
            let samples = Samples::new(&scene, floor);
            let frame = Frame { origin: [0.0; 3], rows: [[0.0; 3]; 3] };
            let reaches = samples.reaches(&[frame], 2.0);
            let mut state = samples.nothing();
            samples.scatter(&decoded, reaches.of(0), true, &mut state.sums, |_| ());
            let logs: i64 = (0..samples.n_blocks())
                .flat_map(|b| state.sums[b][..samples.lanes(b)].iter())
                .map(|&s| samples.log(s))
                .sum();
            let found = samples.log_likelihood(logs, decoded.len() as i64);
            let expected = plain(&scene, &decoded, floor);
            // A point exactly at 3 sigma may fall on either side in single precision.
            prop_assert!((found - expected).abs() < 1e-4 * expected.abs().max(1.0), "{found} {expected}");
            for &r in &decoded {
                samples.scatter(&[r], reaches.of(0), false, &mut state.sums, |_| ());
            }
            prop_assert_eq!(state, samples.nothing());
        }
    }

    #[test]
    fn the_kernel_is_the_exponential() {
        for k in 0..=4500 {
            let e = k as f32 * 1e-3;
            let found = f64::from(kernel(e)) / f64::from(1 << KERNEL_BITS);
            let exact = (-f64::from(e)).exp();
            assert!((found - exact).abs() < 3e-7 + 2e-6 * exact, "{e}: {found} {exact}");
        }
        assert_eq!(kernel(4.51), 0);
        assert_eq!(kernel(f32::INFINITY), 0);
        assert_eq!(kernel(f32::NAN), 0);
    }
}
