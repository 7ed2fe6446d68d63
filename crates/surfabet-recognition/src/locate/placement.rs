//! Where a scan stands in a map, in the map's own frame.

use nalgebra::{UnitQuaternion, Vector3, Vector6};
use surfabet_geom::Pose;
use surfabet_models::Result;

/// A rotation about the sensor, and where the sensor stands, metres about the map's origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    pub rotation: UnitQuaternion<f64>,
    pub translation: Vector3<f64>,
}

impl Placement {
    /// The pose that takes the scan, whose sensor stands at `sensor` in its own frame, to the world.
    pub fn pose(&self, origin: [f64; 3], sensor: [f64; 3]) -> Result<Pose> {
        let matrix = self.rotation.to_rotation_matrix();
        let arm = matrix * Vector3::from(sensor);
        let rows = std::array::from_fn(|r| std::array::from_fn(|c| matrix[(r, c)]));
        let at = std::array::from_fn(|a| origin[a] + self.translation[a] - arm[a]);
        Ok(Pose::new(rows, at)?)
    }

    /// The placement of a pose.
    pub fn of(pose: &Pose, origin: [f64; 3], sensor: [f64; 3]) -> Self {
        let rows = pose.rotation();
        let matrix = nalgebra::Matrix3::from_fn(|r, c| rows[r][c]);
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(matrix);
        let at = pose.apply(sensor);
        Self {
            rotation: UnitQuaternion::from_rotation_matrix(&rotation),
            translation: Vector3::from_fn(|a, _| at[a] - origin[a]),
        }
    }

    /// The placement after a turn about x, y, z of the world and a shift along them.
    pub fn stepped(&self, change: &Vector6<f64>) -> Self {
        let [turn, shift] = [0, 3].map(|k| Vector3::new(change[k], change[k + 1], change[k + 2]));
        Self {
            rotation: UnitQuaternion::from_scaled_axis(turn) * self.rotation,
            translation: self.translation + shift,
        }
    }

    /// The turn about x, y, z of the world and the shift along them that lead to another placement.
    pub fn twist_to(&self, other: &Self) -> Vector6<f64> {
        let turn = (other.rotation * self.rotation.inverse()).scaled_axis();
        let shift = other.translation - self.translation;
        Vector6::new(turn[0], turn[1], turn[2], shift[0], shift[1], shift[2])
    }

    /// The placement a share of the way to another.
    pub fn between(&self, other: &Self, share: f64) -> Self {
        self.stepped(&(self.twist_to(other) * share))
    }

    /// Metres and radians to another placement.
    pub fn distance_to(&self, other: &Self) -> (f64, f64) {
        let away = (self.translation - other.translation).norm();
        (away, self.rotation.angle_to(&other.rotation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_and_back() {
        let rotation = UnitQuaternion::from_euler_angles(0.1, -0.2, 2.5);
        let placement = Placement { rotation, translation: Vector3::new(3.0, -4.0, 1.0) };
        let (origin, sensor) = ([500_000.0, 4_000_000.0, 100.0], [0.3, 0.1, 1.5]);
        let pose = placement.pose(origin, sensor).unwrap();
        let back = Placement::of(&pose, origin, sensor);
        let (away, turned) = placement.distance_to(&back);
        assert!(away < 1e-8 && turned < 1e-7);
        let at = pose.apply(sensor);
        assert!((at[0] - 500_003.0).abs() < 1e-8);
    }

    #[test]
    fn a_twist_leads_from_one_placement_to_another() {
        let of = |roll, yaw, x| Placement {
            rotation: UnitQuaternion::from_euler_angles(roll, -0.2, yaw),
            translation: Vector3::new(x, 2.0, 1.0),
        };
        let (from, to) = (of(0.1, 2.5, 3.0), of(-0.3, -2.9, 8.0));
        let is_at = |a: Placement, b: &Placement| {
            let (away, turned) = a.distance_to(b);
            away < 1e-9 && turned < 1e-7
        };
        assert!(is_at(from.stepped(&from.twist_to(&to)), &to));
        assert!(is_at(from.between(&to, 1.0), &to) && is_at(from.between(&to, 0.0), &from));
    }
}
