//! Tiles of a patch and which of them points support (section II-A, figure 1).

/// Most tiles of a patch; a larger one gets larger tiles.
pub(super) const MAX_TILES: f64 = (1 << 24) as f64;

/// Summed-area table: sums over any rectangle of tiles at once.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct SummedArea {
    shape: [usize; 2],
    /// Sum of the tiles before each column and row, with a border of zeros.
    before: Vec<u32>,
}

impl SummedArea {
    /// Of the values of tiles, along the first axis first; all together are below 2^32.
    pub fn new([nx, ny]: [usize; 2], value: impl Fn(usize) -> u32) -> Self {
        let mut before = vec![0; (nx + 1) * (ny + 1)];
        for y in 0..ny {
            let mut row = 0;
            let (above, below) = before.split_at_mut((y + 1) * (nx + 1));
            let above = &above[y * (nx + 1) + 1..];
            for (x, (sum, above)) in below[1..=nx].iter_mut().zip(above).enumerate() {
                row += value(y * nx + x);
                *sum = above + row;
            }
        }
        Self { shape: [nx, ny], before }
    }

    /// Number of tiles along both axes.
    pub fn shape(&self) -> [usize; 2] {
        self.shape
    }

    /// The sum over columns and rows, each from the first up to the last, which is not included.
    pub fn of(&self, [[x0, x1], [y0, y1]]: [[usize; 2]; 2]) -> u32 {
        let sum = |x: usize, y: usize| self.before[y * (self.shape[0] + 1) + x];
        // In this order no sum is negative.
        (sum(x1, y1) - sum(x0, y1)) - (sum(x1, y0) - sum(x0, y0))
    }

    /// The sum over all tiles.
    pub fn total(&self) -> usize {
        self.before.last().map_or(0, |&n| n as usize)
    }
}

/// A rectangle in the plane of a patch, cut into square tiles; those at its far sides are narrower, where the side of the
/// rectangle is no multiple.
#[derive(Debug, Clone, PartialEq)]
pub struct Tiles {
    low: [f64; 2],
    size: [f64; 2],
    edge: f64,
    shape: [usize; 2],
    supported: Vec<bool>,
    /// Of the supported tiles.
    sums: SummedArea,
}

impl Tiles {
    /// A rectangle with corner `low` and size `size`, cut into tiles of side `edge`, none of them supported.
    pub(super) fn new(low: [f64; 2], size: [f64; 2], edge: f64) -> Self {
        let shape = size.map(|s| (s / edge).ceil().max(1.0) as usize);
        Self::of_shape(low, size, edge, shape)
    }

    /// As [`Tiles::new`], with the number of tiles along both axes known: a quotient may round up to one more.
    pub(super) fn of_shape(low: [f64; 2], size: [f64; 2], edge: f64, shape: [usize; 2]) -> Self {
        let supported = vec![false; shape[0] * shape[1]];
        Self { low, size, edge, shape, supported, sums: SummedArea::default() }
    }

    /// Marks the supported tiles.
    pub(super) fn support(&mut self, supported: Vec<bool>) {
        debug_assert_eq!(supported.len(), self.supported.len());
        self.supported = supported;
        self.sums = SummedArea::new(self.shape, |t| u32::from(self.supported[t]));
    }

    /// Corner with the lowest coordinates, metres about the middle of the frame.
    pub fn low(&self) -> [f64; 2] {
        self.low
    }

    /// Extent along both axes, metres.
    pub fn size(&self) -> [f64; 2] {
        self.size
    }

    /// Side of a tile, metres.
    pub fn edge(&self) -> f64 {
        self.edge
    }

    /// Number of tiles along both axes.
    pub fn shape(&self) -> [usize; 2] {
        self.shape
    }

    /// For each tile, along the first axis first, whether points support it.
    pub fn supported(&self) -> &[bool] {
        &self.supported
    }

    /// Number of supported tiles.
    pub fn n_supported(&self) -> usize {
        self.sums.total()
    }

    /// Area of the supported tiles, square metres.
    pub fn area(&self) -> f64 {
        let nx = self.shape[0];
        let of = |t: usize| {
            let (low, high) = self.bounds(t % nx, t / nx);
            (high[0] - low[0]) * (high[1] - low[1])
        };
        self.supported.iter().enumerate().filter(|(_, s)| **s).map(|(t, _)| of(t)).sum()
    }

    /// Position of a corner of tiles, given in columns and rows; the far sides are where the rectangle ends.
    pub(super) fn corner(&self, corner: [usize; 2]) -> [f64; 2] {
        std::array::from_fn(|a| self.low[a] + (self.edge * corner[a] as f64).min(self.size[a]))
    }

    /// Lower and upper corner of a tile.
    pub(super) fn bounds(&self, x: usize, y: usize) -> ([f64; 2], [f64; 2]) {
        let at = [x as f64, y as f64];
        let low = std::array::from_fn(|a| self.low[a] + self.edge * at[a]);
        let high = std::array::from_fn(|a| {
            (self.low[a] + self.edge * (at[a] + 1.0)).min(self.low[a] + self.size[a])
        });
        (low, high)
    }

    /// The tile that a position of the plane is on; the border belongs to the rectangle.
    #[inline]
    pub(super) fn tile_at(&self, p: [f64; 2]) -> Option<usize> {
        let mut tile = [0; 2];
        for a in 0..2 {
            let off = p[a] - self.low[a];
            if !(0.0..=self.size[a]).contains(&off) {
                return None;
            }
            // Tiles are fewer than 2^32, to which numbers are converted faster.
            tile[a] = ((off / self.edge) as u32 as usize).min(self.shape[a] - 1);
        }
        Some(tile[1] * self.shape[0] + tile[0])
    }

    /// First and last column and row of the tiles that touch a box; `None` beside the rectangle.
    fn window(&self, low: [f64; 2], high: [f64; 2]) -> Option<[[usize; 2]; 2]> {
        let mut window = [[0; 2]; 2];
        for a in 0..2 {
            let [from, to] = [low[a] - self.low[a], high[a] - self.low[a]];
            if to < 0.0 || from > self.size[a] {
                return None;
            }
            let last = self.shape[a] - 1;
            window[a] = [from.max(0.0), to].map(|c| ((c / self.edge) as usize).min(last));
        }
        Some(window)
    }

    /// True when a supported tile touches the box from `low` to `high`, up to rounding at the far sides.
    pub(super) fn any_in(&self, low: [f64; 2], high: [f64; 2]) -> bool {
        let window = self.window(low, high);
        window.is_some_and(|[[x0, x1], [y0, y1]]| self.sums.of([[x0, x1 + 1], [y0, y1 + 1]]) > 0)
    }

    /// Squared distance to the closest supported tile, where this is at most `reach` away.
    #[inline]
    pub(super) fn squared_distance(&self, p: [f64; 2], reach: f64) -> Option<f64> {
        match self.tile_at(p) {
            Some(t) if self.supported[t] => Some(0.0),
            _ => self.squared_distance_beside(p, reach),
        }
    }

    /// The same of a position that is on no supported tile.
    #[inline(never)]
    fn squared_distance_beside(&self, p: [f64; 2], reach: f64) -> Option<f64> {
        let [[x0, x1], [y0, y1]] = self.window(p.map(|c| c - reach), p.map(|c| c + reach))?;
        let mut closest = f64::INFINITY;
        for y in y0..=y1 {
            for x in x0..=x1 {
                if !self.supported[y * self.shape[0] + x] {
                    continue;
                }
                let (low, high) = self.bounds(x, y);
                let off: [f64; 2] =
                    std::array::from_fn(|a| (low[a] - p[a]).max(p[a] - high[a]).max(0.0));
                closest = closest.min(off[0] * off[0] + off[1] * off[1]);
            }
        }
        (closest <= reach * reach).then_some(closest)
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn any_tiles(rng: &mut ChaCha8Rng) -> Tiles {
        let size = [rng.random_range(0.1..3.0), rng.random_range(0.1..3.0)];
        let mut tiles = Tiles::new([-1.0, 0.5], size, 0.4);
        let supported = (0..tiles.supported().len()).map(|_| rng.random_bool(0.3)).collect();
        tiles.support(supported);
        tiles
    }

    #[test]
    fn distances_are_those_to_the_closest_of_all_supported_tiles() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for _ in 0..200 {
            let tiles = any_tiles(&mut rng);
            let nx = tiles.shape()[0];
            for _ in 0..50 {
                let p: [f64; 2] = [rng.random_range(-2.0..3.0), rng.random_range(-1.0..4.0)];
                let to = |t: usize| {
                    let (low, high) = tiles.bounds(t % nx, t / nx);
                    (0..2).map(|a| (p[a] - p[a].clamp(low[a], high[a])).powi(2)).sum::<f64>()
                };
                let all = (0..tiles.supported().len()).filter(|&t| tiles.supported()[t]);
                let closest = all.map(to).fold(f64::INFINITY, f64::min);
                let reach: f64 = rng.random_range(0.01..1.0);
                match tiles.squared_distance(p, reach) {
                    Some(d) => assert!((d - closest).abs() < 1e-12 && d <= reach * reach),
                    None => assert!(closest > reach * reach - 1e-12),
                }
            }
        }
    }

    #[test]
    fn boxes_find_supported_tiles_that_touch_them() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..200 {
            let tiles = any_tiles(&mut rng);
            let nx = tiles.shape()[0];
            let low: [f64; 2] = [rng.random_range(-2.0..3.0), rng.random_range(-1.0..4.0)];
            let high = low.map(|c| c + rng.random_range(0.0..1.0));
            let touches = |t: usize| {
                let (l, h) = tiles.bounds(t % nx, t / nx);
                (0..2).all(|a| l[a] < high[a] && low[a] < h[a])
            };
            let any = (0..tiles.supported().len()).any(|t| tiles.supported()[t] && touches(t));
            assert!(tiles.any_in(low, high) || !any);
        }
    }

    #[test]
    fn sums_are_those_of_all_tiles_of_a_window() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..100 {
            let [nx, ny] = std::array::from_fn(|_| rng.random_range(1..8_usize));
            let values: Vec<u32> = (0..nx * ny).map(|_| rng.random_range(0..9)).collect();
            let sums = SummedArea::new([nx, ny], |t| values[t]);
            assert_eq!(sums.total(), values.iter().sum::<u32>() as usize);
            let window = [nx, ny].map(|n| {
                let first = rng.random_range(0..n);
                [first, rng.random_range(first..=n)]
            });
            let [xs, ys] = window.map(|[first, end]| first..end);
            let wanted: u32 =
                ys.flat_map(|y| xs.clone().map(move |x| y * nx + x)).map(|t| values[t]).sum();
            assert_eq!(sums.of(window), wanted);
        }
    }

    #[test]
    fn what_is_left_over_makes_the_last_tiles_smaller() {
        let mut tiles = Tiles::new([0.0; 2], [1.0, 0.5], 0.4);
        assert_eq!(tiles.shape(), [3, 2]);
        tiles.support(vec![true; 6]);
        assert!((tiles.area() - 0.5).abs() < 1e-12);
    }
}
