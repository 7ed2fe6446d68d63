//! Rays through a surface that is known as points with normals: what a ray meets first, and which of its sides.

use surfabet_base::parallel;

use crate::cells::{cell_of, key};
use crate::morton::MortonMap;
use crate::vector::{add_scaled, dot, minus, squared_distance, unit};

/// Cells along the side of a block: rays pass empty blocks in one step.
const BLOCK_BITS: u32 = 3;

/// How far beyond a cell's face the next one is looked for, in cells: more than rounding.
const NUDGE: f32 = 1e-3;

/// Radius of a disc in cells: the half diagonal of a face and a little, so that discs of neighbouring cells overlap.
const RADIUS: f32 = 0.8;

/// Least cosine between a ray and a normal: along a surface a ray passes its discs by chance.
const LEAST_INCIDENCE: f32 = 0.05;

/// A piece of surface in a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Disc {
    middle: [f32; 3],
    normal: [f32; 3],
}

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Met {
    /// Distance from the start of the ray.
    pub distance: f32,
    /// Whether the side is met that the normal points to.
    pub front: bool,
    /// Unit normal of the surface there.
    pub normal: [f32; 3],
}

/// A surface for rays: a disc for each direction, of six, that the surface in a cell faces.
#[derive(Debug)]
pub struct Sight {
    /// Side of a cell.
    cell: f32,
    discs: Vec<Disc>,
    /// First disc and number of discs of each cell.
    of_cells: MortonMap<(u32, u32)>,
    /// Blocks of cells with discs.
    blocks: MortonMap<()>,
    /// The box of all discs.
    bounds: [[f32; 3]; 2],
}

impl Sight {
    /// A surface of points with unit normals, in cells of side `cell`; there should be two points along it. Points without a
    /// normal are left out.
    pub fn new(positions: &[[f32; 3]], normals: &[[f32; 3]], cell: f32) -> Self {
        let faced = parallel::gather(positions.len().min(normals.len()), |i, found| {
            if let Some(facing) = facing(normals[i]) {
                found.push((key(cell_of(positions[i], cell)), facing, i as u32));
            }
        });
        let mut faced = faced;
        faced.sort_unstable();
        let mut discs = Vec::new();
        let mut of_cells: MortonMap<(u32, u32)> = MortonMap::default();
        for group in faced.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let first = discs.len() as u32;
            of_cells.entry(group[0].0).or_insert((first, 0)).1 += 1;
            discs.push(disc(group.iter().map(|&(.., i)| i as usize), positions, normals));
        }
        let blocks = of_cells.keys().map(|key| (key >> (3 * BLOCK_BITS), ())).collect();
        let bounds = discs.iter().fold([[f32::MAX; 3], [f32::MIN; 3]], |[low, high], disc| {
            let p = disc.middle;
            [
                std::array::from_fn(|a| low[a].min(p[a] - cell)),
                std::array::from_fn(|a| high[a].max(p[a] + cell)),
            ]
        });
        Self { cell, discs, of_cells, blocks, bounds }
    }

    /// What a ray meets first between two distances from `from`; `direction` has unit length.
    pub fn first(&self, from: [f32; 3], direction: [f32; 3], start: f32, end: f32) -> Option<Met> {
        let inverse = direction.map(|c| 1.0 / c);
        let (mut along, end) = self.within_bounds(from, inverse, start, end)?;
        while along < end {
            let at = add_scaled(from, along, direction);
            let cell = cell_of(at, self.cell);
            let code = key(cell);
            let leave = if self.blocks.contains_key(&(code >> (3 * BLOCK_BITS))) {
                let found = self.of_cells.get(&code);
                let met = found.and_then(|&(first, n)| {
                    let discs = &self.discs[first as usize..(first + n) as usize];
                    nearest(discs, from, direction, RADIUS * self.cell, [start, end])
                });
                if met.is_some() {
                    return met;
                }
                self.leave(from, direction, inverse, cell, 0)
            } else {
                self.leave(from, direction, inverse, cell, BLOCK_BITS)
            };
            // Rounding must not stop the ray.
            along = leave.max(along) + NUDGE * self.cell;
        }
        None
    }

    /// The part of a ray that lies in the box of the surface.
    fn within_bounds(
        &self,
        from: [f32; 3],
        inverse: [f32; 3],
        mut start: f32,
        mut end: f32,
    ) -> Option<(f32, f32)> {
        for a in 0..3 {
            let [low, high] = [0, 1].map(|side| self.bounds[side][a] - from[a]);
            if inverse[a].is_finite() {
                let (one, other) = (low * inverse[a], high * inverse[a]);
                start = start.max(one.min(other));
                end = end.min(one.max(other));
            } else if low > 0.0 || high < 0.0 {
                return None;
            }
        }
        (start < end).then_some((start, end))
    }

    /// Distance at which a ray leaves a cell, or the block of `2^bits` cells that it lies in.
    fn leave(
        &self,
        from: [f32; 3],
        direction: [f32; 3],
        inverse: [f32; 3],
        cell: [i32; 3],
        bits: u32,
    ) -> f32 {
        let along = |a: usize| {
            if !inverse[a].is_finite() {
                return f32::MAX;
            }
            let low = cell[a] >> bits << bits;
            let face = if direction[a] > 0.0 { low + (1 << bits) } else { low };
            (face as f32 * self.cell - from[a]) * inverse[a]
        };
        along(0).min(along(1)).min(along(2))
    }
}

/// The axis that a normal is nearest to, twice, plus one where it points down that axis.
fn facing(normal: [f32; 3]) -> Option<u8> {
    let size = normal.map(f32::abs);
    let axis = crate::vector::largest(size);
    (size[axis] > 0.0).then(|| 2 * axis as u8 + u8::from(normal[axis] < 0.0))
}

/// Mean position and direction of some points.
fn disc(points: impl Iterator<Item = usize>, positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Disc {
    let (mut n, mut middle, mut normal) = (0.0_f32, [0.0; 3], [0.0; 3]);
    for i in points {
        n += 1.0;
        middle = add_scaled(middle, 1.0, positions[i]);
        normal = add_scaled(normal, 1.0, normals[i]);
    }
    Disc { middle: middle.map(|c| c / n), normal: unit(normal) }
}

/// The first of some discs that a ray meets between two distances.
fn nearest(
    discs: &[Disc],
    from: [f32; 3],
    direction: [f32; 3],
    radius: f32,
    [start, end]: [f32; 2],
) -> Option<Met> {
    let mut best: Option<Met> = None;
    for disc in discs {
        let incidence = dot(direction, disc.normal);
        if incidence.abs() < LEAST_INCIDENCE {
            continue;
        }
        let distance = dot(minus(disc.middle, from), disc.normal) / incidence;
        let at = add_scaled(from, distance, direction);
        let is_on = squared_distance(at, disc.middle) <= radius * radius;
        if is_on && (start..end).contains(&distance) && best.is_none_or(|b| distance < b.distance) {
            best = Some(Met { distance, front: incidence < 0.0, normal: disc.normal });
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: f32 = 0.1;

    /// Points and normals of the inside of a box of 4 x 3 x 2 m about zero.
    fn room() -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let half = [2.0_f32, 1.5, 1.0];
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        for axis in 0..3 {
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            let n = |a: usize| (2.0 * half[a] / (0.4 * CELL)) as usize;
            for sign in [-1.0, 1.0] {
                for (i, j) in (0..n(u)).flat_map(|i| (0..n(v)).map(move |j| (i, j))) {
                    let mut p = [0.0; 3];
                    p[axis] = sign * half[axis];
                    p[u] = (i as f32 + 0.5) * 0.4 * CELL - half[u];
                    p[v] = (j as f32 + 0.5) * 0.4 * CELL - half[v];
                    let mut normal = [0.0; 3];
                    normal[axis] = -sign;
                    points.push(p);
                    normals.push(normal);
                }
            }
        }
        (points, normals)
    }

    #[test]
    fn rays_in_a_room_meet_its_walls_where_geometry_has_them() {
        let (points, normals) = room();
        let sight = Sight::new(&points, &normals, CELL);
        let half = [2.0_f32, 1.5, 1.0];
        let (mut rays, mut missed) = (0, 0);
        for i in 0..1000 {
            let part = |k: f32| (i as f32 * k).fract();
            let from = [part(0.618_034), part(0.754_878), part(0.569_84)].map(|c| 1.6 * c - 0.8);
            let (z, angle) = (2.0 * part(0.367_879) - 1.0, std::f32::consts::TAU * part(0.718_282));
            let r = (1.0 - z * z).sqrt();
            let direction = [r * angle.cos(), r * angle.sin(), z];
            let exits: [f32; 3] =
                std::array::from_fn(|a| (half[a].copysign(direction[a]) - from[a]) / direction[a]);
            let wanted = exits.into_iter().fold(f32::MAX, f32::min);
            rays += 1;
            // Nothing lies before the wall.
            assert_eq!(sight.first(from, direction, 0.0, wanted - 2.0 * CELL), None);
            let outside = add_scaled(from, 10.0, direction);
            let back = sight.first(outside, direction.map(|c| -c), 0.0, 10.0 - wanted + CELL);
            assert!(back.is_none_or(|met| !met.front));
            match sight.first(from, direction, 0.0, wanted + CELL) {
                Some(met) => {
                    assert!(met.front && (met.distance - wanted).abs() < 2.0 * CELL, "{met:?}");
                }
                None => missed += 1,
            }
        }
        // Between discs and where walls meet a few rays pass.
        assert!(missed * 20 < rays, "{missed} of {rays}");
    }

    #[test]
    fn both_sides_of_a_thin_board_are_seen_from_their_fronts() {
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        for i in 0..400 {
            let (x, y) = (0.05 * (i % 20) as f32 - 0.5, 0.05 * (i / 20) as f32 - 0.5);
            for z in [0.01_f32, -0.01] {
                points.push([x, y, 0.03 + z]);
                normals.push([0.0, 0.0, z.signum()]);
            }
        }
        let sight = Sight::new(&points, &normals, CELL);
        for z in [1.0_f32, -1.0] {
            let met = sight.first([0.02, 0.01, z], [0.0, 0.0, -z], 0.0, 5.0).unwrap();
            assert!(met.front);
            assert!((met.distance - (z - 0.03 - 0.01 * z).abs()).abs() < 1e-4, "{met:?}");
        }
        assert_eq!(sight.first([2.0, 0.0, 1.0], [0.0, 0.0, -1.0], 0.0, 5.0), None);
        assert_eq!(Sight::new(&[], &[], CELL).first([0.0; 3], [1.0, 0.0, 0.0], 0.0, 5.0), None);
    }
}
