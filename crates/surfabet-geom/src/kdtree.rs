//! Nearest neighbours: a balanced k-d tree in flat arrays.
//!
//! Written here rather than taken from `kiddo` (6.3), after measuring both (docs/benchmarks/kernels.md): 16 neighbours of
//! each of a million points take less than half of the time (one neighbour between 0.8 and 2.3 times as much), since results
//! go into the caller's buffer instead of a new vector per query, and equal distances come out in the order of the indices,
//! which `kiddo` leaves open.
//!
//! Leaves are blocks of [`LANES`] points in columns, so that a block's distances are a few vector operations. An
//! inner node halves its run of blocks across the longest side of its bounding box and keeps the boxes of both
//! halves. It is stored under the number of the block that starts its right half, so that there are no links.
//! All blocks but the last are full whatever the points are: duplicates and coplanar points need no care.
//!
//! Searches are exact in `f32`: the distance to a box sums the squared excess per axis in the order in which the
//! distances of points are summed, and every rounding on the way is monotone, so that no box is farther away
//! than a point in it.

use surfabet_base::parallel;

use crate::error::{Error, Result};
use surfabet_base::{Meter, Progress};

/// Points per leaf. Measured on a million scan points, 8 and 32 are both slower by a tenth to a fifth.
const LANES: usize = 16;

/// Most subtrees put off at a time: one per level, and 2^32 points in full blocks have 28 levels.
const MAX_DEPTH: usize = 32;

/// Up to this number of blocks a subtree is built without forking.
const FORK_ABOVE: usize = 256;

/// Neighbours up to which the best so far are kept sorted: to put one more in its place moves half of them on average. Of more
/// than these, up to twice as many are collected before the others are dropped. Results do not depend on it.
const MOST_SORTED: usize = 48;

/// Queries per unit of parallel work: a few milliseconds, so that an interrupt is felt at once.
const BATCH: usize = 1024;

/// A point found. Neighbours order by distance, then by index.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Neighbor {
    /// Distance bits above index bits: non-negative floats order like their bits.
    key: u64,
}

impl Neighbor {
    /// Behind every point, those at infinite distance included.
    const NONE: Self = Self { key: (f32::INFINITY.to_bits() as u64) << 32 | u32::MAX as u64 };

    fn new(squared_distance: f32, index: u32) -> Self {
        Self { key: u64::from(squared_distance.to_bits()) << 32 | u64::from(index) }
    }

    /// Index into the points that the tree was built from.
    #[inline]
    pub fn index(self) -> usize {
        (self.key & u64::from(u32::MAX)) as usize
    }

    /// Squared distance in square metres: differences, squares and their sum (x, y, z in this order), each
    /// rounded to `f32`.
    #[inline]
    pub fn squared_distance(self) -> f32 {
        f32::from_bits((self.key >> 32) as u32)
    }
}

impl std::fmt::Debug for Neighbor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Neighbor")
            .field("index", &self.index())
            .field("squared_distance", &self.squared_distance())
            .finish()
    }
}

/// Neighbours of many queries, as many per query as there are within the radius.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Neighborhoods {
    starts: Vec<usize>,
    neighbors: Vec<Neighbor>,
}

impl Neighborhoods {
    /// Number of queries.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// True when there was no query.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Neighbours of query `i`, nearest first.
    pub fn get(&self, i: usize) -> &[Neighbor] {
        &self.neighbors[self.starts[i]..self.starts[i + 1]]
    }

    /// Where each query's neighbours start in [`Neighborhoods::neighbors`]; one more than there are queries.
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// The neighbours of all queries, one query after the other.
    pub fn neighbors(&self) -> &[Neighbor] {
        &self.neighbors
    }
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    position: [f32; 3],
    index: u32,
}

impl Entry {
    /// Orders like `total_cmp` of the coordinate on an axis, equal ones by index. One integer is compared without branches.
    #[inline(always)]
    fn key(&self, axis: usize) -> i64 {
        // As signed integers the bits of floats ascend, but below zero those after the sign descend.
        let bits = self.position[axis].to_bits() as i32;
        let ascending = bits ^ ((bits >> 31) as u32 >> 1) as i32;
        i64::from(ascending) << 32 | i64::from(self.index)
    }
}

#[derive(Debug, Clone)]
struct PointBlock {
    position: [[f32; LANES]; 3],
    index: [u32; LANES],
}

impl PointBlock {
    /// A block that is not full is filled up with points at infinity, which equal [`Neighbor::NONE`] at best.
    fn new(entries: &[Entry]) -> Self {
        let mut block = Self { position: [[f32::INFINITY; LANES]; 3], index: [u32::MAX; LANES] };
        for (lane, entry) in entries.iter().enumerate() {
            for axis in 0..3 {
                block.position[axis][lane] = entry.position[axis];
            }
            block.index[lane] = entry.index;
        }
        block
    }

    #[inline(always)]
    fn squared_distances(&self, query: [f32; 3]) -> [f32; LANES] {
        std::array::from_fn(|lane| {
            let d: [f32; 3] = std::array::from_fn(|axis| self.position[axis][lane] - query[axis]);
            (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2]
        })
    }
}

/// An axis-aligned box, half a cache line. The fourth lane is never read: it makes a corner one vector.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Bounds {
    low: [f32; 4],
    high: [f32; 4],
}

impl Bounds {
    const EMPTY: Self = Self { low: [f32::INFINITY; 4], high: [f32::NEG_INFINITY; 4] };

    fn of(entries: &[Entry]) -> Self {
        entries.iter().fold(Self::EMPTY, |mut bounds, entry| {
            for axis in 0..3 {
                bounds.low[axis] = bounds.low[axis].min(entry.position[axis]);
                bounds.high[axis] = bounds.high[axis].max(entry.position[axis]);
            }
            bounds
        })
    }

    fn longest_axis(&self) -> usize {
        let side: [f32; 3] = std::array::from_fn(|axis| self.high[axis] - self.low[axis]);
        (1..3).fold(0, |longest, axis| if side[axis] > side[longest] { axis } else { longest })
    }

    #[inline(always)]
    fn squared_distance(&self, query: [f32; 4]) -> f32 {
        // Plain comparisons rather than `max`: one instruction each.
        let d: [f32; 4] = std::array::from_fn(|axis| {
            let below = self.low[axis] - query[axis];
            let above = query[axis] - self.high[axis];
            let outside = if below > above { below } else { above };
            if outside > 0.0 { outside } else { 0.0 }
        });
        (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2]
    }
}

/// A run of blocks put off during a search, and how far its box is.
#[derive(Clone, Copy)]
struct Postponed {
    first: u32,
    last: u32,
    bound: f32,
}

/// What a search collects: points not farther than a limit that may shrink.
trait Collector {
    /// Largest squared distance still of interest.
    fn limit(&self) -> f32;

    /// A point within the limit as it was when its block was entered.
    fn offer(&mut self, neighbor: Neighbor);
}

struct Nearest(Neighbor);

impl Collector for Nearest {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.0.squared_distance()
    }

    #[inline(always)]
    fn offer(&mut self, neighbor: Neighbor) {
        self.0 = self.0.min(neighbor);
    }
}

/// The best so far, sorted; filled up with [`Neighbor::NONE`]. At least one place.
struct NearestSorted<'a>(&'a mut [Neighbor]);

impl Collector for NearestSorted<'_> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.0[self.0.len() - 1].squared_distance()
    }

    #[inline(always)]
    fn offer(&mut self, neighbor: Neighbor) {
        let mut place = self.0.len() - 1;
        if neighbor >= self.0[place] {
            return;
        }
        while place > 0 && self.0[place - 1] > neighbor {
            self.0[place] = self.0[place - 1];
            place -= 1;
        }
        self.0[place] = neighbor;
    }
}

/// Up to twice as many as are wanted, in any order, among them the best so far. At least one is wanted.
struct NearestMany<'a> {
    wanted: usize,
    limit: f32,
    found: &'a mut Vec<Neighbor>,
}

impl NearestMany<'_> {
    /// Drops all but the best, and takes the worst of these for the limit.
    fn drop_others(&mut self) {
        if self.found.len() > self.wanted {
            let (_, worst, _) = self.found.select_nth_unstable(self.wanted - 1);
            self.limit = worst.squared_distance();
            self.found.truncate(self.wanted);
        }
    }
}

impl Collector for NearestMany<'_> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn offer(&mut self, neighbor: Neighbor) {
        if neighbor < Neighbor::NONE {
            self.found.push(neighbor);
            if self.found.len() >= 2 * self.wanted {
                self.drop_others();
            }
        }
    }
}

/// The nearest that is wanted.
struct NearestWhere<F> {
    best: Neighbor,
    is_wanted: F,
}

impl<F: FnMut(usize) -> bool> Collector for NearestWhere<F> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.best.squared_distance()
    }

    #[inline(always)]
    fn offer(&mut self, neighbor: Neighbor) {
        if neighbor < self.best && (self.is_wanted)(neighbor.index()) {
            self.best = neighbor;
        }
    }
}

struct Within<F> {
    limit: f32,
    visit: F,
}

impl<F: FnMut(Neighbor)> Collector for Within<F> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn offer(&mut self, neighbor: Neighbor) {
        if neighbor < Neighbor::NONE {
            (self.visit)(neighbor);
        }
    }
}

/// A k-d tree over points, for searches by number and by radius.
///
/// The result of every search is a function of the points alone, whatever the number of threads: neighbours
/// come nearest first, equal distances by index, also where only some of the equally distant fit into k.
#[derive(Debug, Clone)]
pub struct KdTree {
    len: usize,
    blocks: Vec<PointBlock>,
    /// Boxes of both halves of the node whose right half starts at this block; the first is unused.
    halves: Vec<[Bounds; 2]>,
}

impl KdTree {
    /// Builds the tree in parallel; `points` may be empty and hold duplicates.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a coordinate that is not finite or for 2^32 - 1 points and more.
    pub fn new(points: &[[f32; 3]]) -> Result<Self> {
        if points.len() >= u32::MAX as usize {
            return Err(Error::invalid("number of points", points.len(), "below 4294967295"));
        }
        check_finite("point", points)?;
        let mut entries: Vec<Entry> =
            parallel::map_range(points.len(), |i| Entry { position: points[i], index: i as u32 });
        let mut halves = vec![[Bounds::EMPTY; 2]; entries.len().div_ceil(LANES)];
        let bounds = Bounds::of(&entries);
        arrange(&mut entries, &mut halves, &bounds);
        let blocks = parallel::map_chunks(&entries, LANES, PointBlock::new);
        Ok(Self { len: points.len(), blocks, halves })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True when there is no point.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The nearest point to a finite `query`; `None` when the tree is empty.
    pub fn nearest(&self, query: [f32; 3]) -> Option<Neighbor> {
        let mut collector = Nearest(Neighbor::NONE);
        self.search(query, &mut collector);
        (collector.0 < Neighbor::NONE).then_some(collector.0)
    }

    /// Puts the `k` nearest points to a finite `query`, nearest first, in place of the contents of `found`: fewer
    /// where the tree has fewer.
    pub fn k_nearest(&self, query: [f32; 3], k: usize, found: &mut Vec<Neighbor>) {
        found.clear();
        if k > MOST_SORTED {
            let mut collector =
                NearestMany { wanted: k.min(self.len), limit: f32::INFINITY, found };
            self.search(query, &mut collector);
            collector.drop_others();
            found.sort_unstable();
        } else {
            found.resize(k.min(self.len), Neighbor::NONE);
            self.fill_nearest(query, found);
        }
    }

    /// The nearest point within `radius` metres (included) of a finite `query` whose index `is_wanted`; `None` where there is
    /// none. It is asked of points that are nearer than the best so far.
    pub fn nearest_where(
        &self,
        query: [f32; 3],
        radius: f32,
        is_wanted: impl FnMut(usize) -> bool,
    ) -> Option<Neighbor> {
        // No point has this index.
        let best = Neighbor::new(radius * radius, u32::MAX);
        let mut collector = NearestWhere { best, is_wanted };
        self.search(query, &mut collector);
        (collector.best < best).then_some(collector.best)
    }

    /// Puts the points within `radius` metres (included) of a finite `query`, nearest first, in place of the
    /// contents of `found`. The comparison is between squares rounded to `f32`.
    pub fn within(&self, query: [f32; 3], radius: f32, found: &mut Vec<Neighbor>) {
        found.clear();
        self.visit_within(query, radius, |neighbor| found.push(neighbor));
        found.sort_unstable();
    }

    /// Calls `visit` for the points within `radius` metres (included) of a finite `query`, in an order that depends on the
    /// points alone.
    pub fn visit_within(&self, query: [f32; 3], radius: f32, visit: impl FnMut(Neighbor)) {
        self.search(query, &mut Within { limit: radius * radius, visit });
    }

    /// Calls `visit` with the position and the index of every point in a box, given by its lower and upper corner, that is
    /// `wanted` as are all the boxes around it; also of some others. Boxes hold ever fewer points. The order depends on the
    /// points alone.
    pub fn visit_where(
        &self,
        wanted: impl Fn([f32; 3], [f32; 3]) -> bool,
        mut visit: impl FnMut([f32; 3], usize),
    ) {
        let is_wanted = |bounds: &Bounds| {
            let corner = |c: [f32; 4]| [c[0], c[1], c[2]];
            wanted(corner(bounds.low), corner(bounds.high))
        };
        let mut stack = [(0, 0); MAX_DEPTH];
        let mut depth = 0;
        let mut run = (0, self.blocks.len());
        loop {
            if run.1 - run.0 > 1 {
                let middle = middle(run.0, run.1);
                let [left, right] = self.halves[middle].each_ref().map(is_wanted);
                if left && right {
                    stack[depth] = (middle, run.1);
                    depth += 1;
                }
                if left || right {
                    run = if left { (run.0, middle) } else { (middle, run.1) };
                    continue;
                }
            } else if let Some(block) = self.blocks.get(run.0) {
                let indices = block.index.iter().take_while(|&&index| index != u32::MAX);
                for (lane, &index) in indices.enumerate() {
                    visit(block.position.map(|column| column[lane]), index as usize);
                }
            }
            if depth == 0 {
                return;
            }
            depth -= 1;
            run = stack[depth];
        }
    }

    /// The nearest point to each query, in parallel.
    ///
    /// # Errors
    /// [`Error::TooFewPoints`] when the tree is empty, [`Error::InvalidParameter`] for a query that is not finite,
    /// [`Error::Cancelled`].
    pub fn nearest_batch(
        &self,
        queries: &[[f32; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<Neighbor>> {
        self.k_nearest_batch(queries, 1, progress)
    }

    /// The k nearest points to each query, in parallel: a row of `min(k, len)` neighbours per query, one row after
    /// the other.
    ///
    /// # Errors
    /// As [`KdTree::nearest_batch`], and [`Error::InvalidParameter`] when `k` is zero.
    pub fn k_nearest_batch(
        &self,
        queries: &[[f32; 3]],
        k: usize,
        progress: &dyn Progress,
    ) -> Result<Vec<Neighbor>> {
        if k == 0 {
            return Err(Error::invalid("k", k, "at least 1"));
        }
        if self.is_empty() {
            return Err(Error::TooFewPoints { operation: "k-nearest", needed: 1, found: 0 });
        }
        check_finite("query", queries)?;
        let k = k.min(self.len);
        let mut found = vec![Neighbor::NONE; queries.len() * k];
        let meter = Meter::new(progress, "neighbours", queries.len().div_ceil(BATCH));
        parallel::try_for_each(
            found.chunks_mut(BATCH * k).zip(queries.chunks(BATCH)),
            |_, (rows, queries)| {
                if k == 1 {
                    for (place, &query) in rows.iter_mut().zip(queries) {
                        let mut collector = Nearest(Neighbor::NONE);
                        self.search(query, &mut collector);
                        *place = collector.0;
                    }
                } else {
                    for (row, &query) in rows.chunks_exact_mut(k).zip(queries) {
                        self.fill_nearest(query, row);
                    }
                }
                meter.step()
            },
        )?;
        Ok(found)
    }

    /// The points within `radius` metres of each query, in parallel.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a query that is not finite or a radius that is negative or NaN,
    /// [`Error::Cancelled`].
    pub fn within_batch(
        &self,
        queries: &[[f32; 3]],
        radius: f32,
        progress: &dyn Progress,
    ) -> Result<Neighborhoods> {
        if radius.is_nan() || radius < 0.0 {
            return Err(Error::invalid("radius", radius, "a distance of at least 0"));
        }
        check_finite("query", queries)?;
        let meter = Meter::new(progress, "neighbours", queries.len().div_ceil(BATCH));
        let parts = parallel::try_map_chunks(queries, BATCH, |queries| -> Result<_> {
            let mut counts = Vec::with_capacity(queries.len());
            let mut all = Vec::new();
            let mut found = Vec::new();
            for &query in queries {
                self.within(query, radius, &mut found);
                counts.push(found.len());
                all.extend_from_slice(&found);
            }
            meter.step()?;
            Ok((counts, all))
        })?;
        let mut starts = Vec::with_capacity(queries.len() + 1);
        let mut neighbors = Vec::with_capacity(parts.iter().map(|(_, all)| all.len()).sum());
        let mut end = 0;
        starts.push(end);
        for (counts, all) in parts {
            for count in counts {
                end += count;
                starts.push(end);
            }
            neighbors.extend(all);
        }
        Ok(Neighborhoods { starts, neighbors })
    }

    /// `row` has at most as many places as there are points.
    fn fill_nearest(&self, query: [f32; 3], row: &mut [Neighbor]) {
        if !row.is_empty() {
            row.fill(Neighbor::NONE);
            self.search(query, &mut NearestSorted(row));
        }
    }

    fn search(&self, query: [f32; 3], collector: &mut impl Collector) {
        if self.blocks.is_empty() {
            return;
        }
        let query4 = [query[0], query[1], query[2], 0.0];
        let mut stack = [Postponed { first: 0, last: 0, bound: 0.0 }; MAX_DEPTH];
        let mut depth = 0;
        let mut first = 0;
        let mut last = self.blocks.len();
        loop {
            while last - first > 1 {
                let middle = middle(first, last);
                let [left, right] = &self.halves[middle];
                let left = left.squared_distance(query4);
                let right = right.squared_distance(query4);
                let (far, bound);
                if left <= right {
                    (far, bound) = ((middle, last), right);
                    last = middle;
                } else {
                    (far, bound) = ((first, middle), left);
                    first = middle;
                }
                if bound <= collector.limit() {
                    stack[depth] = Postponed { first: far.0 as u32, last: far.1 as u32, bound };
                    depth += 1;
                }
            }
            let block = &self.blocks[first];
            let distances = block.squared_distances(query);
            let limit = collector.limit();
            let mut near = 0_u32;
            for (lane, &distance) in distances.iter().enumerate() {
                near |= u32::from(distance <= limit) << lane;
            }
            while near != 0 {
                let lane = near.trailing_zeros() as usize;
                near &= near - 1;
                collector.offer(Neighbor::new(distances[lane], block.index[lane]));
            }
            loop {
                if depth == 0 {
                    return;
                }
                depth -= 1;
                if stack[depth].bound <= collector.limit() {
                    break;
                }
            }
            first = stack[depth].first as usize;
            last = stack[depth].last as usize;
        }
    }
}

/// First block of the right half of the blocks `first..last`.
#[inline(always)]
fn middle(first: usize, last: usize) -> usize {
    first + (last - first).div_ceil(2)
}

/// Sorts `entries` into their blocks, of which `halves` has one place each, and notes the boxes of all halves.
fn arrange(entries: &mut [Entry], halves: &mut [[Bounds; 2]], bounds: &Bounds) {
    if halves.len() < 2 {
        return;
    }
    let fork = halves.len() > FORK_ABOVE;
    let axis = bounds.longest_axis();
    let middle = middle(0, halves.len());
    // A total order, so that the same points end up left and right whatever the selection does on its way.
    entries.select_nth_unstable_by_key(middle * LANES, |entry| entry.key(axis));
    let (left_entries, right_entries) = entries.split_at_mut(middle * LANES);
    let (left_halves, right_halves) = halves.split_at_mut(middle);
    let left = Bounds::of(left_entries);
    let right = Bounds::of(right_entries);
    // Nodes inside the right half start theirs at a later block: this place is free.
    right_halves[0] = [left, right];
    if fork {
        rayon::join(
            || arrange(left_entries, left_halves, &left),
            || arrange(right_entries, right_halves, &right),
        );
    } else {
        arrange(left_entries, left_halves, &left);
        arrange(right_entries, right_halves, &right);
    }
}

fn check_finite(name: &'static str, points: &[[f32; 3]]) -> Result<()> {
    let is_wrong = |point: &&[f32; 3]| point.iter().any(|c| !c.is_finite());
    parallel::try_for_each(points.chunks(BATCH), |_, points| match points.iter().find(is_wrong) {
        None => Ok(()),
        Some(point) => Err(Error::invalid(name, format!("{point:?}"), "finite")),
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use surfabet_base::{Cancelled, Silent};

    fn brute_force(points: &[[f32; 3]], query: [f32; 3]) -> Vec<Neighbor> {
        let mut all: Vec<Neighbor> = points
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let d: [f32; 3] = std::array::from_fn(|a| p[a] - query[a]);
                Neighbor::new((d[0] * d[0] + d[1] * d[1]) + d[2] * d[2], i as u32)
            })
            .collect();
        all.sort_unstable();
        all
    }

    /// Coordinates on a coarse grid tie often; others hardly ever.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![(-3_i8..3).prop_map(f32::from), -5.0_f32..5.0, Just(1e6), Just(-0.0)]
    }

    fn points(most: usize) -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..most)
    }

    proptest! {
        #[test]
        fn finds_what_brute_force_finds(
            points in points(400), queries in points(20), k in 1_usize..160, radius in 0.0_f32..4.0,
        ) {
            let tree = KdTree::new(&points).unwrap();
            let mut found = Vec::new();
            let around = tree.within_batch(&queries, radius, &Silent).unwrap();
            prop_assert_eq!(around.len(), queries.len());
            for (i, &query) in queries.iter().enumerate() {
                let all = brute_force(&points, query);
                prop_assert_eq!(tree.nearest(query), all.first().copied());
                tree.k_nearest(query, k, &mut found);
                prop_assert_eq!(&found[..], &all[..k.min(all.len())]);
                tree.within(query, radius, &mut found);
                let inside = all.partition_point(|n| n.squared_distance() <= radius * radius);
                prop_assert_eq!(&found[..], &all[..inside]);
                let is_third = |i: usize| i.is_multiple_of(3);
                let third = all[..inside].iter().copied().find(|n| is_third(n.index()));
                prop_assert_eq!(tree.nearest_where(query, radius, is_third), third);
                // Points above the query.
                let is_above = |_: [f32; 3], high: [f32; 3]| high[2] >= query[2];
                let mut above = Vec::new();
                tree.visit_where(is_above, |p, i| {
                    assert_eq!(p, points[i]);
                    above.push(i);
                });
                above.sort_unstable();
                above.dedup();
                above.retain(|&i| points[i][2] >= query[2]);
                let is_there = |i: &usize| points[*i][2] >= query[2];
                prop_assert_eq!(above, (0..points.len()).filter(is_there).collect::<Vec<_>>());
                prop_assert_eq!(around.get(i), &all[..inside]);
            }
            if !points.is_empty() {
                let rows = tree.k_nearest_batch(&queries, k, &Silent).unwrap();
                let width = k.min(points.len());
                prop_assert_eq!(rows.len(), queries.len() * width);
                for (row, &query) in rows.chunks(width).zip(&queries) {
                    prop_assert_eq!(row, &brute_force(&points, query)[..width]);
                }
            }
        }
    }

    #[test]
    fn equal_distances_come_by_index() {
        let corners: Vec<[f32; 3]> =
            (0..64).map(|i| [(i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32]).collect();
        let tree = KdTree::new(&corners).unwrap();
        let mut found = Vec::new();
        tree.k_nearest([0.5; 3], 10, &mut found);
        let indices: Vec<usize> = found.iter().map(|n| n.index()).collect();
        assert_eq!(indices, (0..10).collect::<Vec<_>>());
    }

    #[test]
    fn a_million_duplicates_are_no_worse_than_other_points() {
        let tree = KdTree::new(&vec![[1.0, 2.0, 3.0]; 1_000_000]).unwrap();
        let mut found = Vec::new();
        tree.k_nearest([1.0, 2.0, 3.0], 3, &mut found);
        assert_eq!(found, [0, 1, 2].map(|i| Neighbor::new(0.0, i)));
    }

    #[test]
    fn distances_that_overflow_are_infinite_and_still_found() {
        let tree = KdTree::new(&[[3e38, 0.0, 0.0], [-3e38, 0.0, 0.0]]).unwrap();
        let mut found = Vec::new();
        tree.k_nearest([0.0; 3], 5, &mut found);
        assert_eq!(found, [0, 1].map(|i| Neighbor::new(f32::INFINITY, i)));
        tree.within([0.0; 3], f32::INFINITY, &mut found);
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn an_empty_tree_has_no_neighbour() {
        let tree = KdTree::new(&[]).unwrap();
        assert_eq!(tree.nearest([0.0; 3]), None);
        assert!(matches!(
            tree.nearest_batch(&[[0.0; 3]], &Silent),
            Err(Error::TooFewPoints { needed: 1, found: 0, .. })
        ));
        assert!(tree.within_batch(&[[0.0; 3]], 1.0, &Silent).unwrap().get(0).is_empty());
    }

    #[test]
    fn refuses_what_is_not_finite() {
        assert!(KdTree::new(&[[0.0, f32::NAN, 0.0]]).is_err());
        let tree = KdTree::new(&[[0.0; 3]]).unwrap();
        assert!(tree.nearest_batch(&[[f32::INFINITY, 0.0, 0.0]], &Silent).is_err());
        assert!(tree.within_batch(&[[0.0; 3]], f32::NAN, &Silent).is_err());
        assert!(tree.k_nearest_batch(&[[0.0; 3]], 0, &Silent).is_err());
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let points: Vec<[f32; 3]> = (0..20_000_u32)
            .map(|i| [(i * 7919 % 101) as f32, (i * 104_729 % 97) as f32, (i % 13) as f32])
            .collect();
        let find = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                KdTree::new(&points).unwrap().k_nearest_batch(&points, 9, &Silent).unwrap()
            })
        };
        let alone = find(1);
        assert_eq!(alone, find(2));
        assert_eq!(alone, find(8));
    }

    #[test]
    fn stops_when_cancelled() {
        struct Impatient;
        impl Progress for Impatient {
            fn update(&self, _: &'static str, _: f32) {}
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        let tree = KdTree::new(&[[0.0; 3]]).unwrap();
        let result = tree.nearest_batch(&[[0.0; 3]], &Impatient);
        assert_eq!(result, Err(Error::Cancelled(Cancelled)));
    }
}
