//! The points within epsilon of a position, for sparsification (eq. 3).
//!
//! Cells are slightly more than two epsilon wide, so that all points within epsilon of a position lie in two by two by
//! two of them. Four by four by four cells make a group. Groups are found by hash and numbered as they appear, and
//! since points are given along a curve through space, neighbours in space are neighbours in memory.

use super::stamp::PlacedPoint;
use crate::vector::squared_distance;

/// Factors that scatter the three coordinates of a group: the first three primes of xxHash.
const FACTORS: [u32; 3] = [0x9e37_79b1, 0x85eb_ca77, 0xc2b2_ae3d];

/// Cells of a group: six bits, two of each coordinate.
const GROUP: usize = 64;

/// A cell, by the hash of its group and its place there.
type Cell = (u32, u32);

/// The eight cells that hold all points within epsilon of a position: its own, and in each axis the next one on the
/// nearer side.
pub(super) struct CellsAround([Cell; 8]);

impl CellsAround {
    #[inline]
    pub fn new(position: [f32; 3], epsilon: f32) -> Self {
        let parts: [[Cell; 2]; 3] = std::array::from_fn(|a| {
            let at = position[a] * per_metre(epsilon);
            let cell = at.floor();
            let other = if at - cell < 0.5 { cell - 1.0 } else { cell + 1.0 };
            [cell, other].map(|c| part(c, a))
        });
        Self(std::array::from_fn(|k| {
            join([parts[0][k & 1], parts[1][k >> 1 & 1], parts[2][k >> 2]])
        }))
    }
}

/// Cells per metre. A half would make cells two epsilon wide; slightly less leaves room for rounding.
#[inline]
fn per_metre(epsilon: f32) -> f32 {
    0.499 / epsilon
}

/// The share of one coordinate in the hash of the group, and in the place in the group.
#[inline]
fn part(cell: f32, axis: usize) -> Cell {
    let cell = cell as i32;
    (((cell >> 2) as u32).wrapping_mul(FACTORS[axis]), ((cell & 3) as u32) << (2 * axis))
}

/// The cell of three coordinates' shares.
#[inline]
fn join([x, y, z]: [Cell; 3]) -> Cell {
    ((x.0 ^ y.0 ^ z.0).wrapping_mul(FACTORS[0]), x.1 | y.1 | z.1)
}

/// The cell of a position.
#[inline]
fn cell_of(position: [f32; 3], epsilon: f32) -> Cell {
    join(std::array::from_fn(|a| part((position[a] * per_metre(epsilon)).floor(), a)))
}

/// Numbers of the groups that hold points. Groups whose hashes agree share a number, which costs time but is exact,
/// since distances are compared.
#[derive(Debug, Clone, Default)]
struct CellGroups {
    /// By the upper bits of the hash; [`CellGroups::NONE`] where there is no group.
    numbers: Vec<u32>,
    /// Places in `numbers` that are in use, by number.
    used: Vec<u32>,
    /// Takes a 32-bit hash to its upper bits.
    shift: u32,
}

impl CellGroups {
    const NONE: u32 = u32::MAX;

    /// Forgets all groups, and makes room for those of so many points: at least as many places, since a group on a
    /// surface holds tens of points.
    fn reset(&mut self, points: usize) {
        self.used.drain(..).for_each(|at| self.numbers[at as usize] = Self::NONE);
        let bits = (usize::BITS - points.leading_zeros()).clamp(4, 24);
        self.shift = u32::BITS - bits;
        let size = (1 << bits).max(self.numbers.len());
        self.numbers.resize(size, Self::NONE);
    }

    /// Index of a cell in lists with an entry per cell of every group; beyond their ends when it has no group.
    #[inline]
    fn find(&self, (hash, place): Cell) -> usize {
        match self.numbers.get((hash >> self.shift) as usize) {
            Some(&number) if number != Self::NONE => number as usize * GROUP + place as usize,
            _ => usize::MAX,
        }
    }

    /// The same, with a new group where there was none.
    #[inline]
    fn find_or_add(&mut self, (hash, place): Cell) -> usize {
        let at = hash >> self.shift;
        let number = &mut self.numbers[at as usize];
        if *number == Self::NONE {
            *number = self.used.len() as u32;
            self.used.push(at);
        }
        *number as usize * GROUP + place as usize
    }

    /// Length of a list with an entry per cell of every group.
    fn cells(&self) -> usize {
        self.used.len() * GROUP
    }
}

/// The points of a cell, as numbers in a [`PointGrid`].
#[derive(Debug, Clone, Copy, Default)]
struct Bucket {
    start: u32,
    /// Kept points come before this one.
    kept_end: u32,
    end: u32,
}

/// Points in the order of their cells, in each cell the kept ones first.
#[derive(Debug, Clone, Default)]
pub(super) struct PointGrid {
    pub points: Vec<PlacedPoint>,
    groups: CellGroups,
    buckets: Vec<Bucket>,
    epsilon: f32,
}

impl PointGrid {
    /// The grid, and the number in `points` of each of its points.
    pub fn new(points: &[PlacedPoint], is_kept: &[bool], epsilon: f32) -> (Self, Vec<u32>) {
        let mut groups = CellGroups::default();
        groups.reset(points.len());
        let cell_of = |p: &PlacedPoint| groups.find_or_add(cell_of(p.position, epsilon)) as u32;
        let cells: Vec<u32> = points.iter().map(cell_of).collect();
        let mut buckets = vec![Bucket::default(); groups.cells()];
        for (&c, &is_kept) in cells.iter().zip(is_kept) {
            let bucket = &mut buckets[c as usize];
            bucket.end += 1;
            bucket.kept_end += u32::from(is_kept);
        }
        let mut start = 0;
        for bucket in &mut buckets {
            let (n, n_kept) = (bucket.end, bucket.kept_end);
            // Both ends grow as points are inserted.
            *bucket = Bucket { start, kept_end: start, end: start + n_kept };
            start += n;
        }
        let mut order = vec![0_u32; points.len()];
        for (i, (&c, &is_kept)) in (0_u32..).zip(cells.iter().zip(is_kept)) {
            let bucket = &mut buckets[c as usize];
            let next = if is_kept { &mut bucket.kept_end } else { &mut bucket.end };
            order[*next as usize] = i;
            *next += 1;
        }
        let points = order.iter().map(|&i| points[i as usize]).collect();
        (Self { points, groups, buckets, epsilon }, order)
    }

    /// Calls `visit` for every point within epsilon of `position`, or for those that may be kept, for some perhaps
    /// twice, until it returns false.
    #[inline]
    pub fn visit_near(
        &self,
        cells: &CellsAround,
        position: [f32; 3],
        only_kept: bool,
        mut visit: impl FnMut(usize, &PlacedPoint) -> bool,
    ) {
        let limit = self.epsilon * self.epsilon;
        for &cell in &cells.0 {
            let Some(&bucket) = self.buckets.get(self.groups.find(cell)) else { continue };
            let end = if only_kept { bucket.kept_end } else { bucket.end };
            let range = bucket.start as usize..end as usize;
            for (i, p) in range.clone().zip(&self.points[range]) {
                if squared_distance(p.position, position) < limit && !visit(i, p) {
                    return;
                }
            }
        }
    }

    /// Widens the range of the points that may be kept, so that it holds `point`.
    pub fn mark_kept(&mut self, point: usize) {
        let cell = self.groups.find(cell_of(self.points[point].position, self.epsilon));
        let end = &mut self.buckets[cell].kept_end;
        *end = (*end).max(point as u32 + 1);
    }
}

/// Points that were kept so far, in linked lists by cell.
#[derive(Debug, Clone, Default)]
pub(super) struct KeptGrid {
    groups: CellGroups,
    heads: Vec<u32>,
    /// Position, and the next of the list.
    nodes: Vec<([f32; 3], u32)>,
    epsilon: f32,
}

impl KeptGrid {
    const END: u32 = u32::MAX;

    /// Forgets all points, and makes room for so many.
    pub fn reset(&mut self, points: usize, epsilon: f32) {
        self.groups.reset(points);
        self.heads.clear();
        self.nodes.clear();
        self.epsilon = epsilon;
    }

    /// True when no point within epsilon of `position` was kept so far.
    #[inline]
    pub fn is_clear(&self, cells: &CellsAround, position: [f32; 3]) -> bool {
        let limit = self.epsilon * self.epsilon;
        cells.0.iter().all(|&cell| {
            let mut at = self.heads.get(self.groups.find(cell)).copied().unwrap_or(Self::END);
            while let Some((p, next)) = self.nodes.get(at as usize) {
                if squared_distance(*p, position) < limit {
                    return false;
                }
                at = *next;
            }
            true
        })
    }

    /// Adds a kept point.
    #[inline]
    pub fn insert(&mut self, position: [f32; 3]) {
        let cell = self.groups.find_or_add(cell_of(position, self.epsilon));
        self.heads.resize(self.groups.cells(), Self::END);
        let head = &mut self.heads[cell];
        self.nodes.push((position, *head));
        *head = self.nodes.len() as u32 - 1;
    }
}
