//! Patches that are close enough to merge (section II-D, step 1).

use surfabet_base::parallel;

use crate::planes::patch::Patch;
use crate::vector::{dot, minus};

/// Pairs of patches of which supported tiles come within G of each other, both expanded by G; `widely` also where tiles that are
/// larger than G leave more between them.
pub(in crate::planes::fit) fn close_pairs(
    patches: &[Patch],
    grid_size: f64,
    widely: bool,
) -> Vec<[u32; 2]> {
    let boxes: Vec<([f64; 3], [f64; 3])> = patches.iter().map(|p| expanded(p, grid_size)).collect();
    // Along the axis on which the boxes overlap least, sorted by their lower ends.
    let axis = widest_axis(&boxes);
    let mut order: Vec<u32> = (0..patches.len() as u32).collect();
    order.sort_by(|&a, &b| {
        boxes[a as usize].0[axis].total_cmp(&boxes[b as usize].0[axis]).then(a.cmp(&b))
    });
    let overlap = |a: u32, b: u32| {
        let ((al, ah), (bl, bh)) = (boxes[a as usize], boxes[b as usize]);
        (0..3).all(|k| al[k] <= bh[k] && bl[k] <= ah[k])
    };
    let mut pairs: Vec<[u32; 2]> = parallel::gather(order.len(), |at, pairs| {
        let a = order[at];
        let end = boxes[a as usize].1[axis];
        let close = order[at + 1..]
            .iter()
            .take_while(|&&b| boxes[b as usize].0[axis] <= end)
            .filter(|&&b| overlap(a, b))
            .filter(|&&b| close(&patches[a as usize], &patches[b as usize], grid_size, widely))
            .map(|&b| [a.min(b), a.max(b)]);
        pairs.extend(close);
    });
    pairs.sort_unstable();
    pairs
}

/// The axis along which the boxes spread the most, in mean extents of a box.
fn widest_axis(boxes: &[([f64; 3], [f64; 3])]) -> usize {
    let spread = |a: usize| {
        let low = boxes.iter().fold(f64::INFINITY, |m, b| m.min(b.0[a]));
        let high = boxes.iter().fold(f64::NEG_INFINITY, |m, b| m.max(b.1[a]));
        let mean = boxes.iter().map(|b| b.1[a] - b.0[a]).sum::<f64>() / boxes.len().max(1) as f64;
        (high - low) / mean.max(f64::MIN_POSITIVE)
    };
    (1..3).fold(0, |m, a| if spread(a) > spread(m) { a } else { m })
}

/// The axis-aligned box of a patch, expanded by G, or by a tile where that is more.
pub(in crate::planes::fit) fn expanded(patch: &Patch, grid_size: f64) -> ([f64; 3], [f64; 3]) {
    let [low, size] = [patch.tiles.low(), patch.tiles.size()];
    let margin = grid_size.max(patch.tiles.edge());
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
        .map(|at: [f64; 2]| patch.frame.at(std::array::from_fn(|a| low[a] + at[a] * size[a])));
    let of = |pick: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
        std::array::from_fn(|a| corners.iter().fold(start, |m, c| pick(m, c[a])))
    };
    (
        of(f64::min, f64::INFINITY).map(|c| c - margin),
        of(f64::max, f64::NEG_INFINITY).map(|c| c + margin),
    )
}

/// True when points of one come within G of points of the other, both expanded by G, or within a tile where points are so sparse
/// that tiles are larger. Points end somewhere in their outermost tiles, on average half a tile from the end of one of both:
/// so much nearer the tiles have to be. `widely` up to two tiles may lie between.
fn close(a: &Patch, b: &Patch, grid_size: f64, widely: bool) -> bool {
    let (few, many) = if a.tiles.n_supported() <= b.tiles.n_supported() { (a, b) } else { (b, a) };
    let nx = few.tiles.shape()[0];
    let edge = 0.5 * (few.tiles.edge() + many.tiles.edge());
    let (reach, inside) = if widely { (2.0 * edge, 0.0) } else { (edge, 0.5 * edge) };
    let reach = reach.max(2.0 * grid_size);
    let beside = reach - inside;
    few.tiles.supported().iter().enumerate().filter(|(_, s)| **s).any(|(t, _)| {
        let (low, high) = few.tiles.bounds(t % nx, t / nx);
        let middle = few.frame.at(std::array::from_fn(|k| 0.5 * (low[k] + high[k])));
        let half: [f64; 2] = std::array::from_fn(|k| 0.5 * (high[k] - low[k]));
        let d = minus(middle, many.frame.center);
        let extent = |axis: [f64; 3]| {
            half[0] * dot(few.frame.u, axis).abs() + half[1] * dot(few.frame.v, axis).abs()
        };
        if dot(d, many.frame.normal).abs() > reach + extent(many.frame.normal) {
            return false;
        }
        let at = [dot(d, many.frame.u), dot(d, many.frame.v)];
        let margin = [many.frame.u, many.frame.v].map(|axis| extent(axis) + beside);
        many.tiles.any_in(
            std::array::from_fn(|k| at[k] - margin[k]),
            std::array::from_fn(|k| at[k] + margin[k]),
        )
    })
}
