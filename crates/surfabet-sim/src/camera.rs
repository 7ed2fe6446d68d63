//! An RGB-D camera: a pinhole with the noise, the steps and the holes of structured light.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use surfabet_base::parallel;
use surfabet_geom::{Error, Progress, Result};

use crate::noise::{PoseError, Stream, axial_noise_std, check_within, random_stream};
use crate::pose::{Frame, Pose, Vec3, frame_of};
use crate::scan::{Measurement, Scan, place};
use crate::scene::{Hit, Scene};

/// A pinhole camera; pixel (0, 0) is the middle of the upper left pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, x in pixels.
    pub cx: f64,
    /// Principal point, y in pixels.
    pub cy: f64,
}

impl Intrinsics {
    /// A Kinect's depth camera (fx = fy = 585, cx 320, cy 240 at 640 x 480), scaled to `width` x `height`.
    pub fn kinect(width: u32, height: u32) -> Self {
        let (sx, sy) = (f64::from(width) / 640.0, f64::from(height) / 480.0);
        Self { width, height, fx: 585.0 * sx, fy: 585.0 * sy, cx: 320.0 * sx, cy: 240.0 * sy }
    }

    fn check(&self) -> Result<()> {
        if !(1..=8192).contains(&self.width) || !(1..=8192).contains(&self.height) {
            let size = format!("{} x {}", self.width, self.height);
            return Err(Error::invalid("image size", size, "1 to 8192 pixels each way"));
        }
        for (name, value) in [("fx", self.fx), ("fy", self.fy)] {
            check_within(name, value, 1e-3, 1e6, "a focal length of 0.001 to 1000000 pixels")?;
        }
        for (name, value) in [("cx", self.cx), ("cy", self.cy)] {
            check_within(name, value, -1e6, 1e6, "within 1000000 pixels of the image")?;
        }
        Ok(())
    }
}

/// How an RGB-D camera measures. [`RgbdOptions::ideal`] is exact, the default is a Kinect without pose error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RgbdOptions {
    /// The pinhole.
    pub intrinsics: Intrinsics,
    /// Nearest and farthest depth that is measured, metres.
    pub depth_limits: [f64; 2],
    /// Times the standard deviation of [`axial_noise_std`]; 0 for exact depth.
    pub depth_noise: f64,
    /// Depth in steps of an eighth of a pixel of disparity (base of 75 mm, focal length of 585 pixels), as a
    /// Kinect gives it: steps of 2.85 mm times the square of the depth in metres.
    pub quantize_disparity: bool,
    /// Largest angle between ray and normal that gives a depth, degrees; over the 15 degrees before it more
    /// and more pixels are lost.
    pub max_incidence: f64,
    /// Fraction of pixels lost anywhere.
    pub dropout: f64,
    /// Standard deviation of every colour channel, 0 to 255.
    pub color_noise: f64,
    /// Error of the poses that the frames are placed with.
    pub pose_error: PoseError,
    /// Seed of all noise.
    pub seed: u64,
}

impl Default for RgbdOptions {
    fn default() -> Self {
        Self {
            intrinsics: Intrinsics::kinect(640, 480),
            depth_limits: [0.4, 4.0],
            depth_noise: 1.0,
            quantize_disparity: false,
            max_incidence: 82.0,
            dropout: 0.002,
            color_noise: 3.0,
            pose_error: PoseError::default(),
            seed: 0,
        }
    }
}

impl RgbdOptions {
    /// No noise, no holes, no limits but 50 m.
    pub fn ideal(intrinsics: Intrinsics) -> Self {
        Self {
            intrinsics,
            depth_limits: [0.0, 50.0],
            depth_noise: 0.0,
            quantize_disparity: false,
            max_incidence: 90.0,
            dropout: 0.0,
            color_noise: 0.0,
            pose_error: PoseError::default(),
            seed: 0,
        }
    }

    fn check(&self) -> Result<()> {
        self.intrinsics.check()?;
        let [near, far] = self.depth_limits;
        if !(near >= 0.0 && far > near && far <= 1000.0) {
            let limits = format!("{:?}", self.depth_limits);
            return Err(Error::invalid("depth_limits", limits, "0 <= near < far <= 1000 m"));
        }
        check_within("depth_noise", self.depth_noise, 0.0, 100.0, "0 to 100 times the model")?;
        check_within("max_incidence", self.max_incidence, 1.0, 90.0, "1 to 90 degrees")?;
        check_within("dropout", self.dropout, 0.0, 1.0, "a fraction from 0 to 1")?;
        check_within("color_noise", self.color_noise, 0.0, 255.0, "0 to 255")?;
        self.pose_error.check()
    }

    /// The depth that is measured of a true one; `None` when it is lost.
    fn measure(&self, depth: f64, incidence: f64, rng: &mut impl Rng) -> Option<f64> {
        let [near, far] = self.depth_limits;
        // Four draws per pixel in any case, so that options do not change each other's noise.
        let normal: f64 = StandardNormal.sample(rng);
        let (lost, grazing): (f64, f64) = (rng.random(), rng.random());
        let kept = (self.max_incidence - incidence.to_degrees()) / 15.0;
        let certain = self.max_incidence >= 90.0;
        if lost < self.dropout || (!certain && grazing >= kept) {
            return None;
        }
        let noise = if self.depth_noise > 0.0 {
            self.depth_noise * axial_noise_std(depth, incidence) * normal
        } else {
            0.0
        };
        let mut measured = depth + noise;
        if self.quantize_disparity && measured > 0.0 {
            let eighths = 585.0 * 0.075 * 8.0;
            measured = eighths / (eighths / measured).round().max(1.0);
        }
        (near..=far).contains(&measured).then_some(measured).filter(|z| *z > 0.0)
    }
}

/// One image pair of the camera with its points.
#[derive(Debug, Clone, PartialEq)]
pub struct RgbdFrame {
    /// Poses, points and truth; the points in the order of the pixels that have a depth.
    pub scan: Scan,
    /// The pinhole.
    pub intrinsics: Intrinsics,
    /// Measured depth along the optical axis per pixel, row by row, metres; 0 where there is none.
    pub depth: Vec<f32>,
    /// Measured colour per pixel, also where there is no depth; black where the ray leaves the scene.
    pub color: Vec<[u8; 3]>,
}

/// Takes an RGB-D frame from every pose (camera to world: x right, y down, z forward).
///
/// Points are placed with poses that carry `pose_error`; the truth of each is kept beside it. The same options
/// give the same frames for any number of threads.
///
/// # Errors
/// [`Error::InvalidParameter`] for no or more than 10000 poses, a pose that is not rigid or an option outside
/// its range; [`Error::Cancelled`] when `progress` asks to stop.
pub fn scan_rgbd(
    scene: &Scene,
    poses: &[Pose],
    options: &RgbdOptions,
    progress: &dyn Progress,
) -> Result<Vec<RgbdFrame>> {
    options.check()?;
    let frames = checked_frames(poses)?;
    let mut taken = Vec::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        progress.update("scanning", index as f32 / frames.len() as f32);
        taken.push(take(scene, index, frame, options, progress)?);
    }
    progress.update("scanning", 1.0);
    Ok(taken)
}

/// The sensor frames of 1 to 10000 poses.
pub(crate) fn checked_frames(poses: &[Pose]) -> Result<Vec<Frame>> {
    if !(1..=10_000).contains(&poses.len()) {
        return Err(Error::invalid("poses", poses.len(), "1 to 10000 poses"));
    }
    poses.iter().map(frame_of).collect()
}

/// A colour as a sensor with noise sees it.
pub(crate) fn noisy_color(color: [f64; 3], std: f64, rng: &mut impl Rng) -> [u8; 3] {
    color.map(|c| {
        let normal: f64 = StandardNormal.sample(rng);
        (c + std * normal).round().clamp(0.0, 255.0) as u8
    })
}

fn take(
    scene: &Scene,
    index: usize,
    frame: &Frame,
    options: &RgbdOptions,
    progress: &dyn Progress,
) -> Result<RgbdFrame> {
    let camera = options.intrinsics;
    let origin: [f64; 3] = frame.translation.vector.into();
    let width = camera.width as usize;
    type Pixel = (f32, [u8; 3], Option<Measurement>);
    let row = |v: u32| -> Result<Vec<Pixel>> {
        progress.check()?;
        let mut rng = random_stream(options.seed, index, &Stream::Line(v));
        let mut pixels = Vec::with_capacity(width);
        for u in 0..camera.width {
            let x = (f64::from(u) - camera.cx) / camera.fx;
            let y = (f64::from(v) - camera.cy) / camera.fy;
            let ray = Vec3::new(x, y, 1.0);
            let hit: Option<Hit> = scene.cast(origin, (frame.rotation * ray).into());
            let Some(hit) = hit else {
                pixels.push((0.0, [0; 3], None));
                continue;
            };
            let color = noisy_color(hit.color, options.color_noise, &mut rng);
            let direction = frame.rotation * ray / ray.norm();
            let cosine = -direction.dot(&Vec3::from(hit.normal));
            let incidence = cosine.clamp(0.0, 1.0).acos();
            let measured = options.measure(hit.distance / ray.norm(), incidence, &mut rng);
            let measurement =
                measured.map(|z| Measurement { local: ray * z, color, intensity: 0.0, hit });
            pixels.push((measured.unwrap_or(0.0) as f32, color, measurement));
        }
        Ok(pixels)
    };
    let rows = parallel::try_map_range(camera.height as usize, |v| row(v as u32))?;
    let mut rng = random_stream(options.seed, index, &Stream::Pose);
    let believed = options.pose_error.believed(frame, &mut rng);
    let measurements: Vec<Measurement> = rows.iter().flatten().filter_map(|p| p.2).collect();
    Ok(RgbdFrame {
        scan: place(&measurements, frame, &believed, false)?,
        intrinsics: camera,
        depth: rows.iter().flatten().map(|p| p.0).collect(),
        color: rows.iter().flatten().map(|p| p.1).collect(),
    })
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{Cancelled, Silent};

    use super::*;
    use crate::room::RoomOptions;

    fn room() -> Scene {
        Scene::room(&RoomOptions::default()).unwrap()
    }

    fn small() -> RgbdOptions {
        RgbdOptions { intrinsics: Intrinsics::kinect(160, 120), ..RgbdOptions::default() }
    }

    #[test]
    fn an_ideal_camera_measures_points_of_the_surface() {
        let scene = room();
        let poses = scene.default_poses(3).unwrap();
        let options = RgbdOptions::ideal(Intrinsics::kinect(160, 120));
        for frame in scan_rgbd(&scene, &poses, &options, &Silent).unwrap() {
            let cloud = &frame.scan.cloud;
            assert!(cloud.len() > 15_000);
            assert_eq!(frame.depth.iter().filter(|z| **z > 0.0).count(), cloud.len());
            for i in (0..cloud.len()).step_by(7) {
                assert!(scene.distance(cloud.world(i)) < 1e-5);
                let closest = scene.closest_point(frame.scan.truth.points[i].map(f64::from));
                assert!(closest.unwrap().distance < 1e-6);
            }
        }
    }

    #[test]
    fn depth_noise_follows_its_model() {
        let scene = room();
        let poses = scene.default_poses(4).unwrap();
        let options = RgbdOptions { max_incidence: 90.0, depth_limits: [0.1, 20.0], ..small() };
        let noisy = scan_rgbd(&scene, &poses, &options, &Silent).unwrap();
        let exact =
            scan_rgbd(&scene, &poses, &RgbdOptions { depth_noise: 0.0, ..options }, &Silent)
                .unwrap();
        let (mut sum, mut square, mut n) = (0.0, 0.0, 0.0);
        for (noisy, exact) in noisy.iter().zip(&exact) {
            let normals = &exact.scan.truth.normals;
            assert_eq!(noisy.scan.truth, exact.scan.truth);
            let depths = |f: &RgbdFrame| -> Vec<f64> {
                f.depth.iter().filter(|z| **z > 0.0).map(|z| f64::from(*z)).collect()
            };
            let origin =
                Vec3::new(exact.scan.pose[0][3], exact.scan.pose[1][3], exact.scan.pose[2][3]);
            for (i, (a, b)) in depths(noisy).iter().zip(depths(exact)).enumerate() {
                let ray = Vec3::from(exact.scan.truth.points[i].map(f64::from)) - origin;
                let cosine = -ray.normalize().dot(&Vec3::from(normals[i].map(f64::from)));
                let z = (a - b) / axial_noise_std(b, cosine.clamp(0.0, 1.0).acos());
                (sum, square, n) = (sum + z, square + z * z, n + 1.0);
            }
        }
        // 75 thousand standard normal values: five deviations of their mean and of their spread.
        assert!(n > 60_000.0);
        assert!((sum / n).abs() < 5.0 / f64::sqrt(n), "{}", sum / n);
        assert!(((square / n).sqrt() - 1.0).abs() < 5.0 / f64::sqrt(2.0 * n) + 1e-3);
    }

    #[test]
    fn steps_of_disparity_are_an_eighth_of_a_pixel() {
        let scene = room();
        let poses = scene.default_poses(1).unwrap();
        let options = RgbdOptions { quantize_disparity: true, ..small() };
        let frame = &scan_rgbd(&scene, &poses, &options, &Silent).unwrap()[0];
        for z in frame.depth.iter().filter(|z| **z > 0.0) {
            let eighths = 351.0 / f64::from(*z);
            assert!((eighths - eighths.round()).abs() < 1e-3);
        }
    }

    #[test]
    fn frames_do_not_depend_on_threads_but_on_the_seed() {
        let scene = room();
        let poses = scene.default_poses(2).unwrap();
        let take = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let pose_error = PoseError { translation_std: 0.01, rotation_std: 0.1 };
            let options = RgbdOptions { seed, pose_error, ..small() };
            pool.install(|| scan_rgbd(&scene, &poses, &options, &Silent).unwrap())
        };
        let one = take(1, 3);
        assert_eq!(one, take(2, 3));
        assert_eq!(one, take(8, 3));
        assert_ne!(one[0].depth, take(1, 4)[0].depth);
        assert_ne!(one[0].scan.pose, one[0].scan.true_pose);
    }

    #[test]
    fn grazing_rays_are_lost() {
        let scene = room();
        let poses = scene.default_poses(6).unwrap();
        for frame in scan_rgbd(&scene, &poses, &small(), &Silent).unwrap() {
            let pose = frame.scan.true_pose;
            let origin = Vec3::new(pose[0][3], pose[1][3], pose[2][3]);
            for (p, n) in frame.scan.truth.points.iter().zip(&frame.scan.truth.normals) {
                let ray = (Vec3::from(p.map(f64::from)) - origin).normalize();
                let incidence = (-ray.dot(&Vec3::from(n.map(f64::from)))).acos();
                assert!(incidence.to_degrees() < 82.001);
            }
            assert!(frame.scan.cloud.ranges().unwrap().iter().all(|r| *r < 6.0));
        }
    }

    #[test]
    fn refuses_wrong_options_and_stops_when_told() {
        let scene = room();
        let poses = scene.default_poses(1).unwrap();
        let message = |options: RgbdOptions, poses: &[Pose]| {
            scan_rgbd(&scene, poses, &options, &Silent).unwrap_err().to_string()
        };
        assert_eq!(message(small(), &[]), "poses is 0, but must be 1 to 10000 poses");
        let limits = RgbdOptions { depth_limits: [2.0, 1.0], ..small() };
        assert!(message(limits, &poses).contains("near < far"));
        let camera = Intrinsics { width: 0, ..Intrinsics::kinect(10, 10) };
        let no_image = RgbdOptions { intrinsics: camera, ..small() };
        assert!(message(no_image, &poses).contains("image size is 0 x 10"));
        let nan = RgbdOptions { depth_noise: f64::NAN, ..small() };
        assert!(message(nan, &poses).contains("depth_noise is NaN"));

        struct Stop;
        impl Progress for Stop {
            fn update(&self, _: &'static str, _: f32) {}
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        let stopped = scan_rgbd(&scene, &poses, &small(), &Stop);
        assert_eq!(stopped.unwrap_err(), Error::Cancelled(Cancelled));
    }
}
