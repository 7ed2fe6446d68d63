//! Inliers and outliers of a model (IV).

use surfabet_geom::{KdTree, Progress};

use super::prepared::PreparedScene;
use crate::bic_alphabet::rebuild::Sparsified;
use crate::error::Result;

/// Agreement of a decoded scene with the measured one (IV).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::bic_alphabet) struct Fidelity {
    /// Share of the scene's points with a decoded point within their sigma.
    pub inliers: f64,
    /// Share of the decoded points that are further from the nearest point of the scene than that point's sigma.
    pub outliers: f64,
}

/// Measures the kept points against the scene; without any, there are neither inliers nor outliers.
pub(in crate::bic_alphabet) fn fidelity(
    prepared: &PreparedScene<'_>,
    sparsified: &Sparsified,
    progress: &dyn Progress,
) -> Result<Fidelity> {
    let scene = &prepared.scene;
    let decoded: Vec<[f32; 3]> = sparsified.kept().collect();
    if decoded.is_empty() {
        return Ok(Fidelity { inliers: 0.0, outliers: 0.0 });
    }
    let within = |i: usize, squared: f32| f64::from(squared).sqrt() <= f64::from(scene.sigma[i]);
    let backward = KdTree::new(&decoded)?.nearest_batch(&scene.positions, progress)?;
    let pairs = backward.iter().enumerate();
    let inliers = pairs.filter(|(i, n)| within(*i, n.squared_distance())).count();
    let forward = prepared.tree.nearest_batch(&decoded, progress)?;
    let outliers = forward.iter().filter(|n| !within(n.index(), n.squared_distance())).count();
    Ok(Fidelity {
        inliers: inliers as f64 / scene.len() as f64,
        outliers: outliers as f64 / decoded.len() as f64,
    })
}
