//! The adaptive models of the geometry, and the contexts that choose between them.

use surfabet_entropy::{Bit, Quadtree, SInt, Symbols, UInt};

use crate::patches::model::MAX_LEVELS;
use crate::patches::surface::basis::N_SHAPES;

/// Heights of the quadtree over tiles with models of their own.
const HEIGHTS: u32 = 3;

const LEVELS: usize = MAX_LEVELS as usize;

/// State of a pixel that is set; zero stands for one that is not.
pub(in crate::patches) const SET: usize = 1;

/// State of a pixel that may not have been coded yet.
pub(in crate::patches) const UNKNOWN: usize = 2;

/// Number of states.
const STATES: usize = 3;

/// Every adaptive model of the geometry. Those of a level are numbered by a context, see the functions below.
#[derive(Debug, Clone)]
pub(in crate::patches) struct GeometryModels {
    /// Lowest tile coordinates of a side.
    pub corner: SInt,
    /// Which tiles hold sheets.
    pub tiles: Quadtree,
    /// Number of sheets of a tile, less one.
    pub sheets: UInt,
    /// Which surface around the tile a sheet continues; zero: none.
    pub candidate: UInt,
    /// Depth of a sheet that continues none.
    pub base: SInt,
    /// Is a square empty? By [`beside_context`].
    pub empty: Vec<Bit>,
    /// Is a square split? By [`split_context`].
    pub split: Vec<Bit>,
    /// Are all pixels of a patch set? By [`beside_context`].
    pub full: Vec<Bit>,
    /// Is a pixel set? By [`pixel_context`].
    pub mask: Vec<Bit>,
    /// Difference of the half thickness to the predicted one; the second model where any patch is beside.
    pub thickness: [SInt; 2],
    /// Difference of the depth to the predicted one, by [`depth_context`].
    pub depth: Vec<SInt>,
    /// Number of the last shape with a coefficient, by level.
    pub last: Vec<Symbols>,
    /// Coefficients before the last, by [`shape_context`].
    pub shapes: Vec<SInt>,
    /// Magnitude of the last coefficient, less one, by level.
    pub last_shape: Vec<UInt>,
}

impl Default for GeometryModels {
    fn default() -> Self {
        let last =
            Symbols::new(N_SHAPES as u32).expect("the number of shapes is the size of an alphabet");
        Self {
            corner: SInt::new(),
            tiles: Quadtree::new(HEIGHTS),
            sheets: UInt::new(),
            candidate: UInt::new(),
            base: SInt::new(),
            empty: vec![Bit::new(); LEVELS * STATES * STATES],
            split: vec![Bit::new(); LEVELS * 6],
            full: vec![Bit::new(); LEVELS * STATES * STATES],
            mask: vec![Bit::with_memory(Bit::MAX_MEMORY); LEVELS * STATES.pow(4)],
            thickness: [const { SInt::new() }; 2],
            depth: vec![SInt::new(); LEVELS * 3],
            last: vec![last; LEVELS],
            shapes: vec![SInt::new(); LEVELS * N_SHAPES],
            last_shape: vec![UInt::new(); LEVELS],
        }
    }
}

/// Context of a square by the states of the pixels left of it and above.
pub(in crate::patches) fn beside_context(level: u32, [left, above]: [usize; 2]) -> usize {
    (level as usize * STATES + left) * STATES + above
}

/// Context of a split by the number of patches beside the square, at most 2, and whether any of them is of a finer
/// level.
pub(in crate::patches) fn split_context(level: u32, neighbours: usize, finer: bool) -> usize {
    (level as usize * 3 + neighbours) * 2 + usize::from(finer)
}

/// Context of a mask pixel by the states of the pixels left, above, above left and above right.
pub(in crate::patches) const fn pixel_context(level: u32, states: [usize; 4]) -> usize {
    let [left, above, above_left, above_right] = states;
    (((level as usize * STATES + left) * STATES + above) * STATES + above_left) * STATES
        + above_right
}

/// Context of a depth by the number of patches beside the square, at most 2.
pub(in crate::patches) fn depth_context(level: u32, neighbours: usize) -> usize {
    level as usize * 3 + neighbours
}

/// Context of the coefficient of a shape.
pub(in crate::patches) fn shape_context(level: u32, shape: usize) -> usize {
    level as usize * N_SHAPES + shape
}
