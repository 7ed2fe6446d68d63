//! A scan simulator with exact ground truth: furnished rooms seen by depth cameras and rotating lasers.
//!
//! A [`Scene`] is a set of solids (boxes, cylinders, spheres) grouped into instances: `chair`, `door`, `shelf`,
//! `wall` and so on. Instances of one class are congruent, several chairs are the same chair in other poses, unless
//! [`RoomOptions::variation`] is above zero.
//! Its surface is known exactly, so every measure of a reconstruction can be taken against the truth and not
//! against another noisy scan.
//!
//! World frame: z up, the floor at z = 0, the room's centre above the origin. Camera frame: x right, y down,
//! z forward. Laser frame: x forward, y left, z up. Poses are 4 x 4 row-major matrices from sensor to world.
//! Everything is in metres; angles in options are in degrees.
//!
//! Same options and seed give the same scene and the same scans, whatever the number of threads: every image
//! row and every laser column draws its noise from a random stream of its own.

mod bvh;
mod camera;
mod furniture;
mod laser;
mod noise;
mod pose;
mod room;
mod scan;
mod scene;
mod solid;
mod texture;
mod variants;

pub use camera::{Intrinsics, RgbdFrame, RgbdOptions, scan_rgbd};
pub use laser::{LidarOptions, scan_lidar};
pub use noise::{PoseError, axial_noise_std};
pub use pose::Pose;
pub use room::{RoomKind, RoomOptions};
pub use scan::{GroundTruth, Scan, fuse};
pub use scene::{ClosestPoint, Hit, Instance, Scene, Surface, SurfaceKind, SurfaceSamples};

pub use surfabet_geom::{Error, Result};
