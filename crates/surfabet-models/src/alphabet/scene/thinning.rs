//! Thinning: where a scan is denser than sigma, one point per half of a sigma is kept.

use rayon::prelude::*;

use crate::alphabet::constants::THINNING_SIDE;
use crate::scans::Scene;

/// Ascending indices of the points that are kept: in every cell the one nearest to its middle. Cells are cubes whose
/// side is the power of two metres next below half of the point's sigma.
pub(in crate::alphabet) fn thinned(scene: &Scene) -> Vec<u32> {
    let mut keys: Vec<([i64; 4], u32, u32)> = scene
        .positions
        .par_iter()
        .zip(&scene.sigma)
        .enumerate()
        .map(|(i, (p, sigma))| {
            let exponent = (THINNING_SIDE * sigma).log2().floor();
            let side = exponent.exp2();
            let cell = p.map(|c| (c / side).floor());
            let off: f32 = (0..3).map(|a| (p[a] / side - cell[a] - 0.5).powi(2)).sum();
            let [x, y, z] = cell.map(|c| c as i64);
            ([exponent as i64, x, y, z], off.to_bits(), i as u32)
        })
        .collect();
    keys.par_sort_unstable();
    keys.dedup_by_key(|k| k.0);
    let mut kept: Vec<u32> = keys.into_iter().map(|k| k.2).collect();
    kept.par_sort_unstable();
    kept
}
