//! Inliers and outliers of a model (IV).

use surfabet_geom::{KdTree, Progress};

use crate::bic_alphabet::choice::reconstruction::Stage;
use crate::bic_alphabet::rebuild::sparsify::Sparse;
use crate::error::Result;

/// How faithful a decoded scene is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fidelity {
    /// Share of the scene's points with a decoded point within their sigma.
    pub inliers: f64,
    /// Share of the decoded points that are further from the nearest point of the scene than that point's sigma.
    pub outliers: f64,
}

/// Measures the kept points against the scene; without any, there are neither inliers nor outliers.
pub(crate) fn fidelity(
    stage: &Stage<'_>,
    sparse: &Sparse,
    progress: &dyn Progress,
) -> Result<Fidelity> {
    let scene = stage.scene;
    let kept = sparse.arena.points.iter().zip(&sparse.kept).filter(|(_, k)| **k);
    let decoded: Vec<[f32; 3]> = kept.map(|(p, _)| p.position).collect();
    if decoded.is_empty() {
        return Ok(Fidelity { inliers: 0.0, outliers: 0.0 });
    }
    let within = |i: usize, squared: f32| f64::from(squared).sqrt() <= f64::from(scene.sigma[i]);
    let backward = KdTree::new(&decoded)?.nearest_batch(&scene.positions, progress)?;
    let pairs = backward.iter().enumerate();
    let inliers = pairs.filter(|(i, n)| within(*i, n.squared_distance())).count();
    let forward = stage.tree.nearest_batch(&decoded, progress)?;
    let outliers = forward.iter().filter(|n| !within(n.index(), n.squared_distance())).count();
    Ok(Fidelity {
        inliers: inliers as f64 / scene.len() as f64,
        outliers: outliers as f64 / decoded.len() as f64,
    })
}
