//! The adaptive models of a field, and the contexts that choose between them.

use surfabet_entropy::{Bit, SInt};

/// Levels of the pyramid with models of their own, from the cells up.
const LEVELS: usize = 12;

/// Classes of how many coefficients are coded around a cell.
const ACTIVITIES: usize = 7;

/// Adaptive models of a field of N channels.
#[derive(Debug, Clone)]
pub(super) struct FieldModels<const N: usize> {
    /// Mean of all cells, by channel.
    pub mean: [SInt; N],
    /// Is any coefficient of the cell not zero? By [`CellContext::any`].
    pub any: Vec<Bit>,
    /// Coefficients, by [`CellContext::coefficient`].
    pub coefficients: Vec<SInt>,
}

impl<const N: usize> Default for FieldModels<N> {
    fn default() -> Self {
        Self {
            mean: [const { SInt::new() }; N],
            any: vec![Bit::with_memory(Bit::MAX_MEMORY); LEVELS * ACTIVITIES * ACTIVITIES],
            coefficients: vec![SInt::new(); N * LEVELS * 3],
        }
    }
}

/// What the models of a cell depend on.
pub(super) struct CellContext {
    /// Level of the children in the pyramid.
    pub level: usize,
    parent: usize,
    around: usize,
}

impl CellContext {
    /// Context of a cell: `parent` is the activity of its parent and of what lies ahead, `around` that of the cells
    /// beside it which are coded already.
    pub fn new(level: usize, parent: usize, around: usize) -> Self {
        let most = ACTIVITIES - 1;
        Self { level: level.min(LEVELS - 1), parent: parent.min(most), around: around.min(most) }
    }

    /// Context of whether any coefficient of the cell is not zero.
    pub fn any(&self) -> usize {
        (self.level * ACTIVITIES + self.parent) * ACTIVITIES + self.around
    }

    /// Context of a coefficient: `before` is the sum of the magnitudes of those of the cell before it, each counted as
    /// 2 at most.
    pub fn coefficient(&self, channel: usize, before: u32) -> usize {
        (channel * LEVELS + self.level) * 3 + before.min(2) as usize
    }
}
