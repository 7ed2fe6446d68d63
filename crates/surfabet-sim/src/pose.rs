//! Rigid poses at the border: 4 x 4 row-major matrices, checked.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use surfabet_geom::{Error, Result};

/// A rigid transformation from a local frame to the world: 4 x 4, row-major, last row 0 0 0 1, metres.
pub type Pose = [[f64; 4]; 4];

pub(crate) type Vec3 = Vector3<f64>;
pub(crate) type Frame = Isometry3<f64>;

/// Largest deviation from a rotation matrix that is taken for rounding, as in poses printed with few digits.
const TOLERANCE: f64 = 1e-4;

/// The nearest rigid transformation, when `pose` is one up to rounding.
pub(crate) fn frame_of(pose: &Pose) -> Result<Frame> {
    let linear = Matrix3::from_fn(|r, c| pose[r][c]);
    let finite = pose.iter().flatten().all(|v| v.is_finite());
    let last_row = (0..4).all(|c| (pose[3][c] - f64::from(u8::from(c == 3))).abs() <= TOLERANCE);
    let orthonormal = (linear.transpose() * linear - Matrix3::identity()).amax() <= TOLERANCE;
    if !(finite && last_row && orthonormal && linear.determinant() > 0.0) {
        return Err(Error::invalid(
            "pose",
            format!("{pose:?}"),
            "a rigid 4 x 4 matrix from sensor to world: orthonormal rotation without mirroring, \
             last row 0 0 0 1",
        ));
    }
    // A quaternion of a matrix that is orthonormal to 1e-4 is a unit one to the same degree: normalising it
    // gives a proper rotation.
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(linear));
    Ok(Frame::from_parts(Translation3::new(pose[0][3], pose[1][3], pose[2][3]), rotation))
}

/// The 4 x 4 matrix of a rigid transformation.
pub(crate) fn pose_of(frame: &Frame) -> Pose {
    let matrix = frame.to_homogeneous();
    std::array::from_fn(|r| std::array::from_fn(|c| matrix[(r, c)]))
}

/// A frame at `position` turned by `yaw` radians about z.
pub(crate) fn upright(position: Vec3, yaw: f64) -> Frame {
    Frame::from_parts(position.into(), UnitQuaternion::from_axis_angle(&Vec3::z_axis(), yaw))
}

/// A camera (x right, y down, z forward) at `position`, looking along `yaw` (from x towards y) and `pitch`
/// (upwards), radians.
pub(crate) fn looking(position: Vec3, yaw: f64, pitch: f64) -> Frame {
    let forward = Vec3::new(pitch.cos() * yaw.cos(), pitch.cos() * yaw.sin(), pitch.sin());
    let right = Vec3::new(yaw.sin(), -yaw.cos(), 0.0);
    let down = forward.cross(&right);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    Frame::from_parts(position.into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_looking_along_x_has_its_axes_where_they_belong() {
        let pose = pose_of(&looking(Vec3::new(1.0, 2.0, 3.0), 0.0, 0.0));
        let expected = [
            [0.0, 0.0, 1.0, 1.0],
            [-1.0, 0.0, 0.0, 2.0],
            [0.0, -1.0, 0.0, 3.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        for r in 0..4 {
            for c in 0..4 {
                assert!((pose[r][c] - expected[r][c]).abs() < 1e-12, "{pose:?}");
            }
        }
    }

    #[test]
    fn poses_make_the_round_trip_and_wrong_ones_are_refused() {
        let pose = pose_of(&looking(Vec3::new(1.0, 2.0, 3.0), 0.4, -0.3));
        let again = pose_of(&frame_of(&pose).unwrap());
        assert!((0..16).all(|i| (pose[i / 4][i % 4] - again[i / 4][i % 4]).abs() < 1e-12));

        let mut mirrored = pose;
        (0..3).for_each(|r| mirrored[r][0] = -mirrored[r][0]);
        let mut scaled = pose;
        scaled[0][0] *= 2.0;
        let mut nan = pose;
        nan[1][3] = f64::NAN;
        let mut projective = pose;
        projective[3][0] = 0.5;
        for bad in [mirrored, scaled, nan, projective] {
            assert!(frame_of(&bad).unwrap_err().to_string().contains("rigid 4 x 4"));
        }
    }
}
