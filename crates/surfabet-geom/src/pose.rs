//! Rigid transforms: where a sensor stands, how one frame lies in another.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::error::{Error, Result};

/// How far a rotation matrix may be from orthonormal: text files keep six digits of it.
const LARGEST_SKEW: f64 = 1e-3;

/// A rotation followed by a translation in metres, in double precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    isometry: Isometry3<f64>,
}

impl Pose {
    /// Leaves everything in its place.
    pub fn identity() -> Self {
        Self { isometry: Isometry3::identity() }
    }

    /// From the rows of a rotation matrix and a translation. The nearest rotation is taken.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] when a value is not finite, or when the matrix is off a rotation by more than
    /// 0.001: a reflection, a scaling or a skew.
    pub fn new(rotation: [[f64; 3]; 3], translation: [f64; 3]) -> Result<Self> {
        let matrix = Matrix3::from_fn(|r, c| rotation[r][c]);
        let skew = (matrix * matrix.transpose() - Matrix3::identity()).abs().max();
        // Negated, so that NaN is refused too.
        if !(skew <= LARGEST_SKEW && matrix.determinant() > 0.0) {
            return Err(Error::invalid(
                "rotation",
                format!("{rotation:?}"),
                "a rotation matrix, orthonormal to 0.001 and without reflection",
            ));
        }
        if translation.iter().any(|t| !t.is_finite()) {
            return Err(Error::invalid("translation", format!("{translation:?}"), "finite"));
        }
        let rough = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
        let near = UnitQuaternion::new_normalize(rough.into_inner());
        let rotation = UnitQuaternion::from_matrix_eps(&matrix, f64::EPSILON, 100, near);
        let translation = Translation3::from(Vector3::from(translation));
        Ok(Self { isometry: Isometry3::from_parts(translation, rotation) })
    }

    /// From a 4 x 4 matrix in rows, as pose files hold it; its last row is not looked at, since some files keep
    /// a time stamp there.
    ///
    /// # Errors
    /// As [`Pose::new`].
    pub fn from_rows(matrix: [[f64; 4]; 4]) -> Result<Self> {
        Self::new(
            std::array::from_fn(|r| std::array::from_fn(|c| matrix[r][c])),
            std::array::from_fn(|r| matrix[r][3]),
        )
    }

    /// Rows of the rotation matrix.
    pub fn rotation(&self) -> [[f64; 3]; 3] {
        let matrix = self.isometry.rotation.to_rotation_matrix();
        std::array::from_fn(|r| std::array::from_fn(|c| matrix[(r, c)]))
    }

    /// Translation in metres: where the frame's origin goes.
    pub fn translation(&self) -> [f64; 3] {
        self.isometry.translation.vector.into()
    }

    /// The pose that undoes this one.
    pub fn inverse(&self) -> Self {
        Self { isometry: self.isometry.inverse() }
    }

    /// `self` after `first`.
    pub fn after(&self, first: &Self) -> Self {
        Self { isometry: self.isometry * first.isometry }
    }

    /// Moves a point.
    pub fn apply(&self, point: [f64; 3]) -> [f64; 3] {
        (self.isometry * Point3::from(point)).coords.into()
    }

    /// Turns a direction.
    pub fn rotate(&self, direction: [f64; 3]) -> [f64; 3] {
        (self.isometry.rotation * Vector3::from(direction)).into()
    }
}

impl Default for Pose {
    fn default() -> Self {
        Self::identity()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const QUARTER_TURN: [[f64; 3]; 3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];

    fn any_pose() -> impl Strategy<Value = Pose> {
        (prop::array::uniform3(-3.0..3.0_f64), prop::array::uniform3(-1e3..1e3)).prop_map(
            |(axis_angle, translation)| {
                let rotation = Rotation3::new(Vector3::from(axis_angle));
                let rows = std::array::from_fn(|r| std::array::from_fn(|c| rotation[(r, c)]));
                Pose::new(rows, translation).unwrap()
            },
        )
    }

    #[test]
    fn turns_then_moves() {
        let pose = Pose::new(QUARTER_TURN, [10.0, 0.0, 0.0]).unwrap();
        let p = pose.apply([1.0, 2.0, 3.0]);
        for (found, expected) in p.iter().zip([8.0, 1.0, 3.0]) {
            assert!((found - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn refuses_what_is_no_rotation() {
        let mirror = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(Pose::new(mirror, [0.0; 3]).is_err());
        assert!(Pose::new(QUARTER_TURN.map(|r| r.map(|c| 2.0 * c)), [0.0; 3]).is_err());
        assert!(Pose::new([[f64::NAN; 3]; 3], [0.0; 3]).is_err());
        assert!(Pose::new(QUARTER_TURN, [f64::INFINITY, 0.0, 0.0]).is_err());
    }

    #[test]
    fn repairs_a_rotation_read_from_text() {
        let rough = [[0.707, -0.707, 0.0], [0.707, 0.707, 0.0], [0.0, 0.0, 1.0]];
        let rotation = Pose::new(rough, [0.0; 3]).unwrap().rotation();
        assert!((rotation[0][0] - 0.5_f64.sqrt()).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn inverse_and_composition(
            a in any_pose(), b in any_pose(), p in prop::array::uniform3(-10.0..10.0_f64)
        ) {
            let there = a.after(&b).apply(p);
            let steps = a.apply(b.apply(p));
            let back = a.after(&b).inverse().apply(there);
            for i in 0..3 {
                prop_assert!((there[i] - steps[i]).abs() < 1e-9);
                prop_assert!((back[i] - p[i]).abs() < 1e-9);
            }
        }
    }
}
