//! The two nearest neurons to a signal, exactly, while neurons move, come and go.
//!
//! A k-d tree whose leaves hold up to [`LANES`] neurons in columns, so that a leaf's distances are a few vector
//! operations. A neuron that moves stays in its leaf as long as it stays in the leaf's region, which is nearly
//! always, and is sent down from the root otherwise. A full leaf is split at its median; the tree is built anew
//! whenever the number of neurons has doubled, so that its depth stays logarithmic whatever the density does.
//!
//! Exact in `f32`: a region is as far away as the planes that part it from the signal, whose distances are summed
//! in the order in which those of neurons are, and every rounding on the way is monotone. So no region looks
//! farther away than a neuron in it, and regions as far as the second winner are looked into for the tie.

use surfabet_geom::Aabb;

/// Neurons per leaf.
const LANES: usize = 8;

/// Neurons per leaf of a tree built anew: the rest is room to grow.
const FILL: usize = 6;

/// Deepest path; one more split builds the tree anew.
const MAX_DEPTH: u32 = 48;

/// No block, no place.
const NONE: u32 = u32::MAX;

/// Marks a node that is a leaf in place of its axis.
const LEAF: u32 = 3;

/// A neuron found. Orders by distance, then by id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Winner {
    key: u64,
}

impl Winner {
    const NONE: Self = Self { key: (f32::INFINITY.to_bits() as u64) << 32 | u32::MAX as u64 };

    #[inline(always)]
    fn new(squared_distance: f32, id: u32) -> Self {
        // Non-negative floats order like their bits.
        Self { key: u64::from(squared_distance.to_bits()) << 32 | u64::from(id) }
    }

    #[inline(always)]
    /// The neuron.
    pub fn id(self) -> u32 {
        self.key as u32
    }

    #[inline(always)]
    /// Its squared distance to the signal, square metres, as [`KdTree`](surfabet_geom::KdTree) computes it.
    pub fn squared_distance(self) -> f32 {
        f32::from_bits((self.key >> 32) as u32)
    }
}

/// Winner and second winner so far.
struct Best([Winner; 2]);

impl Best {
    #[inline(always)]
    fn offer(&mut self, winner: Winner) {
        if winner < self.0[1] {
            if winner < self.0[0] {
                self.0 = [winner, self.0[0]];
            } else {
                self.0[1] = winner;
            }
        }
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.0[1].squared_distance()
    }
}

/// What finds winners among neurons with ids below some bound.
pub trait Winners {
    /// A new neuron with an id that is not in use.
    fn insert(&mut self, id: u32, position: [f32; 3]);
    /// Takes a neuron out.
    fn remove(&mut self, id: u32);
    /// A neuron is elsewhere now.
    fn shift(&mut self, id: u32, position: [f32; 3]);
    /// The two nearest neurons to a finite `query`, of equally near ones those with the smaller ids. There are at
    /// least two.
    fn two_nearest(&self, query: [f32; 3]) -> [Winner; 2];
}

/// A block of neurons of a leaf.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Block {
    /// Columns; unused lanes are at infinity.
    position: [[f32; LANES]; 3],
    id: [u32; LANES],
    /// Region of the leaf: its lower faces belong to it, its upper ones do not.
    region: Aabb,
    len: u32,
    /// Another block of the same leaf: for neurons at one place that no plane parts.
    next: u32,
}

impl Block {
    fn new(region: Aabb) -> Self {
        Self {
            position: [[f32::INFINITY; LANES]; 3],
            id: [NONE; LANES],
            region,
            len: 0,
            next: NONE,
        }
    }

    #[inline(always)]
    fn squared_distances(&self, query: [f32; 3]) -> [f32; LANES] {
        std::array::from_fn(|lane| {
            let d: [f32; 3] = std::array::from_fn(|axis| self.position[axis][lane] - query[axis]);
            (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2]
        })
    }

    #[inline(always)]
    fn contains(&self, p: [f32; 3]) -> bool {
        let Aabb { low, high } = &self.region;
        // Without branches in between.
        (0..3).fold(true, |inside, a| inside & (low[a] <= p[a]) & (p[a] < high[a]))
    }

    fn entry(&self, slot: usize) -> Entry {
        Entry { position: std::array::from_fn(|a| self.position[a][slot]), id: self.id[slot] }
    }
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    position: [f32; 3],
    id: u32,
}

/// A plane with two children that follow each other, or a leaf.
#[derive(Debug, Clone, Copy)]
struct Node {
    split: f32,
    axis: u32,
    /// First child, or first block of the leaf.
    first: u32,
}

#[derive(Debug, Clone, Copy)]
struct Postponed {
    node: u32,
    bound: f32,
    offset: [f32; 3],
}

/// The k-d tree that follows the neurons.
#[derive(Debug, Clone)]
pub struct Index {
    nodes: Vec<Node>,
    blocks: Vec<Block>,
    /// Block and slot of every id: `block * LANES + slot`.
    places: Vec<u32>,
    len: usize,
    built_len: usize,
}

impl Default for Index {
    fn default() -> Self {
        Self::new()
    }
}

impl Index {
    /// No neurons.
    pub fn new() -> Self {
        Self {
            nodes: vec![Node { split: 0.0, axis: LEAF, first: 0 }],
            blocks: vec![Block::new(Aabb::ALL)],
            places: Vec::new(),
            len: 0,
            built_len: 0,
        }
    }

    /// Node of the leaf that `p` belongs to, and its depth.
    fn leaf_of(&self, p: [f32; 3]) -> (usize, u32) {
        let (mut at, mut depth) = (0, 0);
        loop {
            let node = self.nodes[at];
            if node.axis == LEAF {
                return (at, depth);
            }
            at = node.first as usize + usize::from(p[node.axis as usize] >= node.split);
            depth += 1;
        }
    }

    fn put(&mut self, block: usize, entry: Entry) {
        let b = &mut self.blocks[block];
        let slot = b.len as usize;
        (0..3).for_each(|a| b.position[a][slot] = entry.position[a]);
        b.id[slot] = entry.id;
        b.len += 1;
        self.places[entry.id as usize] = (block * LANES + slot) as u32;
    }

    /// Block of a leaf with room, if there is one.
    fn with_room(&self, first: u32) -> Option<usize> {
        let mut at = first;
        while at != NONE {
            if (self.blocks[at as usize].len as usize) < LANES {
                return Some(at as usize);
            }
            at = self.blocks[at as usize].next;
        }
        None
    }

    fn place(&mut self, entry: Entry) {
        loop {
            let (leaf, depth) = self.leaf_of(entry.position);
            let first = self.nodes[leaf].first;
            if let Some(block) = self.with_room(first) {
                return self.put(block, entry);
            }
            if depth >= MAX_DEPTH {
                // Medians of n neurons are log2(n) levels deep, and two more per axis where many share a coordinate.
                self.rebuild();
                continue;
            }
            let mut entries = vec![entry];
            let mut at = first;
            while at != NONE {
                let block = &self.blocks[at as usize];
                entries.extend((0..block.len as usize).map(|slot| block.entry(slot)));
                at = block.next;
            }
            let region = self.blocks[first as usize].region;
            match median_plane(&mut entries) {
                Some((axis, split, half)) => {
                    let children = self.nodes.len();
                    let child = Node { split: 0.0, axis: LEAF, first: NONE };
                    self.nodes.extend([child, child]);
                    self.nodes[leaf] = Node { split, axis: axis as u32, first: children as u32 };
                    let [left, right] = region.split(axis, split);
                    self.fill(children, &entries[..half], left);
                    self.fill(children + 1, &entries[half..], right);
                }
                None => self.fill(leaf, &entries, region),
            }
            return;
        }
    }

    /// Puts entries into new blocks of a leaf; more than one only where no plane parts them.
    fn fill(&mut self, leaf: usize, entries: &[Entry], region: Aabb) {
        let first = self.blocks.len();
        self.nodes[leaf].first = first as u32;
        let n_blocks = entries.len().div_ceil(LANES).max(1);
        for at in first..first + n_blocks {
            let mut block = Block::new(region);
            block.next = if at + 1 < first + n_blocks { at as u32 + 1 } else { NONE };
            self.blocks.push(block);
        }
        for (i, &entry) in entries.iter().enumerate() {
            self.put(first + i / LANES, entry);
        }
    }

    /// Builds the tree over the neurons that it holds.
    fn rebuild(&mut self) {
        let mut entries: Vec<Entry> = self
            .places
            .iter()
            .filter(|&&place| place != NONE)
            .map(|&p| self.blocks[p as usize / LANES].entry(p as usize % LANES))
            .collect();
        self.built_len = entries.len();
        self.nodes.clear();
        self.blocks.clear();
        self.nodes.push(Node { split: 0.0, axis: LEAF, first: 0 });
        self.build(0, &mut entries, Aabb::ALL);
    }

    fn build(&mut self, at: usize, entries: &mut [Entry], region: Aabb) {
        if entries.len() > FILL
            && let Some((axis, split, half)) = median_plane(entries)
        {
            let children = self.nodes.len();
            let leaf = Node { split: 0.0, axis: LEAF, first: 0 };
            self.nodes.extend([leaf, leaf]);
            self.nodes[at] = Node { split, axis: axis as u32, first: children as u32 };
            let [left, right] = region.split(axis, split);
            let (below, above) = entries.split_at_mut(half);
            self.build(children, below, left);
            self.build(children + 1, above, right);
            return;
        }
        self.fill(at, entries, region);
    }
}

/// A plane across the longest side of the bounding box of at least two entries, near the median: axis, place, and
/// how many are below, which then come first. `None` when all are at one place.
fn median_plane(entries: &mut [Entry]) -> Option<(usize, f32, usize)> {
    let bounds = Aabb::of(entries.iter().map(|e| e.position))?;
    let axis = bounds.longest_axis();
    if bounds.sides()[axis] <= 0.0 {
        return None;
    }
    entries.sort_unstable_by(|a, b| {
        a.position[axis].total_cmp(&b.position[axis]).then(a.id.cmp(&b.id))
    });
    let value = |i: usize| entries[i].position[axis];
    let n = entries.len();
    // The step from one value to a larger one that is nearest to the middle.
    let half = (0..n)
        .flat_map(|off| [n / 2 + off, (n / 2).wrapping_sub(off)])
        .find(|&i| (1..n).contains(&i) && value(i - 1) < value(i))?;
    let middle = 0.5 * (value(half - 1) + value(half));
    let split =
        if middle > value(half - 1) && middle <= value(half) { middle } else { value(half) };
    Some((axis, split, half))
}

impl Winners for Index {
    fn insert(&mut self, id: u32, position: [f32; 3]) {
        if self.places.len() <= id as usize {
            self.places.resize(id as usize + 1, NONE);
        }
        self.place(Entry { position, id });
        self.len += 1;
        if self.len > 2 * self.built_len.max(LANES) {
            self.rebuild();
        }
    }

    fn remove(&mut self, id: u32) {
        let place = std::mem::replace(&mut self.places[id as usize], NONE) as usize;
        let (at, slot) = (place / LANES, place % LANES);
        let block = &mut self.blocks[at];
        block.len -= 1;
        let last = block.len as usize;
        let moved = block.id[last];
        for column in &mut block.position {
            column[slot] = column[last];
            column[last] = f32::INFINITY;
        }
        block.id[slot] = moved;
        block.id[last] = NONE;
        if slot != last {
            self.places[moved as usize] = place as u32;
        }
        self.len -= 1;
    }

    #[inline]
    fn shift(&mut self, id: u32, position: [f32; 3]) {
        let place = self.places[id as usize] as usize;
        let (at, slot) = (place / LANES, place % LANES);
        let block = &mut self.blocks[at];
        if block.contains(position) {
            (0..3).for_each(|a| block.position[a][slot] = position[a]);
        } else {
            self.remove(id);
            self.place(Entry { position, id });
            self.len += 1;
        }
    }

    fn two_nearest(&self, query: [f32; 3]) -> [Winner; 2] {
        let mut best = Best([Winner::NONE; 2]);
        let empty = Postponed { node: 0, bound: 0.0, offset: [0.0; 3] };
        let mut stack = [empty; MAX_DEPTH as usize + 1];
        let mut waiting = 0;
        let mut now = empty;
        loop {
            let mut node = self.nodes[now.node as usize];
            while node.axis != LEAF {
                let axis = node.axis as usize;
                let off = query[axis] - node.split;
                let above = u32::from(off >= 0.0);
                let mut offset = now.offset;
                offset[axis] = off;
                let bound = (offset[0] * offset[0] + offset[1] * offset[1]) + offset[2] * offset[2];
                // One place is put off per level of the path, of which there are no more than the stack has.
                stack[waiting] = Postponed { node: node.first + 1 - above, bound, offset };
                waiting += usize::from(bound <= best.limit());
                node = self.nodes[(node.first + above) as usize];
            }
            let mut at = node.first;
            while at != NONE {
                let block = &self.blocks[at as usize];
                let distances = block.squared_distances(query);
                for (d, id) in distances.into_iter().zip(block.id) {
                    if d <= best.limit() {
                        best.offer(Winner::new(d, id));
                    }
                }
                at = block.next;
            }
            loop {
                if waiting == 0 {
                    return best.0;
                }
                waiting -= 1;
                if stack[waiting].bound <= best.limit() {
                    break;
                }
            }
            now = stack[waiting];
        }
    }
}

/// Neurons whose nearest is known before any is looked at one by one.
const BATCH: usize = 64;

/// All distances for every signal, in columns.
#[derive(Debug, Clone, Default)]
pub struct BruteForce {
    /// Unused ids are at infinity; a multiple of [`BATCH`] long.
    columns: [Vec<f32>; 3],
}

impl Winners for BruteForce {
    fn insert(&mut self, id: u32, position: [f32; 3]) {
        let len = (id as usize + 1).next_multiple_of(BATCH);
        for (column, p) in self.columns.iter_mut().zip(position) {
            if column.len() < len {
                column.resize(len, f32::INFINITY);
            }
            column[id as usize] = p;
        }
    }

    fn remove(&mut self, id: u32) {
        self.columns.iter_mut().for_each(|column| column[id as usize] = f32::INFINITY);
    }

    fn shift(&mut self, id: u32, position: [f32; 3]) {
        self.insert(id, position);
    }

    fn two_nearest(&self, query: [f32; 3]) -> [Winner; 2] {
        let mut best = Best([Winner::NONE; 2]);
        let [xs, ys, zs] = [0, 1, 2].map(|a| self.columns[a].as_chunks::<BATCH>().0);
        let mut distances = [0.0_f32; BATCH];
        for (batch, ((x, y), z)) in xs.iter().zip(ys).zip(zs).enumerate() {
            for lane in 0..BATCH {
                let d = [x[lane] - query[0], y[lane] - query[1], z[lane] - query[2]];
                distances[lane] = (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2];
            }
            let mut least = [f32::INFINITY; 8];
            for part in distances.as_chunks::<8>().0 {
                for (l, &d) in least.iter_mut().zip(part) {
                    *l = if d < *l { d } else { *l };
                }
            }
            if least.into_iter().fold(f32::INFINITY, f32::min) <= best.limit() {
                for (lane, &d) in distances.iter().enumerate() {
                    best.offer(Winner::new(d, (batch * BATCH + lane) as u32));
                }
            }
        }
        best.0
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[derive(Debug, Clone)]
    enum Change {
        Insert([f32; 3]),
        Remove(usize),
        Shift(usize, [f32; 3]),
        Nudge(usize, [f32; 3]),
    }

    /// Coordinates on a coarse grid tie often; others hardly ever.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![(-2_i8..2).prop_map(f32::from), -5.0_f32..5.0, Just(1e6)]
    }

    fn position() -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(coordinate())
    }

    fn change() -> impl Strategy<Value = Change> {
        let small = prop::array::uniform3(-0.01_f32..0.01);
        prop_oneof![
            4 => position().prop_map(Change::Insert),
            1 => any::<usize>().prop_map(Change::Remove),
            2 => (any::<usize>(), position()).prop_map(|(i, p)| Change::Shift(i, p)),
            3 => (any::<usize>(), small).prop_map(|(i, p)| Change::Nudge(i, p)),
        ]
    }

    fn by_definition(alive: &[(u32, [f32; 3])], query: [f32; 3]) -> Vec<Winner> {
        let mut all: Vec<Winner> = alive
            .iter()
            .map(|&(id, p)| {
                let d: [f32; 3] = std::array::from_fn(|a| p[a] - query[a]);
                Winner::new((d[0] * d[0] + d[1] * d[1]) + d[2] * d[2], id)
            })
            .collect();
        all.sort_unstable();
        all
    }

    proptest! {
        #[test]
        fn both_searches_are_exact_while_neurons_come_go_and_move(
            changes in prop::collection::vec(change(), 1..400),
            queries in prop::collection::vec(position(), 1..20),
        ) {
            let (mut index, mut brute) = (Index::new(), BruteForce::default());
            let mut alive: Vec<(u32, [f32; 3])> = Vec::new();
            let mut free: Vec<u32> = Vec::new();
            let mut used = 0;
            for (step, change) in changes.into_iter().enumerate() {
                match change {
                    Change::Remove(i) if alive.len() > 2 => {
                        let (id, _) = alive.swap_remove(i % alive.len());
                        free.push(id);
                        index.remove(id);
                        brute.remove(id);
                    }
                    Change::Shift(i, _) | Change::Nudge(i, _) if !alive.is_empty() => {
                        let n = alive.len();
                        let (id, p) = &mut alive[i % n];
                        *p = match change {
                            Change::Nudge(_, by) => std::array::from_fn(|a| p[a] + by[a]),
                            Change::Shift(_, to) => to,
                            _ => *p,
                        };
                        index.shift(*id, *p);
                        brute.shift(*id, *p);
                    }
                    Change::Insert(p) => {
                        let id = free.pop().unwrap_or(used);
                        used = used.max(id + 1);
                        alive.push((id, p));
                        index.insert(id, p);
                        brute.insert(id, p);
                    }
                    _ => {}
                }
                if alive.len() >= 2 && step % 8 == 0 {
                    for &q in &queries {
                        let expected = by_definition(&alive, q);
                        prop_assert_eq!(&index.two_nearest(q)[..], &expected[..2]);
                        prop_assert_eq!(&brute.two_nearest(q)[..], &expected[..2]);
                    }
                }
            }
        }
    }

    #[test]
    fn many_neurons_at_one_place_and_in_a_nested_row() {
        let (mut index, mut brute) = (Index::new(), BruteForce::default());
        for id in 0..2000_u32 {
            // A hundred at zero, then ever nearer to it from one side: the deepest tree that medians can give.
            let x = if id < 100 { 0.0 } else { 2.0_f32.powi(-((id % 120) as i32)) };
            let p = [x, 0.0, 0.0];
            index.insert(id, p);
            brute.insert(id, p);
            if id >= 1 {
                for q in [[0.0; 3], [1e-20, 0.0, 0.0], [0.3, 0.1, -0.2]] {
                    assert_eq!(index.two_nearest(q), brute.two_nearest(q), "{id}");
                }
            }
        }
    }
}
