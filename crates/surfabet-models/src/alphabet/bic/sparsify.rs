//! Sparsification (eq. 3): decoded points keep a distance of epsilon.
//!
//! The paper leaves the order open, and with an order along the list of occurrences a change at its start would run
//! through all of it. Here every point has a rank of its own: points nearer to the middle of their word come first
//! (their pose is most certain there), then occurrences in a random but fixed order. A point is kept unless one that
//! comes before it is kept within epsilon. So a change reaches only as far as chains of neighbours in descending rank,
//! a few points, and the result depends on the set of points alone.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::pose::{Frame, ranks};
use super::words::{BicWord, point_step};

/// A point of an occurrence, in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placed {
    pub position: [f32; 3],
    /// Smaller comes first; no two points have the same.
    pub rank: u64,
    /// The feature or occurrence that it belongs to.
    pub owner: u32,
}

/// A word ready to be placed: its points that may appear (see [`BicWord::thinned`]) in metres, with what they
/// contribute to the rank.
#[derive(Debug, Clone)]
pub(super) struct Stamp {
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

    /// The points at a frame; `rank` is that of the occurrence.
    pub fn place(
        &self,
        frame: &Frame,
        owner: u32,
        rank: u32,
    ) -> impl Iterator<Item = Placed> + use<'_> {
        let frame = *frame;
        self.points.iter().map(move |&(q, of)| Placed {
            position: frame.place(q),
            rank: of | u64::from(rank) << 16,
            owner,
        })
    }
}

/// Points in buckets by cell, for looking about within epsilon.
#[derive(Debug, Clone, Default)]
pub(super) struct Arena {
    /// Bucket after bucket.
    pub points: Vec<Placed>,
    starts: Vec<u32>,
    shift: u32,
    per_metre: f32,
}

/// Odd factors that scatter the three coordinates of a cell.
const FACTORS: [u32; 3] = [0x9e37_79b1, 0x85eb_ca77, 0xc2b2_ae3d];

impl Arena {
    pub fn new(points: &[Placed], epsilon: f32) -> Self {
        Self::arranged(points, epsilon).0
    }

    /// Also tells which of `points` each of the arena's is.
    fn arranged(points: &[Placed], epsilon: f32) -> (Self, Vec<u32>) {
        let bits = usize::BITS - (2 * points.len()).leading_zeros();
        let bits = bits.clamp(4, 30);
        let mut arena = Self {
            points: Vec::new(),
            starts: vec![0; (1 << bits) + 1],
            shift: u32::BITS - bits,
            // Cells of slightly more than two epsilon: what is nearer than epsilon lies in a block of two by two by two.
            per_metre: 0.499 / epsilon,
        };
        let buckets: Vec<u32> = points.iter().map(|p| arena.bucket(p.position)).collect();
        for &b in &buckets {
            arena.starts[b as usize + 1] += 1;
        }
        for b in 0..1 << bits {
            arena.starts[b + 1] += arena.starts[b];
        }
        let mut next = arena.starts.clone();
        let mut order = vec![0_u32; points.len()];
        for (i, &b) in buckets.iter().enumerate() {
            order[next[b as usize] as usize] = i as u32;
            next[b as usize] += 1;
        }
        arena.points = order.iter().map(|&i| points[i as usize]).collect();
        (arena, order)
    }

    fn bucket(&self, position: [f32; 3]) -> u32 {
        let part = |a: usize| {
            let cell = (position[a] * self.per_metre).floor() as i32 as u32;
            cell.wrapping_mul(FACTORS[a])
        };
        (part(0) ^ part(1) ^ part(2)).wrapping_mul(FACTORS[0]) >> self.shift
    }

    /// Shows `visit` every point nearer than the square root of `limit`, some perhaps twice.
    #[inline]
    fn near(&self, position: [f32; 3], limit: f32, mut visit: impl FnMut(usize, &Placed)) {
        if self.points.is_empty() {
            return;
        }
        let mut parts = [[0_u32; 2]; 3];
        for a in 0..3 {
            let at = position[a] * self.per_metre;
            let cell = at.floor();
            let other = if at - cell < 0.5 { cell - 1.0 } else { cell + 1.0 };
            parts[a] = [cell, other].map(|c| (c as i32 as u32).wrapping_mul(FACTORS[a]));
        }
        for k in 0..8 {
            let mixed = parts[0][k & 1] ^ parts[1][k >> 1 & 1] ^ parts[2][k >> 2];
            let bucket = (mixed.wrapping_mul(FACTORS[0]) >> self.shift) as usize;
            let from = self.starts[bucket] as usize;
            let to = self.starts[bucket + 1] as usize;
            for (i, p) in self.points[from..to].iter().enumerate() {
                let d: [f32; 3] = std::array::from_fn(|a| p.position[a] - position[a]);
                if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < limit {
                    visit(from + i, p);
                }
            }
        }
    }
}

/// Every occurrence's points, and which of them are kept.
#[derive(Debug, Clone)]
pub(super) struct Sparse {
    pub arena: Arena,
    pub kept: Vec<bool>,
    /// Points of occurrences that were taken out.
    gone: Vec<bool>,
    /// Points of each owner.
    owner_starts: Vec<u32>,
    owned: Vec<u32>,
    limit: f32,
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
pub(super) struct Change {
    marks: Vec<u8>,
    seen: Vec<u32>,
    added: Arena,
    added_kept: Vec<bool>,
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
        let arena = Arena::new(points, epsilon);
        let n = arena.points.len();
        let mut sparse = Self::from_kept(arena, vec![false; n], owners, epsilon);
        let mut order: Vec<u32> = (0..n as u32).collect();
        order.sort_unstable_by_key(|&i| sparse.arena.points[i as usize].rank);
        for i in order {
            let p = sparse.arena.points[i as usize];
            let mut clear = true;
            sparse.arena.near(p.position, sparse.limit, |o, _| clear &= !sparse.kept[o]);
            sparse.kept[i as usize] = clear;
        }
        sparse
    }

    fn from_kept(arena: Arena, kept: Vec<bool>, owners: usize, epsilon: f32) -> Self {
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
        Self { arena, kept, gone, owner_starts, owned, limit: epsilon * epsilon }
    }

    /// Points of an owner.
    fn of(&self, owner: u32) -> &[u32] {
        let [from, to] = [owner, owner + 1].map(|o| self.owner_starts[o as usize] as usize);
        &self.owned[from..to]
    }

    /// Works out what happens to the kept points when all points of the owners in `removed` go and `added` come.
    pub fn change(&self, removed: &[u32], added: &[Placed], epsilon: f32, change: &mut Change) {
        let Change { marks, seen, added: arena, added_kept, queue, flips } = change;
        flips.clear();
        queue.clear();
        // A change that was forgotten leaves its marks only where it says.
        marks.resize(self.arena.points.len(), UNSEEN);
        seen.drain(..).for_each(|i| marks[i as usize] = UNSEEN);
        for &i in removed.iter().flat_map(|&o| self.of(o)).filter(|&&i| !self.gone[i as usize]) {
            marks[i as usize] = REMOVED;
            seen.push(i);
        }
        let base = self.arena.points.len() as u32;
        // Points that one which goes may have kept out come back into play.
        for k in 0..seen.len() {
            let i = seen[k] as usize;
            if !self.kept[i] {
                continue;
            }
            let p = self.arena.points[i];
            flips.push((p.position, p.owner, false));
            self.arena.near(p.position, self.limit, |o, other| {
                let waits = !self.kept[o] && !self.gone[o] && marks[o] == UNSEEN;
                if waits && other.rank > p.rank {
                    marks[o] = QUEUED;
                    seen.push(o as u32);
                    queue.push(Reverse((other.rank, o as u32)));
                }
            });
        }
        *arena = Arena::new(added, epsilon);
        added_kept.clear();
        added_kept.resize(arena.points.len(), false);
        let mut order: Vec<(u64, u32)> =
            arena.points.iter().zip(base..).map(|(p, i)| (p.rank, i)).collect();
        order.sort_unstable();
        let mut order = order.into_iter().peekable();
        let mut behind: Vec<u32> = Vec::new();
        loop {
            // The first of those added and of those in play.
            let (_, i) = match (order.peek(), queue.peek()) {
                (Some(a), Some(Reverse(q))) if a < q => *a,
                (Some(a), None) => *a,
                (_, Some(Reverse(q))) => *q,
                (None, None) => break,
            };
            let (p, before) = if i >= base {
                order.next();
                (arena.points[(i - base) as usize], false)
            } else {
                queue.pop();
                (self.arena.points[i as usize], self.kept[i as usize])
            };
            let mut clear = true;
            behind.clear();
            arena.near(p.position, self.limit, |o, other| {
                clear &= !(added_kept[o] && other.rank < p.rank);
            });
            self.arena.near(p.position, self.limit, |o, other| {
                if other.rank > p.rank {
                    behind.push(o as u32);
                } else if other.rank < p.rank {
                    clear &= !match marks[o] {
                        UNSEEN => self.kept[o],
                        mark => mark == KEPT,
                    };
                }
            });
            if i >= base {
                added_kept[(i - base) as usize] = clear;
            } else {
                marks[i as usize] = if clear { KEPT } else { DROPPED };
            }
            if clear == before {
                continue;
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
                KEPT => self.kept[at] = true,
                DROPPED => self.kept[at] = false,
                _ => {}
            }
        }
    }

    /// The state after a change.
    pub fn changed(&self, change: &Change, epsilon: f32) -> Self {
        let owners = self.owner_starts.len() - 1;
        let n = self.arena.points.len() + change.added.points.len();
        let (mut points, mut kept) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for (i, p) in self.arena.points.iter().enumerate() {
            let mark = change.marks[i];
            if mark != REMOVED && !self.gone[i] {
                points.push(*p);
                kept.push(if mark == UNSEEN { self.kept[i] } else { mark == KEPT });
            }
        }
        points.extend_from_slice(&change.added.points);
        kept.extend_from_slice(&change.added_kept);
        let (arena, order) = Arena::arranged(&points, epsilon);
        let kept = order.into_iter().map(|i| kept[i as usize]).collect();
        Self::from_kept(arena, kept, owners, epsilon)
    }

    /// Number of kept points, M.
    pub fn count(&self) -> usize {
        self.kept.iter().filter(|&&k| k).count()
    }
}

/// The points of a scene rebuilt from occurrences (eq. 2, 3): for each a pose, its frame, and the number of its stamp.
pub(super) fn rebuild(
    poses: &[super::pose::BicPose],
    frames: &[Frame],
    words: &[u32],
    stamps: &[Stamp],
    epsilon: f32,
) -> Sparse {
    let ranks = ranks(poses);
    let points: Vec<Placed> = (0..)
        .zip(frames.iter().zip(words))
        .filter_map(|(o, (frame, &word))| Some((o, frame, stamps.get(word as usize)?)))
        .flat_map(|(o, frame, stamp)| stamp.place(frame, o, ranks[o as usize]))
        .collect();
    Sparse::new(&points, poses.len(), epsilon)
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
            let added: Vec<Placed> =
                shifted.map(|p| Placed { rank: p.rank | 1 << 31, ..p }).collect();
            let sparse = Sparse::new(&before, 40, EPSILON);
            let mut change = Change::default();
            // One that is forgotten leaves nothing behind.
            sparse.change(&[1, 2, 3], &[], EPSILON, &mut change);
            sparse.change(&removed, &added, EPSILON, &mut change);
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
                sparse.change(&[owner], &[], EPSILON, &mut change);
                sparse.remove(&change);
            }
            let rest: Vec<Placed> =
                before.iter().copied().filter(|p| !removed.contains(&p.owner)).collect();
            prop_assert_eq!(kept_ranks(&sparse), kept_ranks(&Sparse::new(&rest, 40, EPSILON)));
        }
    }
}
