//! Words by minimum description length: beyond the paper, and the default.
//!
//! Every bit counts: those of the alphabet, of every occurrence, and of what the model does not explain. Words are small
//! height maps with holes, in units of their radius, so that one word stands at several scales. Candidates stand on a
//! lattice of cells; their poses are integers before anything is measured about them. A lazy greedy cover chooses among
//! them, words that do not pay for themselves are dropped, and occurrences are improved one by one.

mod attributes;
mod candidates;
mod cover;
mod coverage;
mod data;
mod decode;
mod find;
mod lattice;
mod learn;
mod model;
mod near;
mod nearby;
mod neighbors;
mod options;
mod patch;
mod placement;
mod similarity;
mod surface;
mod syntax;
mod thin;
mod word;
mod words;

pub use attributes::{Channels, INTENSITY_STEPS};
pub use decode::MdlDecodeOptions;
pub use find::{FindOptions, Found, Region};
pub use lattice::{MAX_SCALE, SigmaRule};
pub use learn::{describe, learn};
pub use model::{Alphabet, AlphabetModel, Attributes, Header, Occurrence};
pub use options::{MAX_WORDS, MdlOptions};
pub use similarity::{WordShare, place_similarity};
pub use word::{HEIGHT_STEPS, PIXELS, Word};
