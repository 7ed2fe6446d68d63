//! Sparsification (eq. 3): decoded points keep a distance of epsilon.
//!
//! The paper leaves the order open, and with an order along the list of occurrences a change at its start would run
//! through all of it. Here every point has a rank of its own: points nearer to the middle of their word come first
//! (their pose is most certain there), then those of earlier occurrences. A point is kept unless one that
//! comes before it is kept within epsilon. So a change reaches only as far as chains of neighbours in descending rank,
//! a few points, and the result depends on the set of points alone.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::bic_alphabet::pose::Frame;
use crate::bic_alphabet::rebuild::grid::{Arena, Block, Taken};
use crate::bic_alphabet::words::{BicWord, point_step};

/// A point of an occurrence, in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placed {
    pub position: [f32; 3],
    /// Smaller comes first; no two points have the same.
    pub rank: u64,
    /// The feature or occurrence that it belongs to.
    pub owner: u32,
}

/// A word ready to be placed: its points that may appear (see [`BicWord::thinned`]) in metres, with what they
/// contribute to the rank.
#[derive(Debug, Clone)]
pub(crate) struct Stamp {
    points: Vec<([f32; 3], u64)>,
}

impl Stamp {
    pub fn new(word: &BicWord, radius: f64, epsilon: f64) -> Self {
        let step = point_step(radius);
        let metres = |k: u16| word.points[usize::from(k)].map(|c| (f64::from(c) * step) as f32);
        let kept = word.thinned(radius, epsilon);
        let points = kept
            .into_iter()
            .map(|k| (metres(k), u64::from(word.ring(k)) << 48 | u64::from(k)))
            .collect();
        Self { points }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Appends the points at all frames of `owners`, which ascend, in the order of their ranks.
    pub fn place(&self, frames: &[Frame], owners: &[u32], out: &mut Vec<Placed>) {
        out.reserve(self.len() * owners.len());
        for ring in self.points.chunk_by(|a, b| a.1 >> 48 == b.1 >> 48) {
            for &owner in owners {
                let frame = &frames[owner as usize];
                out.extend(ring.iter().map(|&(q, of)| Placed {
                    position: frame.place(q),
                    rank: of | u64::from(owner) << 16,
                    owner,
                }));
            }
        }
    }
}

/// Every occurrence's points, and which of them are kept.
#[derive(Debug, Clone)]
pub(crate) struct Sparse {
    pub arena: Arena,
    pub kept: Vec<bool>,
    /// Points of occurrences that were taken out.
    gone: Vec<bool>,
    /// Points of each owner.
    owner_starts: Vec<u32>,
    owned: Vec<u32>,
}

/// Not seen in the change under way.
const UNSEEN: u8 = 0;
/// Waits for its turn.
const QUEUED: u8 = 1;
/// Its owner is taken out.
const REMOVED: u8 = 2;
/// Decided: not kept.
const DROPPED: u8 = 3;
/// Decided: kept.
const KEPT: u8 = 4;

/// What a change of a few occurrences does to the kept points. Applied or forgotten; reused for the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct Change {
    marks: Vec<u8>,
    seen: Vec<u32>,
    /// Points that come, in the order of their ranks.
    pub added: Vec<Placed>,
    added_kept: Vec<bool>,
    taken: Taken,
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    /// Points that are no longer kept (false) or newly kept (true), with their owners.
    pub flips: Vec<([f32; 3], u32, bool)>,
}

impl Change {
    /// Newly kept less no longer kept.
    pub fn balance(&self) -> i64 {
        self.flips.iter().map(|f| if f.2 { 1 } else { -1 }).sum()
    }
}

impl Sparse {
    /// Sparsifies `points`, whose owners are below `owners`.
    pub fn new(points: &[Placed], owners: usize, epsilon: f32) -> Self {
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.sort_unstable_by_key(|&i| points[i as usize].rank);
        let mut taken = Taken::default();
        taken.reset(points.len(), epsilon);
        let mut kept = vec![false; points.len()];
        for i in order {
            let position = points[i as usize].position;
            if taken.is_clear(&Block::about(position, epsilon), position) {
                taken.take(position);
                kept[i as usize] = true;
            }
        }
        let (arena, order) = Arena::new(points, &kept, epsilon);
        let kept = order.into_iter().map(|i| kept[i as usize]).collect();
        Self::from_kept(arena, kept, owners)
    }

    fn from_kept(arena: Arena, kept: Vec<bool>, owners: usize) -> Self {
        let mut owner_starts = vec![0_u32; owners + 1];
        for p in &arena.points {
            owner_starts[p.owner as usize + 1] += 1;
        }
        for o in 0..owners {
            owner_starts[o + 1] += owner_starts[o];
        }
        let mut next = owner_starts.clone();
        let mut owned = vec![0; arena.points.len()];
        for (i, p) in arena.points.iter().enumerate() {
            let at = &mut next[p.owner as usize];
            owned[*at as usize] = i as u32;
            *at += 1;
        }
        let gone = vec![false; arena.points.len()];
        Self { arena, kept, gone, owner_starts, owned }
    }

    /// Points of an owner.
    fn of(&self, owner: u32) -> &[u32] {
        let [from, to] = [owner, owner + 1].map(|o| self.owner_starts[o as usize] as usize);
        &self.owned[from..to]
    }

    /// Works out what happens to the kept points when all points of the owners in `removed` go and those that stand in
    /// `change.added` come.
    pub fn change(&self, removed: &[u32], epsilon: f32, change: &mut Change) {
        let Change { marks, seen, added, added_kept, taken, queue, flips } = change;
        flips.clear();
        queue.clear();
        // A change that was forgotten leaves its marks only where it says.
        seen.drain(..).for_each(|i| marks[i as usize] = UNSEEN);
        marks.resize(self.arena.points.len(), UNSEEN);
        for &i in removed.iter().flat_map(|&o| self.of(o)).filter(|&&i| !self.gone[i as usize]) {
            marks[i as usize] = REMOVED;
            seen.push(i);
        }
        // Points that one which goes may have kept out come back into play.
        for k in 0..seen.len() {
            let i = seen[k] as usize;
            if !self.kept[i] {
                continue;
            }
            let p = self.arena.points[i];
            flips.push((p.position, p.owner, false));
            let block = Block::about(p.position, epsilon);
            self.arena.near(&block, p.position, false, |o, other| {
                let waits = !self.kept[o] && !self.gone[o] && marks[o] == UNSEEN;
                if waits && other.rank > p.rank {
                    marks[o] = QUEUED;
                    seen.push(o as u32);
                    queue.push(Reverse((other.rank, o as u32)));
                }
                true
            });
        }
        taken.reset(added.len(), epsilon);
        added_kept.clear();
        let mut behind: Vec<u32> = Vec::new();
        loop {
            // The first of those added and of those in play.
            let come = added.get(added_kept.len());
            let in_play = match (come, queue.peek()) {
                (Some(p), Some(Reverse((rank, i)))) if *rank < p.rank => Some(*i),
                (None, Some(Reverse((_, i)))) => Some(*i),
                (None, None) => break,
                _ => None,
            };
            let (p, before) = match (in_play, come) {
                (Some(i), _) => {
                    queue.pop();
                    (self.arena.points[i as usize], self.kept[i as usize])
                }
                (None, Some(p)) => (*p, false),
                (None, None) => break,
            };
            // Those taken so far come before this one.
            let block = Block::about(p.position, epsilon);
            let mut clear = taken.is_clear(&block, p.position);
            behind.clear();
            if clear || before {
                // One that comes has to do with kept points only.
                self.arena.near(&block, p.position, !before, |o, other| {
                    if other.rank > p.rank {
                        behind.push(o as u32);
                        return true;
                    }
                    let kept = match marks[o] {
                        UNSEEN => self.kept[o],
                        mark => mark == KEPT,
                    };
                    clear &= !(kept && other.rank < p.rank);
                    clear || before
                });
            }
            match in_play {
                Some(i) => marks[i as usize] = if clear { KEPT } else { DROPPED },
                None => added_kept.push(clear),
            }
            if clear == before {
                continue;
            }
            if clear {
                taken.take(p.position);
            }
            flips.push((p.position, p.owner, clear));
            for &o in &behind {
                let at = o as usize;
                // A point that comes kicks out those kept, one that goes lets in those kept out.
                if marks[at] == UNSEEN && !self.gone[at] && self.kept[at] == clear {
                    marks[at] = QUEUED;
                    seen.push(o);
                    queue.push(Reverse((self.arena.points[at].rank, o)));
                }
            }
        }
    }

    /// Makes a change without added points real.
    pub fn remove(&mut self, change: &Change) {
        for &i in &change.seen {
            let at = i as usize;
            match change.marks[at] {
                REMOVED => (self.gone[at], self.kept[at]) = (true, false),
                KEPT => {
                    self.kept[at] = true;
                    self.arena.keep(at);
                }
                DROPPED => self.kept[at] = false,
                _ => {}
            }
        }
    }

    /// The state after a change.
    pub fn changed(&self, change: &Change, epsilon: f32) -> Self {
        let owners = self.owner_starts.len() - 1;
        let n = self.arena.points.len() + change.added.len();
        let (mut points, mut kept) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for (i, p) in self.arena.points.iter().enumerate() {
            let mark = change.marks[i];
            if mark != REMOVED && !self.gone[i] {
                points.push(*p);
                kept.push(if mark == UNSEEN { self.kept[i] } else { mark == KEPT });
            }
        }
        points.extend_from_slice(&change.added);
        kept.extend_from_slice(&change.added_kept);
        let (arena, order) = Arena::new(&points, &kept, epsilon);
        let kept = order.into_iter().map(|i| kept[i as usize]).collect();
        Self::from_kept(arena, kept, owners)
    }

    /// Number of kept points, M.
    pub fn count(&self) -> usize {
        self.kept.iter().filter(|&&k| k).count()
    }
}

/// The points of a scene rebuilt from occurrences (eq. 2, 3): the frame of each, and the number of its stamp.
pub(crate) fn rebuild(frames: &[Frame], words: &[u32], stamps: &[Stamp], epsilon: f32) -> Sparse {
    let mut owners: Vec<Vec<u32>> = vec![Vec::new(); stamps.len()];
    for (o, &word) in (0..).zip(words) {
        if let Some(owners) = owners.get_mut(word as usize) {
            owners.push(o);
        }
    }
    let mut points = Vec::new();
    for (stamp, owners) in stamps.iter().zip(&owners) {
        stamp.place(frames, owners, &mut points);
    }
    Sparse::new(&points, words.len(), epsilon)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const EPSILON: f32 = 0.2;

    /// Points of up to 40 owners in a cube of one metre.
    fn points() -> impl Strategy<Value = Vec<Placed>> {
        let one = (prop::array::uniform3(0.0_f32..1.0), 0_u32..40, any::<u32>());
        prop::collection::vec(one, 0..200).prop_map(|all| {
            let place = |(i, (position, owner, rank)): (u64, ([f32; 3], u32, u32))| Placed {
                position,
                owner,
                rank: u64::from(rank) << 32 | i,
            };
            (0..).zip(all).map(place).collect()
        })
    }

    fn squared(a: &Placed, b: &Placed) -> f32 {
        let d: [f32; 3] = std::array::from_fn(|i| a.position[i] - b.position[i]);
        d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    }

    fn kept_ranks(sparse: &Sparse) -> Vec<u64> {
        let pairs = sparse.arena.points.iter().zip(&sparse.kept);
        let mut ranks: Vec<u64> = pairs.filter(|(_, k)| **k).map(|(p, _)| p.rank).collect();
        ranks.sort_unstable();
        ranks
    }

    proptest! {
        #[test]
        fn kept_points_are_apart_and_the_others_are_near_one_before_them(points in points()) {
            let sparse = Sparse::new(&points, 40, EPSILON);
            let near = |p: &Placed| {
                let pairs = sparse.arena.points.iter().zip(&sparse.kept);
                let others = pairs.filter(|(o, k)| **k && o.rank < p.rank);
                others.map(|(o, _)| squared(o, p)).fold(f32::INFINITY, f32::min)
            };
            for (p, kept) in sparse.arena.points.iter().zip(&sparse.kept) {
                prop_assert_eq!(*kept, near(p) >= EPSILON * EPSILON);
            }
        }

        #[test]
        fn a_change_gives_what_starting_over_gives(
            before in points(),
            after in points(),
            removed in prop::collection::btree_set(0_u32..40, 0..12),
        ) {
            let removed: Vec<u32> = removed.into_iter().collect();
            let is_removed = |p: &Placed| removed.contains(&p.owner);
            let shifted = after.into_iter().filter(|p| is_removed(p));
            let mut added: Vec<Placed> =
                shifted.map(|p| Placed { rank: p.rank | 1 << 31, ..p }).collect();
            added.sort_by_key(|p| p.rank);
            let sparse = Sparse::new(&before, 40, EPSILON);
            let mut change = Change::default();
            // One that is forgotten leaves nothing behind.
            sparse.change(&[1, 2, 3], EPSILON, &mut change);
            change.added.clone_from(&added);
            sparse.change(&removed, EPSILON, &mut change);
            let balance = change.balance();
            let found = sparse.changed(&change, EPSILON);
            let rest: Vec<Placed> = before.iter().copied().filter(|p| !is_removed(p)).collect();
            let expected = Sparse::new(&[rest, added].concat(), 40, EPSILON);
            prop_assert_eq!(kept_ranks(&found), kept_ranks(&expected));
            prop_assert_eq!(found.count() as i64, sparse.count() as i64 + balance);
        }

        #[test]
        fn owners_taken_out_one_by_one_leave_what_starting_over_gives(
            before in points(),
            removed in prop::collection::vec(0_u32..40, 0..12),
        ) {
            let mut sparse = Sparse::new(&before, 40, EPSILON);
            let mut change = Change::default();
            for &owner in &removed {
                sparse.change(&[owner], EPSILON, &mut change);
                sparse.remove(&change);
            }
            let rest: Vec<Placed> =
                before.iter().copied().filter(|p| !removed.contains(&p.owner)).collect();
            prop_assert_eq!(kept_ranks(&sparse), kept_ranks(&Sparse::new(&rest, 40, EPSILON)));
        }
    }
}
