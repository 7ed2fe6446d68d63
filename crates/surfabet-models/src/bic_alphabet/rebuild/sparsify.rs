//! Sparsification (eq. 3): decoded points keep a distance of epsilon.
//!
//! `R^ = { r_i in R : |r_i - r_j| >= epsilon for all r_j in R^ }`. The paper leaves open which points that is, and with
//! an order along the list of occurrences a change at its start would run through all of it. Here every point has a
//! rank of its own: points nearer to the middle of their word come first (their pose is most certain there), then those
//! of earlier occurrences. A point is kept unless one that comes before it is kept within epsilon. So a change reaches
//! only as far as chains of neighbours in ascending rank, a few points, and the result depends on the set of points
//! alone.

use super::change::{Change, Mark};
use super::grid::{CellsAround, KeptGrid, PointGrid};
use super::stamp::PlacedPoint;

/// Every occurrence's points, and which of them are kept.
#[derive(Debug, Clone)]
pub(in crate::bic_alphabet) struct Sparsified {
    pub(super) grid: PointGrid,
    pub(super) is_kept: Vec<bool>,
    /// Points of occurrences that were removed.
    pub(super) is_removed: Vec<bool>,
    /// Points of owner o are `owned[owner_starts[o]..owner_starts[o + 1]]`, as numbers in the grid.
    owner_starts: Vec<u32>,
    owned: Vec<u32>,
}

impl Sparsified {
    /// Sparsifies `points`, whose owners are below `owners`, in the order of their ranks.
    pub fn new(points: &[PlacedPoint], owners: usize, epsilon: f32) -> Self {
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.sort_unstable_by_key(|&i| points[i as usize].rank);
        let mut before = KeptGrid::default();
        before.reset(points.len(), epsilon);
        let mut is_kept = vec![false; points.len()];
        for i in order {
            let position = points[i as usize].position;
            if before.is_clear(&CellsAround::new(position, epsilon), position) {
                before.insert(position);
                is_kept[i as usize] = true;
            }
        }
        Self::from_kept(points, &is_kept, owners, epsilon)
    }

    /// Points of which it is known which are kept.
    fn from_kept(points: &[PlacedPoint], is_kept: &[bool], owners: usize, epsilon: f32) -> Self {
        let (grid, order) = PointGrid::new(points, is_kept, epsilon);
        let is_kept = order.into_iter().map(|i| is_kept[i as usize]).collect();
        let mut owner_starts = vec![0_u32; owners + 1];
        for p in &grid.points {
            owner_starts[p.owner as usize + 1] += 1;
        }
        for o in 0..owners {
            owner_starts[o + 1] += owner_starts[o];
        }
        let mut next = owner_starts.clone();
        let mut owned = vec![0; grid.points.len()];
        for (i, p) in grid.points.iter().enumerate() {
            let at = &mut next[p.owner as usize];
            owned[*at as usize] = i as u32;
            *at += 1;
        }
        let is_removed = vec![false; grid.points.len()];
        Self { grid, is_kept, is_removed, owner_starts, owned }
    }

    /// Points of an owner, as numbers in the grid.
    pub(super) fn owned_by(&self, owner: u32) -> &[u32] {
        let [from, to] = [owner, owner + 1].map(|o| self.owner_starts[o as usize] as usize);
        &self.owned[from..to]
    }

    /// The kept points, R^ of eq. 3.
    pub fn kept(&self) -> impl Iterator<Item = &PlacedPoint> {
        self.grid.points.iter().zip(&self.is_kept).filter(|(_, kept)| **kept).map(|(p, _)| p)
    }

    /// Number of kept points, M.
    pub fn count(&self) -> usize {
        self.is_kept.iter().filter(|&&kept| kept).count()
    }

    /// Applies a change without added points in place.
    pub fn remove(&mut self, change: &Change) {
        for (i, mark) in change.marked() {
            match mark {
                Mark::Removed => (self.is_removed[i], self.is_kept[i]) = (true, false),
                Mark::Kept => {
                    self.is_kept[i] = true;
                    self.grid.mark_kept(i);
                }
                Mark::Dropped => self.is_kept[i] = false,
                Mark::Unseen | Mark::Queued => {}
            }
        }
    }

    /// The state after a change.
    pub fn changed(&self, change: &Change, epsilon: f32) -> Self {
        let owners = self.owner_starts.len() - 1;
        let n = self.grid.points.len() + change.added.len();
        let (mut points, mut is_kept) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for (i, p) in self.grid.points.iter().enumerate() {
            let mark = change.mark(i);
            if mark != Mark::Removed && !self.is_removed[i] {
                points.push(*p);
                is_kept.push(mark.is_kept(self.is_kept[i]));
            }
        }
        points.extend_from_slice(&change.added);
        is_kept.extend_from_slice(change.added_kept());
        Self::from_kept(&points, &is_kept, owners, epsilon)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;

    pub const EPSILON: f32 = 0.2;

    /// Points of up to 40 owners in a cube of one metre.
    pub fn points() -> impl Strategy<Value = Vec<PlacedPoint>> {
        let one = (prop::array::uniform3(0.0_f32..1.0), 0_u32..40, any::<u32>());
        prop::collection::vec(one, 0..200).prop_map(|all| {
            let place = |(i, (position, owner, rank)): (u64, ([f32; 3], u32, u32))| PlacedPoint {
                position,
                owner,
                rank: u64::from(rank) << 32 | i,
            };
            (0..).zip(all).map(place).collect()
        })
    }

    fn squared(a: &PlacedPoint, b: &PlacedPoint) -> f32 {
        let d: [f32; 3] = std::array::from_fn(|i| a.position[i] - b.position[i]);
        d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    }

    pub fn kept_ranks(sparsified: &Sparsified) -> Vec<u64> {
        let mut ranks: Vec<u64> = sparsified.kept().map(|p| p.rank).collect();
        ranks.sort_unstable();
        ranks
    }

    proptest! {
        #[test]
        fn kept_points_are_apart_and_the_others_are_near_one_before_them(points in points()) {
            let sparsified = Sparsified::new(&points, 40, EPSILON);
            let near = |p: &PlacedPoint| {
                let others = sparsified.kept().filter(|o| o.rank < p.rank);
                others.map(|o| squared(o, p)).fold(f32::INFINITY, f32::min)
            };
            for (p, kept) in sparsified.grid.points.iter().zip(&sparsified.is_kept) {
                prop_assert_eq!(*kept, near(p) >= EPSILON * EPSILON);
            }
        }
    }
}
