//! Words by minimum description length: the paper's idea with words of several scales and an informed search.
//!
//! M. Ruhnke, B. Steder, G. Grisetti, W. Burgard: Unsupervised Learning of Compact 3D Models Based on the Detection of
//! Recurrent Structures, ICRA 2010.
//!
//! The length of the whole description is minimised: bits of the words, of every occurrence, and of what the model does
//! not explain. Words are small height maps with holes, in units of their radius, so that one word can occur at several
//! scales. Candidates belong to cells of a lattice; their poses are rounded to integers before anything is measured on
//! them. A lazy greedy cover chooses among them, words that do not pay for themselves are dropped, and occurrences are
//! refined one by one.
//!
//! A cloud runs through the files of this folder in this order:
//!
//! | file or folder | step | paper |
//! |---|---|---|
//! | `options`, `constants` | options of the user, tuned constants of the method | |
//! | `learn` | the steps, one after the other | III, IV-B |
//! | `lattice`, `word`, `placement` | radii, height maps and poses in integers | |
//! | `scene` | points no denser than sigma needs, in units of the lattice and by cells | eq. 13 |
//! | `candidates` | planes at every cell, words from the surface about them, and what each explains | III-C, eq. 13 |
//! | `choice` | the occurrences that shorten the description most, without redundant ones | III-D |
//! | `channels` | colour and intensity of occurrences | |
//! | `model`, `contract` | the result, and what it has in common with the other models | |
//! | `coding` | the bits of words, occurrences and channels | |
//! | `decode` | back to a cloud at any spacing | eq. 2 |

mod candidates;
mod channels;
mod choice;
mod coding;
mod constants;
mod contract;
mod decode;
mod lattice;
mod learn;
mod model;
mod options;
mod placement;
mod scene;
mod word;

pub use channels::{Channels, INTENSITY_STEPS};
pub use lattice::{MAX_SCALE, SigmaRule};
pub use learn::{AlphabetFigures, AlphabetReport, describe, learn};
pub use model::{Alphabet, AlphabetHeader, AlphabetModel, Attributes, Header, Occurrence};
pub use options::{AlphabetOptions, MAX_WORDS};
pub use word::{HEIGHT_STEPS, PIXELS, Word};
