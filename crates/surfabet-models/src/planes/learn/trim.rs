//! Trimming: planes become rectangles with supported tiles (section II-A, figures 2 and 3).

use surfabet_geom::Moments;

use crate::planes::patch::{Frame, Patch};
use crate::planes::points::Points;
use crate::planes::tiles::{MAX_TILES, Tiles};
use crate::vector::{dot, minus};

/// Points that a tile with points holds on average; tiles are as large as this needs where points are sparse.
const PER_TILE: f64 = 4.0;

/// Doublings of the grid size that a tile may have where points are sparse.
const DOUBLINGS: usize = 5;

/// The smallest threshold T: a tile is supported by more points than this.
const LEAST_THRESHOLD: f64 = 1.0;

/// A rectangle turned away from the principal axes has to be smaller by this factor.
const SMALLER: f64 = 0.95;

/// Steps in which a right angle is searched for the smallest rectangle, and each step again.
const TURNS: f64 = 30.0;

/// Strips whose outermost points stand for all.
const STRIPS: usize = 128;

/// Share of the mean of the tiles around it, up to this many away, that a tile needs.
const HALF: f64 = 0.75;
const AROUND: usize = 2;

/// Trims a plane to the patch that the points of `set` support, with tiles of side `grid_size` (G) or a power of two
/// more. `None` when no tile is supported.
pub(super) fn trim(points: &Points, frame: Frame, set: &[u32], grid_size: f64) -> Option<Patch> {
    if set.len() < 3 {
        return None;
    }
    let facing = facing(points, set);
    let seen = facing.map_or(0.0, |f| dot(f, frame.normal));
    let mut frame = if seen < 0.0 { frame.flipped() } else { frame };
    let mut local: Vec<[f64; 3]> =
        set.iter().map(|&i| frame.local(points.positions[i as usize])).collect();
    for direction in [principal, smallest] {
        let [cosine, sine] = direction(&local);
        frame = frame.turned([cosine, sine]);
        for p in &mut local {
            *p = [cosine * p[0] + sine * p[1], cosine * p[1] - sine * p[0], p[2]];
        }
    }
    let range = |a: usize| {
        local
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |r, p| [r[0].min(p[a]), r[1].max(p[a])])
    };
    let [[x0, x1], [y0, y1]] = [range(0), range(1)];
    let (low, size) = ([x0, y0], [x1 - x0, y1 - y0]);
    let mut edge = grid_size;
    while (size[0] / edge + 1.0) * (size[1] / edge + 1.0) > MAX_TILES {
        edge *= 2.0;
    }
    let within = |p: &[f64; 3]| p[2].abs() <= 0.5 * grid_size;
    let mut tiles = Tiles::new(low, size, edge);
    let mut counts = count(&tiles, &local, within);
    for _ in 0..DOUBLINGS {
        let held: u32 = counts.iter().sum();
        let full = counts.iter().filter(|&&c| c > 0).count();
        if f64::from(held) >= PER_TILE * full as f64 || full <= 1 {
            break;
        }
        edge *= 2.0;
        tiles = Tiles::new(low, size, edge);
        counts = count(&tiles, &local, within);
    }
    let supported = supported(&tiles, &counts);
    tiles.support(supported);
    if tiles.n_supported() == 0 {
        return None;
    }
    let mut support = Vec::new();
    let mut scatter = Scatter::new(counts.len());
    for (&i, p) in set.iter().zip(&local) {
        if let Some(t) = tiles.tile_at([p[0], p[1]]).filter(|&t| within(p) && tiles.supported()[t])
        {
            support.push(i);
            scatter.add(t, f64::from(points.weights[i as usize]), p[2]);
        }
    }
    let moments = points.moments_about(frame.center, set.iter().map(|&i| (i, 1.0)));
    let density = set.len() as f64 / tiles.area();
    Some(Patch {
        frame,
        tiles,
        density,
        standard_deviation: mean_square(&moments, &frame).sqrt(),
        support,
        whole: set.to_vec(),
        moments,
        facing: facing.unwrap_or_default(),
        noise: scatter.within(),
    })
}

/// Tiles with more points than the support threshold T = mean - 2 std of the points per tile, over the tiles with
/// points. That is below 1 unless points are evenly spread: then more than one point has to be there.
///
/// A tile at the rim of a surface holds points that noise has carried over the edge. So that patches end where
/// surfaces do, a tile also needs a good half of what the tiles around it hold, give or take chance.
fn supported(tiles: &Tiles, counts: &[u32]) -> Vec<bool> {
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
            let (x, y) = (t % nx, t / nx);
            let (mut around, mut full) = (0.0, 0.0);
            for row in y.saturating_sub(AROUND)..(y + AROUND + 1).min(ny) {
                for column in x.saturating_sub(AROUND)..(x + AROUND + 1).min(nx) {
                    let c = counts[row * nx + column];
                    if c > 0 {
                        around += f64::from(c);
                        full += 1.0;
                    }
                }
            }
            let around = around / full;
            f64::from(counts[t]) >= HALF * around - f64::sqrt(around)
        })
        .collect()
}

fn count(tiles: &Tiles, local: &[[f64; 3]], within: impl Fn(&[f64; 3]) -> bool) -> Vec<u32> {
    let mut counts = vec![0; tiles.supported().len()];
    for p in local.iter().filter(|p| within(p)) {
        if let Some(t) = tiles.tile_at([p[0], p[1]]) {
            counts[t] += 1;
        }
    }
    counts
}

/// Cosine and sine of the direction in which points of a plane spread the most.
fn principal(local: &[[f64; 3]]) -> [f64; 2] {
    let n = local.len() as f64;
    let mean: [f64; 2] = std::array::from_fn(|a| local.iter().map(|p| p[a]).sum::<f64>() / n);
    let of = |a: usize, b: usize| {
        local.iter().map(|p| (p[a] - mean[a]) * (p[b] - mean[b])).sum::<f64>() / n
    };
    let angle = 0.5 * (2.0 * of(0, 1)).atan2(of(0, 0) - of(1, 1));
    [angle.cos(), angle.sin()]
}

/// Cosine and sine by which to turn the principal axes so that the bounding rectangle is clearly smaller; no turn
/// where none is. For what is about as wide as long the principal axis is left to chance.
fn smallest(local: &[[f64; 3]]) -> [f64; 2] {
    let rim = rim(local);
    let area = |angle: f64| {
        let [c, s] = [angle.cos(), angle.sin()];
        let side = |[x, y]: [f64; 2]| {
            let along = rim.iter().map(|p| x * p[0] + y * p[1]);
            let ends =
                along.fold([f64::INFINITY, f64::NEG_INFINITY], |e, v| [e[0].min(v), e[1].max(v)]);
            ends[1] - ends[0]
        };
        side([c, s]) * side([-s, c])
    };
    let best = |angles: &mut dyn Iterator<Item = f64>| {
        angles
            .map(|a| (area(a), a))
            .fold((f64::INFINITY, 0.0), |b, c| if c.0 < b.0 { c } else { b })
    };
    let coarse = std::f64::consts::FRAC_PI_2 / TURNS;
    let (_, about) = best(&mut (0..TURNS as i32).map(|k| f64::from(k) * coarse));
    let fine = coarse / TURNS;
    let half = TURNS as i32;
    let (least, angle) = best(&mut (-half..=half).map(|k| about + f64::from(k) * fine));
    if least < SMALLER * area(0.0) { [angle.cos(), angle.sin()] } else { [1.0, 0.0] }
}

/// The points that bound others along the second axis, strip by strip of the first.
fn rim(local: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let ends = local
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |e, p| [e[0].min(p[0]), e[1].max(p[0])]);
    let per = STRIPS as f64 / (ends[1] - ends[0]).max(f64::MIN_POSITIVE);
    let mut strips: Vec<Option<[[f64; 3]; 2]>> = vec![None; STRIPS];
    for &p in local {
        let strip = &mut strips[(((p[0] - ends[0]) * per) as usize).min(STRIPS - 1)];
        let [low, high] = strip.get_or_insert([p, p]);
        if p[1] < low[1] {
            *low = p;
        }
        if p[1] > high[1] {
            *high = p;
        }
    }
    strips.into_iter().flatten().flatten().collect()
}

/// Sum of the sides that points were seen from.
pub(super) fn facing(points: &Points, set: &[u32]) -> Option<[f64; 3]> {
    let facing = points.facing.as_ref()?;
    Some(set.iter().fold([0.0; 3], |sum, &i| {
        std::array::from_fn(|a| sum[a] + f64::from(facing[i as usize][a]))
    }))
}

/// Heights of points per tile: number, weight, weighted sum and weighted sum of squares.
struct Scatter(Vec<[f64; 4]>);

impl Scatter {
    fn new(tiles: usize) -> Self {
        Self(vec![[0.0; 4]; tiles])
    }

    fn add(&mut self, tile: usize, weight: f64, height: f64) {
        let [n, w, sum, squares] = &mut self.0[tile];
        *n += 1.0;
        *w += weight;
        *sum += weight * height;
        *squares += weight * height * height;
    }

    /// Standard deviation of the heights about the means of their tiles.
    fn within(&self) -> f64 {
        let mut squares = 0.0;
        let mut freedom = 0.0;
        for &[n, w, sum, square] in self.0.iter().filter(|t| t[0] > 1.0 && t[1] > 0.0) {
            squares += (square - sum * sum / w).max(0.0);
            freedom += w * (n - 1.0) / n;
        }
        if freedom > 0.0 { (squares / freedom).sqrt() } else { 0.0 }
    }
}

/// What the moments of some points say of their distances from a plane: the mean square.
pub(in crate::planes) fn mean_square(moments: &Moments, frame: &Frame) -> f64 {
    let n = frame.normal;
    let c = moments.covariance();
    let off = dot(minus(moments.mean(), frame.center), n);
    (0..3).map(|a| n[a] * dot(c[a], n)).sum::<f64>().max(0.0) + off * off
}
