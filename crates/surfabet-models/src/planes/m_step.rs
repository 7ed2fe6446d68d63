//! M-step: the plane of each patch by orthogonal regression, weighted with the probabilities (section II-A).

use rayon::prelude::*;
use surfabet_geom::Moments;

use super::e_step::Responsibilities;
use super::patch::{Frame, Patch};
use super::points::Points;

/// The plane through the mean along the two larger principal axes; `None` for points on a line or at one place.
pub(super) fn plane(moments: &Moments) -> Option<Frame> {
    let fitted = moments.plane(0.0)?;
    Some(Frame::with_normal(fitted.mean, fitted.normal))
}

/// A plane with the weighted moments of its points.
#[derive(Debug, Clone, PartialEq)]
pub struct Regression {
    /// The plane.
    pub frame: Frame,
    pub(super) moments: Moments,
}

/// The plane of each patch, `None` where its points span none.
pub fn m_step(
    points: &Points,
    patches: &[Patch],
    responsibilities: &Responsibilities,
) -> Vec<Option<Regression>> {
    patches
        .par_iter()
        .enumerate()
        .map(|(j, patch)| {
            let entries = responsibilities.of(j).iter().copied();
            let moments = points.moments_about(patch.frame.center, entries);
            Some(Regression { frame: plane(&moments)?, moments })
        })
        .collect()
}
