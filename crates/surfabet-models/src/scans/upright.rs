//! The frame of a feature: its normal, and the upward direction about it (III-C).

use crate::options::choices;
use crate::vector::{cross, dot};

/// From this |z| of a normal on, the projection of world z is too short to be the upward direction: 64 degrees.
const NEARLY_VERTICAL: f64 = 0.9;

/// The upward direction where the normal itself is nearly vertical, which the paper leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Upright {
    /// World x. Floors and ceilings get one orientation for the whole scene.
    #[default]
    WorldX,
    /// World z all the same, where it has a projection.
    WorldZ,
    /// Away from the sensor.
    ViewDirection,
}
choices!(Upright { WorldX = "x", WorldZ = "z", ViewDirection = "view" });

/// Rows: right, up, normal; all unit vectors, right-handed.
///
/// Up is world z, or by `rule` where the normal is nearly vertical, projected onto the plane of the feature; world x
/// where that has no projection. `view` is the direction from the sensor to the point, for [`Upright::ViewDirection`].
pub fn upright_frame(normal: [f64; 3], rule: Upright, view: [f64; 3]) -> [[f64; 3]; 3] {
    let [x, z] = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let wanted = match rule {
        _ if normal[2].abs() <= NEARLY_VERTICAL => z,
        Upright::WorldX => x,
        Upright::WorldZ => z,
        Upright::ViewDirection => view,
    };
    // World x is at least 0.4 off a nearly vertical normal, so that it always has a projection.
    let up = projected(wanted, normal).or_else(|| projected(x, normal)).unwrap_or(z);
    [cross(up, normal), up, normal]
}

/// The part of `v` that is orthogonal to the unit vector `normal`, at unit length; `None` where there is none.
fn projected(v: [f64; 3], normal: [f64; 3]) -> Option<[f64; 3]> {
    let along = dot(v, normal);
    let rest: [f64; 3] = std::array::from_fn(|a| v[a] - along * normal[a]);
    let length = dot(rest, rest).sqrt();
    (length > 1e-6).then(|| rest.map(|c| c / length))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn frames_are_rotations_with_the_normal_last(
            v in prop::array::uniform3(-1.0_f64..1.0),
            view in prop::array::uniform3(-1.0_f64..1.0),
            rule in prop::sample::select(vec![Upright::WorldX, Upright::WorldZ, Upright::ViewDirection]),
        ) {
            let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            prop_assume!(length > 0.1);
            let normal = v.map(|c| c / length);
            let rows = upright_frame(normal, rule, view);
            for (i, a) in rows.iter().enumerate() {
                for (j, b) in rows.iter().enumerate() {
                    let dot: f64 = (0..3).map(|k| a[k] * b[k]).sum();
                    prop_assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-9);
                }
            }
            let handed = cross(rows[0], rows[1]);
            prop_assert!((0..3).all(|a| (handed[a] - normal[a]).abs() < 1e-9));
            if normal[2].abs() <= NEARLY_VERTICAL {
                prop_assert!(rows[0][2].abs() < 1e-9 && rows[1][2] > 0.0);
            }
        }
    }

    #[test]
    fn a_floor_has_one_orientation() {
        let rows = upright_frame([0.0, 0.0, 1.0], Upright::WorldX, [0.0; 3]);
        assert_eq!(rows[1], [1.0, 0.0, 0.0]);
        // Along the normal nothing is up but the fallback.
        assert_eq!(upright_frame([0.0, 0.0, 1.0], Upright::WorldZ, [0.0; 3])[1], [1.0, 0.0, 0.0]);
        let away = upright_frame([0.0, 0.0, 1.0], Upright::ViewDirection, [0.0, 1.0, -1.0]);
        assert!((away[1][1] - 1.0).abs() < 1e-12);
    }
}
