//! A pose refined on the surfaces of the map: point to plane, robustly, by Gauss-Newton.

use nalgebra::{Matrix6, UnitQuaternion, Vector6};
use surfabet_geom::vector::{cross, dot, minus};

use super::constants::{HOLD, SAME_NORMAL};
use super::map::Localizer;
use super::placement::Placement;
use super::samples::Sample;

/// A sample on a surface of the map.
pub(super) struct SurfaceMatch {
    /// Where the sample comes to lie, about the sensor.
    pub arm: [f32; 3],
    /// Normal of the surface.
    pub normal: [f32; 3],
    /// Signed distance from the surface along its normal, metres.
    pub distance: f32,
    /// Distance along the surface from the map's sample, metres.
    pub aside: f32,
    /// Cosine between the normals of sample and surface; zero where the sample has none.
    pub cosine: f32,
}

/// A rotation as rows in single precision.
pub(super) struct RotationRows([[f32; 3]; 3]);

impl RotationRows {
    pub fn of(rotation: &UnitQuaternion<f64>) -> Self {
        let matrix = rotation.to_rotation_matrix();
        Self(std::array::from_fn(|r| std::array::from_fn(|c| matrix[(r, c)] as f32)))
    }

    pub fn turn(&self, v: [f32; 3]) -> [f32; 3] {
        self.0.map(|row| dot(row, v))
    }
}

/// What a sample meets in the map, if anything is near.
pub(super) fn matched(
    map: &Localizer,
    rows: &RotationRows,
    at: [f32; 3],
    sample: &Sample,
) -> Option<SurfaceMatch> {
    let arm = rows.turn(minus(sample.point, sample.viewpoint));
    let p = std::array::from_fn(|a| at[a] + arm[a]);
    let i = map.nearest.at(p)?;
    let normal = map.normals[i];
    let away = minus(p, map.points[i]);
    let distance = dot(away, normal);
    let aside = (dot(away, away) - distance * distance).max(0.0).sqrt();
    let cosine = dot(rows.turn(sample.normal), normal);
    Some(SurfaceMatch { arm, normal, distance, aside, cosine })
}

/// The normal equations of one step, of turns about x, y, z of the world and shifts along them.
pub(super) struct System {
    pub matrix: Matrix6<f64>,
    pub vector: Vector6<f64>,
    /// Sum of all weights, and of the weighted squares of distances.
    pub weight: f64,
    pub squares: f64,
}

/// The least-squares pose of samples on their nearest surfaces, with weights `1 / (1 + (d / reach)^2)^2` of distances d
/// (Geman and McClure). `reach` falls geometrically from the first to the last step.
pub(super) fn refine(
    map: &Localizer,
    samples: &[Sample],
    start: Placement,
    reach: [f64; 2],
    steps: usize,
) -> Placement {
    let mut placement = start;
    for step in 0..steps {
        let system = matched_system(map, samples, &placement, reach_of(reach, step, steps));
        let Some(change) = system.solve() else { break };
        placement = placement.stepped(&change);
        if step + 1 < steps && change.norm() < 1e-5 && 2 * step > steps - 1 {
            break;
        }
    }
    placement
}

/// The reach of a step in cells: it falls geometrically from the first to the last.
pub(super) fn reach_of([first, last]: [f64; 2], step: usize, steps: usize) -> f64 {
    let t = step as f64 / (steps - 1).max(1) as f64;
    first * (last / first).powf(t)
}

/// The normal equations of samples on their nearest surfaces, with a reach in cells.
pub(super) fn matched_system(
    map: &Localizer,
    samples: &[Sample],
    placement: &Placement,
    reach: f64,
) -> System {
    System::of(map, samples, placement, map.cell * reach)
}

impl System {
    fn of(map: &Localizer, samples: &[Sample], placement: &Placement, reach: f64) -> Self {
        let rows = RotationRows::of(&placement.rotation);
        let at: [f32; 3] = std::array::from_fn(|a| placement.translation[a] as f32);
        let mut upper = [[0.0_f64; 6]; 6];
        let (mut vector, mut weight, mut squares) = ([0.0_f64; 6], 0.0, 0.0);
        let scale = (1.0 / reach) as f32;
        for sample in samples {
            let Some(m) = matched(map, &rows, at, sample) else { continue };
            if sample.is_flat() && m.cosine.abs() < SAME_NORMAL {
                continue;
            }
            let x = (m.distance * scale).powi(2) + (0.25 * m.aside * scale).powi(2);
            let w = f64::from(1.0 / ((1.0 + x) * (1.0 + x)));
            let turn = cross(m.arm, m.normal);
            let row = [turn[0], turn[1], turn[2], m.normal[0], m.normal[1], m.normal[2]];
            let row = row.map(f64::from);
            let distance = f64::from(m.distance);
            for i in 0..6 {
                for j in i..6 {
                    upper[i][j] += w * row[i] * row[j];
                }
                vector[i] -= w * row[i] * distance;
            }
            weight += w;
            squares += w * distance * distance;
        }
        let matrix = Matrix6::from_fn(|i, j| upper[i.min(j)][i.max(j)]);
        Self { matrix, vector: Vector6::from(vector), weight, squares }
    }

    /// The matrix with a little weight on every direction, so that what no surface fixes stays.
    pub fn held(&self) -> Matrix6<f64> {
        let part = |from: usize| (from..from + 3).map(|i| self.matrix[(i, i)]).sum::<f64>() / 3.0;
        let mut held = self.matrix;
        for i in 0..6 {
            held[(i, i)] += HOLD * part(3 * (i / 3)) + 1e-9;
        }
        held
    }

    fn solve(&self) -> Option<Vector6<f64>> {
        if self.weight <= 0.0 {
            return None;
        }
        self.held().cholesky().map(|c| c.solve(&self.vector))
    }
}
