//! The two ways to predict the cells of a level that files have.

use crate::patches::constants::{
    NEIGHBOUR_SHARE, NEIGHBOUR_SHARE_BESIDE, RESIDUAL_SHARE, STEP_SHARES, STEP_SHARES_BESIDE,
};

/// What the children of a cell are predicted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Prediction {
    /// The means of their parents and of the cells beside these. Older files are so.
    #[default]
    Parents,
    /// These, and what was missed at the cells beside them that are coded already.
    Beside,
}

impl Prediction {
    /// Weight of the parent next to a child's own along each axis.
    pub(super) fn neighbour_share(self) -> f32 {
        match self {
            Self::Parents => NEIGHBOUR_SHARE,
            Self::Beside => NEIGHBOUR_SHARE_BESIDE,
        }
    }

    /// The share of what was missed at each cell beside a child that is added to its prediction, where there is any.
    pub(super) fn residual_share(self) -> Option<f32> {
        (self == Self::Beside).then_some(RESIDUAL_SHARE)
    }

    /// Step of a level of the pyramid against that of the model: for the cells themselves, their parents, and so on.
    pub(super) fn step_share(self, level: usize) -> f32 {
        let shares = match self {
            Self::Parents => STEP_SHARES,
            Self::Beside => STEP_SHARES_BESIDE,
        };
        shares[level.min(shares.len() - 1)]
    }
}
