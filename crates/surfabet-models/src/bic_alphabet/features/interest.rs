//! Interest points: the local maxima, over place and scale, of the Laplacian of Gaussian on the range image (III-C).

use surfabet_base::parallel;
use surfabet_geom::{PointCloud, Pose, Progress, Projection, RangeImage};

use super::laplacian::response;
use crate::bic_alphabet::constants::{LEAST_PIXEL, PIXEL_PER_ALPHA};
use crate::bic_alphabet::options::BicAlphabetOptions;
use crate::error::Result;
use crate::scans::Scene;

/// Points of the scene where the response is a local maximum over place and scale, the strongest first; one range image
/// per viewpoint.
pub(in crate::bic_alphabet) fn interest_points(
    scene: &Scene,
    options: &BicAlphabetOptions,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let Some(alpha) = scene.deviation.angular_resolution else { return Ok(Vec::new()) };
    if scene.viewpoints.is_empty() || options.interest_scales.is_empty() {
        return Ok(Vec::new());
    }
    let from = |i: u32| scene.viewpoints[i as usize].map(f32::to_bits);
    let mut order: Vec<u32> = (0..scene.len() as u32).collect();
    order.sort_unstable_by_key(|&i| (from(i), i));
    let mut found: Vec<(f32, u32)> = Vec::new();
    for seen in order.chunk_by(|&i, &j| from(i) == from(j)) {
        progress.check()?;
        let viewpoint = scene.viewpoints[seen[0] as usize].map(f64::from);
        let positions = seen.iter().map(|&i| scene.positions[i as usize]).collect();
        let image = range_image(
            positions,
            viewpoint,
            (PIXEL_PER_ALPHA * alpha).max(LEAST_PIXEL),
            progress,
        )?;
        let blobs = blobs(&image, &options.interest_scales, options.interest_threshold as f32);
        found.extend(blobs.into_iter().map(|(response, i)| (response, seen[i as usize])));
    }
    found.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    Ok(found.into_iter().map(|(_, i)| i).collect())
}

/// The spherical range image of points seen from `viewpoint`, as high as their elevations, with pixels of `pixel` radians.
fn range_image(
    positions: Vec<[f32; 3]>,
    viewpoint: [f64; 3],
    pixel: f64,
    progress: &dyn Progress,
) -> Result<RangeImage> {
    let elevation = |p: &[f32; 3]| {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|a| f64::from(p[a]) - viewpoint[a]);
        z.atan2(x.hypot(y))
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    let low = positions.iter().map(elevation).fold(quarter, f64::min);
    let high = positions.iter().map(elevation).fold(-quarter, f64::max);
    let elevations = [(low - pixel).max(-quarter), (high + pixel).min(quarter)];
    let projection =
        Projection::Spherical { azimuth_step: pixel, elevation_step: pixel, elevations };
    let pose = Pose::new([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], viewpoint)?;
    let (cloud, _) = PointCloud::from_positions(positions);
    Ok(RangeImage::new(&cloud, projection, pose, progress)?)
}

/// Response and point of every pixel where the response is at least `threshold` and no smaller than at its neighbours in
/// the image (eight) and in scale (nine above, nine below).
fn blobs(image: &RangeImage, scales: &[f64], threshold: f32) -> Vec<(f32, u32)> {
    let [rows, columns] = image.shape();
    let responses: Vec<Vec<f32>> =
        parallel::map(scales, |&scale| response(image.ranges(), [rows, columns], scale));
    // Absolute response: bumps and dents alike.
    let strength = |level: usize, row: usize, column: usize| -> f32 {
        responses[level][row * columns + column].abs()
    };
    let is_highest = |level: usize, row: usize, column: usize| {
        let own = strength(level, row, column);
        let levels = level.saturating_sub(1)..=(level + 1).min(scales.len() - 1);
        levels.flat_map(|l| (0..9).map(move |k| (l, k))).all(|(l, k)| {
            let (r, c) = (row + k / 3, (column + k % 3 + columns - 1) % columns);
            r == 0 || r > rows || (l, r - 1, c) == (level, row, column) || {
                let other = strength(l, r - 1, c);
                // Of equals, the first in the order of levels and pixels.
                own > other || (own == other && (level, row, column) < (l, r - 1, c))
            }
        })
    };
    let mut found: Vec<(f32, u32)> = parallel::gather(scales.len() * rows, |k, found| {
        let (level, row) = (k / rows, k % rows);
        found.extend((0..columns).filter_map(|column| {
            let point = image.index()[row * columns + column];
            let own = strength(level, row, column);
            let found =
                point != RangeImage::NO_POINT && own >= threshold && is_highest(level, row, column);
            found.then_some((own, point))
        }));
    });
    // A pixel may be highest at two scales that do not touch.
    found.sort_unstable_by(|a, b| a.1.cmp(&b.1).then(b.0.total_cmp(&a.0)));
    found.dedup_by_key(|f| f.1);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scans::Deviation;
    use surfabet_geom::{CloudParts, Silent, Viewpoints};

    const ALPHA: f64 = 0.01;

    /// A sphere of 3 m around the sensor, seen every [`ALPHA`], with a bump towards the sensor.
    fn scene(bump: impl Fn(f64, f64) -> f64) -> Scene {
        let mut positions = Vec::new();
        for row in -40..40 {
            for column in -60..60 {
                let (e, a) = (f64::from(row) * ALPHA, f64::from(column) * ALPHA);
                let r = 3.0 - bump(a, e);
                positions
                    .push([e.cos() * a.cos(), e.cos() * a.sin(), e.sin()].map(|c| (r * c) as f32));
            }
        }
        let viewpoints = Viewpoints { origins: vec![[0.0; 3]], index: vec![0; positions.len()] };
        let parts = CloudParts { positions, viewpoints: Some(viewpoints), ..CloudParts::default() };
        let (cloud, _) = PointCloud::from_parts(parts).unwrap();
        let rule = Deviation { angular_resolution: Some(ALPHA), ..Deviation::default() };
        Scene::new(&cloud, rule, 0.0, &Silent).unwrap()
    }

    fn angles(p: [f32; 3]) -> [f64; 2] {
        let [x, y, z] = p.map(f64::from);
        [y.atan2(x), z.atan2(x.hypot(y))]
    }

    #[test]
    fn a_bump_is_found_where_it_is_and_nothing_else_inside() {
        let scene = scene(|a, e| 0.3 * (-((a - 0.2).powi(2) + (e + 0.1).powi(2)) / 0.0016).exp());
        let found = interest_points(&scene, &BicAlphabetOptions::default(), &Silent).unwrap();
        let [a, e] = angles(scene.positions[found[0] as usize]);
        assert!((a - 0.2).abs() < 0.03 && (e + 0.1).abs() < 0.03, "{a} {e}");
        for &i in &found {
            let [a, e] = angles(scene.positions[i as usize]);
            let near = (a - 0.2).hypot(e + 0.1) < 0.2;
            assert!(near || a.abs() > 0.4 || e.abs() > 0.2, "{a} {e}");
        }
    }

    #[test]
    fn a_flat_scene_has_no_interest_points() {
        let scene = scene(|_, _| 0.0);
        let found = interest_points(&scene, &BicAlphabetOptions::default(), &Silent).unwrap();
        assert!(found.is_empty(), "{}", found.len());
    }
}
