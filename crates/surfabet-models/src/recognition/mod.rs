//! Recognition on a model of words: other places like an example, and the similarity of places.
//!
//! | file or folder | purpose |
//! |---|---|
//! | `find` | other places of a scene that look like an example |
//! | `recurring` | classes of things that occur in a scene again and again |
//! | `similarity` | whether two scenes are the same place |
//! | `surface` | the surface of a model as oriented samples in smooth pieces, for `find` and `recurring` |
//! | `constants` | tuned constants of all |

mod constants;
mod find;
mod recurring;
mod similarity;
mod surface;

pub use find::{Example, FindOptions, Found, Region};
pub use recurring::{RecurringClass, RecurringOptions};
pub use similarity::{PlaceSignature, WordShare, place_similarity};
