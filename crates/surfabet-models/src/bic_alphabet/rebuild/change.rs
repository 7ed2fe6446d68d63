//! Which points change from kept to dropped or back (eq. 3) when occurrences are added or removed.
//!
//! Points are decided in the order of their ranks. The removed points let in points that they kept out, and each point
//! whose decision flips puts the points of larger rank within epsilon in the queue: a newly kept one those kept so
//! far, a dropped one those dropped so far.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::grid::{CellsAround, KeptGrid};
use super::sparsify::Sparsified;
use super::stamp::PlacedPoint;

/// What the change under way has to do with a point of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Mark {
    /// Nothing so far: as before.
    Unseen,
    /// Waits to be decided.
    Queued,
    /// Its owner is removed.
    Removed,
    /// Decided: not kept.
    Dropped,
    /// Decided: kept.
    Kept,
}

impl Mark {
    /// Whether a point with this mark is kept, given whether it was.
    #[inline]
    pub fn is_kept(self, was_kept: bool) -> bool {
        if self == Self::Unseen { was_kept } else { self == Self::Kept }
    }
}

/// A point that is no longer kept, or newly kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::bic_alphabet) struct Flip {
    pub position: [f32; 3],
    pub owner: u32,
    /// Newly kept.
    pub is_kept: bool,
}

/// What a change of a few occurrences does to the kept points. Applied or forgotten; reused for the next.
#[derive(Debug, Clone, Default)]
pub(in crate::bic_alphabet) struct Change {
    /// Points to add, in the order of their ranks: set before [`Sparsified::change`].
    pub added: Vec<PlacedPoint>,
    /// Points whose decision flips.
    pub flips: Vec<Flip>,
    /// Decisions on the first of `added`.
    added_kept: Vec<bool>,
    /// By point of the grid.
    marks: Vec<Mark>,
    /// Points whose mark is not [`Mark::Unseen`].
    marked: Vec<u32>,
    /// Points that became kept in this change.
    newly_kept: KeptGrid,
    /// Rank and number of the points of the grid to decide.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    /// Points of larger rank within epsilon of the one under decision.
    later: Vec<u32>,
}

/// The point to decide next.
struct Turn {
    point: PlacedPoint,
    /// Its number in the grid; `None` for an added one.
    index: Option<u32>,
    was_kept: bool,
}

impl Change {
    /// Number of newly kept points less that of points no longer kept.
    pub fn balance(&self) -> i64 {
        self.flips.iter().map(|flip| if flip.is_kept { 1 } else { -1 }).sum()
    }

    /// Which of the added points are kept.
    pub(super) fn added_kept(&self) -> &[bool] {
        &self.added_kept
    }

    /// The mark of a point of the grid.
    pub(super) fn mark(&self, point: usize) -> Mark {
        self.marks[point]
    }

    /// Points of the grid that the change has to do with.
    pub(super) fn marked(&self) -> impl Iterator<Item = (usize, Mark)> {
        self.marked.iter().map(|&i| (i as usize, self.marks[i as usize]))
    }

    /// Forgets the change before, but for the added points of the next.
    fn reset(&mut self, points: usize, epsilon: f32) {
        self.flips.clear();
        self.queue.clear();
        self.added_kept.clear();
        for i in self.marked.drain(..) {
            self.marks[i as usize] = Mark::Unseen;
        }
        self.marks.resize(points, Mark::Unseen);
        self.newly_kept.reset(self.added.len(), epsilon);
    }

    /// The point of the smallest rank among the added ones and the queue.
    fn next(&mut self, sparsified: &Sparsified) -> Option<Turn> {
        let added = self.added.get(self.added_kept.len());
        match (added, self.queue.peek()) {
            (None, None) => None,
            (Some(&point), queued)
                if queued.is_none_or(|Reverse((rank, _))| point.rank <= *rank) =>
            {
                Some(Turn { point, index: None, was_kept: false })
            }
            _ => {
                let Reverse((_, i)) = self.queue.pop()?;
                let (point, was_kept) =
                    (sparsified.grid.points[i as usize], sparsified.is_kept[i as usize]);
                Some(Turn { point, index: Some(i), was_kept })
            }
        }
    }
}

impl Sparsified {
    /// Computes in `change` what happens to the kept points when all points of the owners in `removed` are removed and
    /// those in `change.added` are added.
    pub fn change(&self, removed: &[u32], epsilon: f32, change: &mut Change) {
        change.reset(self.grid.points.len(), epsilon);
        self.mark_removed(removed, change);
        self.queue_points_let_in(epsilon, change);
        while let Some(turn) = change.next(self) {
            self.decide(&turn, epsilon, change);
        }
    }

    fn mark_removed(&self, removed: &[u32], change: &mut Change) {
        let owned = removed.iter().flat_map(|&owner| self.owned_by(owner));
        for &i in owned.filter(|&&i| !self.is_removed[i as usize]) {
            change.marks[i as usize] = Mark::Removed;
            change.marked.push(i);
        }
    }

    /// Queues the points that a removed one may have kept out.
    fn queue_points_let_in(&self, epsilon: f32, change: &mut Change) {
        let Change { marks, marked, queue, flips, .. } = change;
        for k in 0..marked.len() {
            let i = marked[k] as usize;
            if !self.is_kept[i] {
                continue;
            }
            let p = self.grid.points[i];
            flips.push(Flip { position: p.position, owner: p.owner, is_kept: false });
            let cells = CellsAround::new(p.position, epsilon);
            self.grid.visit_near(&cells, p.position, false, |o, other| {
                let waits = !self.is_kept[o] && !self.is_removed[o] && marks[o] == Mark::Unseen;
                if waits && other.rank > p.rank {
                    marks[o] = Mark::Queued;
                    marked.push(o as u32);
                    queue.push(Reverse((other.rank, o as u32)));
                }
                true
            });
        }
    }

    /// Eq. 3 for one point: it is kept unless a point of smaller rank is kept within epsilon, all of which are decided
    /// by now. Where that flips the point, those that it affects are queued.
    #[inline]
    fn decide(&self, turn: &Turn, epsilon: f32, change: &mut Change) {
        let Change { flips, added_kept, marks, marked, newly_kept, queue, later, .. } = change;
        let &Turn { point, index, was_kept } = turn;
        let cells = CellsAround::new(point.position, epsilon);
        // Points newly kept so far have smaller ranks.
        let mut is_kept = newly_kept.is_clear(&cells, point.position);
        later.clear();
        if is_kept || was_kept {
            // A point that was not kept has to do with kept points only.
            self.grid.visit_near(&cells, point.position, !was_kept, |o, other| {
                if other.rank > point.rank {
                    later.push(o as u32);
                    return true;
                }
                is_kept &= !(marks[o].is_kept(self.is_kept[o]) && other.rank < point.rank);
                is_kept || was_kept
            });
        }
        match index {
            Some(i) => marks[i as usize] = if is_kept { Mark::Kept } else { Mark::Dropped },
            None => added_kept.push(is_kept),
        }
        if is_kept == was_kept {
            return;
        }
        if is_kept {
            newly_kept.insert(point.position);
        }
        flips.push(Flip { position: point.position, owner: point.owner, is_kept });
        for &o in later.iter() {
            let at = o as usize;
            // A newly kept point may drop those kept, a dropped one may let in those dropped.
            if marks[at] == Mark::Unseen && !self.is_removed[at] && self.is_kept[at] == is_kept {
                marks[at] = Mark::Queued;
                marked.push(o);
                queue.push(Reverse((self.grid.points[at].rank, o)));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::sparsify::tests::{EPSILON, kept_ranks, points};
    use super::*;

    proptest! {
        #[test]
        fn a_change_gives_what_starting_over_gives(
            before in points(),
            after in points(),
            removed in prop::collection::btree_set(0_u32..40, 0..12),
        ) {
            let removed: Vec<u32> = removed.into_iter().collect();
            let is_removed = |p: &PlacedPoint| removed.contains(&p.owner);
            let shifted = after.into_iter().filter(|p| is_removed(p));
            let mut added: Vec<PlacedPoint> =
                shifted.map(|p| PlacedPoint { rank: p.rank | 1 << 31, ..p }).collect();
            added.sort_by_key(|p| p.rank);
            let sparsified = Sparsified::new(&before, 40, EPSILON);
            let mut change = Change::default();
            // One that is forgotten leaves nothing behind.
            sparsified.change(&[1, 2, 3], EPSILON, &mut change);
            change.added.clone_from(&added);
            sparsified.change(&removed, EPSILON, &mut change);
            let balance = change.balance();
            let found = sparsified.changed(&change, EPSILON);
            let rest: Vec<PlacedPoint> = before.iter().copied().filter(|p| !is_removed(p)).collect();
            let expected = Sparsified::new(&[rest, added].concat(), 40, EPSILON);
            prop_assert_eq!(kept_ranks(&found), kept_ranks(&expected));
            prop_assert_eq!(found.count() as i64, sparsified.count() as i64 + balance);
        }

        #[test]
        fn owners_taken_out_one_by_one_leave_what_starting_over_gives(
            before in points(),
            removed in prop::collection::vec(0_u32..40, 0..12),
        ) {
            let mut sparsified = Sparsified::new(&before, 40, EPSILON);
            let mut change = Change::default();
            for &owner in &removed {
                sparsified.change(&[owner], EPSILON, &mut change);
                sparsified.remove(&change);
            }
            let rest: Vec<PlacedPoint> =
                before.iter().copied().filter(|p| !removed.contains(&p.owner)).collect();
            prop_assert_eq!(kept_ranks(&sparsified), kept_ranks(&Sparsified::new(&rest, 40, EPSILON)));
        }
    }
}
