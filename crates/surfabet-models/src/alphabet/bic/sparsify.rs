//! Sparsification (eq. 3): decoded points keep a distance of epsilon.
//!
//! The paper leaves the order open, and with an order along the list of occurrences a change at its start would run
//! through all of it. Here every point has a rank of its own: points nearer to the middle of their word come first
//! (their pose is most certain there), then those of earlier occurrences. A point is kept unless one that
//! comes before it is kept within epsilon. So a change reaches only as far as chains of neighbours in descending rank,
//! a few points, and the result depends on the set of points alone.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::pose::Frame;
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

/// Cells of slightly more than two epsilon, by bucket: what is nearer than epsilon to a point lies in a block of two by
/// two by two of them. Four by four by four cells share a hash, so that neighbours in space are neighbours in memory.
#[derive(Debug, Clone, Copy, Default)]
struct Cells {
    per_metre: f32,
    /// Of 32-bit hashes to the number of groups of cells.
    shift: u32,
}

/// Odd factors that scatter the three coordinates of a group of cells.
const FACTORS: [u32; 3] = [0x9e37_79b1, 0x85eb_ca77, 0xc2b2_ae3d];

/// Bits of a cell's place in its group.
const GROUP_BITS: u32 = 6;

impl Cells {
    /// Sixteen times as many buckets as points, since most cells of a group are empty; no more than two million while
    /// these are twice as many.
    fn new(points: usize, epsilon: f32) -> Self {
        let bits = |n: usize| usize::BITS - n.leading_zeros();
        let bits = bits(16 * points).min(bits(2 * points).max(21)).clamp(GROUP_BITS + 4, 30);
        Self { per_metre: 0.499 / epsilon, shift: u32::BITS + GROUP_BITS - bits }
    }

    fn buckets(self) -> usize {
        1 << (u32::BITS + GROUP_BITS - self.shift)
    }

    /// Hash and place in the group of a coordinate.
    #[inline]
    fn part(cell: f32, axis: usize) -> (u32, u32) {
        let cell = cell as i32;
        (((cell >> 2) as u32).wrapping_mul(FACTORS[axis]), (cell & 3) as u32)
    }

    #[inline]
    fn join(self, x: (u32, u32), y: (u32, u32), z: (u32, u32)) -> usize {
        let group = (x.0 ^ y.0 ^ z.0).wrapping_mul(FACTORS[0]) >> self.shift;
        (group << GROUP_BITS | z.1 << 4 | y.1 << 2 | x.1) as usize
    }

    #[inline]
    fn bucket(self, position: [f32; 3]) -> usize {
        let part = |a: usize| Self::part((position[a] * self.per_metre).floor(), a);
        self.join(part(0), part(1), part(2))
    }

    /// Buckets of the eight cells about a position, some perhaps the same.
    #[inline]
    fn around(self, position: [f32; 3]) -> [usize; 8] {
        let parts: [[(u32, u32); 2]; 3] = std::array::from_fn(|a| {
            let at = position[a] * self.per_metre;
            let cell = at.floor();
            let other = if at - cell < 0.5 { cell - 1.0 } else { cell + 1.0 };
            [cell, other].map(|c| Self::part(c, a))
        });
        std::array::from_fn(|k| self.join(parts[0][k & 1], parts[1][k >> 1 & 1], parts[2][k >> 2]))
    }
}

#[inline]
fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let d: [f32; 3] = std::array::from_fn(|i| a[i] - b[i]);
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}

/// Points in the order of their buckets.
#[derive(Debug, Clone, Default)]
pub(super) struct Arena {
    pub points: Vec<Placed>,
    starts: Vec<u32>,
    cells: Cells,
}

impl Arena {
    /// The arena, and which of `points` each of its points is.
    fn new(points: &[Placed], epsilon: f32) -> (Self, Vec<u32>) {
        let cells = Cells::new(points.len(), epsilon);
        let buckets: Vec<u32> = points.iter().map(|p| cells.bucket(p.position) as u32).collect();
        let mut starts = vec![0_u32; cells.buckets() + 1];
        for &b in &buckets {
            starts[b as usize + 1] += 1;
        }
        for b in 0..cells.buckets() {
            starts[b + 1] += starts[b];
        }
        let mut next = starts.clone();
        let mut order = vec![0_u32; points.len()];
        for (i, &b) in buckets.iter().enumerate() {
            order[next[b as usize] as usize] = i as u32;
            next[b as usize] += 1;
        }
        let points = order.iter().map(|&i| points[i as usize]).collect();
        (Self { points, starts, cells }, order)
    }

    /// Shows `visit` every point nearer than the square root of `limit`, some perhaps twice, until it returns false.
    #[inline]
    fn near(&self, position: [f32; 3], limit: f32, mut visit: impl FnMut(usize, &Placed) -> bool) {
        if self.points.is_empty() {
            return;
        }
        for bucket in self.cells.around(position) {
            let from = self.starts[bucket] as usize;
            let to = self.starts[bucket + 1] as usize;
            for (i, p) in self.points[from..to].iter().enumerate() {
                if squared_distance(p.position, position) < limit && !visit(from + i, p) {
                    return;
                }
            }
        }
    }
}

/// Points that were kept so far, in lists by bucket.
#[derive(Debug, Clone, Default)]
struct Taken {
    cells: Cells,
    heads: Vec<u32>,
    /// Position, and the next of the list.
    nodes: Vec<([f32; 3], u32)>,
    used: Vec<u32>,
}

impl Taken {
    const END: u32 = u32::MAX;

    fn reset(&mut self, points: usize, epsilon: f32) {
        self.used.drain(..).for_each(|b| self.heads[b as usize] = Self::END);
        self.nodes.clear();
        self.cells = Cells::new(points, epsilon);
        let buckets = self.cells.buckets().max(self.heads.len());
        self.heads.resize(buckets, Self::END);
    }

    #[inline]
    fn is_clear(&self, around: &[usize; 8], position: [f32; 3], limit: f32) -> bool {
        around.iter().all(|&b| {
            let mut at = self.heads[b];
            while let Some((p, next)) = self.nodes.get(at as usize) {
                if squared_distance(*p, position) < limit {
                    return false;
                }
                at = *next;
            }
            true
        })
    }

    #[inline]
    fn take(&mut self, position: [f32; 3]) {
        let bucket = self.cells.bucket(position);
        let head = &mut self.heads[bucket];
        if *head == Self::END {
            self.used.push(bucket as u32);
        }
        self.nodes.push((position, *head));
        *head = self.nodes.len() as u32 - 1;
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
        let limit = epsilon * epsilon;
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.sort_unstable_by_key(|&i| points[i as usize].rank);
        let mut taken = Taken::default();
        taken.reset(points.len(), epsilon);
        let mut kept = vec![false; points.len()];
        for i in order {
            let position = points[i as usize].position;
            if taken.is_clear(&taken.cells.around(position), position, limit) {
                taken.take(position);
                kept[i as usize] = true;
            }
        }
        let (arena, order) = Arena::new(points, epsilon);
        let kept = order.into_iter().map(|i| kept[i as usize]).collect();
        Self::from_kept(arena, kept, owners, epsilon)
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
            self.arena.near(p.position, self.limit, |o, other| {
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
            let mut clear = taken.is_clear(&taken.cells.around(p.position), p.position, self.limit);
            behind.clear();
            if clear || before {
                self.arena.near(p.position, self.limit, |o, other| {
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
                None => {
                    added_kept.push(clear);
                    if clear {
                        taken.take(p.position);
                    }
                }
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
        let (arena, order) = Arena::new(&points, epsilon);
        let kept = order.into_iter().map(|i| kept[i as usize]).collect();
        Self::from_kept(arena, kept, owners, epsilon)
    }

    /// Number of kept points, M.
    pub fn count(&self) -> usize {
        self.kept.iter().filter(|&&k| k).count()
    }
}

/// The points of a scene rebuilt from occurrences (eq. 2, 3): the frame of each, and the number of its stamp.
pub(super) fn rebuild(frames: &[Frame], words: &[u32], stamps: &[Stamp], epsilon: f32) -> Sparse {
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
