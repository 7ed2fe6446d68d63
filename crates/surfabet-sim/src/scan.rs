//! What a simulated sensor gives: points where it believes them, and beside each the truth.

use surfabet_geom::{CloudParts, PointCloud, Result, Viewpoints};

use crate::pose::{Frame, Pose, Vec3, pose_of};
use crate::scene::Hit;

/// The truth of every point of a cloud, in its order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GroundTruth {
    /// Where the ray met the surface, in the world, metres.
    pub points: Vec<[f32; 3]>,
    /// Unit outward normals there.
    pub normals: Vec<[f32; 3]>,
    /// Rows in [`crate::Scene::instances`].
    pub instances: Vec<u32>,
    /// Rows in [`crate::Scene::surfaces`].
    pub surfaces: Vec<u32>,
}

/// The points of one sensor pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// The pose that the points were placed with.
    pub pose: Pose,
    /// The pose that the sensor really had.
    pub true_pose: Pose,
    /// In the world, with colours, ranges and viewpoint; laser scans have intensities too.
    pub cloud: PointCloud,
    /// The truth of every point.
    pub truth: GroundTruth,
}

/// One measured point before it is placed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measurement {
    /// In the sensor's frame, metres.
    pub local: Vec3,
    pub color: [u8; 3],
    pub intensity: f32,
    pub hit: Hit,
}

/// Places measurements with the believed pose.
pub(crate) fn place(
    measurements: &[Measurement],
    frame: &Frame,
    believed: &Frame,
    with_intensity: bool,
) -> Result<Scan> {
    let origin = believed.translation.vector;
    let world = |m: &Measurement| (believed * nalgebra::Point3::from(m.local)).coords;
    let positions = measurements.iter().map(|m| world(m).map(|c| c as f32).into()).collect();
    let parts = CloudParts {
        positions,
        colors: Some(measurements.iter().map(|m| m.color).collect()),
        intensities: with_intensity.then(|| measurements.iter().map(|m| m.intensity).collect()),
        ranges: Some(measurements.iter().map(|m| m.local.norm() as f32).collect()),
        viewpoints: Some(Viewpoints {
            origins: vec![origin.into()],
            index: vec![0; measurements.len()],
        }),
        ..CloudParts::default()
    };
    let truth = GroundTruth {
        points: measurements.iter().map(|m| m.hit.point.map(|c| c as f32)).collect(),
        normals: measurements.iter().map(|m| m.hit.normal.map(|c| c as f32)).collect(),
        instances: measurements.iter().map(|m| m.hit.instance).collect(),
        surfaces: measurements.iter().map(|m| m.hit.surface).collect(),
    };
    let (cloud, _) = PointCloud::from_parts(parts)?;
    Ok(Scan { pose: pose_of(believed), true_pose: pose_of(frame), cloud, truth })
}

/// All scans as one cloud with its truth, in their order.
pub fn fuse<'a>(scans: impl IntoIterator<Item = &'a Scan>) -> (PointCloud, GroundTruth) {
    let mut truth = GroundTruth::default();
    let mut clouds = Vec::new();
    for scan in scans {
        truth.points.extend_from_slice(&scan.truth.points);
        truth.normals.extend_from_slice(&scan.truth.normals);
        truth.instances.extend_from_slice(&scan.truth.instances);
        truth.surfaces.extend_from_slice(&scan.truth.surfaces);
        clouds.push(scan.cloud.clone());
    }
    // Scans of one sensor have the same attributes: nothing is lost.
    (PointCloud::concat(&clouds).0, truth)
}
