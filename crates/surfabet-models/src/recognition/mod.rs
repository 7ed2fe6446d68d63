//! Recognition on a model of words: other places like an example, and the similarity of places.
//!
//! | folder or file | question |
//! |---|---|
//! | `find` | where in a scene is something like an example? |
//! | `similarity` | are two scenes the same place? |
//! | `surface` | the surface of a model as oriented samples in smooth pieces, for `find` |
//! | `constants` | what is tuned |

mod constants;
mod find;
mod similarity;
mod surface;

pub use find::{FindOptions, Found, Region};
pub use similarity::{WordShare, place_similarity};
