//! M-step: the plane of each patch by orthogonal regression, weighted with the probabilities (section II-A).
//!
//! With `c_j = sum_i p_ij a_i / sum_i p_ij`, the weighted mean of the points `a_i`, the plane `e_j` goes through `c_j`, and its
//! normal is the eigenvector of the smallest eigenvalue of
//!
//! ```text
//! M_j = sum_i p_ij (a_i - c_j) (a_i - c_j)^T
//! ```

use surfabet_base::parallel;
use surfabet_geom::Moments;

use super::e_step::Responsibilities;
use crate::planes::constants::CLEAR_SHARE;
use crate::planes::patch::{Frame, Patch};
use crate::planes::points::Points;

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
    parallel::map_range(patches.len(), |j| {
        let entries = responsibilities.of(j).iter().copied();
        let moments = points.moments_about(patches[j].frame.center, entries);
        Some(Regression { frame: plane(&moments)?, moments })
    })
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
    parallel::map_range(patches.len(), |j| {
        let patch = &patches[j];
        let clear = |i: u32| {
            let [x, y, _] = patch.frame.local(points.positions[i as usize]);
            let foot = patch.frame.at([x, y]).map(|c| c as f32);
            let near = |&k: &u32| patches[k as usize].distance(foot, margin).is_some();
            !neighbors[j].iter().any(near)
        };
        let all = responsibilities.of(j).iter().copied();
        let chosen: Vec<(u32, f32)> = all.clone().filter(|&(i, _)| clear(i)).collect();
        let center = patch.frame.center;
        let whole = points.moments_about(center, all);
        let moments = points.moments_about(center, chosen);
        let enough = moments.weight() >= CLEAR_SHARE * whole.weight();
        let moments = if enough { moments } else { whole };
        Some(Regression { frame: plane(&moments)?, moments })
    })
}
