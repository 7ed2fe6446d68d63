//! Thinning: where a scan is denser than sigma, one point per half of a sigma is kept.

use surfabet_base::parallel;

use crate::alphabet::constants::THINNING_SIDE;
use crate::scans::Scene;

/// Ascending indices of the points that are kept: in every cell the one nearest to its middle. Cells are cubes whose
/// side is the power of two metres next below half of the point's sigma.
pub(in crate::alphabet) fn thinned(scene: &Scene) -> Vec<u32> {
    let keys: Vec<([i64; 4], u32)> = parallel::map_range(scene.positions.len(), |i| {
        let (p, sigma) = (scene.positions[i], scene.sigma[i]);
        let exponent = (THINNING_SIDE * sigma).log2().floor();
        let side = exponent.exp2();
        let cell = p.map(|c| (c / side).floor());
        let off: f32 = (0..3).map(|a| (p[a] / side - cell[a] - 0.5).powi(2)).sum();
        let [x, y, z] = cell.map(|c| c as i64);
        ([exponent as i64, x, y, z], off.to_bits())
    });
    let key = |i: u32| keys[i as usize];
    let mut kept: Vec<u32> = (0..keys.len() as u32).collect();
    parallel::sort_numbers_by(&mut kept, &|i, j| key(i).cmp(&key(j)).then(i.cmp(&j)));
    kept.dedup_by_key(|i| key(*i).0);
    parallel::sort_numbers(&mut kept);
    kept
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::scans::Deviation;

    #[test]
    fn points_are_thinned_to_about_half_a_sigma() {
        // A square of 0.2 m, a point every 2 mm, at a sigma of 20 mm.
        let grid = (0..10_000).map(|i| [(i % 100) as f32 * 0.002, (i / 100) as f32 * 0.002, 0.0]);
        let (cloud, _) = PointCloud::from_positions(grid.collect());
        let deviation = Deviation { sigma_scale: 1.0, noise: Some(0.02), ..Deviation::default() };
        let scene = Scene::new(&cloud, deviation, 0.0, &Silent).unwrap();
        let kept = thinned(&scene);
        assert!(kept.is_sorted_by(|a, b| a < b));
        // Cells of 1/128 m, the power of two below 10 mm: 26 times 26 of them.
        assert_eq!(kept.len(), 26 * 26);
        for p in &scene.positions {
            let squared = |i: &u32| -> f32 {
                let q = scene.positions[*i as usize];
                (0..3).map(|a| (p[a] - q[a]).powi(2)).sum()
            };
            let nearest = kept.iter().map(squared).fold(f32::INFINITY, f32::min).sqrt();
            // Half a sigma times the root of three, the diagonal of the largest cell.
            assert!(nearest <= 0.5 * 0.02 * 1.733, "{nearest}");
        }
    }
}
