//! The walk through an octree level by level: all nodes of a level before those of the next, in the order of their keys.

use surfabet_entropy::Coder;
use surfabet_geom::morton::{self, MortonMap};

use crate::patches::attributes::cells::index;

/// A level of the octree while it is coded.
pub(super) struct Level {
    /// Height of its nodes, from 1 for parents of cells.
    pub height: usize,
    /// Keys of its nodes, growing.
    pub nodes: Vec<u64>,
    /// Their numbers.
    pub places: MortonMap<u32>,
    /// Which children each has, a bit per child; zero for those that are not coded yet.
    pub children: Vec<u8>,
}

/// Writes, reads or prices sorted, different keys of cells: `code_node` codes the children of a node of a level, by its number, and is
/// given those that a writer wants it to have.
///
/// # Errors
/// Whatever the coder finds wrong, which includes more than `max_points` of them.
pub(super) fn code_levels<C: Coder>(
    coder: &mut C,
    keys: &[u64],
    max_points: usize,
    mut code_node: impl FnMut(&mut C, &Level, usize, u8) -> Result<u8, C::Error>,
) -> Result<Vec<u64>, C::Error> {
    if coder.bypass(u64::from(!keys.is_empty()), 1)? == 0 {
        return Ok(Vec::new());
    }
    let mut nodes = vec![0_u64];
    for height in (1..=morton::BITS).rev() {
        let mut wanted = Wanted::of(keys, height);
        let children = vec![0; nodes.len()];
        let mut level = Level { height: height as usize, places: index(&nodes), nodes, children };
        let mut next = Vec::with_capacity(level.nodes.len());
        for number in 0..level.nodes.len() {
            let key = level.nodes[number];
            let found = code_node(coder, &level, number, wanted.children_of(key))?;
            level.children[number] = found;
            next.extend((0..8).filter(|c| found >> c & 1 != 0).map(|c| key << 3 | c));
            if next.len() > max_points {
                return Err(coder.corrupt(format!("more than {max_points} points")));
            }
        }
        nodes = next;
    }
    Ok(nodes)
}

/// What a writer has still to encode of a level.
pub(super) struct Wanted<'a> {
    /// Keys of cells from the next node on; empty for a reader.
    keys: &'a [u64],
    /// From the key of a cell to that of a child of the level's nodes.
    shift: u32,
}

impl<'a> Wanted<'a> {
    /// Of sorted keys of cells, for nodes of this height.
    pub fn of(keys: &'a [u64], height: u32) -> Self {
        Self { keys, shift: 3 * (height - 1) }
    }

    /// The children that the node of a key, which follows those asked for before, is to have.
    pub fn children_of(&mut self, key: u64) -> u8 {
        let n = self.keys.partition_point(|k| k >> self.shift >> 3 <= key);
        let (of_node, rest) = self.keys.split_at(n);
        self.keys = rest;
        of_node.iter().fold(0, |children, k| children | 1 << (k >> self.shift & 7))
    }
}

/// What the tests of both ways to code nodes have in common.
#[cfg(test)]
pub(super) mod testing {
    use surfabet_entropy::{Bit, Coder};

    /// Cells at random, and the bits that they take: n of N places, log2 of N over n, about n (log2 (N / n) + 1.44). Nothing is to be
    /// learned but the density.
    pub fn scattered() -> (Vec<u64>, f64) {
        let mut state = 1_u64;
        let mut places = std::collections::BTreeSet::new();
        while places.len() < 20_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            places.insert(state >> 43);
        }
        let keys: Vec<u64> = places.into_iter().collect();
        let n = keys.len() as f64;
        let least = n * (((1_u64 << 21) as f64 / n).log2() + std::f64::consts::LOG2_E);
        (keys, least)
    }

    /// A hostile stream: everything is occupied.
    pub struct Ones;

    impl Coder for Ones {
        type Error = String;

        fn bit(&mut self, _: &mut Bit, _: bool) -> Result<bool, String> {
            Ok(true)
        }

        fn bypass(&mut self, _: u64, _: u32) -> Result<u64, String> {
            Ok(1)
        }

        fn corrupt(&self, what: String) -> String {
            what
        }
    }
}
