//! Planes at every cell of a scale, as poses of integers.

use nalgebra::{Matrix3, Vector3};
use pulp::Arch;
use surfabet_base::parallel;
use surfabet_geom::{Neighbor, Progress};

use super::{Candidate, Descriptor, WordSamples};
use crate::alphabet::choice::CoverCounts;
use crate::alphabet::constants::{
    LEAST_RADIUS_IN_SIGMAS, MAX_FITTED, MAX_SAMPLES_PER_SIDE, ON_FIRST_PLANE, ON_PLANE,
    PLANE_ROUNDS, PLANES_PER_CELL, TILT_RIDGE,
};
use crate::alphabet::lattice::{MAX_SLOPE, UNITS, cell_center, offset_step, sigma, slope_steps};
use crate::alphabet::placement::Placement;
use crate::alphabet::scene::{Cells, LatticeScene, LocalPoint, Rows, local_points};
use crate::alphabet::word::Word;
use crate::error::Result;
use crate::scans::{Upright, upright_frame};
use crate::vector::{self, squared_distance};

/// A plane as a candidate, and the descriptor of the surface about it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::alphabet) struct CandidatePlane {
    pub candidate: Candidate,
    pub descriptor: Descriptor,
}

/// The planes at all cells of a scale, sorted and each once.
pub(in crate::alphabet) fn find_planes(
    search: &PlaneSearch<'_>,
    progress: &dyn Progress,
) -> Result<Vec<CandidatePlane>> {
    let plane = [Word::plane()];
    let mut found = parallel::try_map_range_with(
        search.cells.len(),
        || (PlaneBuffers::default(), WordSamples::new(&plane)),
        |(buffers, samples), k| -> Result<Vec<CandidatePlane>> {
            progress.check()?;
            let mut planes = search.planes_of_cell(k, buffers, samples);
            planes.sort_by_key(|p| p.candidate.placement);
            Ok(planes)
        },
    )?;
    // Those of a cell follow one another, and each of them is there once.
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by_key(|&k| search.cells.get(k).0);
    Ok(order.into_iter().flat_map(|k| std::mem::take(&mut found[k])).collect())
}

/// Points of a cell that are compared with a plane at a time.
const CHUNK: usize = 16;

/// Buffers for the points about a cell.
#[derive(Default)]
struct PlaneBuffers {
    rows: Rows,
    fitted: Vec<u32>,
    touched: Vec<u32>,
    local: Vec<LocalPoint>,
    around: PlanePoints,
    neighbors: Vec<Neighbor>,
}

/// The search on one scale.
pub(in crate::alphabet) struct PlaneSearch<'a> {
    pub scene: &'a LatticeScene,
    pub cells: &'a Cells,
    pub scale: u32,
    /// Distance of samples, in sigma.
    pub spacing: f64,
    /// What larger planes explain already, and the weight of points that it takes for a plane to pay for itself: none is
    /// sought where fewer are left, and none starts at a point that is explained.
    pub explained: Option<(&'a CoverCounts, f32)>,
}

impl PlaneSearch<'_> {
    /// Up to [`PLANES_PER_CELL`] planes through the k-th cell: each starts at the point with a normal that is nearest to
    /// the cell's middle, and takes the points within its sigma away from the search for the next.
    fn planes_of_cell(
        &self,
        k: usize,
        buffers: &mut PlaneBuffers,
        samples: &mut WordSamples<'_>,
    ) -> Vec<CandidatePlane> {
        let PlaneBuffers { rows, fitted, touched, local, around, neighbors } = buffers;
        let (cell, inside) = self.cells.get(k);
        let scene = self.scene;
        let middle = cell_center(cell, self.scale);
        let center = middle.map(|c| c as f64);
        let radius = (UNITS << self.scale) as f64;
        let mut open: Vec<u32> = inside.to_vec();
        if let Some((counts, least)) = self.explained {
            if counts.n_open(inside) <= least {
                return Vec::new();
            }
            open.retain(|&i| !counts.is_explained(i));
        }
        let mut found: Vec<CandidatePlane> = Vec::new();
        self.cells.around(cell, rows);
        self.cells.some_of(rows, MAX_FITTED, fitted);
        around.fill(scene, fitted, center);
        for _ in 0..PLANES_PER_CELL {
            let Some((seed, normal)) = self.seed(&mut open, center, neighbors) else { break };
            let view = scene.views.get(seed as usize).copied().unwrap_or(0);
            let sensor = scene.sensor(view);
            let level = scene.rule.level(middle, sensor);
            open.retain(|&i| i != seed);
            let is_too_small = radius < LEAST_RADIUS_IN_SIGMAS * sigma(level);
            if is_too_small || 2.0 * radius > MAX_SAMPLES_PER_SIDE * sigma(level) {
                continue;
            }
            let p = scene.points[seed as usize].map(f64::from);
            let offset = (0..3).map(|a| normal[a] * (p[a] - center[a])).sum();
            let fitted = around.fit(normal, offset, radius);
            let Some((normal, offset)) = fitted else { continue };
            let placement = quantized(normal, offset, cell, self.scale, level, view);
            let pose = placement.pose(level, sensor);
            open.retain(|&i| {
                let [.., height] = pose.to_word(scene.points[i as usize].map(f64::from));
                height.abs() > ON_PLANE * f64::from(scene.sigma[i as usize])
            });
            if found.iter().any(|p| p.candidate.placement == placement) {
                continue;
            }
            self.cells.touched(rows, &pose, touched);
            local_points(scene, &pose, touched, local);
            let [weight, _] = samples.cover(0, &pose, self.spacing, local);
            if weight > 0 {
                let descriptor = Descriptor::of_points(&pose, local);
                let candidate = Candidate { placement, pose, coverage: samples.coverage() };
                found.push(CandidatePlane { candidate, descriptor });
            }
        }
        found
    }

    /// Of the points `open` the one with a normal that is nearest to `center`, and its normal; others without a normal go.
    fn seed(
        &self,
        open: &mut Vec<u32>,
        center: [f64; 3],
        buffer: &mut Vec<Neighbor>,
    ) -> Option<(u32, [f64; 3])> {
        let scene = self.scene;
        let nearest = |open: &[u32]| {
            open.iter().copied().min_by(|&i, &j| {
                let off =
                    |i: u32| squared_distance(scene.points[i as usize].map(f64::from), center);
                off(i).total_cmp(&off(j)).then(i.cmp(&j))
            })
        };
        let mut normal = |i: u32| scene.normals.of(i, buffer);
        let first = nearest(open)?;
        if let Some(normal) = normal(first) {
            return Some((first, normal.map(f64::from)));
        }
        open.retain(|&i| i != first && normal(i).is_some());
        let seed = nearest(open)?;
        Some((seed, normal(seed)?.map(f64::from)))
    }
}

/// The points that planes of a cell are fitted to, in columns, from the cell's middle.
#[derive(Default)]
struct PlanePoints {
    offsets: [Vec<f64>; 3],
    sigma: Vec<f64>,
    weights: Vec<f64>,
}

impl PlanePoints {
    /// Takes these points of the scene.
    fn fill(&mut self, scene: &LatticeScene, points: &[u32], center: [f64; 3]) {
        self.weights.clear();
        self.sigma.clear();
        self.offsets.iter_mut().for_each(Vec::clear);
        for i in points.iter().map(|&i| i as usize) {
            let p = scene.points[i].map(f64::from);
            for a in 0..3 {
                self.offsets[a].push(p[a] - center[a]);
            }
            self.sigma.push(f64::from(scene.sigma[i]));
            self.weights.push(f64::from(scene.weights[i]));
        }
    }

    /// Normal and offset from the cell's middle of a plane that starts with these, fitted to the points near to it within
    /// the word's square: weighted least squares of the height over the plane before,
    /// `sum (h - x0 - x1 u / r - x2 v / r)^2 / sigma^2`, in a few rounds. `None` where the plane does not pass within a
    /// radius of the middle, or has no points.
    fn fit(&self, mut normal: [f64; 3], mut offset: f64, radius: f64) -> Option<([f64; 3], f64)> {
        for round in 0..PLANE_ROUNDS {
            let rows = upright_frame(normal, Upright::WorldX, [0.0; 3]);
            let tolerance = if round == 0 { ON_FIRST_PLANE } else { ON_PLANE };
            let mut sums = NormalEquations::default();
            Arch::new().dispatch(|| self.add_near(&rows, offset, tolerance, radius, &mut sums));
            let x = sums.solution()?;
            let tilted: [f64; 3] = std::array::from_fn(|a| {
                rows[2][a] - (x[1] * rows[0][a] + x[2] * rows[1][a]) / radius
            });
            let length = vector::length(tilted);
            // The plane through the same point above the cell's middle.
            offset = (offset + x[0]) / length;
            normal = tilted.map(|c| c / length);
        }
        (offset.abs() <= radius).then_some((normal, offset))
    }

    /// Adds the points within so many sigmas of a plane and within the square of the word, in their order.
    #[inline(always)]
    fn add_near(
        &self,
        rows: &[[f64; 3]; 3],
        offset: f64,
        tolerance: f64,
        radius: f64,
        sums: &mut NormalEquations,
    ) {
        let [xs, ys, zs] = &self.offsets;
        let columns = xs.chunks(CHUNK).zip(ys.chunks(CHUNK)).zip(zs.chunks(CHUNK));
        let others = self.sigma.chunks(CHUNK).zip(self.weights.chunks(CHUNK));
        for (((x, y), z), (sigma, weights)) in columns.zip(others) {
            // Frame by frame over all of a chunk: most points are not near, so this loop takes few operations per point.
            let mut local = [[0.0; CHUNK]; 3];
            let mut near = [false; CHUNK];
            for k in 0..x.len() {
                let [u, v, h] = rows.map(|r| r[0] * x[k] + r[1] * y[k] + r[2] * z[k]);
                let h = h - offset;
                near[k] =
                    (u.abs() <= radius) & (v.abs() <= radius) & (h.abs() <= tolerance * sigma[k]);
                [local[0][k], local[1][k], local[2][k]] = [u, v, h];
            }
            for k in (0..x.len()).filter(|&k| near[k]) {
                let weight = weights[k] / (sigma[k] * sigma[k]);
                sums.add([1.0, local[0][k] / radius, local[1][k] / radius], local[2][k], weight);
            }
        }
    }
}

/// The normal equations of a plane.
#[derive(Default)]
struct NormalEquations {
    matrix: Matrix3<f64>,
    right: Vector3<f64>,
}

impl NormalEquations {
    /// Adds `w x x'` and `w h x`; only the lower half of the matrix.
    #[inline(always)]
    fn add(&mut self, x: [f64; 3], h: f64, w: f64) {
        for a in 0..3 {
            for b in 0..=a {
                self.matrix[(a, b)] += x[a] * x[b] * w;
            }
            self.right[a] += x[a] * (h * w);
        }
    }

    /// The tilt with a ridge on it; `None` where there is none.
    fn solution(mut self) -> Option<Vector3<f64>> {
        self.matrix.fill_upper_triangle_with_lower_triangle();
        let ridge = TILT_RIDGE * self.matrix[(0, 0)];
        self.matrix[(1, 1)] += ridge;
        self.matrix[(2, 2)] += ridge;
        Some(self.matrix.try_inverse()? * self.right)
    }
}

/// The plane with this normal and offset from the cell's middle, rounded to the integers of the lattice.
fn quantized(
    normal: [f64; 3],
    offset: f64,
    cell: [i32; 3],
    scale: u32,
    level: u32,
    view: u16,
) -> Placement {
    let axis = (1..3).fold(0, |m, a| if normal[a].abs() > normal[m].abs() { a } else { m });
    let steps = f64::from(slope_steps(scale, level));
    let slope = |k: usize| {
        let s = (normal[(axis + k) % 3] / normal[axis] * steps).round();
        s.clamp(-f64::from(MAX_SLOPE), f64::from(MAX_SLOPE)) as i16
    };
    // The integer normal points along the positive axis.
    let offset = offset * normal[axis].signum();
    Placement {
        scale: scale as u8,
        cell,
        axis: axis as u8,
        slopes: [slope(1), slope(2)],
        offset: (offset / offset_step(level) as f64).round() as i32,
        word: 0,
        view,
    }
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::alphabet::scene::Thinned;
    use crate::scans::{Deviation, Scene};

    #[test]
    fn no_smaller_plane_is_sought_where_a_larger_one_explains() {
        // A floor of 2 m, and a board of 0.4 m half a metre above it, a point every 2 cm.
        let floor = (0..10_000).map(|i| [(i % 100) as f32 * 0.02, (i / 100) as f32 * 0.02, 0.0]);
        let board = (0..400).map(|i| [(i % 20) as f32 * 0.02 + 0.8, (i / 20) as f32 * 0.02, 0.5]);
        let (cloud, _) = PointCloud::from_positions(floor.chain(board).collect());
        let deviation = Deviation { noise: Some(0.01), ..Deviation::default() };
        let scene = Scene::new(&cloud, deviation, 0.0, &Silent).unwrap();
        let thinning = Thinned::of(&scene, usize::MAX);
        let scene = LatticeScene::new(&scene.select(&thinning.kept), thinning, 0.1).unwrap();
        let cells = Cells::new(&scene.points, 0);
        let planes = |explained| {
            let search =
                PlaneSearch { scene: &scene, cells: &cells, scale: 0, spacing: 1.0, explained };
            find_planes(&search, &Silent).unwrap()
        };
        let all = planes(None);
        let none = CoverCounts::new(&scene.weights);
        assert_eq!(planes(Some((&none, 2.0))), all);

        let is_floor = |i: &u32| scene.points[*i as usize][2] == 0.0;
        let of_floor: Vec<u32> = (0..scene.points.len() as u32).filter(is_floor).collect();
        let mut counts = CoverCounts::new(&scene.weights);
        counts.add(&of_floor);
        let left = planes(Some((&counts, 2.0)));
        assert!(!left.is_empty() && left.len() < all.len() / 4);
        assert!(left.iter().all(|p| !p.candidate.coverage.points.iter().any(is_floor)));
        // Nor where fewer points are left than a plane has to explain.
        let n_board = (scene.points.len() - of_floor.len()) as f32;
        assert_eq!(planes(Some((&counts, n_board))), []);
    }
}
