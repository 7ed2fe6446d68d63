//! Places that can be told from all others of the same surface: where normals of three directions meet.
//!
//! A corner is found again where the scene shows the same thing again, to within a pixel or two. Its descriptor is
//! how much surface there is in each of 6 x 6 x 6 cells around it, along the axes of the lattice: quarter turns and mirrors
//! only exchange cells.

use nalgebra::Matrix3;
use surfabet_base::parallel;
use surfabet_geom::cells::{cell_of, key};
use surfabet_geom::morton::MortonMap;

use super::surface::SurfacePixels;
use crate::patches::constants::{
    DESCRIPTOR_CELL, KEYPOINT_CELL, KEYPOINTS_APART, LEAST_CORNER, MOST_KEYPOINTS, NORMALS_AROUND,
};

/// Cells along the side of the cube that a descriptor covers.
const SIDE: usize = 6;

/// Numbers in a descriptor.
pub(super) const DESCRIPTOR: usize = SIDE * SIDE * SIDE;

/// Numbers in a descriptor that turns and mirrors do not change.
pub(super) const INVARIANT: usize = SIDE * RINGS;

/// Distances from the axis of turns among these.
const RINGS: usize = 6;

/// Turns by quarters, each mirrored or not.
pub(super) const N_TURNS: usize = 8;

/// A place with its descriptor: the surface around it.
pub(super) struct Keypoint {
    /// Pixels of the lattice.
    pub position: [f32; 3],
    /// Share of the surface in each cell around, as vector of unit length.
    pub descriptor: [f32; DESCRIPTOR],
    /// Sums of it over what turns exchange.
    pub invariant: [f32; INVARIANT],
}

/// What is gathered in a cell.
#[derive(Clone, Default)]
struct Gathered {
    n: f32,
    sum: [f32; 3],
    normals: Matrix3<f64>,
}

/// The keypoints of a surface in the order of their cells; things turn about `axis`.
pub(super) fn keypoints(surface: &SurfacePixels<'_>, axis: usize) -> Vec<Keypoint> {
    let cells = gather(surface);
    let keys = {
        let mut keys: Vec<u64> = cells.keys().copied().collect();
        parallel::sort_keys(&mut keys);
        keys
    };
    let strength = parallel::map(&keys, |&key| strength(&cells, key));
    let by_key: MortonMap<f64> =
        keys.iter().zip(&strength).map(|(&key, &(strength, _))| (key, strength)).collect();
    let mut corners: Vec<(f64, u64, [f32; 3])> = Vec::new();
    for (&key, &(strength, middle)) in keys.iter().zip(&strength) {
        let is_less = |other: u64| {
            by_key.get(&other).is_none_or(|&of| of < strength || of == strength && other >= key)
        };
        if strength >= LEAST_CORNER && about(key, KEYPOINTS_APART).all(is_less) {
            corners.push((strength, key, middle));
        }
    }
    corners.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    corners.truncate(MOST_KEYPOINTS);
    corners.sort_by_key(|corner| corner.1);
    parallel::map(&corners, |&(_, _, position)| describe(&cells, position, axis))
}

/// Pixels and normals by cell.
fn gather(surface: &SurfacePixels<'_>) -> MortonMap<Gathered> {
    let mut cells: MortonMap<Gathered> = MortonMap::default();
    for leaf in 0..surface.leaves.len() {
        let n = nalgebra::Vector3::from(surface.normal(leaf).map(f64::from));
        let normals = n * n.transpose();
        for pixel in surface.pixels_of(leaf) {
            let p = surface.middles[pixel];
            let cell = cells.entry(key(cell_of(p, KEYPOINT_CELL))).or_default();
            cell.n += 1.0;
            (0..3).for_each(|a| cell.sum[a] += p[a]);
            cell.normals += normals;
        }
    }
    cells
}

/// Keys of the cells at most `reach` from a cell along each axis.
fn about(of: u64, reach: i32) -> impl Iterator<Item = u64> {
    let [x, y, z] = surfabet_geom::cells::of_key(of);
    let side = 2 * reach + 1;
    (0..side * side * side).map(move |i| {
        let at = [i % side, i / side % side, i / (side * side)].map(|c| c - reach);
        key([x + at[0], y + at[1], z + at[2]])
    })
}

/// The third eigenvalue of the normals about a cell, and the middle of the surface there.
fn strength(cells: &MortonMap<Gathered>, key: u64) -> (f64, [f32; 3]) {
    let mut all = Gathered::default();
    for cell in about(key, NORMALS_AROUND).filter_map(|key| cells.get(&key)) {
        all.n += cell.n;
        (0..3).for_each(|a| all.sum[a] += cell.sum[a]);
        all.normals += cell.normals;
    }
    (all.normals.symmetric_eigenvalues().min(), all.sum.map(|s| s / all.n.max(1.0)))
}

/// The keypoint of a place: shares of the surface in the cells around, their roots as a vector of unit length.
fn describe(cells: &MortonMap<Gathered>, position: [f32; 3], axis: usize) -> Keypoint {
    let mut descriptor = [0.0_f32; DESCRIPTOR];
    let reach = (0.5 * SIDE as f32 * DESCRIPTOR_CELL / KEYPOINT_CELL).ceil() as i32;
    for cell in
        about(key(cell_of(position, KEYPOINT_CELL)), reach).filter_map(|key| cells.get(&key))
    {
        // From the lowest middle of a cell of the descriptor, in such cells.
        let at: [f32; 3] = std::array::from_fn(|a| {
            let offset = (cell.sum[a] / cell.n - position[a]) / DESCRIPTOR_CELL;
            offset + 0.5 * SIDE as f32 - 0.5
        });
        let low = at.map(f32::floor);
        for corner in 0..8_usize {
            let mut weight = cell.n;
            let mut index = [0; 3];
            for a in 0..3 {
                let up = corner >> a & 1;
                let part = at[a] - low[a];
                weight *= if up == 1 { part } else { 1.0 - part };
                index[a] = low[a] as i32 + up as i32;
            }
            if index.iter().all(|c| (0..SIDE as i32).contains(c)) {
                descriptor[number(index.map(|c| c as usize))] += weight;
            }
        }
    }
    // Roots, so that a wall does not outweigh all else.
    descriptor = descriptor.map(f32::sqrt);
    let length = descriptor.iter().map(|c| c * c).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    descriptor = descriptor.map(|c| c / length);
    let mut invariant = [0.0; INVARIANT];
    for (i, c) in descriptor.iter().enumerate() {
        let at = [i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE)];
        let from = |a: usize| (2 * at[a]).abs_diff(SIDE - 1) / 2;
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3].map(from);
        let (near, far) = (u.min(v), u.max(v));
        // The six pairs of distances in 0, 1, 2 whatever their order.
        invariant[RINGS * at[axis] + far * (far + 1) / 2 + near] += c;
    }
    Keypoint { position, descriptor, invariant }
}

/// Number of a cell of a descriptor.
fn number([x, y, z]: [usize; 3]) -> usize {
    x + SIDE * (y + SIDE * z)
}

/// For each of the turns the cells of a descriptor that come to each cell: mirrored (bit 2) along the axis after `axis`,
/// then turned about it by quarters (the lower bits).
pub(super) fn exchanges(axis: usize) -> [[u16; DESCRIPTOR]; N_TURNS] {
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    std::array::from_fn(|turn| {
        let mut exchange = [0; DESCRIPTOR];
        for i in 0..DESCRIPTOR {
            let mut at = [i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE)];
            if turn & 4 != 0 {
                at[u] = SIDE - 1 - at[u];
            }
            for _ in 0..turn & 3 {
                (at[u], at[v]) = (SIDE - 1 - at[v], at[u]);
            }
            exchange[number(at)] = i as u16;
        }
        exchange
    })
}
