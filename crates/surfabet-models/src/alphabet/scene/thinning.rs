//! Thinning: where a scan is denser than sigma, one point per half of a sigma is kept; of a large scene one per 0.8
//! sigma, which counts for those that it stands for.

use surfabet_base::parallel;
use surfabet_geom::morton;

use crate::alphabet::constants::{COARSE_THINNING_SIDE, THINNING_SIDE};
use crate::scans::Scene;

/// The points that words are fitted to.
pub(in crate::alphabet) struct Thinned {
    /// Indices of the points of the scene.
    pub kept: Vec<u32>,
    /// How many points of a scene that was thinned to half a sigma each of them stands for.
    pub weights: Vec<u16>,
    /// Whether one point per sigma was kept.
    pub is_coarse: bool,
}

impl Thinned {
    /// One point per half of a sigma; where more than `most` are left, one per 0.8 sigma: samples are a
    /// sigma apart, and each still has a point near it.
    pub fn of(scene: &Scene, most: usize) -> Self {
        // The power of two metres next below half of the point's sigma.
        let fine = |sigma: f32| (THINNING_SIDE * sigma).log2().floor();
        let all: Vec<u32> = (0..scene.positions.len() as u32).collect();
        let (kept, _) = one_per_cell(scene, &all, fine);
        if kept.len() <= most {
            return Self { weights: vec![1; kept.len()], kept, is_coarse: false };
        }
        // Quarters of octaves next below: closer to the side that is meant.
        let coarse = |sigma: f32| (4.0 * (COARSE_THINNING_SIDE * sigma).log2()).floor() / 4.0;
        let (kept, weights) = one_per_cell(scene, &kept, coarse);
        // Neighbours in space are neighbours in memory: a large scene does not fit the cache.
        let code = |k: usize| {
            let i = kept[k] as usize;
            morton::encode(scene.positions[i].map(|c| (c / scene.sigma[i]).floor() as i64 as u64))
        };
        let mut order = parallel::map_range(kept.len(), |k| (code(k), k as u32));
        parallel::sort_keyed(&mut order);
        let (kept, weights) =
            order.iter().map(|&(_, k)| (kept[k as usize], weights[k as usize])).unzip();
        Self { kept, weights, is_coarse: true }
    }
}

/// Of the points `among`, in every cell the one nearest to its middle, ascending, and how many are in its cell. Cells are
/// cubes whose side is two to the power of `exponent` of the point's sigma.
fn one_per_cell(
    scene: &Scene,
    among: &[u32],
    exponent: impl Fn(f32) -> f32 + Sync,
) -> (Vec<u32>, Vec<u16>) {
    // The cell, and how far from its middle the point is.
    let place = |i: u32| {
        let (p, exponent) = (scene.positions[i as usize], exponent(scene.sigma[i as usize]));
        let side = exponent.exp2();
        let cell = p.map(|c| (c / side).floor());
        let off: f32 = (0..3).map(|a| (p[a] / side - cell[a] - 0.5).powi(2)).sum();
        let [x, y, z] = cell.map(|c| c as i64);
        ([exponent.to_bits().into(), x, y, z], off.to_bits())
    };
    let mut keyed: Vec<(u64, u32)> = parallel::map_range(among.len(), |k| {
        let (cell, _): ([i64; 4], u32) = place(among[k]);
        (key(cell), among[k])
    });
    parallel::sort_keyed(&mut keyed);
    let groups: Vec<&[(u64, u32)]> = keyed.chunk_by(|a, b| a.0 == b.0).collect();
    let mut found: Vec<(u64, u32)> = parallel::gather(groups.len(), |k, found| {
        if let [(_, i)] = groups[k] {
            found.push((u64::from(*i), 1));
            return;
        }
        let mut same: Vec<_> = groups[k].iter().map(|&(_, i)| (place(i), i)).collect();
        // By cell, since two of them may have one key.
        same.sort_unstable();
        let cells = same.chunk_by(|a, b| a.0.0 == b.0.0);
        found.extend(cells.map(|cell| (u64::from(cell[0].1), cell.len() as u32)));
    });
    parallel::sort_keyed(&mut found);
    let most = u32::from(u16::MAX);
    found.into_iter().map(|(i, n)| (i as u32, n.min(most) as u16)).unzip()
}

/// A key of a cell that few others have: the lowest bits of its coordinates and of the exponent. With x on top, points of
/// neighbouring keys are neighbours in memory, since scenes are sorted by x.
fn key([exponent, x, y, z]: [i64; 4]) -> u64 {
    let low = |value: i64, bits: u32| value as u64 & ((1 << bits) - 1);
    low(x, 20) << 44 | low(y, 20) << 24 | low(z, 20) << 4 | low(exponent >> 19, 4)
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
        let Thinned { kept, weights, is_coarse } = Thinned::of(&scene, 10_000);
        assert!(!is_coarse && weights.iter().all(|&w| w == 1));
        assert!(kept.is_sorted_by(|a, b| a < b));
        // Cells of 1/128 m, the power of two below 10 mm: 26 times 26 of them.
        assert_eq!(kept.len(), 26 * 26);
        let far = |kept: &[u32]| farthest(&scene, kept);
        // Half a sigma times the root of three, the diagonal of the largest cell.
        assert!(far(&kept) <= 0.5 * 0.02 * 1.733);

        // Where that is one too many, coarser; each fine point counts once.
        let fine = kept;
        let Thinned { kept, weights, is_coarse } = Thinned::of(&scene, 26 * 26 - 1);
        assert!(is_coarse && kept.len() < fine.len() / 3);
        assert_eq!(weights.iter().map(|&w| usize::from(w)).sum::<usize>(), fine.len());
        assert!(far(&kept) <= 0.8 * 0.02 * 1.733);
        let distinct: std::collections::HashSet<_> = kept.iter().collect();
        assert!(distinct.len() == kept.len() && kept.iter().all(|i| fine.contains(i)));
    }

    /// The largest distance from a point of the scene to the nearest that is kept.
    fn farthest(scene: &Scene, kept: &[u32]) -> f32 {
        let nearest = |p: &[f32; 3]| {
            let squared = |i: &u32| -> f32 {
                let q = scene.positions[*i as usize];
                (0..3).map(|a| (p[a] - q[a]).powi(2)).sum()
            };
            kept.iter().map(squared).fold(f32::INFINITY, f32::min).sqrt()
        };
        scene.positions.iter().map(nearest).fold(0.0, f32::max)
    }
}
