//! The choice of words by the Bayesian information criterion (III, III-A), and the occurrences that are not needed
//! (III-D).
//!
//! | file | computes | paper |
//! |---|---|---|
//! | `prepared` | what scoring needs of a scene and never changes | III-C |
//! | `matching` | the nearest word of every feature | III-C |
//! | `reconstruction` | the scene as an alphabet rebuilds it, and its BIC | eq. 4, 5 |
//! | `trial` | what a candidate word, or an occurrence less, changes | eq. 4 |
//! | `candidates` | words sampled from the scene, accepted when the BIC falls | III |
//! | `reduce` | fewer occurrences | III-D |
//! | `quality` | inliers and outliers | IV |

mod candidates;
mod matching;
mod prepared;
mod quality;
mod reconstruction;
mod reduce;
mod trial;

pub(super) use candidates::{ChosenWords, choose_words};
pub(super) use matching::Matching;
pub(super) use prepared::PreparedScene;
pub(super) use quality::{Fidelity, fidelity};
pub(super) use reconstruction::Reconstruction;
pub(super) use reduce::reduce;
