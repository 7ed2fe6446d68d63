//! The scene rebuilt from occurrences: every word at its poses (eq. 2), thinned so that points keep a distance of
//! epsilon (eq. 3).
//!
//! `R^ = { r_i in R : |r_i - r_j| >= epsilon for all r_j in R^ }`. The paper leaves open which points that is. Here
//! occurrences go one after the other, in an order as good as random that follows from their poses
//! ([`BicPose::precedence`](super::pose::BicPose)), and the points of each from its middle outwards. A point is kept unless
//! one before it is kept within epsilon. So the points of an occurrence depend only on those of the neighbours that go
//! before it, and a change reaches only as far as chains of neighbours in that order, a few occurrences.
//!
//! | file | computes | paper |
//! |---|---|---|
//! | `stamp` | the points of a word, from its middle outwards | eq. 1 |
//! | `thin` | which points of one occurrence are kept | eq. 2, 3 |
//! | `neighbors` | which occurrences may come within epsilon of each other, and which goes first | |
//! | `sparsify` | the kept points of all occurrences | eq. 3 |
//! | `change` | what changes when occurrences get another word, or none | eq. 3 |
//! | `grid` | the kept points near an occurrence, where all are placed at once | |

mod change;
mod grid;
mod neighbors;
mod sparsify;
mod stamp;
mod thin;

pub(super) use change::Change;
pub(super) use neighbors::Neighbors;
pub(super) use sparsify::{Places, Sparsified, rebuild};
pub(super) use stamp::Stamp;

/// The word of an occurrence that has none.
pub(super) const NO_WORD: u32 = u32::MAX;
