//! A rotating laser scanner: columns of beams, range noise, beams that do not come back.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use surfabet_base::parallel;
use surfabet_geom::{Error, Progress, Result};

use crate::camera::{checked_frames, noisy_color};
use crate::noise::{PoseError, Stream, check_within, random_stream};
use crate::pose::{Frame, Pose, Vec3};
use crate::scan::{Measurement, Scan, place};
use crate::scene::Scene;

/// How a rotating laser measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LidarOptions {
    /// Lowest and highest beam, degrees above the horizon.
    pub elevation_limits: [f64; 2],
    /// Between neighbouring beams of a column, degrees.
    pub elevation_step: f64,
    /// Between neighbouring columns, degrees; the last column ends before the first.
    pub azimuth_step: f64,
    /// Nearest and farthest range that is measured, metres.
    pub range_limits: [f64; 2],
    /// Standard deviation of the range, metres.
    pub range_noise: f64,
    /// Fraction of beams lost anywhere.
    pub dropout: f64,
    /// Standard deviation of every colour channel, 0 to 255.
    pub color_noise: f64,
    /// Error of the poses that the scans are placed with.
    pub pose_error: PoseError,
    /// Seed of all noise.
    pub seed: u64,
}

impl Default for LidarOptions {
    fn default() -> Self {
        Self {
            elevation_limits: [-60.0, 60.0],
            elevation_step: 0.5,
            azimuth_step: 0.5,
            range_limits: [0.3, 100.0],
            range_noise: 0.005,
            dropout: 0.002,
            color_noise: 3.0,
            pose_error: PoseError::default(),
            seed: 0,
        }
    }
}

impl LidarOptions {
    /// The default pattern without noise or holes.
    pub fn ideal() -> Self {
        Self {
            range_limits: [0.0, 100.0],
            range_noise: 0.0,
            dropout: 0.0,
            color_noise: 0.0,
            ..Self::default()
        }
    }

    fn check(&self) -> Result<()> {
        let [low, high] = self.elevation_limits;
        if !(low >= -90.0 && high >= low && high <= 90.0) {
            let limits = format!("{:?}", self.elevation_limits);
            return Err(Error::invalid("elevation_limits", limits, "-90 <= low <= high <= 90"));
        }
        let [near, far] = self.range_limits;
        if !(near >= 0.0 && far > near && far <= 10_000.0) {
            let limits = format!("{:?}", self.range_limits);
            return Err(Error::invalid("range_limits", limits, "0 <= near < far <= 10000 m"));
        }
        for (name, step) in
            [("elevation_step", self.elevation_step), ("azimuth_step", self.azimuth_step)]
        {
            check_within(name, step, 0.01, 90.0, "0.01 to 90 degrees")?;
        }
        check_within("range_noise", self.range_noise, 0.0, 10.0, "0 to 10 m")?;
        check_within("dropout", self.dropout, 0.0, 1.0, "a fraction from 0 to 1")?;
        check_within("color_noise", self.color_noise, 0.0, 255.0, "0 to 255")?;
        self.pose_error.check()
    }

    /// Elevations of a column and azimuths of a turn, radians.
    fn angles(&self) -> (Vec<f64>, Vec<f64>) {
        let [low, high] = self.elevation_limits;
        // Half a thousandth of a step keeps the last beam when the division rounds down.
        let beams = ((high - low) / self.elevation_step + 5e-4) as u32 + 1;
        let columns = (360.0 / self.azimuth_step - 5e-4).ceil() as u32;
        let at = |start: f64, step: f64, n: u32| {
            (0..n).map(|i| (start + step * f64::from(i)).to_radians()).collect()
        };
        (at(low, self.elevation_step, beams), at(0.0, self.azimuth_step, columns))
    }
}

/// Takes a full turn from every pose (sensor to world: x forward, y left, z up): column by column from azimuth
/// zero towards y, each from the lowest beam up.
///
/// Intensity is the luminance of the surface times the cosine of the incidence, 0 to 1. Beams that leave the
/// scene, hit out of range or are lost leave no point. The same options give the same scans for any number of
/// threads.
///
/// # Errors
/// [`Error::InvalidParameter`] for no or more than 10000 poses, a pose that is not rigid or an option outside
/// its range; [`Error::Cancelled`] when `progress` asks to stop.
pub fn scan_lidar(
    scene: &Scene,
    poses: &[Pose],
    options: &LidarOptions,
    progress: &dyn Progress,
) -> Result<Vec<Scan>> {
    options.check()?;
    let frames = checked_frames(poses)?;
    let mut taken = Vec::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        progress.update("scanning", index as f32 / frames.len() as f32);
        taken.push(turn(scene, index, frame, options, progress)?);
    }
    progress.update("scanning", 1.0);
    Ok(taken)
}

fn turn(
    scene: &Scene,
    index: usize,
    frame: &Frame,
    options: &LidarOptions,
    progress: &dyn Progress,
) -> Result<Scan> {
    let (elevations, azimuths) = options.angles();
    let origin: [f64; 3] = frame.translation.vector.into();
    let [near, far] = options.range_limits;
    let column = |number: usize| -> Result<Vec<Measurement>> {
        let azimuth = azimuths[number];
        progress.check()?;
        let mut rng = random_stream(options.seed, index, &Stream::Line(number as u32));
        let mut returned = Vec::with_capacity(elevations.len());
        for elevation in &elevations {
            let flat = elevation.cos();
            let beam = Vec3::new(flat * azimuth.cos(), flat * azimuth.sin(), elevation.sin());
            let direction = frame.rotation * beam;
            let Some(hit) = scene.cast(origin, direction.into()) else {
                continue;
            };
            let color = noisy_color(hit.color, options.color_noise, &mut rng);
            let normal: f64 = StandardNormal.sample(&mut rng);
            let lost: f64 = rng.random();
            let range = hit.distance + options.range_noise * normal;
            if lost < options.dropout || range <= 0.0 || !(near..=far).contains(&range) {
                continue;
            }
            let cosine = -direction.dot(&Vec3::from(hit.normal));
            let [r, g, b] = hit.color;
            let luminance = (0.299 * r + 0.587 * g + 0.114 * b) / 255.0;
            let intensity = (luminance * cosine.clamp(0.0, 1.0)) as f32;
            returned.push(Measurement { local: beam * range, color, intensity, hit });
        }
        Ok(returned)
    };
    let columns = parallel::try_map_range(azimuths.len(), column)?;
    let mut rng = random_stream(options.seed, index, &Stream::Pose);
    let believed = options.pose_error.believed(frame, &mut rng);
    place(&columns.concat(), frame, &believed, true)
}

#[cfg(test)]
mod tests {
    use surfabet_geom::Silent;

    use super::*;
    use crate::room::RoomOptions;

    fn room() -> Scene {
        Scene::room(&RoomOptions::default()).unwrap()
    }

    fn coarse(options: LidarOptions) -> LidarOptions {
        LidarOptions { elevation_step: 2.0, azimuth_step: 2.0, ..options }
    }

    #[test]
    fn the_pattern_has_as_many_beams_as_its_steps_say() {
        let (elevations, azimuths) = LidarOptions::default().angles();
        assert_eq!((elevations.len(), azimuths.len()), (241, 720));
        let odd =
            LidarOptions { azimuth_step: 0.7, elevation_step: 0.972, ..LidarOptions::default() };
        let (elevations, azimuths) = odd.angles();
        assert_eq!((elevations.len(), azimuths.len()), (124, 515));
        assert!(*azimuths.last().unwrap() < std::f64::consts::TAU);
    }

    #[test]
    fn an_ideal_laser_measures_points_of_the_surface_and_misses_through_the_open_door() {
        let scene = room();
        let poses = scene.default_lidar_poses(4).unwrap();
        let options = coarse(LidarOptions::ideal());
        let scans = scan_lidar(&scene, &poses, &options, &Silent).unwrap();
        let beams = 61 * 180;
        assert!(scans.iter().map(|s| s.cloud.len()).sum::<usize>() < 4 * beams);
        for scan in &scans {
            assert!(scan.cloud.len() > beams * 9 / 10);
            for i in 0..scan.cloud.len() {
                assert!(scene.distance(scan.cloud.world(i)) < 1e-5);
            }
        }
    }

    #[test]
    fn range_noise_has_the_spread_asked_for() {
        let scene = room();
        let poses = scene.default_lidar_poses(3).unwrap();
        let exact = coarse(LidarOptions { range_limits: [0.05, 50.0], ..LidarOptions::ideal() });
        let noisy = LidarOptions { range_noise: 0.02, ..exact };
        let a = scan_lidar(&scene, &poses, &noisy, &Silent).unwrap();
        let b = scan_lidar(&scene, &poses, &exact, &Silent).unwrap();
        let errors: Vec<f64> = a
            .iter()
            .zip(&b)
            .flat_map(|(a, b)| {
                assert_eq!(a.truth, b.truth);
                let ranges = |s: &Scan| s.cloud.ranges().unwrap().to_vec();
                ranges(a).into_iter().zip(ranges(b)).map(|(x, y)| f64::from(x - y))
            })
            .collect();
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        assert!(mean.abs() < 5.0 * 0.02 / n.sqrt());
        assert!((rms / 0.02 - 1.0).abs() < 5.0 / (2.0 * n).sqrt());
    }

    #[test]
    fn scans_do_not_depend_on_threads() {
        let scene = room();
        let poses = scene.default_lidar_poses(2).unwrap();
        let take = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let options = coarse(LidarOptions::default());
            pool.install(|| scan_lidar(&scene, &poses, &options, &Silent).unwrap())
        };
        assert_eq!(take(1), take(8));
    }

    #[test]
    fn refuses_wrong_options() {
        let scene = room();
        let poses = scene.default_lidar_poses(1).unwrap();
        let message = |options: LidarOptions| {
            scan_lidar(&scene, &poses, &options, &Silent).unwrap_err().to_string()
        };
        let base = LidarOptions::default;
        assert!(
            message(LidarOptions { elevation_step: 0.0, ..base() }).contains("elevation_step is 0")
        );
        assert!(
            message(LidarOptions { elevation_limits: [10.0, -10.0], ..base() })
                .contains("low <= high")
        );
        assert!(
            message(LidarOptions { range_noise: f64::NAN, ..base() })
                .contains("range_noise is NaN")
        );
    }
}
