//! The paper's own method: words sampled from the scene, accepted when the Bayesian information criterion falls.
//!
//! A cloud runs through the files of this folder in this order:
//!
//! | file | step | paper |
//! |---|---|---|
//! | `options` | what to learn, with everything that the paper leaves open | |
//! | `learn` | the steps | III |
//! | `features/interest` | interest points on the range image | III-C |
//! | `features`, `pose` | features that cover the scene, and their poses | III-C |
//! | `features/descriptor` | range-image patches along the normal | III-C |
//! | `words` | all points within delta of a feature | eq. 1 |
//! | `choice/matching` | the nearest word of every feature | III-C |
//! | `rebuild` | words at their poses, decoded points epsilon apart | eq. 2, 3 |
//! | `likelihood` | of the scene given the decoded points | eq. 6 to 13 |
//! | `choice/reconstruction`, `choice/trial` | the BIC, changed in place by a candidate | eq. 4, 5 |
//! | `choice/candidates` | the loop over candidate words | III |
//! | `choice/reduce` | fewer occurrences | III-D |
//! | `choice/quality` | inliers and outliers | IV |
//! | `model`, `coding`, `decode` | the result, its bits, and back to a cloud | IV-B |
//! | `contract` | what every model can do | |
//! | `constants` | tuned constants, each with its reason | |

mod choice;
mod coding;
mod constants;
mod contract;
mod decode;
mod features;
mod learn;
mod likelihood;
mod model;
mod options;
mod pose;
mod rebuild;
mod report;
mod words;

pub use learn::learn;
pub use model::{
    BicAlphabet, BicAlphabetHeader, BicAlphabetModel, BicHeader, BicShape, MAX_CELL, MAX_WORDS,
};
pub use options::BicAlphabetOptions;
pub use pose::{BicPose, MAX_POSITION};
pub use report::{BicAlphabetFigures, BicAlphabetReport};
pub use words::{BicWord, MAX_WORD_POINTS};
