//! Occupied cells of a grid, coded as a tree whose nodes have `2^D` children: an [`Octree`], or a [`Quadtree`].
//!
//! A node is coded as one adaptive bit per child: is any cell inside the child occupied? Every node holds a cell, so
//! the last child is certain when no other is occupied, and takes no bit. Nodes come depth first and children in the
//! order of their numbers, whose bit `a` is the bit of coordinate `a`: cells come in Morton order.

use std::ops::Range;

use crate::coder::Coder;
use crate::models::Bit;

/// Models of the tree over cells of a cubic grid.
pub type Octree = Tree<3>;

/// Models of the tree over cells of a square grid.
pub type Quadtree = Tree<2>;

/// Adaptive models of a tree over cells of `D` coordinates.
///
/// The probability that a child is occupied depends on the height of its node, on its number, and on how many
/// children before it are occupied.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tree<const D: usize> {
    /// By height, child, and number of occupied children before.
    bits: Vec<Bit>,
    heights: u32,
}

impl<const D: usize> Tree<D> {
    /// Children of a node.
    pub const CHILDREN: usize = 1 << D;

    /// Largest height of a tree: cells have 32 bits per coordinate.
    pub const MAX_HEIGHT: u32 = u32::BITS;

    /// Models of which nothing is known: each of the lowest `heights` heights, at least one, has its own; nodes
    /// further up share those of the highest.
    pub fn new(heights: u32) -> Self {
        let heights = heights.clamp(1, Self::MAX_HEIGHT);
        let n = heights as usize * Self::CHILDREN * Self::CHILDREN;
        Self { bits: vec![Bit::new(); n], heights }
    }

    /// Is a child of a node of `height`, at least one, occupied, when `before` of the children before it are?
    ///
    /// [`Cells`] asks this of every child. It stands alone for trees that hold more than their leaves.
    ///
    /// # Errors
    /// Whatever the coder finds wrong with what it reads.
    ///
    /// # Panics
    /// Unless `before <= child < 2^D`.
    #[inline]
    pub fn child<C: Coder>(
        &mut self,
        coder: &mut C,
        height: u32,
        child: usize,
        before: usize,
        occupied: bool,
    ) -> Result<bool, C::Error> {
        if child == Self::CHILDREN - 1 && before == 0 {
            return Ok(true);
        }
        let height = height.clamp(1, self.heights) as usize - 1;
        let bit = &mut self.bits[(height * Self::CHILDREN + child) * Self::CHILDREN + before];
        coder.bit(bit, occupied)
    }
}

/// Morton code of a cell: bit `D b + a` is bit `b` of coordinate `a`.
pub trait MortonCode: Copy {
    /// `n` bits, at most 8, above the lowest `shift`.
    fn bits(self, shift: u32, n: u32) -> usize;
}

impl MortonCode for u64 {
    #[inline]
    fn bits(self, shift: u32, n: u32) -> usize {
        (self.checked_shr(shift).unwrap_or(0) as usize) & ((1 << n) - 1)
    }
}

impl MortonCode for u128 {
    #[inline]
    fn bits(self, shift: u32, n: u32) -> usize {
        (self.checked_shr(shift).unwrap_or(0) as usize) & ((1 << n) - 1)
    }
}

/// An occupied cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell<const D: usize> {
    /// Its coordinates.
    pub at: [u32; D],
    /// Which of the codes given to the writer are this cell's; empty when reading.
    pub given: Range<usize>,
}

/// The walk over the occupied cells of a grid, which writes, reads or prices the tree on the way.
///
/// ```
/// use surfabet_entropy::{Cells, Octree, Price};
///
/// let codes = [0b000_001_u64, 0b000_001, 0b101_000];
/// let mut coder = Price::default();
/// let mut tree = Octree::new(3);
/// let mut cells = Cells::new(&codes, 2, 10);
/// let mut found = Vec::new();
/// while let Ok(Some(cell)) = cells.next(&mut coder, &mut tree) {
///     found.push((cell.at, cell.given));
/// }
/// assert_eq!(found, [([1, 0, 0], 0..2), ([2, 0, 2], 2..3)]);
/// ```
#[derive(Debug, Clone)]
pub struct Cells<'a, const D: usize, K> {
    codes: &'a [K],
    height: u32,
    /// Cells that may still come.
    left: usize,
    most: usize,
    /// The nodes from the root to the one reached.
    path: Vec<Node<D>>,
}

#[derive(Debug, Clone)]
struct Node<const D: usize> {
    at: [u32; D],
    /// Codes of the children still to come.
    given: Range<usize>,
    /// The next child, and how many before it are occupied.
    child: usize,
    occupied: usize,
}

impl<'a, const D: usize, K: MortonCode> Cells<'a, D, K> {
    /// The cells of the `codes`, in ascending order, in a grid of `2^height` cells along each side; for a reader,
    /// `codes` is empty. No more than `most` cells are coded. A tree holds one cell at least.
    pub fn new(codes: &'a [K], height: u32, most: usize) -> Self {
        let root = Node { at: [0; D], given: 0..codes.len(), child: 0, occupied: 0 };
        Self { codes, height, left: most, most, path: vec![root] }
    }

    /// The next occupied cell; none after the last.
    ///
    /// # Errors
    /// Whatever the coder finds wrong with what it reads, which includes more cells than the most allowed and a
    /// height that no tree has. The walk is over then.
    pub fn next<C: Coder>(
        &mut self,
        coder: &mut C,
        models: &mut Tree<D>,
    ) -> Result<Option<Cell<D>>, C::Error> {
        let found = self.find(coder, models);
        if found.is_err() {
            self.path.clear();
        }
        found
    }

    fn find<C: Coder>(
        &mut self,
        coder: &mut C,
        models: &mut Tree<D>,
    ) -> Result<Option<Cell<D>>, C::Error> {
        // The path is never longer than the height and one.
        while let Some(depth) = self.path.len().checked_sub(1) {
            if self.height > Tree::<D>::MAX_HEIGHT {
                return Err(coder.corrupt(format!("a tree of height {}, at most 32", self.height)));
            }
            let node = &mut self.path[depth];
            let height = self.height - depth as u32;
            if height == 0 {
                let cell = Cell { at: node.at, given: node.given.clone() };
                self.path.pop();
                self.left = self.left.checked_sub(1).ok_or_else(|| {
                    coder.corrupt(format!("more occupied cells than {}", self.most))
                })?;
                return Ok(Some(cell));
            }
            let child = node.child;
            if child == Tree::<D>::CHILDREN {
                debug_assert!(node.given.is_empty(), "codes in ascending order below 2^(D height)");
                self.path.pop();
                continue;
            }
            node.child += 1;
            let rest = &self.codes[node.given.clone()];
            let shift = D as u32 * (height - 1);
            let inside = rest.partition_point(|code| code.bits(shift, D as u32) <= child);
            if models.child(coder, height, child, node.occupied, inside > 0)? {
                node.occupied += 1;
                let at = std::array::from_fn(|a| node.at[a] << 1 | (child >> a & 1) as u32);
                let given = node.given.start..node.given.start + inside;
                node.given.start = given.end;
                self.path.push(Node { at, given, child: 0, occupied: 0 });
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;
    use crate::Price;

    /// Decisions as they are, to be read again.
    struct Tape<'a> {
        bits: std::slice::Iter<'a, bool>,
    }

    impl Coder for Tape<'_> {
        type Error = String;

        fn bit(&mut self, model: &mut Bit, _: bool) -> Result<bool, String> {
            let bit = *self.bits.next().ok_or("the tape is over")?;
            model.update(bit);
            Ok(bit)
        }

        fn bypass(&mut self, _: u64, _: u32) -> Result<u64, String> {
            unreachable!("every bit of a tree is adaptive")
        }

        fn corrupt(&self, what: String) -> String {
            what
        }
    }

    /// Writes decisions, and prices them.
    #[derive(Default)]
    struct Recorder {
        bits: Vec<bool>,
        price: Price,
    }

    impl Coder for Recorder {
        type Error = std::convert::Infallible;

        fn bit(&mut self, model: &mut Bit, value: bool) -> Result<bool, Self::Error> {
            self.bits.push(value);
            self.price.bit(model, value)
        }

        fn bypass(&mut self, value: u64, n_bits: u32) -> Result<u64, Self::Error> {
            self.price.bypass(value, n_bits)
        }

        fn corrupt(&self, what: String) -> Self::Error {
            unreachable!("{what}")
        }
    }

    fn walk<const D: usize, K: MortonCode, C: Coder>(
        coder: &mut C,
        codes: &[K],
        height: u32,
        most: usize,
    ) -> Result<Vec<Cell<D>>, C::Error> {
        let mut tree = Tree::<D>::new(3);
        let mut cells = Cells::new(codes, height, most);
        let mut found = Vec::new();
        while let Some(cell) = cells.next(coder, &mut tree)? {
            found.push(cell);
        }
        Ok(found)
    }

    fn code<const D: usize>(at: [u32; D]) -> u128 {
        let bit = |b: u32, a: usize| u128::from(at[a] >> b & 1) << (D as u32 * b + a as u32);
        (0..u32::BITS).flat_map(|b| (0..D).map(move |a| (b, a))).map(|(b, a)| bit(b, a)).sum()
    }

    /// Writing, pricing and reading `codes` agree, and give each cell once and with its codes.
    fn comes_back<const D: usize>(codes: &[u128], height: u32) -> Result<(), TestCaseError> {
        let mut out = Recorder::default();
        let Ok(written) = walk::<D, _, _>(&mut out, codes, height, codes.len());
        let mut price = Price::default();
        let Ok(priced) = walk::<D, _, _>(&mut price, codes, height, codes.len());
        prop_assert_eq!(&priced, &written);
        prop_assert_eq!(price, out.price);
        let given: Vec<usize> = written.iter().flat_map(|cell| cell.given.clone()).collect();
        prop_assert_eq!(given, (0..codes.len()).collect::<Vec<_>>());
        for cell in &written {
            prop_assert!(!cell.given.is_empty());
            prop_assert!(codes[cell.given.clone()].iter().all(|&c| c == code(cell.at)));
        }
        prop_assert_eq!(written.len(), codes.iter().collect::<BTreeSet<_>>().len());

        let mut tape = Tape { bits: out.bits.iter() };
        let read = walk::<D, u128, _>(&mut tape, &[], height, written.len()).unwrap();
        prop_assert_eq!(tape.bits.len(), 0);
        let at = |cells: &[Cell<D>]| cells.iter().map(|c| c.at).collect::<Vec<_>>();
        prop_assert_eq!(at(&read), at(&written));
        // One cell fewer than there are is too many.
        let mut tape = Tape { bits: out.bits.iter() };
        let error = walk::<D, u128, _>(&mut tape, &[], height, written.len() - 1).unwrap_err();
        prop_assert!(error.contains("more occupied cells than"), "{}", error);
        // A tape cut short is noticed.
        if let Some((_, cut)) = out.bits.split_last() {
            let mut tape = Tape { bits: cut.iter() };
            prop_assert!(walk::<D, u128, _>(&mut tape, &[], height, written.len()).is_err());
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn octrees_come_back(
            cells in prop::collection::vec(prop::array::uniform3(any::<u32>()), 1..60),
            height in 0_u32..=32,
        ) {
            let cut = |c: u32| c.checked_shr(u32::BITS - height).unwrap_or(0);
            let mut codes: Vec<u128> = cells.iter().map(|c| code(c.map(cut))).collect();
            codes.sort_unstable();
            comes_back::<3>(&codes, height)?;
        }

        #[test]
        fn quadtrees_come_back(
            cells in prop::collection::vec(prop::array::uniform2(0_u32..16), 1..60),
        ) {
            let mut codes: Vec<u128> = cells.into_iter().map(code).collect();
            codes.sort_unstable();
            comes_back::<2>(&codes, 4)?;
        }

        #[test]
        fn short_and_wide_codes_take_the_same_bits(
            codes in prop::collection::btree_set(0_u64..1 << 63, 1..50),
        ) {
            let short: Vec<u64> = codes.iter().copied().collect();
            let wide: Vec<u128> = codes.into_iter().map(u128::from).collect();
            let [mut a, mut b] = [Price::default(); 2];
            let Ok(_) = walk::<3, _, _>(&mut a, &short, 21, short.len());
            let Ok(_) = walk::<3, _, _>(&mut b, &wide, 21, wide.len());
            prop_assert_eq!(a, b);
        }

        #[test]
        fn garbage_ends_in_cells_or_an_error(
            bits in prop::collection::vec(any::<bool>(), 0..3000),
            height in 0_u32..=40,
            most in 0_usize..100,
        ) {
            let mut tape = Tape { bits: bits.iter() };
            let mut tree = Octree::new(4);
            let mut cells = Cells::<3, u64>::new(&[], height, most);
            let mut found = 0;
            while let Ok(Some(cell)) = cells.next(&mut tape, &mut tree) {
                found += 1;
                prop_assert!(cell.given.is_empty());
                prop_assert!(cell.at.iter().all(|&c| u64::from(c) < 1 << height));
            }
            prop_assert!(found <= most);
            // Each cell costs eight decisions per level at most: a walk that is over stays so.
            prop_assert!(bits.len() - tape.bits.len() <= (most + 1) * 8 * height as usize);
            prop_assert_eq!(cells.next(&mut tape, &mut tree), Ok(None));
        }
    }

    #[test]
    fn a_lone_cell_in_the_last_corner_costs_no_bit_for_its_last_children() {
        let mut out = Recorder::default();
        let Ok(cells) = walk::<3, _, _>(&mut out, &[0o777_u64], 3, 1);
        assert_eq!(cells, [Cell { at: [7; 3], given: 0..1 }]);
        assert_eq!(out.bits, [false; 21]);
    }

    #[test]
    fn heights_above_the_highest_with_models_of_its_own_share_them() {
        let mut tree = Octree::new(2);
        let mut price = Price::default();
        for _ in 0..50 {
            let Ok(_) = tree.child(&mut price, 2, 0, 0, true);
        }
        let cost = |height: u32| {
            let mut price = Price::default();
            let Ok(_) = tree.clone().child(&mut price, height, 0, 0, true);
            price.bits
        };
        assert!(cost(2) < 0.05);
        assert_eq!(cost(2), cost(7));
        assert_eq!(cost(1), 1.0);
    }
}
