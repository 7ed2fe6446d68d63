//! Which tiles of a rectangle points support (figures 2 and 3).

use super::rectangle::bounds;
use crate::planes::constants::{
    LEAST_THRESHOLD, LINE_COVER, RIM_SHARE, RIM_TILES, TILE_DOUBLINGS, TILE_POINTS,
};
use crate::planes::tiles::{MAX_TILES, Tiles};

/// The rectangle of points cut into tiles, and the points in the cube of each. Tiles have the side `grid_size` or a power
/// of two more, where the rectangle is too large or points are too sparse for tiles of that side. Points are also too
/// sparse where they lie on scan lines, and tiles of twice the side cover clearly more of the rectangle.
pub(super) fn tiled(local: &[[f64; 3]], grid_size: f64, on_lines: bool) -> (Tiles, Vec<u32>) {
    let (low, size) = bounds(local);
    let mut edge = grid_size;
    while (size[0] / edge + 1.0) * (size[1] / edge + 1.0) > MAX_TILES {
        edge *= 2.0;
    }
    let of_edge = |edge: f64| {
        let tiles = Tiles::new(low, size, edge);
        let counts = count(&tiles, local, grid_size);
        (tiles, counts)
    };
    let mut now = of_edge(edge);
    for _ in 0..TILE_DOUBLINGS {
        let held: u32 = now.1.iter().sum();
        let full = filled(&now.1);
        let dense = f64::from(held) >= TILE_POINTS * full as f64;
        if full <= 1 || (dense && !on_lines) {
            break;
        }
        edge *= 2.0;
        let next = of_edge(edge);
        let cover = |counts: &[u32]| filled(counts) as f64 / counts.len() as f64;
        if dense && cover(&next.1) < LINE_COVER * cover(&now.1) {
            break;
        }
        now = next;
    }
    now
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
/// c_k > max(T, 1),  T = mean(c) - 2 std(c)  over the tiles with points
/// c_k >= 3/4 m_k - sqrt(m_k)
/// ```
///
/// The paper has the first, without the 1: T is below that unless points are evenly spread, and a single point is no
/// surface. The second, if `rims`, ends patches where surfaces end: noise carries points over the edge, to tiles at the
/// rim.
pub(super) fn supported(tiles: &Tiles, counts: &[u32], rims: bool) -> Vec<bool> {
    let filled = || counts.iter().filter(|&&c| c > 0).map(|&c| f64::from(c));
    let n = filled().count() as f64;
    let mean = filled().sum::<f64>() / n;
    let variance = filled().map(|c| (c - mean).powi(2)).sum::<f64>() / n;
    let threshold = (mean - 2.0 * variance.sqrt()).max(LEAST_THRESHOLD);
    let [nx, ny] = tiles.shape();
    (0..counts.len())
        .map(|t| {
            if f64::from(counts[t]) <= threshold {
                return false;
            }
            if !rims {
                return true;
            }
            let around = mean_around(counts, [nx, ny], t);
            f64::from(counts[t]) >= RIM_SHARE * around - f64::sqrt(around)
        })
        .collect()
}

/// Mean number of points of the tiles with points around tile `t`, itself included.
fn mean_around(counts: &[u32], [nx, ny]: [usize; 2], t: usize) -> f64 {
    let (x, y) = (t % nx, t / nx);
    let (mut sum, mut full) = (0.0, 0.0);
    for row in y.saturating_sub(RIM_TILES)..(y + RIM_TILES + 1).min(ny) {
        for column in x.saturating_sub(RIM_TILES)..(x + RIM_TILES + 1).min(nx) {
            let c = counts[row * nx + column];
            if c > 0 {
                sum += f64::from(c);
                full += 1.0;
            }
        }
    }
    sum / full
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
