//! Exact distances to the exposed surface.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::{COVERED, ClosestPoint, LIFT, Scene, to_array};
use crate::pose::Vec3;
use crate::solid::{Cell, Shape, SurfacePoint};

/// Cells of surface smaller than this are not cut further when their exposed part is searched, metres.
const SMALLEST_CELL: f64 = 1e-5;

/// A cell of surface ordered by its distance, the nearest first.
struct CellCandidate {
    distance: f64,
    cell: Cell,
    nearest: SurfacePoint,
}

impl PartialEq for CellCandidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for CellCandidate {}
impl PartialOrd for CellCandidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for CellCandidate {
    fn cmp(&self, other: &Self) -> Ordering {
        // Ties by face and parameters, so that the order is total.
        other
            .distance
            .total_cmp(&self.distance)
            .then_with(|| other.cell.face.cmp(&self.cell.face))
            .then_with(|| other.cell.low[0].total_cmp(&self.cell.low[0]))
            .then_with(|| other.cell.low[1].total_cmp(&self.cell.low[1]))
    }
}

impl Scene {
    /// The exact unsigned distance from `point` to the exposed surface, metres; NaN for a point that is not
    /// finite. See [`Scene::closest_point`] for the one case that is exact to 10 micrometres only.
    pub fn distance(&self, point: [f64; 3]) -> f64 {
        self.closest_point(point).map_or(f64::NAN, |c| c.distance)
    }

    /// The nearest point of the exposed surface; `None` for a point that is not finite.
    ///
    /// Where the nearest point of a solid is covered by another one, the faces of the solid are cut into cells, and
    /// these are searched best first for the nearest exposed point, down to 10 micrometres: such a query lies inside
    /// a solid, nearest to the rim of a contact. Spheres touch others in single points only and are never cut.
    pub fn closest_point(&self, point: [f64; 3]) -> Option<ClosestPoint> {
        let p = Vec3::from(point);
        if !p.iter().all(|c| c.is_finite()) {
            return None;
        }
        let mut nearest: Option<(usize, SurfacePoint)> = None;
        let mut covered = Vec::new();
        let local = |s: usize| (self.inverses[s] * nalgebra::Point3::from(p)).coords;
        let bound = self.hierarchy.near(&p, f64::INFINITY, |s, best| {
            let solid = &self.solids[s];
            let (signed, on) = solid.shape.closest(&local(s));
            let found = signed.abs();
            if found > best {
                return best;
            }
            if !(matches!(solid.shape, Shape::Sphere(_)) || self.exposed(s, &on)) {
                covered.push((found, s));
                return best;
            }
            if found < best || nearest.is_some_and(|n| s < n.0) {
                nearest = Some((s, on));
            }
            found
        });
        // Only what is nearer than the bound has to be searched, so the cells to cut are few.
        let mut distance = bound;
        covered.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (least, s) in covered {
            if least >= distance {
                break;
            }
            if let Some((found, on)) = self.closest_exposed(s, &local(s), distance)
                && found < distance
            {
                (distance, nearest) = (found, Some((s, on)));
            }
        }
        let (s, on) = nearest?;
        let (point, normal) = self.to_world(s, &on);
        Some(ClosestPoint {
            distance,
            point: to_array(&point),
            normal: to_array(&normal),
            instance: self.solids[s].instance,
            surface: self.surface(s, &on),
        })
    }

    /// The exposed point of solid `s` nearest to `p` (in the frame of the solid), when nearer than `limit`.
    fn closest_exposed(&self, s: usize, p: &Vec3, limit: f64) -> Option<(f64, SurfacePoint)> {
        let solid = &self.solids[s];
        let shape = &solid.shape;
        let candidate = |cell: Cell| {
            let nearest = shape.at(cell.face, shape.closest_in_cell(&cell, p));
            CellCandidate { distance: (nearest.point - p).norm(), cell, nearest }
        };
        let mut queue: BinaryHeap<CellCandidate> = (0..shape.faces())
            .filter(|face| solid.hidden & (1 << face) == 0)
            .flat_map(|face| shape.cells(face))
            .map(candidate)
            .collect();
        while let Some(CellCandidate { distance, cell, nearest }) = queue.pop() {
            if distance >= limit {
                return None;
            }
            let radius = shape.cell_radius(&cell);
            if radius < SMALLEST_CELL || self.exposed(s, &nearest) {
                return Some((distance, nearest));
            }
            let middle: [f64; 2] = std::array::from_fn(|k| 0.5 * (cell.low[k] + cell.high[k]));
            if self.wholly_covered(s, &cell) {
                continue;
            }
            for (u, v) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let half = |k: usize, upper: usize| {
                    if upper == 1 { (middle[k], cell.high[k]) } else { (cell.low[k], middle[k]) }
                };
                let ((u0, u1), (v0, v1)) = (half(0, u), half(1, v));
                queue.push(candidate(Cell { face: cell.face, low: [u0, v0], high: [u1, v1] }));
            }
        }
        None
    }

    /// True when one other solid, being convex, covers all of a cell of surface.
    fn wholly_covered(&self, s: usize, cell: &Cell) -> bool {
        let solid = &self.solids[s];
        let middle = std::array::from_fn(|k| 0.5 * (cell.low[k] + cell.high[k]));
        let (centre, normal) = self.to_world(s, &solid.shape.at(cell.face, middle));
        let lift = normal * LIFT;
        let hull: Vec<Vec3> = solid
            .shape
            .hull(cell)
            .iter()
            .map(|p| (solid.frame * nalgebra::Point3::from(*p)).coords + lift)
            .collect();
        self.hierarchy.any_at(&(centre + lift), |other| {
            other != s && hull.iter().all(|p| self.depth_in(other, p) > COVERED)
        })
    }
}
