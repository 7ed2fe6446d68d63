//! Motions of a placement that no surface fixes: along a corridor, over a floor and about its normal, about the axis of a tunnel.

use nalgebra::{Matrix3, Matrix6, SymmetricEigen, UnitQuaternion, Vector3, Vector6};

use super::constants::{FINE_REACH, FINE_STEPS, LOOSE};
use super::map::Localizer;
use super::placement::Placement;
use super::refine::{System, matched_system, reach_of};
use super::samples::Sample;

/// A motion to first order: a turn about the sensor, radians about its axis, and the shift that goes with it, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FreeMotion {
    pub turn: Vector3<f64>,
    pub shift: Vector3<f64>,
}

impl FreeMotion {
    /// The shift along a line.
    pub fn along(direction: [f64; 3]) -> Self {
        Self { turn: Vector3::zeros(), shift: direction.into() }
    }

    /// Whether it is a shift along a line.
    pub fn is_shift(&self) -> bool {
        self.turn == Vector3::zeros()
    }

    /// The placement after `times` the motion.
    pub fn applied(&self, placement: &Placement, times: f64) -> Placement {
        Placement {
            rotation: UnitQuaternion::from_scaled_axis(self.turn * times) * placement.rotation,
            translation: placement.translation + self.shift * times,
        }
    }
}

/// Motions that surfaces hold little at a placement: unit shifts along lines, then turns by a radian about unit axes, each with the shift
/// that the surfaces make of it. Little is less than a share [`LOOSE`] of what they hold in all directions.
///
/// Of the normal matrix with blocks A of turns, B of turns and shifts and C of shifts, shifts are the eigenvectors of C with small
/// eigenvalues; turns those of `A - B C^+ B^T`, what is left when the position follows a turn, with C^+ the inverse of C without those
/// shifts.
pub(super) fn loose_motions(system: &System) -> Vec<FreeMotion> {
    let block = |r: usize, c: usize| system.matrix.fixed_view::<3, 3>(r, c).into_owned();
    let (turns, mixed, shifts) = (block(0, 0), block(0, 3), block(3, 3));
    let is_loose = |value: f64, all: &Matrix3<f64>| value < LOOSE * all.trace();
    let mut motions = Vec::new();
    if shifts.trace() <= 0.0 || turns.trace() <= 0.0 {
        return motions;
    }
    let mut inverse = Matrix3::zeros();
    let eigen = SymmetricEigen::new(shifts);
    for (value, shift) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if is_loose(*value, &shifts) {
            motions
                .push(FreeMotion { turn: Vector3::zeros(), shift: upwards(&shift.into_owned()) });
        } else {
            inverse += shift * shift.transpose() / *value;
        }
    }
    let follows = inverse * mixed.transpose();
    let eigen = SymmetricEigen::new(turns - mixed * follows);
    for (value, turn) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if is_loose(*value, &turns) {
            let turn = upwards(&turn.into_owned());
            motions.push(FreeMotion { turn, shift: -(follows * turn) });
        }
    }
    motions
}

/// A direction or its opposite: that whose largest component is positive.
fn upwards(direction: &Vector3<f64>) -> Vector3<f64> {
    // No component is a negative zero.
    (direction * direction[direction.iamax()].signum()).add_scalar(0.0)
}

/// Free motions as a subspace of turns and shifts, where a turn counts as the metres by which it moves a sample at the lever.
pub(super) struct FreeSpace {
    /// Root mean square of the arms by which samples hold turns, over that by which they hold shifts, metres.
    lever: f64,
    /// Projects on the subspace.
    onto: Matrix6<f64>,
}

impl FreeSpace {
    pub fn new(system: &System, motions: &[FreeMotion]) -> Self {
        let part = |from: usize| (from..from + 3).map(|i| system.matrix[(i, i)]).sum::<f64>();
        let lever = (part(0) / part(3).max(1e-12)).sqrt().max(1e-3);
        let mut onto = Matrix6::zeros();
        for motion in motions {
            let mut v = stacked(motion.turn * lever, motion.shift);
            v -= onto * v;
            if v.norm() > 1e-6 {
                v /= v.norm();
                onto += v * v.transpose();
            }
        }
        Self { lever, onto }
    }

    /// Turns and shifts in metres: as they are multiplied by this, their matrix by its inverse from both sides.
    fn scale(&self) -> Vector6<f64> {
        stacked(Vector3::repeat(self.lever), Vector3::repeat(1.0))
    }

    /// What of a normal matrix holds other motions than the free ones.
    pub fn without(&self, matrix: &Matrix6<f64>) -> Matrix6<f64> {
        let scale = Matrix6::from_diagonal(&self.scale());
        let down = Matrix6::from_diagonal(&self.scale().map(|s| 1.0 / s));
        let rest = Matrix6::identity() - self.onto;
        scale * (rest * (down * matrix * down) * rest) * scale
    }

    /// The step to the least squares of a system, and along the free motions to where they come nearest to `target`.
    fn step(&self, system: &System, from: &Placement, target: &Placement) -> Option<Vector6<f64>> {
        let scale = self.scale();
        let down = Matrix6::from_diagonal(&scale.map(|s| 1.0 / s));
        let rest = Matrix6::identity() - self.onto;
        let matrix = down * system.held() * down;
        let held = rest * matrix * rest + self.onto * matrix.trace();
        let fixed = held.cholesky()?.solve(&(rest * (down * system.vector)));
        let free = self.onto * from.twist_to(target).component_mul(&scale);
        Some(down * (fixed + free))
    }

    /// Metres from one placement to another beside the free motions.
    pub fn distance(&self, from: &Placement, to: &Placement) -> f64 {
        let twist = from.twist_to(to).component_mul(&self.scale());
        (twist - self.onto * twist).norm()
    }
}

/// A placement refined on the surfaces, but along `motions` as near to `target` as they lead.
pub(super) fn refine_beside(
    map: &Localizer,
    samples: &[Sample],
    start: &Placement,
    target: &Placement,
    motions: &[FreeMotion],
) -> Placement {
    let mut placement = *start;
    for step in 0..FINE_STEPS {
        let system =
            matched_system(map, samples, &placement, reach_of(FINE_REACH, step, FINE_STEPS));
        let space = FreeSpace::new(&system, motions);
        let Some(change) = space.step(&system, &placement, target) else { break };
        placement = placement.stepped(&change);
        if change.norm() < 1e-5 && 2 * step > FINE_STEPS {
            break;
        }
    }
    placement
}

fn stacked(turn: Vector3<f64>, shift: Vector3<f64>) -> Vector6<f64> {
    Vector6::new(turn[0], turn[1], turn[2], shift[0], shift[1], shift[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The system of points on surfaces: position about the sensor, normal.
    fn system_of(facts: &[([f64; 3], [f64; 3])]) -> System {
        let mut matrix = Matrix6::zeros();
        for (arm, normal) in facts {
            let (arm, normal) = (Vector3::from(*arm), Vector3::from(*normal));
            let row = stacked(arm.cross(&normal), normal);
            matrix += row * row.transpose();
        }
        System { matrix, vector: Vector6::zeros(), weight: facts.len() as f64, squares: 0.0 }
    }

    /// Points all around at distances along x.
    fn around(place: impl Fn(f64, f64) -> ([f64; 3], [f64; 3])) -> Vec<([f64; 3], [f64; 3])> {
        let turn = |k: i32| f64::from(k) * std::f64::consts::TAU / 24.0;
        (0..24)
            .flat_map(|k| (-5..=5).map(|x| place(f64::from(x), turn(k))).collect::<Vec<_>>())
            .collect()
    }

    #[test]
    fn a_floor_is_free_in_two_directions_and_about_its_normal() {
        let floor = around(|r, a| ([r * a.cos(), r * a.sin(), -1.2], [0.0, 0.0, 1.0]));
        let motions = loose_motions(&system_of(&floor));
        assert_eq!(motions.len(), 3);
        assert!(motions[..2].iter().all(|m| m.is_shift() && m.shift[2].abs() < 1e-9));
        assert!(motions[2].turn[2].abs() > 1.0 - 1e-9);
    }

    #[test]
    fn a_tunnel_is_free_along_and_about_its_axis() {
        // The axis is 0.3 m beside the sensor: a turn about it shifts the sensor.
        let tunnel =
            around(|x, a| ([x, 0.3 + 1.5 * a.cos(), 1.5 * a.sin()], [0.0, a.cos(), a.sin()]));
        let motions = loose_motions(&system_of(&tunnel));
        assert_eq!(motions.len(), 2);
        assert!(motions[0].is_shift() && motions[0].shift[0].abs() > 1.0 - 1e-9);
        let [turn, shift] = [motions[1].turn, motions[1].shift];
        assert!(turn[0].abs() > 1.0 - 1e-9);
        // The axis stays where it is.
        let axis = Vector3::new(0.0, 0.3, 0.0);
        assert!((turn.cross(&axis) + shift).norm() < 1e-9);
    }

    #[test]
    fn three_walls_leave_nothing_free() {
        let mut facts = Vec::new();
        for axis in 0..3 {
            for (u, v) in [(-2.0, -1.0), (-1.0, 2.0), (1.0, 1.5), (2.0, -1.0)] {
                let (mut arm, mut normal) = ([2.0; 3], [0.0; 3]);
                (arm[(axis + 1) % 3], arm[(axis + 2) % 3]) = (u, v);
                normal[axis] = 1.0;
                facts.push((arm, normal));
            }
        }
        assert_eq!(loose_motions(&system_of(&facts)), []);
    }

    #[test]
    fn what_is_free_has_no_weight_and_the_rest_keeps_its_own() {
        let floor = around(|r, a| ([r * a.cos(), r * a.sin(), -1.2], [0.0, 0.0, 1.0]));
        let system = system_of(&floor);
        let motions = loose_motions(&system);
        let rest = FreeSpace::new(&system, &motions).without(&system.matrix);
        for i in [2, 3, 4] {
            assert!(rest.column(i).norm() < 1e-9);
        }
        assert!((rest[(5, 5)] - system.matrix[(5, 5)]).abs() < 1e-6);
    }
}
