//! The paper's own method: words sampled from the scene, accepted when the Bayesian information criterion falls.
//!
//! A cloud runs through the files of this folder in this order:
//!
//! | file | step | paper |
//! |---|---|---|
//! | `options` | what to learn, with everything that the paper leaves open | |
//! | `interest` | interest points on the range image | III-C |
//! | `features`, `pose` | features that cover the scene, and their poses | III-C |
//! | `descriptor` | range-image patches along the normal | III-C |
//! | `words` | all points within delta of a feature | eq. 1 |
//! | `matching` | the nearest word of every feature | III-C |
//! | `sparsify`, `grid` | decoded points epsilon apart | eq. 2, 3 |
//! | `likelihood` | of the scene given the decoded points | eq. 6 to 13 |
//! | `score` | the BIC, changed in place by a candidate | eq. 4, 5 |
//! | `learn` | the loop | III |
//! | `reduce` | fewer occurrences | III-D |
//! | `quality` | inliers and outliers | IV |
//! | `model`, `syntax`, `decode` | the result, its bits, and back to a cloud | IV-B |

mod choice;
mod coding;
mod contract;
mod decode;
mod features;
mod learn;
mod likelihood;
mod model;
mod options;
mod pose;
mod rebuild;
mod words;

pub use learn::learn;
pub use model::{
    BicAlphabet, BicAlphabetHeader, BicAlphabetModel, BicHeader, BicShape, MAX_CELL, MAX_WORDS,
};
pub use options::BicAlphabetOptions;
pub use pose::{BicPose, MAX_POSITION};
pub use words::{BicWord, MAX_WORD_POINTS};
