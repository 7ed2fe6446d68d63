//! Merging of patches that are close, parallel and in one plane (section II-D, figure 6).

mod agglomerate;
mod close_pairs;
mod rule;

use surfabet_geom::{Moments, Progress};

pub(super) use self::agglomerate::agglomerate;
pub(super) use self::close_pairs::{close_pairs, expanded};
pub(super) use self::rule::{PlanarSet, Rule};
use super::largest_first::largest_first;
use super::m_step::plane;
use super::trim::trim;
use crate::error::Result;
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Merges patches until all pairs are dissimilar.
pub(super) fn merge(
    points: &Points,
    patches: Vec<Patch>,
    rule: &Rule,
    progress: &dyn Progress,
) -> Result<Vec<Patch>> {
    let grid_size = rule.distance;
    // Between scan lines there is nothing.
    let pairs = close_pairs(&patches, grid_size, points.line_spacing.is_some());
    let parts = patches.iter().map(PlanarSet::of).collect();
    let into = agglomerate(parts, &pairs, rule, progress)?;
    let mut groups: Vec<Vec<Patch>> = patches.iter().map(|_| Vec::new()).collect();
    for (patch, &to) in patches.into_iter().zip(&into) {
        groups[to as usize].push(patch);
    }
    let size = |group: &Vec<Patch>| group.iter().map(Patch::n_supporting).sum();
    let merged = largest_first(groups, size, |mut group| {
        if group.len() < 2 {
            return group.pop();
        }
        let mut support: Vec<u32> = group.iter().flat_map(|p| &p.whole).copied().collect();
        // Faster than the unstable one, as the points of each patch are sorted.
        support.sort();
        let mut moments = Moments::new();
        group.iter().for_each(|p| moments.merge(&p.moments));
        trim(points, plane(&moments)?, &support, grid_size)
    });
    Ok(merged.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::planes::fit::incidence::Incidence;

    const RULE: Rule =
        Rule { distance: 0.06, deviation: 0.02, incidence: Incidence::EVEN, tolerance: 1.25 };

    /// Number of patches that remain of two of 1 m x 1 m; `second` moves a point of the unit square to the second.
    fn merged(rule: &Rule, second: impl Fn(f64, f64, f64) -> [f64; 3]) -> usize {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut positions: Vec<[f32; 3]> = Vec::new();
        for i in 0..8000 {
            let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.random_range(0.0..1.0));
            let z = rng.random_range(-0.035..0.035);
            let p = if i % 2 == 0 { [x, y, z] } else { second(x, y, z) };
            positions.push(p.map(|c| c as f32));
        }
        let cloud = PointCloud::from_positions(positions.clone()).0;
        let points = Points::new(&cloud, None).unwrap();
        let patches = (0..2)
            .map(|half| {
                let mut set: Vec<u32> =
                    (0..8000).filter(|i| i % 2 == half).map(|i| points.place[i]).collect();
                set.sort_unstable();
                let center = points.positions[set[0] as usize].map(f64::from);
                let moments = points.moments_about(center, set.iter().map(|&i| (i, 1.0)));
                trim(&points, plane(&moments).unwrap(), &set, rule.distance).unwrap()
            })
            .collect();
        merge(&points, patches, rule, &Silent).unwrap().len()
    }

    #[test]
    fn neighbours_in_one_plane_become_one() {
        assert_eq!(merged(&RULE, |x, y, z| [x + 1.02, y, z]), 1);
    }

    #[test]
    fn one_surface_in_two_layers_becomes_one() {
        assert_eq!(merged(&RULE, |x, y, z| [x, y, z + 0.01]), 1);
    }

    #[test]
    fn what_is_apart_stays_apart_even_in_one_plane() {
        assert_eq!(merged(&RULE, |x, y, z| [x + 1.5, y, z]), 2);
    }

    #[test]
    fn corners_and_layers_stay() {
        assert_eq!(merged(&RULE, |x, y, z| [1.0 + z, y, x]), 2);
        assert_eq!(merged(&RULE, |x, y, z| [x, y, z + 0.05]), 2);
    }

    #[test]
    fn the_papers_conditions_alone_merge_layers_closer_than_the_grid_size() {
        let paper = Rule { tolerance: f64::INFINITY, ..RULE };
        assert_eq!(merged(&paper, |x, y, z| [x, y, z + 0.05]), 1);
        assert_eq!(merged(&paper, |x, y, z| [x, y, z + 0.1]), 2);
    }
}
