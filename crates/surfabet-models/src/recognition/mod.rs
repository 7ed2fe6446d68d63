//! Recognition on a model of words: other places like an example, and the similarity of places.
//!
//! | file or folder | purpose |
//! |---|---|
//! | `find` | other places of a scene that look like an example |
//! | `similarity` | whether two scenes are the same place |
//! | `surface` | the surface of a model as oriented samples in smooth pieces, for `find` |
//! | `constants` | tuned constants of all three |

mod constants;
mod find;
mod similarity;
mod surface;

pub use find::{FindOptions, Found, Region};
pub use similarity::{WordShare, place_similarity};
