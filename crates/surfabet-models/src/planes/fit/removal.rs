//! What the likelihood loses without a patch, and the patches that the others explain as well.
//!
//! Where two surfaces are less than some standard deviations apart, EM may lay a third patch between both, which lives on the
//! tails of their noise. Each has its share of the points, and no two of them merge. The likelihood decides: without the one
//! in between, the other two grow denser and explain its points about as well.

use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::largest_first::largest_first;
use super::responsibilities::Responsibilities;
use crate::error::Result;
use crate::planes::constants::{OUTLIER_COST, REMOVED_GAIN, REMOVED_PARAMETERS};

/// What comes of removing a patch.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Removal {
    /// By how much the logarithm of the likelihood falls.
    pub loss: f64,
    /// Expected number of its points, `m_j = sum_i p_ij`.
    pub mass: f64,
    /// The patches that get its points, and how many each.
    pub neighbors: Vec<(u32, f64)>,
}

impl Removal {
    /// The loss beyond what the parameters of a patch and a misfit of the noise gain by themselves.
    fn excess(&self) -> f64 {
        let parameters = 0.5 * REMOVED_PARAMETERS * self.mass.max(1.0).ln();
        self.loss - parameters - REMOVED_GAIN * self.mass
    }
}

/// What comes of removing each of `n` patches, the others kept.
///
/// Removing patch `j` moves to patch `k`
///
/// ```text
/// moved_k = sum_i p_ij p_ik / (1 - p_ij + o p_ij),   r_k = 1 + moved_k / m_k
/// ```
///
/// with `o` the likelihood of a point far from all patches, relative to that on its patch. The logarithm of the likelihood
/// of points that are a Poisson process falls by
///
/// ```text
/// -sum_i ln(sum_(k != j) p_ik r_k + o p_ij) - sum_k (m_k - sum_i p_ik) ln r_k - (m_j - sum_k moved_k)
/// ```
///
/// with sums over the points `i` of patch `j`.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(super) fn removals(
    last: &Responsibilities,
    n: usize,
    progress: &dyn Progress,
) -> Result<Vec<Removal>> {
    let mass: Vec<f64> =
        parallel::map_range(n, |j| last.of(j).iter().map(|e| f64::from(e.1)).sum());
    let size = |&j: &usize| last.of(j).len();
    largest_first(0..n, size, |j| -> Result<Removal> {
        progress.check()?;
        Ok(removal(last, &mass, j as u32))
    })
    .into_iter()
    .collect()
}

/// The patches that the others explain as well, ascending; of neighbours only the one that costs least.
pub(super) fn superfluous(removals: &[Removal]) -> Vec<u32> {
    let excess: Vec<f64> = removals.iter().map(Removal::excess).collect();
    let mut cheap: Vec<u32> = (0..removals.len() as u32).collect();
    cheap.retain(|&j| excess[j as usize] < 0.0);
    cheap.sort_by(|&a, &b| excess[a as usize].total_cmp(&excess[b as usize]).then(a.cmp(&b)));
    let mut touched = vec![false; removals.len()];
    cheap.retain(|&j| {
        let first = !touched[j as usize];
        if first {
            touched[j as usize] = true;
            removals[j as usize].neighbors.iter().for_each(|n| touched[n.0 as usize] = true);
        }
        first
    });
    cheap.sort_unstable();
    cheap
}

/// What comes of removing patch `j`.
fn removal(last: &Responsibilities, mass: &[f64], j: u32) -> Removal {
    let outlier = (-OUTLIER_COST).exp();
    let own = last.of(j as usize);
    // Most points are on no other patch.
    let is_shared = |i: u32| last.of_point(i as usize).len() > 1;
    let others = |i: u32| last.of_point(i as usize).iter().filter(|e| e.0 != j);
    // For each other patch moved_k, and the sum of its p_ik over the points of this one.
    let mut shared: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
    for &(i, p) in own {
        let p = f64::from(p);
        for &(k, q) in others(i) {
            let q = f64::from(q);
            let [moved, sum] = shared.entry(k).or_default();
            *moved += p * q / (1.0 - p + outlier * p);
            *sum += q;
        }
    }
    let grown: BTreeMap<u32, f64> =
        shared.iter().map(|(&k, s)| (k, 1.0 + s[0] / mass[k as usize])).collect();
    let mut gain = mass[j as usize] - shared.values().map(|s| s[0]).sum::<f64>();
    for (k, [_, sum]) in &shared {
        gain += (mass[*k as usize] - sum).max(0.0) * grown[k].ln();
    }
    let alone = outlier.ln();
    for &(i, p) in own {
        if is_shared(i) {
            let explained: f64 = others(i).map(|(k, q)| f64::from(*q) * grown[k]).sum();
            gain += (explained + outlier * f64::from(p)).max(f64::MIN_POSITIVE).ln();
        } else {
            gain += alone;
        }
    }
    let neighbors = shared.into_iter().map(|(k, [moved, _])| (k, moved)).collect();
    Removal { loss: -gain, mass: mass[j as usize], neighbors }
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::planes::fit::e_step::e_step;
    use crate::planes::fit::m_step::plane;
    use crate::planes::fit::trim::trim;
    use crate::planes::patch::Patch;
    use crate::planes::points::Points;

    /// Two squares of 400 points 2 m apart, and the patches of both.
    fn squares() -> (Points, Vec<Patch>) {
        let at = |i: u16| {
            [f32::from(i % 20) * 0.05, f32::from(i / 20 % 20) * 0.05, f32::from(i / 400) * 2.0]
        };
        let positions: Vec<[f32; 3]> = (0..800).map(at).collect();
        let cloud = PointCloud::from_positions(positions).0;
        let points = Points::new(&cloud, None).unwrap();
        let patch = |high: bool| {
            let mine =
                |&i: &u32| (points.positions[i as usize][2] > points.positions[0][2] + 1.0) == high;
            let set: Vec<u32> = (0..800).filter(mine).collect();
            let moments = points.moments_about([0.0; 3], set.iter().map(|&i| (i, 1.0)));
            trim(&points, plane(&moments).unwrap(), &set, 0.1).unwrap()
        };
        let patches = vec![patch(false), patch(true)];
        (points, patches)
    }

    #[test]
    fn the_last_patch_of_some_points_costs_what_outliers_cost() {
        let (points, patches) = squares();
        let last = e_step(&points, &patches, 0.1, 0.03, None, &Silent).unwrap();
        let found = removals(&last, 2, &Silent).unwrap();
        for removal in &found {
            assert!((removal.mass - 400.0).abs() < 1e-6);
            // Without it 400 points fewer are expected.
            assert!((removal.loss - 400.0 * (OUTLIER_COST - 1.0)).abs() < 1e-6, "{removal:?}");
        }
        assert!(superfluous(&found).is_empty());
    }

    #[test]
    fn of_two_equal_patches_one_goes() {
        let (points, mut patches) = squares();
        patches.push(patches[0].clone());
        let last = e_step(&points, &patches, 0.1, 0.03, None, &Silent).unwrap();
        let found = removals(&last, 3, &Silent).unwrap();
        // The other one becomes twice as dense; what is left is the share of outliers, about twice exp(-4) per point.
        assert!(found[0].loss.abs() < 400.0 * 2.0 * (-OUTLIER_COST).exp(), "{:?}", found[0]);
        assert_eq!(superfluous(&found), [0]);
    }
}
