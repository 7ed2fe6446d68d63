//! The bounding volume hierarchy over all solids: the only file that knows parry.
//!
//! parry works in single precision here; it only selects the solids that may matter. Its boxes are loosened by more
//! than any rounding, and the solids themselves are asked in double precision.

use std::cell::Cell;

use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

use crate::pose::Vec3;

/// Margin about every solid, metres: above the rounding of `f32` coordinates up to a kilometre.
const MARGIN: f64 = 1e-3;

#[derive(Debug)]
pub(crate) struct Hierarchy {
    bvh: Bvh,
}

/// A cost that parry compares, never below the true one.
fn rounded_up(cost: f64) -> f32 {
    (cost * (1.0 + 1e-6) + 1e-6) as f32
}

impl Hierarchy {
    /// `boxes`: lower and upper corner per solid.
    pub(crate) fn new(boxes: &[(Vec3, Vec3)]) -> Self {
        let corner = |v: Vec3| Vector::new(v.x as f32, v.y as f32, v.z as f32);
        let margin = Vec3::repeat(MARGIN);
        let leaves: Vec<Aabb> = boxes
            .iter()
            .map(|(low, high)| Aabb::new(corner(low - margin), corner(high + margin)))
            .collect();
        Self { bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves) }
    }

    /// Calls `visit(solid, best)` for every solid that a ray may meet before `best`, near ones first; `visit`
    /// returns the new best distance. Returns the last one.
    pub(crate) fn along_ray(
        &self,
        origin: &Vec3,
        direction: &Vec3,
        limit: f64,
        mut visit: impl FnMut(usize, f64) -> f64,
    ) -> f64 {
        let o: [f32; 3] = std::array::from_fn(|a| origin[a] as f32);
        // An infinite inverse would give NaN on the faces of a box; a huge finite one does not.
        let inverse: [f32; 3] =
            std::array::from_fn(|a| (1.0 / direction[a]).clamp(-1e18, 1e18) as f32);
        let entry = |node: &BvhNode| {
            let (low, high) = (node.mins(), node.maxs());
            let (low, high) = ([low.x, low.y, low.z], [high.x, high.y, high.z]);
            let (mut enter, mut leave) = (0.0_f32, f32::MAX);
            for a in 0..3 {
                let (s, t) = ((low[a] - o[a]) * inverse[a], (high[a] - o[a]) * inverse[a]);
                enter = enter.max(s.min(t));
                leave = leave.min(s.max(t));
            }
            if enter <= leave { enter } else { f32::MAX }
        };
        self.search(limit, entry, &mut visit)
    }

    /// Calls `visit(solid, best)` for every solid that may lie nearer to `p` than `best`, near ones first;
    /// `visit` returns the new best distance. Returns the last one.
    pub(crate) fn near(
        &self,
        p: &Vec3,
        limit: f64,
        mut visit: impl FnMut(usize, f64) -> f64,
    ) -> f64 {
        let p: [f32; 3] = std::array::from_fn(|a| p[a] as f32);
        let gap = |node: &BvhNode| {
            let (low, high) = (node.mins(), node.maxs());
            let (low, high) = ([low.x, low.y, low.z], [high.x, high.y, high.z]);
            let square: f32 =
                (0..3).map(|a| (low[a] - p[a]).max(p[a] - high[a]).max(0.0)).map(|d| d * d).sum();
            square.sqrt()
        };
        self.search(limit, gap, &mut visit)
    }

    /// True when `test` holds for a solid whose box contains `p`.
    pub(crate) fn any_at(&self, p: &Vec3, mut test: impl FnMut(usize) -> bool) -> bool {
        let p: [f32; 3] = std::array::from_fn(|a| p[a] as f32);
        let inside = |node: &BvhNode| {
            let (low, high) = (node.mins(), node.maxs());
            (low.x <= p[0] && p[0] <= high.x)
                && (low.y <= p[1] && p[1] <= high.y)
                && (low.z <= p[2] && p[2] <= high.z)
        };
        self.bvh.leaves(inside).any(|leaf| test(leaf as usize))
    }

    fn search(
        &self,
        limit: f64,
        bound: impl Fn(&BvhNode) -> f32,
        visit: &mut dyn FnMut(usize, f64) -> f64,
    ) -> f64 {
        let best = Cell::new(limit);
        let visit = std::cell::RefCell::new(visit);
        self.bvh.find_best(
            rounded_up(limit).min(f32::MAX),
            |node, _| bound(node),
            |leaf, _| {
                // The closure is never entered twice: parry calls it from one loop.
                let found = (visit.borrow_mut())(leaf as usize, best.get());
                let better = found < best.get();
                best.set(found);
                better.then(|| rounded_up(found))
            },
        );
        best.get()
    }
}
