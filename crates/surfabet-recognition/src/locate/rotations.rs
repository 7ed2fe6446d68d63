//! Rotations from scan to map, guessed from the directions that surfaces of both face.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use surfabet_geom::vector::{cross, dot, unit};

use super::constants::{
    LARGEST_TILT, LEAST_DENSITY, LEAST_SECOND_SHARE, ROTATIONS, SAME_ANGLE, SAME_ROTATION, YAWS,
};
use super::directions::Directions;
use super::map::Localizer;

/// Which rotations are looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Allowed {
    /// The vertical of the scan is that of the map within [`LARGEST_TILT`].
    Upright,
    /// All that are not upright.
    Tilted,
    /// All.
    Any,
    /// Those within an angle, radians, of a given one.
    About(UnitQuaternion<f64>, f64),
}

impl Allowed {
    fn holds(self, rotation: &UnitQuaternion<f64>) -> bool {
        let tilt = (rotation * Vector3::z()).z;
        match self {
            Self::Upright => tilt >= LARGEST_TILT.cos(),
            Self::Tilted => tilt < LARGEST_TILT.cos(),
            Self::Any => true,
            Self::About(prior, angle) => prior.angle_to(rotation) <= angle,
        }
    }
}

/// Rotations that take directions of the scan to those of the map, the likeliest first.
///
/// Two directions of the scan on two of the map with the same angle between them give one each; they are ranked by how
/// likely the map's normals make those of the scan. Where the scan has no second direction its vertical is turned all
/// around.
pub(super) fn rotations(
    map: &Localizer,
    scan: &Directions,
    allowed: Allowed,
) -> Vec<UnitQuaternion<f64>> {
    let mut found = RankedRotations { map, scan, allowed, ranked: Vec::new() };
    found.add_from_pairs();
    let second: f64 = scan.all.iter().skip(1).map(|d| d.1).sum();
    let mut most = ROTATIONS;
    if found.ranked.is_empty() || second < LEAST_SECOND_SHARE {
        found.add_from_vertical();
        most = YAWS;
    }
    found.ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<UnitQuaternion<f64>> = Vec::new();
    for (_, rotation) in found.ranked {
        // From the vertical they are 4 degrees apart.
        let same = if most == YAWS { 0.5 * SAME_ROTATION } else { SAME_ROTATION };
        if kept.len() < most && kept.iter().all(|other| other.angle_to(&rotation) > same) {
            kept.push(rotation);
        }
    }
    kept
}

struct RankedRotations<'a> {
    map: &'a Localizer,
    scan: &'a Directions,
    allowed: Allowed,
    ranked: Vec<(f64, UnitQuaternion<f64>)>,
}

impl RankedRotations<'_> {
    /// Adds rotations of pairs of directions to pairs of the map with the same angle.
    fn add_from_pairs(&mut self) {
        let (scan, map) = (&self.scan.all, &self.map.directions.all);
        for i in 0..scan.len() {
            for j in i + 1..scan.len() {
                for (k, l) in (0..map.len()).flat_map(|k| (0..map.len()).map(move |l| (k, l))) {
                    if k != l {
                        self.add_from_pair([scan[i].0, scan[j].0], [map[k].0, map[l].0]);
                    }
                }
            }
        }
    }

    /// Both signs of both directions of the map.
    fn add_from_pair(&mut self, from: [[f64; 3]; 2], to: [[f64; 3]; 2]) {
        let angle = |[a, b]: [[f64; 3]; 2]| dot(a, b).clamp(-1.0, 1.0).acos();
        // Nearly parallel directions fix nothing.
        if dot(from[0], from[1]).abs() > 0.9 {
            return;
        }
        for signs in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
            let to = [to[0].map(|c| signs[0] * c), to[1].map(|c| signs[1] * c)];
            if (angle(from) - angle(to)).abs() < SAME_ANGLE {
                let [from, to] = [frame(from), frame(to)];
                let matrix = to * from.transpose();
                let rotation = Rotation3::from_matrix_unchecked(matrix);
                self.add(UnitQuaternion::from_rotation_matrix(&rotation));
            }
        }
    }

    /// The vertical of the scan on that of the map, and turns about it.
    fn add_from_vertical(&mut self) {
        let vertical = |directions: &Directions| {
            let upright = |d: &&([f64; 3], f64)| d.0[2].abs() > LARGEST_TILT.cos();
            let first = directions.all.iter().find(upright);
            Vector3::from(first.map_or([0.0, 0.0, 1.0], |d| d.0.map(|c| c * d.0[2].signum())))
        };
        let (from, to) = (vertical(self.scan), vertical(&self.map.directions));
        let upright = UnitQuaternion::rotation_between(&from, &to).unwrap_or_default();
        let axis = nalgebra::Unit::new_normalize(to);
        for k in 0..YAWS {
            let angle = std::f64::consts::TAU * k as f64 / YAWS as f64;
            self.add(UnitQuaternion::from_axis_angle(&axis, angle) * upright);
        }
    }

    fn add(&mut self, rotation: UnitQuaternion<f64>) {
        if self.allowed.holds(&rotation) {
            self.ranked.push((self.likelihood(&rotation), rotation));
        }
    }

    /// Mean logarithm of the map's density at the scan's normals.
    fn likelihood(&self, rotation: &UnitQuaternion<f64>) -> f64 {
        let matrix = rotation.to_rotation_matrix();
        let of = |&(n, w): &([f64; 3], f64)| {
            let turned: [f64; 3] = (matrix * Vector3::from(n)).into();
            w * self.map.density.at(turned).max(LEAST_DENSITY).ln()
        };
        self.scan.bins.iter().map(of).sum()
    }
}

/// Orthogonal columns: the first direction, what is across both, and what is across these.
fn frame([a, b]: [[f64; 3]; 2]) -> Matrix3<f64> {
    let across = unit(cross(a, b));
    let columns = [a, across, cross(a, across)].map(Vector3::from);
    Matrix3::from_columns(&columns)
}
