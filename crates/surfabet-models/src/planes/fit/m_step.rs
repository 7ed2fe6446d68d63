//! M-step: the plane of each patch by orthogonal regression, weighted with the probabilities (section II-A).
//!
//! With `c_j = sum_i p_ij a_i / sum_i p_ij`, the weighted mean of the points `a_i`, the plane `e_j` goes through `c_j`, and its
//! normal is the eigenvector of the smallest eigenvalue of
//!
//! ```text
//! M_j = sum_i p_ij (a_i - c_j) (a_i - c_j)^T
//! ```

use surfabet_geom::Moments;

use super::largest_first::largest_first;
use super::responsibilities::Responsibilities;
use crate::planes::constants::CLEAR_SHARE;
use crate::planes::patch::{Frame, Patch, Reach};
use crate::planes::points::Points;
use crate::vector::{dot, minus};

/// The plane through `c_j` whose normal is the eigenvector of the smallest eigenvalue of `M_j`; `None` for points on a
/// line or at one place.
pub(in crate::planes) fn plane(moments: &Moments) -> Option<Frame> {
    let fitted = moments.plane(0.0)?;
    Some(Frame::with_normal(fitted.mean, fitted.normal))
}

/// A plane with the weighted moments of its points.
#[derive(Debug, Clone, PartialEq)]
pub struct Regression {
    /// The plane.
    pub frame: Frame,
    /// Weight, `c_j` and `M_j`.
    pub(super) moments: Moments,
}

/// The plane of each patch, `None` where its points span none.
pub fn m_step(
    points: &Points,
    patches: &[Patch],
    responsibilities: &Responsibilities,
) -> Vec<Option<Regression>> {
    let size = |&j: &usize| responsibilities.of(j).len();
    largest_first(0..patches.len(), size, |j| {
        let entries = responsibilities.of(j).iter().copied();
        regression(points.moments_about(patches[j].frame.center, entries))
    })
}

/// The plane of points with these moments; `None` where they span none.
fn regression(moments: Moments) -> Option<Regression> {
    Some(Regression { frame: plane(&moments)?, moments })
}

/// As [`m_step`], without points whose foot on the plane is within `margin` of another of the patches, as long as
/// enough are left.
///
/// Where two surfaces meet, the patch of a point is decided by its distances. The regression then sees noise that is
/// cut off on one side, and the planes lean into the corner. Points chosen by their place along the plane have all of
/// their noise.
pub(super) fn clear_m_step(
    points: &Points,
    patches: &[Patch],
    pairs: &[[u32; 2]],
    responsibilities: &Responsibilities,
    margin: f64,
) -> Vec<Option<Regression>> {
    let mut neighbors: Vec<Vec<u32>> = vec![Vec::new(); patches.len()];
    for &[a, b] in pairs {
        neighbors[a as usize].push(b);
        neighbors[b as usize].push(a);
    }
    let size = |&j: &usize| responsibilities.of(j).len();
    largest_first(0..patches.len(), size, |j| {
        let patch = &patches[j];
        let beside: Vec<(&Patch, Reach, [[f64; 2]; 2])> = neighbors[j]
            .iter()
            .map(|&k| {
                let other = &patches[k as usize];
                let reach = other.reach(margin);
                (other, reach, seen_in(&patch.frame, other, &reach))
            })
            .collect();
        let clear = |i: u32| {
            let [x, y, _] = patch.frame.local(points.positions[i as usize]);
            let foot = patch.frame.at([x, y]).map(|c| c as f32);
            let within = |[x0, x1]: [f64; 2], x: f64| x0 <= x && x <= x1;
            let near = |(other, reach, [xs, ys]): &(&Patch, Reach, [[f64; 2]; 2])| {
                within(*xs, x) && within(*ys, y) && other.distance_within(foot, reach).is_some()
            };
            !beside.iter().any(near)
        };
        let all = || responsibilities.of(j).iter().copied();
        let center = patch.frame.center;
        let moments = points.moments_about(center, all().filter(|&(i, _)| clear(i)));
        if moments.weight() >= CLEAR_SHARE * points.weight_of(all()) {
            regression(moments)
        } else {
            regression(points.moments_about(center, all()))
        }
    })
}

/// The box along the axes of `frame` around all points of its plane within `reach` of a patch.
fn seen_in(frame: &Frame, patch: &Patch, reach: &Reach) -> [[f64; 2]; 2] {
    let [low, size] = [patch.tiles.low(), patch.tiles.size()];
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
        .map(|at: [f64; 2]| patch.frame.at(std::array::from_fn(|a| low[a] + at[a] * size[a])));
    let reach = reach.height.max(reach.beside);
    let far = corners.iter().flatten().fold(reach, |far, c| far.max(c.abs()));
    // They are rounded to single precision.
    let reach = reach + 4.0 * f64::from(f32::EPSILON) * far;
    let [u, v] =
        [frame.u, frame.v].map(|axis| corners.map(|corner| dot(minus(corner, frame.center), axis)));
    [u, v].map(|along| {
        let low = along.into_iter().fold(f64::INFINITY, f64::min);
        let high = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
        [low - reach, high + reach]
    })
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::planes::tiles::Tiles;
    use crate::vector::unit;

    #[test]
    fn what_is_near_a_patch_is_in_its_box() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut vector =
            |size: f64| -> [f64; 3] { std::array::from_fn(|_| rng.random_range(-size..size)) };
        let mut near = 0;
        for round in 0..300 {
            let [frame, other] = [0, 1].map(|_| Frame::with_normal(vector(0.3), unit(vector(1.0))));
            let edge = if round % 2 == 0 { 0.1 } else { 0.4 };
            let mut tiles = Tiles::new([-0.4, -0.2], [1.0, 0.7], edge);
            tiles.support(vec![true; tiles.supported().len()]);
            let patch = Patch::bare(other, tiles);
            let reach = patch.reach(0.2);
            let [xs, ys] = seen_in(&frame, &patch, &reach);
            for _ in 0..50 {
                let [x, y, _] = vector(1.5);
                let foot = frame.at([x, y]).map(|c| c as f32);
                if patch.distance(foot, 0.2).is_some() {
                    near += 1;
                    assert!((xs[0]..=xs[1]).contains(&x) && (ys[0]..=ys[1]).contains(&y));
                }
            }
        }
        assert!(near > 500);
    }
}
