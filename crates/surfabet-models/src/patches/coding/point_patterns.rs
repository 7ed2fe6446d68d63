//! Points that no patch is near enough to: cells of a cubic grid, coded level by level as an octree, given the pattern of the cells around.
//!
//! All nodes of a level are coded before those of the next, in the order of their keys, a bit per child: does it hold a point? So of the
//! children of the 26 nodes around, those of nodes before are known, and of nodes after it is known whether there are any. Five models look at
//! different parts of this, and give one probability together: where scans are surfaces and lines, one of them has seen how these go on.

use surfabet_entropy::{Bit, Coder, MixedBits, MixedContext};
use surfabet_geom::morton::step;

use super::levels::{Level, code_levels};

/// Heights of nodes with models of their own, from the finest; nodes further up share those of the last.
const HEIGHTS: usize = 4;

/// Bits of the contexts that are hashed.
const HASH_BITS: u32 = 17;

/// Most occupied and most unknown cells around that are distinguished.
const MOST_OCCUPIED: usize = 7;
const MOST_UNKNOWN: usize = 15;

/// Weight of each of the five models at first, in units of 2^-16: 0.35, since each knows something else.
const WEIGHT: i32 = 22_938;

/// Steps to the six nodes or cells that share a face with one.
const FACES: [[i32; 3]; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

/// Steps to the cells that share a face or an edge with a child and may come before it: one down along an axis, down along two, and up along
/// one of two.
const NEAR: [[i32; 3]; 12] = [
    [-1, 0, 0],
    [0, -1, 0],
    [0, 0, -1],
    [0, -1, -1],
    [-1, 0, -1],
    [-1, -1, 0],
    [-1, 1, 0],
    [-1, 0, 1],
    [0, -1, 1],
    [1, -1, 0],
    [1, 0, -1],
    [0, 1, -1],
];

/// The first of [`NEAR`]: one down along an axis or along two.
const DOWN: usize = 6;

/// Steps to cells two down along an axis.
const FAR: [[i32; 3]; 12] = [
    [-2, 0, 0],
    [0, -2, 0],
    [0, 0, -2],
    [-2, -1, 0],
    [-1, -2, 0],
    [-2, 0, -1],
    [-1, 0, -2],
    [0, -2, -1],
    [0, -1, -2],
    [-2, 1, 0],
    [-2, 0, 1],
    [0, -2, 1],
];

/// Adaptive models of the points; weights by height, number of occupied children before and of occupied cells around.
#[derive(Debug, Clone)]
pub(in crate::patches) struct PatternModels(MixedBits<5>);

impl Default for PatternModels {
    fn default() -> Self {
        let hashed = 1 << HASH_BITS;
        let contexts = [HEIGHTS << 14, HEIGHTS << 10, hashed, 1 << 18, hashed];
        Self(MixedBits::new(contexts, Bit::DEFAULT_MEMORY, HEIGHTS << 6, WEIGHT))
    }
}

/// Context of some bits, of which a few are equal now and then.
fn hashed(low: u32, high: u32) -> usize {
    let mixed = low.wrapping_mul(0x9e37_79b1) ^ high.wrapping_mul(0x85eb_ca6b);
    (mixed >> (u32::BITS - HASH_BITS)) as usize
}

/// Children of a node and of the 26 around: 6 x 6 x 6 cells, those of the node from 2 to 3 along each axis. Bit `x + 6 y` of number `z`.
#[derive(Default)]
struct Block([u64; 6]);

impl Block {
    /// Sets the cells of the node `at`, 0 to 2 along each axis, that are bits of `children`.
    fn set_children(&mut self, at: [usize; 3], children: u8) {
        for z in 0..2 {
            let of_layer = u64::from(children >> (4 * z));
            let rows = of_layer & 3 | (of_layer >> 2 & 3) << 6;
            self.0[2 * at[2] + z] |= rows << (2 * at[0] + 12 * at[1]);
        }
    }

    /// Is the cell a step away from a child?
    fn has(&self, child: usize, step: [i32; 3]) -> u32 {
        let [x, y, z] = std::array::from_fn(|a| 2 + (child >> a & 1) as i32 + step[a]);
        (self.0[z as usize] >> (x + 6 * y) & 1) as u32
    }

    /// Which of the cells that are steps away from a child are there, the first as the highest bit.
    fn pattern(&self, child: usize, steps: &[[i32; 3]]) -> u32 {
        steps.iter().fold(0, |bits, &step| bits << 1 | self.has(child, step))
    }

    /// Number of cells among a child and the 26 around it.
    fn count(&self, child: usize) -> usize {
        /// Three bits of three rows.
        const NINE: u64 = 0b111 | 0b111 << 6 | 0b111 << 12;
        let [x, y, z]: [usize; 3] = std::array::from_fn(|a| 1 + (child >> a & 1));
        let layers = self.0[z..z + 3].iter();
        layers.map(|layer| (layer >> (x + 6 * y) & NINE).count_ones() as usize).sum()
    }
}

/// What is known around a node, more with each child that is coded.
struct PatternContext<'a> {
    /// Cells that are occupied, as far as it is known.
    occupied: Block,
    /// Cells of which it is not known.
    unknown: Block,
    /// Which nodes there are: bit `x + 3 y + 9 z` for the one at `x - 1`, `y - 1`, `z - 1`.
    nodes: u32,
    /// Which of the six nodes beside there are, in the order of [`FACES`].
    beside: usize,
    models: &'a mut PatternModels,
    /// Height of the node less one, at most [`HEIGHTS`] less one.
    height: usize,
}

impl<'a> PatternContext<'a> {
    /// Of a node of a level, by its number.
    fn new(level: &Level, number: usize, models: &'a mut PatternModels) -> Self {
        let key = level.nodes[number];
        // What the key changes by along each axis, down, not at all and up.
        let change = |axis: usize| [false, true].map(|up| key ^ step(key, axis, up));
        let changes: [[u64; 3]; 3] = std::array::from_fn(|axis| {
            let [down, up] = change(axis);
            [down, 0, up]
        });
        let (mut occupied, mut unknown, mut nodes) = (Block::default(), Block::default(), 0);
        for j in 0..27 {
            let at = [j % 3, j / 3 % 3, j / 9];
            let other = (0..3).fold(key, |key, axis| key ^ changes[axis][at[axis]]);
            let Some(&place) = level.places.get(&other) else { continue };
            nodes |= 1 << j;
            let place = place as usize;
            if place < number {
                occupied.set_children(at, level.children[place]);
            } else {
                unknown.set_children(at, u8::MAX);
            }
        }
        let is_there = |[x, y, z]: [i32; 3]| nodes >> (13 + x + 3 * y + 9 * z) & 1;
        let beside = (0..6).map(|i| (is_there(FACES[i]) as usize) << i).sum();
        let height = level.height.min(HEIGHTS) - 1;
        Self { occupied, unknown, nodes, beside, models, height }
    }

    /// Codes the children of the node: bit `c` for child `c`.
    fn children<C: Coder>(&mut self, coder: &mut C, wanted: u8) -> Result<u8, C::Error> {
        let mut coded = 0_u8;
        for child in 0..8 {
            let is_certain = child == 7 && coded == 0;
            let at = self.contexts(child, coded);
            let is_occupied =
                is_certain || self.models.0.bit(coder, at, wanted >> child & 1 != 0)?;
            coded |= u8::from(is_occupied) << child;
            self.take(child, is_occupied);
        }
        Ok(coded)
    }

    /// Takes note of a child.
    fn take(&mut self, child: usize, is_occupied: bool) {
        self.occupied.set_children([1; 3], u8::from(is_occupied) << child);
        let [x, y, z]: [usize; 3] = std::array::from_fn(|a| 2 + (child >> a & 1));
        self.unknown.0[z] &= !(1 << (x + 6 * y));
    }

    /// Contexts of a child; `coded` are the children before it.
    fn contexts(&self, child: usize, coded: u8) -> MixedContext<5> {
        let before = coded.count_ones() as usize;
        // The child's number, and which of those before it are occupied.
        let siblings = 1 << child | usize::from(coded);
        let occupied = self.occupied.count(child).min(MOST_OCCUPIED);
        // The child itself is one of them.
        let unknown = (self.unknown.count(child) - 1).min(MOST_UNKNOWN);
        let near = self.occupied.pattern(child, &NEAR) as usize;
        let down = self.occupied.pattern(child, &NEAR[..DOWN]);
        let far = self.occupied.pattern(child, &FAR);
        let (height, of_height) = (self.height, self.height as u32);
        MixedContext {
            mixer: (height << 3 | before) << 3 | occupied,
            models: [
                (height << 6 | self.beside) << 8 | siblings,
                ((height << 3 | occupied) << 4 | unknown) << 3 | before,
                hashed(far << 6 | down, of_height << 3 | child as u32),
                (child << 12 | near) << 3 | before,
                hashed(self.nodes, of_height << 8 | siblings as u32),
            ],
        }
    }
}

/// Writes, reads or prices sorted, different keys of cells.
///
/// # Errors
/// Whatever the coder finds wrong, which includes more than `max_points` of them.
pub(in crate::patches) fn code_point_patterns<C: Coder>(
    coder: &mut C,
    models: &mut PatternModels,
    keys: &[u64],
    max_points: usize,
) -> Result<Vec<u64>, C::Error> {
    code_levels(coder, keys, max_points, |coder, level, number, wanted| {
        PatternContext::new(level, number, models).children(coder, wanted)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use surfabet_entropy::Price;
    use surfabet_geom::morton;

    use crate::patches::attributes::cells::index;
    use crate::patches::coding::levels::Wanted;
    use crate::patches::coding::levels::testing::{Ones, scattered};
    use crate::patches::coding::near_points::{NearPointModels, code_near_points};

    fn price(keys: &[u64]) -> f64 {
        let mut price = Price::default();
        let models = &mut PatternModels::default();
        let Ok(_) = code_point_patterns(&mut price, models, keys, usize::MAX);
        price.bits
    }

    fn cell(at: [i64; 3]) -> u64 {
        morton::encode(at.map(|c| c as u64))
    }

    /// One of eight, at random.
    fn one_of_eight(state: &mut u64) -> bool {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        *state >> 61 == 0
    }

    proptest! {
        #[test]
        fn every_key_is_walked(keys in prop::collection::btree_set(0_u64..1 << 63, 0..50)) {
            let keys: Vec<u64> = keys.into_iter().collect();
            let models = &mut PatternModels::default();
            let Ok(found) = code_point_patterns(&mut Price::default(), models, &keys, usize::MAX);
            prop_assert_eq!(found, keys);
        }
    }

    #[test]
    fn cells_around_are_what_the_grid_has() {
        // Against the definition: of a random set, the cells around each child that come before it in the walk, and those after it.
        let mut state = 7;
        let mut keys: Vec<u64> = (0..12 * 12 * 12)
            .filter(|_| one_of_eight(&mut state))
            .map(|i| cell([i % 12, i / 12 % 12, i / 144]))
            .collect();
        keys.sort_unstable();
        let mut nodes: Vec<u64> = keys.iter().map(|k| k >> 3).collect();
        nodes.dedup();
        let mut wanted = Wanted::of(&keys, 1);
        let wanted: Vec<u8> = nodes.iter().map(|&node| wanted.children_of(node)).collect();
        let children = vec![0; nodes.len()];
        let mut level = Level { height: 1, places: index(&nodes), nodes, children };
        for (number, &of_node) in wanted.iter().enumerate() {
            let models = &mut PatternModels::default();
            let mut around = PatternContext::new(&level, number, models);
            for child in 0..8 {
                check_child(&around, &level, number, child, &keys);
                around.take(child, of_node >> child & 1 != 0);
            }
            level.children[number] = of_node;
        }
    }

    /// Compares what is known around a child with all cells that there are.
    fn check_child(
        around: &PatternContext<'_>,
        level: &Level,
        number: usize,
        child: usize,
        keys: &[u64],
    ) {
        let own = level.nodes[number] << 3 | child as u64;
        let at = morton::decode(own).map(|c| c as i64);
        let key = |step: [i32; 3]| {
            let at: [i64; 3] = std::array::from_fn(|a| at[a] + i64::from(step[a]));
            (at.iter().all(|&c| c >= 0)).then(|| cell(at))
        };
        let is_known = |key: &u64| *key < own && keys.binary_search(key).is_ok();
        for steps in [NEAR, FAR] {
            let expected = steps.iter().map(|&step| key(step).is_some_and(|key| is_known(&key)));
            let expected = expected.fold(0, |bits, has| bits << 1 | u32::from(has));
            assert_eq!(around.occupied.pattern(child, &steps), expected);
        }
        let steps = (0..27).map(|j| [j % 3 - 1, j / 3 % 3 - 1, j / 9 - 1]);
        let all: Vec<u64> = steps.filter_map(key).collect();
        let known = all.iter().filter(|key| is_known(key)).count();
        // Unknown is what lies in a node that there is, and comes later; the child itself does.
        let is_open = |key: &&u64| **key >= own && level.places.contains_key(&(**key >> 3));
        assert_eq!(around.occupied.count(child), known);
        assert_eq!(around.unknown.count(child), all.iter().filter(is_open).count());
    }

    #[test]
    fn surfaces_take_less_than_with_two_models() {
        // A tilted plane of one cell's thickness: 10,000 cells; and rings about the vertical, half a cell apart from being closed.
        let plane = |i: i64| {
            let (x, y) = (i % 100, i / 100);
            [1000 + x, 1000 + y, 1000 + (3 * x + 2 * y) / 10]
        };
        let ring = |i: i64| {
            let (angle, radius) = ((i % 1000) as f64 * 0.006_283, 40.0 + 4.0 * (i / 1000) as f64);
            [angle.cos(), angle.sin(), 0.3].map(|c| 1000 + (radius * c) as i64)
        };
        let cells = |n: i64, at: &dyn Fn(i64) -> [i64; 3]| {
            (0..n).map(|i| cell(at(i))).collect::<std::collections::BTreeSet<_>>()
        };
        for cells in [cells(10_000, &plane), cells(20_000, &ring)] {
            let keys: Vec<u64> = cells.into_iter().collect();
            let mut before = Price::default();
            let models = &mut NearPointModels::default();
            let Ok(_) = code_near_points(&mut before, models, &keys, usize::MAX);
            let found = price(&keys);
            assert!(
                found < 0.97 * before.bits && found > 0.2 * before.bits,
                "{found} {}",
                before.bits
            );
        }
    }

    #[test]
    fn scattered_cells_take_what_their_places_hold() {
        let (keys, least) = scattered();
        let found = price(&keys);
        assert!(found > 0.99 * least && found < 1.2 * least, "{found} {least}");
    }

    #[test]
    fn more_points_than_allowed_are_an_error_of_the_reader() {
        let models = &mut PatternModels::default();
        assert!(code_point_patterns(&mut Ones, models, &[], 100).is_err());
    }
}
