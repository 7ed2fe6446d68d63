//! A k-d tree that follows the neurons as they move, are added and removed.
//!
//! Its leaves hold up to [`LANES`] neurons in columns, so that a leaf's distances are a few vector operations. A neuron
//! that moves stays in its leaf as long as it stays in the leaf's region, which is nearly always, and is inserted from
//! the root otherwise. A full leaf is split at its median; the tree is rebuilt whenever the number of neurons has
//! doubled, so that its depth stays logarithmic whatever the density does.
//!
//! Exact in `f32`: the distance of a region is that of the planes between it and the signal, whose squares are summed
//! in the order in which those of neurons are, and every rounding on the way is monotone. So no region is computed to
//! be farther away than a neuron in it, and regions as far as the second winner are searched for the tie.

use surfabet_geom::Aabb;

use super::{Best, Winner, Winners};
use crate::gas::constants::FILL;

/// Neurons per leaf.
const LANES: usize = 8;

/// Deepest path; one more split rebuilds the tree. Medians of n neurons are log2(n) levels deep, 26 for the most that a
/// gas may have, and two more per axis where many share a coordinate.
const MAX_DEPTH: u32 = 48;

/// No block, no place.
const NONE: u32 = u32::MAX;

/// In place of the axis of a node: the node is a leaf.
const LEAF: u32 = 3;

/// A block of neurons of a leaf.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct NeuronBlock {
    /// Columns; unused lanes are at infinity.
    position: [[f32; LANES]; 3],
    id: [u32; LANES],
    /// Region of the leaf: its lower faces belong to it, its upper ones do not.
    region: Aabb,
    len: u32,
    /// Another block of the same leaf: for neurons at one place that no plane parts.
    next: u32,
}

impl NeuronBlock {
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

    fn entry(&self, slot: usize) -> TreeNeuron {
        TreeNeuron { position: std::array::from_fn(|a| self.position[a][slot]), id: self.id[slot] }
    }
}

/// A neuron of the tree.
#[derive(Debug, Clone, Copy)]
struct TreeNeuron {
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

/// A subtree that a search may have to visit later.
#[derive(Debug, Clone, Copy)]
struct Postponed {
    node: u32,
    /// Squared distance of its region from the query, or less.
    bound: f32,
    /// From the nearest plane on each axis to the query; zero where none lies between.
    offset: [f32; 3],
}

/// The k-d tree that follows the neurons.
#[derive(Debug, Clone)]
pub struct Index {
    nodes: Vec<Node>,
    blocks: Vec<NeuronBlock>,
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
            blocks: vec![NeuronBlock::new(Aabb::ALL)],
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

    /// Adds a neuron to a block with room.
    fn put(&mut self, block: usize, entry: TreeNeuron) {
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

    /// Inserts a neuron from the root, and splits its leaf where that is full.
    fn place(&mut self, entry: TreeNeuron) {
        loop {
            let (leaf, depth) = self.leaf_of(entry.position);
            let first = self.nodes[leaf].first;
            if let Some(block) = self.with_room(first) {
                return self.put(block, entry);
            }
            if depth >= MAX_DEPTH {
                self.rebuild();
                continue;
            }
            return self.split_leaf(leaf, first, entry);
        }
    }

    /// Splits a full leaf at the median of its neurons and a new one; where all are at one place the leaf gets another
    /// block.
    fn split_leaf(&mut self, leaf: usize, first: u32, entry: TreeNeuron) {
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
    }

    /// Puts entries into new blocks of a leaf; more than one only where no plane parts them.
    fn fill(&mut self, leaf: usize, entries: &[TreeNeuron], region: Aabb) {
        let first = self.blocks.len();
        self.nodes[leaf].first = first as u32;
        let n_blocks = entries.len().div_ceil(LANES).max(1);
        for at in first..first + n_blocks {
            let mut block = NeuronBlock::new(region);
            block.next = if at + 1 < first + n_blocks { at as u32 + 1 } else { NONE };
            self.blocks.push(block);
        }
        for (i, &entry) in entries.iter().enumerate() {
            self.put(first + i / LANES, entry);
        }
    }

    /// Builds the tree anew over the neurons that it holds.
    fn rebuild(&mut self) {
        let mut entries: Vec<TreeNeuron> = self
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

    /// Builds the subtree of node `at` over `entries`.
    fn build(&mut self, at: usize, entries: &mut [TreeNeuron], region: Aabb) {
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
fn median_plane(entries: &mut [TreeNeuron]) -> Option<(usize, f32, usize)> {
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
        self.place(TreeNeuron { position, id });
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
            self.place(TreeNeuron { position, id });
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
                // One subtree is postponed per level of the path, of which there are no more than the stack has.
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
