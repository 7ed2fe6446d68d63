//! Questions to a model: where is this again, is this the same place.
//!
//! | folder or file | question |
//! |---|---|
//! | `find` | where in a scene stands what an example shows |
//! | `similarity` | how alike two places are, by the words that occur there |
//! | `surface` | the surface of a model as oriented samples, for both |

mod find;
mod similarity;
mod surface;

pub use find::{FindOptions, Found, Region};
pub use similarity::{WordShare, place_similarity};
