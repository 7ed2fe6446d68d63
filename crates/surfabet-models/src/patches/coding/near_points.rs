//! Points that no patch is near enough to: cells of a cubic grid, coded level by level as an octree, given the cells around.
//!
//! A node of the octree is a bit per child: does it hold a point? All nodes of a level are coded before those of the next, in
//! the order of their keys. So of the cells around a child of a node `n` is known: those of `n` before it; those of nodes before
//! `n`, which are all that are displaced downwards; and whether the other nodes around are occupied at all. Scans are surfaces
//! and lines, and what goes on there goes on here.

use surfabet_entropy::{Bit, Coder, MixedBits, MixedContext};
use surfabet_geom::morton::{MortonMap, step};

use super::levels::code_levels;

/// Heights of nodes with models of their own, from the finest; nodes further up share those of the last.
const HEIGHTS: usize = 4;

/// Counts of occupied children before, and of nodes around, are distinguished up to this.
const MOST: usize = 3;

/// Weight of each of the two models at first: half of each.
const WEIGHT: i32 = 1 << 15;

/// Adaptive models of the points: one by how many of the cells around are occupied, one by which of them are; weights by
/// height and number of occupied children before.
#[derive(Debug, Clone)]
pub(in crate::patches) struct NearPointModels(MixedBits<2>);

impl Default for NearPointModels {
    fn default() -> Self {
        let contexts = [HEIGHTS << 13, HEIGHTS << 15];
        Self(MixedBits::new(contexts, Bit::DEFAULT_MEMORY, HEIGHTS * (MOST + 1), WEIGHT))
    }
}

/// What is known around a node before its children are coded.
struct NodeContext<'a> {
    /// Which children the nodes one down along each axis have.
    below: [u8; 3],
    /// Which children the nodes one down along the two axes after each have.
    below_edge: [u8; 3],
    /// The nodes one up along each axis: are they occupied?
    above: [bool; 3],
    /// How many of the six nodes beside are occupied.
    beside: usize,
    models: &'a mut NearPointModels,
    /// Height of the node, from 1 for parents of cells.
    height: usize,
}

impl<'a> NodeContext<'a> {
    /// Of the node of a key; `places` are the numbers of all nodes of its level, `children` what is known of theirs.
    fn new(
        key: u64,
        places: &MortonMap<u32>,
        children: &[u8],
        models: &'a mut NearPointModels,
        height: usize,
    ) -> Self {
        let of = |key: u64| places.get(&key).map(|&i| children[i as usize]);
        let down = |axis: usize| of(step(key, axis, false));
        let edge = |axis: usize| {
            of(step(step(key, (axis + 1) % 3, false), (axis + 2) % 3, false)).unwrap_or(0)
        };
        let above = std::array::from_fn(|axis| places.contains_key(&step(key, axis, true)));
        let below: [Option<u8>; 3] = std::array::from_fn(down);
        let beside = below.iter().flatten().count() + above.iter().filter(|up| **up).count();
        let below_edge = std::array::from_fn(edge);
        let height = height.min(HEIGHTS) - 1;
        Self { below: below.map(|b| b.unwrap_or(0)), below_edge, above, beside, models, height }
    }

    /// Bit `a` is set where the cell one down from a child along axis `a` is occupied; `coded` are the children before it.
    fn faces(&self, child: usize, coded: u8) -> usize {
        let occupied = |axis: usize| {
            let other = child ^ 1 << axis;
            let of = if child >> axis & 1 != 0 { coded } else { self.below[axis] };
            usize::from(of >> other & 1)
        };
        (0..3).map(|axis| occupied(axis) << axis).sum()
    }

    /// Bit `a` is set where the cell one down from a child along both axes after `a` is occupied.
    fn edges(&self, child: usize, coded: u8) -> usize {
        let occupied = |axis: usize| {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let other = child ^ 1 << u ^ 1 << v;
            let of = match (child >> u & 1, child >> v & 1) {
                (1, 1) => coded,
                (1, _) => self.below[v],
                (_, 1) => self.below[u],
                _ => self.below_edge[axis],
            };
            usize::from(of >> other & 1)
        };
        (0..3).map(|axis| occupied(axis) << axis).sum()
    }

    /// Bit `a` is set where the node one up from a child along axis `a` is another one, and occupied.
    fn ahead(&self, child: usize) -> usize {
        (0..3).map(|a| usize::from(child >> a & 1 != 0 && self.above[a]) << a).sum()
    }

    /// Codes the children of the node: bit `c` for child `c`.
    fn children<C: Coder>(&mut self, coder: &mut C, wanted: u8) -> Result<u8, C::Error> {
        let mut coded = 0_u8;
        for child in 0..8 {
            let before = coded.count_ones() as usize;
            let is_certain = child == 7 && before == 0;
            if is_certain || self.child(coder, child, coded, wanted >> child & 1 != 0)? {
                coded |= 1 << child;
            }
        }
        Ok(coded)
    }

    /// Is a child occupied?
    fn child<C: Coder>(
        &mut self,
        coder: &mut C,
        child: usize,
        coded: u8,
        wanted: bool,
    ) -> Result<bool, C::Error> {
        let before = coded.count_ones() as usize;
        let (faces, edges) = (self.faces(child, coded), self.edges(child, coded));
        let ahead = self.ahead(child);
        let n = |mask: usize| mask.count_ones() as usize;
        // Fields of 3, 2, 2, 2, 2, 2 and 2 bits.
        let by_count = [n(faces), before.min(MOST), n(ahead), n(edges), self.beside.min(MOST)];
        let by_count = by_count.iter().fold(self.height << 3 | child, |all, &k| all << 2 | k);
        // Fields of 3 bits, but the height.
        let by_place = [child, faces, before, edges, ahead];
        let by_place = by_place.iter().fold(self.height, |all, &k| all << 3 | k);
        let mixer = self.height * (MOST + 1) + before.min(MOST);
        let at = MixedContext { mixer, models: [by_count, by_place] };
        self.models.0.bit(coder, at, wanted)
    }
}

/// Writes, reads or prices sorted, different keys of cells.
///
/// # Errors
/// Whatever the coder finds wrong, which includes more than `max_points` of them.
pub(in crate::patches) fn code_near_points<C: Coder>(
    coder: &mut C,
    models: &mut NearPointModels,
    keys: &[u64],
    max_points: usize,
) -> Result<Vec<u64>, C::Error> {
    code_levels(coder, keys, max_points, |coder, level, number, wanted| {
        NodeContext::new(level.nodes[number], &level.places, &level.children, models, level.height)
            .children(coder, wanted)
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
    use crate::patches::coding::points::{PointModels, code_points};

    fn price(keys: &[u64]) -> f64 {
        let mut price = Price::default();
        let models = &mut NearPointModels::default();
        let Ok(_) = code_near_points(&mut price, models, keys, usize::MAX);
        price.bits
    }

    proptest! {
        #[test]
        fn every_key_is_walked(keys in prop::collection::btree_set(0_u64..1 << 63, 0..50)) {
            let keys: Vec<u64> = keys.into_iter().collect();
            let models = &mut NearPointModels::default();
            let Ok(found) = code_near_points(&mut Price::default(), models, &keys, usize::MAX);
            prop_assert_eq!(found, keys);
        }
    }

    #[test]
    fn cells_around_are_what_the_grid_has() {
        // Against the definition: a node at an even place, all cells of a random set that come before a child in the walk.
        let cell = |at: [i64; 3]| morton::encode(at.map(|c| c as u64));
        let mut state = 7_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            state >> 61 == 0
        };
        let mut keys: Vec<u64> = Vec::new();
        for z in 0..12 {
            for y in 0..12 {
                keys.extend((0..12).filter(|_| random()).map(|x| cell([x, y, z])));
            }
        }
        keys.sort_unstable();
        let mut nodes: Vec<u64> = keys.iter().map(|k| k >> 3).collect();
        nodes.dedup();
        let places = index(&nodes);
        let has = |at: [i64; 3]| keys.binary_search(&cell(at)).is_ok();
        let mut wanted = Wanted::of(&keys, 1);
        let children: Vec<u8> = nodes.iter().map(|&node| wanted.children_of(node)).collect();
        for (&node, &wanted) in nodes.iter().zip(&children) {
            let models = &mut NearPointModels::default();
            let around = NodeContext::new(node, &places, &children, models, 1);
            let corner = morton::decode(node).map(|c| 2 * c as i64);
            for child in 0..8_usize {
                let at: [i64; 3] = std::array::from_fn(|a| corner[a] + (child >> a & 1) as i64);
                let coded = wanted & ((1 << child) - 1) as u8;
                for axis in 0..3 {
                    let mut below = at;
                    below[axis] -= 1;
                    assert_eq!(around.faces(child, coded) >> axis & 1 != 0, has(below));
                    below = at;
                    below[(axis + 1) % 3] -= 1;
                    below[(axis + 2) % 3] -= 1;
                    assert_eq!(around.edges(child, coded) >> axis & 1 != 0, has(below));
                }
            }
        }
    }

    #[test]
    fn surfaces_take_less_than_without_the_cells_around() {
        // A tilted plane of one cell's thickness: 10,000 cells.
        let at = |i: u64, j: u64| [1000 + i, 1000 + j, 1000 + (3 * i + 2 * j) / 10];
        let cells = (0..100).flat_map(|i| (0..100).map(move |j| at(i, j)));
        let mut keys: Vec<u64> = cells.map(morton::encode).collect();
        keys.sort_unstable();
        let mut alone = Price::default();
        let Ok(_) = code_points(&mut alone, &mut PointModels::default(), &keys, usize::MAX);
        assert!(price(&keys) < 0.6 * alone.bits, "{} {}", price(&keys), alone.bits);
    }

    #[test]
    fn scattered_cells_take_what_their_places_hold() {
        let (keys, least) = scattered();
        let found = price(&keys);
        assert!(found > 0.99 * least && found < 1.15 * least, "{found} {least}");
    }

    #[test]
    fn more_points_than_allowed_are_an_error_of_the_reader() {
        let models = &mut NearPointModels::default();
        let mut ones = Ones;
        assert!(code_near_points(&mut ones, models, &[], 100).is_err());
    }
}
