//! Features: interest points, then points spread uniformly, each with the pose that its normal and the upright rule
//! give it (III-C).
//!
//! | file | computes |
//! |---|---|
//! | `mod` | features that cover the scene, and their poses |
//! | `interest` | interest points on the range image |
//! | `laplacian` | the Laplacian of Gaussian that they are the maxima of |
//! | `descriptor` | the surface about a feature, to compare it with others |

mod descriptor;
mod interest;
mod laplacian;

pub(super) use descriptor::{
    Descriptors, EMPTY, descriptor_distance, penalty_steps, pixel_centers,
};

use surfabet_base::parallel;
use surfabet_geom::{KdTree, Progress, fit_normal, orient_normal};

use crate::bic_alphabet::constants::{INTEREST_SPACING, POINTS_PER_CHECK};
use crate::bic_alphabet::options::BicAlphabetOptions;
use crate::bic_alphabet::pose::{BicPose, Frame, low_cell, mix};
use crate::error::Result;
use crate::scans::Scene;
use interest::interest_points;

/// Places of a scene that occurrences may take, in the order of their poses and without duplicates.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::bic_alphabet) struct Features {
    pub poses: Vec<BicPose>,
    pub frames: Vec<Frame>,
    /// Lowest cell of the poses, which their order counts from.
    pub low: [i32; 3],
    /// How many are interest points.
    pub interest: usize,
}

impl Features {
    /// Covers the scene: no point is farther than the feature spacing from the point that a feature was taken at.
    pub fn new(
        scene: &Scene,
        tree: &KdTree,
        options: &BicAlphabetOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (chosen, interest) = spread(scene, tree, options, progress)?;
        progress.check()?;
        let mut poses: Vec<BicPose> =
            parallel::try_map(&chosen, |&i| pose(scene, tree, i as usize, options))?;
        let low = low_cell(&poses);
        poses.sort_by_cached_key(|p| p.order(low));
        poses.dedup();
        let frame = |pose: &BicPose| pose.frame(options.upright, options.radius());
        let frames = parallel::map(&poses, frame);
        Ok(Self { poses, frames, low, interest })
    }

    pub fn len(&self) -> usize {
        self.poses.len()
    }
}

/// Points that features are taken at, and how many of them are interest points.
///
/// Interest points at least [`INTEREST_SPACING`] feature spacings from each other, the strongest first; then, in random
/// order, points farther than the spacing from every feature so far. So every point of the scene has a feature within
/// the spacing.
fn spread(
    scene: &Scene,
    tree: &KdTree,
    options: &BicAlphabetOptions,
    progress: &dyn Progress,
) -> Result<(Vec<u32>, usize)> {
    let interest = interest_points(scene, options, progress)?;
    let spacing = options.feature_spacing() as f32;
    let mut chosen = Vec::new();
    let mut nearest = vec![f32::INFINITY; scene.len()];
    let mut near = Vec::new();
    // Takes point i when no point taken before lies within `least`.
    let mut take = |i: u32, least: f32, chosen: &mut Vec<u32>| {
        if nearest[i as usize] > least * least {
            chosen.push(i);
            tree.within(scene.positions[i as usize], spacing, &mut near);
            for n in &near {
                let of = &mut nearest[n.index()];
                *of = of.min(n.squared_distance());
            }
        }
    };
    for i in interest {
        take(i, INTEREST_SPACING * spacing, &mut chosen);
    }
    let n_interest = chosen.len();
    let mut order: Vec<u32> = (0..scene.len() as u32).collect();
    order.sort_by_cached_key(|&i| (mix(options.random_state ^ mix(u64::from(i))), i));
    for (k, i) in order.into_iter().enumerate() {
        if k % (POINTS_PER_CHECK) == 0 {
            progress.check()?;
        }
        take(i, spacing, &mut chosen);
    }
    Ok((chosen, n_interest))
}

/// The pose at point `i`: the normal of the points within the radius, at least `normal_neighbors`, on the side of the
/// sensor, and the upright rule.
fn pose(scene: &Scene, tree: &KdTree, i: usize, options: &BicAlphabetOptions) -> Result<BicPose> {
    let position = scene.positions[i];
    let viewpoint = scene.viewpoints.get(i).copied();
    let mut near = Vec::new();
    tree.within(position, options.radius() as f32, &mut near);
    if near.len() < options.normal_neighbors as usize {
        tree.k_nearest(position, options.normal_neighbors as usize, &mut near);
    }
    let towards: [f64; 3] = std::array::from_fn(|a| {
        viewpoint.map_or(0.0, |v| f64::from(v[a]) - f64::from(position[a]))
    });
    let fitted = fit_normal(position, near.iter().map(|n| scene.positions[n.index()]));
    let normal = match fitted {
        Some((normal, _)) => orient_normal(normal, position, viewpoint),
        // Points that span no plane are taken to face the sensor; without one the zero vector is coded as world z.
        None => towards.map(|c| c as f32),
    };
    let view = towards.map(|c| -c);
    BicPose::quantize(position, normal, view, options.upright, options.radius())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_geom::{PointCloud, Silent};

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn every_point_has_a_feature_within_the_spacing(
            positions in prop::collection::vec(prop::array::uniform3(-1.0_f32..1.0), 1..300),
            spacing in 0.05_f64..0.8,
        ) {
            let (cloud, _) = PointCloud::from_positions(positions);
            let options = BicAlphabetOptions { radius: Some(0.1), feature_spacing: Some(spacing), ..BicAlphabetOptions::default() };
            let scene = Scene::new(&cloud, options.deviation(), 0.0, &Silent).unwrap();
            let tree = KdTree::new(&scene.positions).unwrap();
            let features = Features::new(&scene, &tree, &options, &Silent).unwrap();
            // Positions are stored in steps of a 32nd of the radius: half of one off in each axis.
            let rounding = 0.5 * 0.1 / 32.0 * 3.0_f64.sqrt() + 1e-6;
            for p in &scene.positions {
                let nearest = features
                    .frames
                    .iter()
                    .map(|f| (0..3).map(|a| f64::from(f.origin[a] - p[a]).powi(2)).sum::<f64>())
                    .fold(f64::INFINITY, f64::min)
                    .sqrt();
                prop_assert!(nearest <= spacing + rounding, "{nearest}");
            }
            prop_assert!(features.poses.windows(2).all(|w| w[0].order(features.low) < w[1].order(features.low)));
        }
    }
}
