//! Words by minimum description length: beyond the paper, and the default.
//!
//! Every bit counts: those of the alphabet, of every occurrence, and of what the model does not explain. Words are small
//! height maps with holes, in units of their radius, so that one word stands at several scales. Candidates stand on a
//! lattice of cells; their poses are integers before anything is measured about them. A lazy greedy cover chooses among
//! them, words that do not pay for themselves are dropped, and occurrences are improved one by one.
//!
//! A cloud runs through the files of this folder in this order:
//!
//! | file | step | paper |
//! |---|---|---|
//! | `options` | what to learn, and what a point is worth | |
//! | `scene` | points no denser than sigma needs, in units and by cells | eq. 13 |
//! | `lattice`, `word`, `placement` | the integers that radii, height maps and poses are made of | |
//! | `candidates`, `scene::local_points` | planes at every cell, and the words that look like what is there | III-C |
//! | `candidates::descriptor`, `candidates::clusters` | descriptors, and their clusters as words | III-C |
//! | `candidates::coverage` | points that a placed word explains, and samples that explain none | eq. 13 |
//! | `choice` | the occurrences that explain most for their bits, without redundant ones | III-D |
//! | `learn` | all of it, and a scene by an alphabet that is given | III, IV-B |
//! | `channels` | colour and intensity of occurrences | |
//! | `model` | the result | |
//! | `coding` | its bits, each occurrence after those near to it | |
//! | `decode` | back to a cloud at any spacing | eq. 2 |

mod candidates;
mod channels;
mod choice;
mod coding;
mod contract;
mod decode;
mod lattice;
mod learn;
pub(crate) mod model;
mod options;
mod placement;
mod scene;
pub(crate) mod word;

pub use channels::{Channels, INTENSITY_STEPS};
pub use lattice::{MAX_SCALE, SigmaRule};
pub use learn::{describe, learn};
pub use model::{Alphabet, AlphabetHeader, AlphabetModel, Attributes, Header, Occurrence};
pub use options::{AlphabetOptions, MAX_WORDS};
pub use word::{HEIGHT_STEPS, PIXELS, Word};
