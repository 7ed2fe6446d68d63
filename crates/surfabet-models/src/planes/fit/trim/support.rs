//! Which tiles of a rectangle points support (figures 2 and 3).

use super::rectangle::Bounds;
use crate::planes::constants::{
    LEAST_THRESHOLD, LINE_COVER, RIM_SHARE, RIM_TILES, TILE_DOUBLINGS, TILE_POINTS,
};
use crate::planes::tiles::{MAX_TILES, SummedArea, Tiles};

/// The bounding rectangle of points cut into tiles, and the points in the cube of each. Tiles have the side `grid_size` or a power
/// of two more, where the rectangle is too large or points are too sparse for tiles of that side. Points are also too
/// sparse where they lie on scan lines, and tiles of twice the side cover clearly more of the rectangle.
pub(super) fn tiled(
    local: &[[f64; 3]],
    (low, size): Bounds,
    grid_size: f64,
    on_lines: bool,
) -> (Tiles, Vec<u32>) {
    let mut edge = grid_size;
    while (size[0] / edge + 1.0) * (size[1] / edge + 1.0) > MAX_TILES {
        edge *= 2.0;
    }
    let tiles = Tiles::new(low, size, edge);
    let counts = count(&tiles, local, grid_size);
    let mut now = (tiles, counts);
    for _ in 0..TILE_DOUBLINGS {
        let held: u32 = now.1.iter().sum();
        let full = filled(&now.1);
        let dense = f64::from(held) >= TILE_POINTS * full as f64;
        if full <= 1 || (dense && !on_lines) {
            break;
        }
        edge *= 2.0;
        let tiles = Tiles::new(low, size, edge);
        let counts = by_fours(&now, &tiles);
        let next = (tiles, counts);
        let cover = |counts: &[u32]| filled(counts) as f64 / counts.len() as f64;
        if dense && cover(&next.1) < LINE_COVER * cover(&now.1) {
            break;
        }
        now = next;
    }
    now
}

/// The points in the cubes of tiles of twice the side: each holds four of the tiles before, or fewer at the far sides.
fn by_fours((before, counts): &(Tiles, Vec<u32>), tiles: &Tiles) -> Vec<u32> {
    let mut sums = vec![0; tiles.supported().len()];
    let [nx, to] = [before.shape()[0], tiles.shape()[0]];
    for (y, row) in counts.chunks(nx).enumerate() {
        for (x, count) in row.iter().enumerate() {
            sums[y / 2 * to + x / 2] += count;
        }
    }
    sums
}

/// Number of tiles with points.
fn filled(counts: &[u32]) -> usize {
    counts.iter().filter(|&&c| c > 0).count()
}

/// True for a point in the cubes of side `grid_size` around the tiles of the plane.
pub(super) fn in_cube(p: &[f64; 3], grid_size: f64) -> bool {
    p[2].abs() <= 0.5 * grid_size
}

/// Number of points in the cube around each tile: `support(t_k)`.
pub(in crate::planes::fit) fn count(tiles: &Tiles, local: &[[f64; 3]], grid_size: f64) -> Vec<u32> {
    let mut counts = vec![0; tiles.supported().len()];
    for p in local.iter().filter(|p| in_cube(p, grid_size)) {
        if let Some(t) = tiles.tile_at([p[0], p[1]]) {
            counts[t] += 1;
        }
    }
    counts
}

/// The supported tiles. With `c_k` the number of points of tile `k` and `m_k` the mean over the tiles with points around it
/// and itself, both of these have to hold:
///
/// ```text
/// c_k >= T and c_k > 1,  T = mean(c) - 2 std(c)  over the tiles with points
/// c_k >= 3/4 m_k - sqrt(m_k)
/// ```
///
/// The paper has `c_k > T`, which no tile of a regular grid holds whose tiles all have the same number of points; and not the 1:
/// T is below that unless points are evenly spread, and a single point is no surface. The second, if `rims`, ends patches where surfaces end: noise carries points over the edge, to tiles at the
/// rim.
pub(super) fn supported(tiles: &Tiles, counts: &[u32], rims: bool) -> Vec<bool> {
    let filled = || counts.iter().filter(|&&c| c > 0).map(|&c| f64::from(c));
    let n = filled().count() as f64;
    let mean = filled().sum::<f64>() / n;
    let variance = filled().map(|c| (c - mean).powi(2)).sum::<f64>() / n;
    let threshold = mean - 2.0 * variance.sqrt();
    let enough = |c: u32| f64::from(c) >= threshold && f64::from(c) > LEAST_THRESHOLD;
    if !rims {
        return counts.iter().map(|&c| enough(c)).collect();
    }
    let around = NeighborCounts::new(tiles.shape(), counts);
    let holds = |(t, &c): (usize, &u32)| {
        enough(c) && {
            let mean = around.mean(t);
            f64::from(c) >= RIM_SHARE * mean - f64::sqrt(mean)
        }
    };
    counts.iter().enumerate().map(holds).collect()
}

/// Points of the tiles around a tile.
struct NeighborCounts {
    points: SummedArea,
    filled: SummedArea,
}

impl NeighborCounts {
    fn new(shape: [usize; 2], counts: &[u32]) -> Self {
        let filled = |t: usize| u32::from(counts[t] > 0);
        Self {
            points: SummedArea::new(shape, |t| counts[t]),
            filled: SummedArea::new(shape, filled),
        }
    }

    /// Mean number of points of the tiles with points around tile `t`, itself included.
    fn mean(&self, t: usize) -> f64 {
        let [nx, ny] = self.points.shape();
        let window = [[t % nx, nx], [t / nx, ny]]
            .map(|[at, n]| [at.saturating_sub(RIM_TILES), (at + RIM_TILES + 1).min(n)]);
        f64::from(self.points.of(window)) / f64::from(self.filled.of(window))
    }
}

/// Heights of points per tile: number, weight, weighted sum and weighted sum of squares.
pub(super) struct Scatter(Vec<[f64; 4]>);

impl Scatter {
    pub fn new(tiles: usize) -> Self {
        Self(vec![[0.0; 4]; tiles])
    }

    pub fn add(&mut self, tile: usize, weight: f64, height: f64) {
        let [n, w, sum, squares] = &mut self.0[tile];
        *n += 1.0;
        *w += weight;
        *sum += weight * height;
        *squares += weight * height * height;
    }

    /// Standard deviation of the heights about the means of their tiles, metres.
    ///
    /// `sqrt(sum w (z - mean)^2 / sum w (n - 1) / n)`, sums over the tiles with `n > 1` points of weight `w` in all.
    pub fn within(&self) -> f64 {
        let mut squares = 0.0;
        let mut freedom = 0.0;
        for &[n, w, sum, square] in self.0.iter().filter(|t| t[0] > 1.0 && t[1] > 0.0) {
            squares += (square - sum * sum / w).max(0.0);
            freedom += w * (n - 1.0) / n;
        }
        if freedom > 0.0 { (squares / freedom).sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Points over 3 m x 1.7 m, 3 cm thick, where `keep` says so.
    fn points(keep: impl Fn(f64, f64) -> bool) -> Vec<[f64; 3]> {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let all = (0..6000).map(|_| [3.0, 1.7, 0.03].map(|size| rng.random_range(0.0..size)));
        all.filter(|p| keep(p[0], p[1])).map(|p| [p[0], p[1], p[2] - 0.015]).collect()
    }

    #[test]
    fn larger_tiles_hold_what_is_counted_in_them() {
        let local = points(|x, _| !(0.7..1.3).contains(&x));
        let mut tiles = Tiles::new([0.0; 2], [3.0, 1.7], 0.013);
        let mut counts = count(&tiles, &local, 0.02);
        for doubling in 1..=5 {
            let next = Tiles::new([0.0; 2], [3.0, 1.7], 0.013 * f64::from(1 << doubling));
            counts = by_fours(&(tiles, counts), &next);
            assert_eq!(counts, count(&next, &local, 0.02));
            tiles = next;
        }
    }

    #[test]
    fn tiles_with_equally_many_points_are_all_supported() {
        let tiles = Tiles::new([0.0; 2], [5.0, 4.0], 1.0);
        for rims in [false, true] {
            assert!(supported(&tiles, &[16; 20], rims).iter().all(|&s| s));
        }
    }

    #[test]
    fn tiles_at_rims_need_their_share_of_those_around() {
        let shape = [7, 6];
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let counts: Vec<u32> = (0..42).map(|_| rng.random_range(0..20)).collect();
        let tiles = Tiles::new([0.0; 2], shape.map(|n| n as f64), 1.0);
        assert_eq!(tiles.shape(), shape);
        let all = supported(&tiles, &counts, false);
        for (t, &holds) in supported(&tiles, &counts, true).iter().enumerate() {
            let [x, y] = [t % 7, t / 7];
            let near = |u: &usize| (u % 7).abs_diff(x) <= 2 && (u / 7).abs_diff(y) <= 2;
            let around: Vec<f64> = (0..42)
                .filter(near)
                .filter(|&u| counts[u] > 0)
                .map(|u| f64::from(counts[u]))
                .collect();
            let mean = around.iter().sum::<f64>() / around.len() as f64;
            let enough = f64::from(counts[t]) >= 0.75 * mean - mean.sqrt();
            assert_eq!(holds, all[t] && enough, "{t}");
        }
    }
}
