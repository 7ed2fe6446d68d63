//! Many places: which of them a model shows, and which are of one kind.
//!
//! | file | what it does |
//! |---|---|
//! | `index` | places ranked by similarity of words and of their pairs, the first of them located |
//! | `kinds` | places of one kind, by average linkage over what stands at which height |

mod index;
mod kinds;

pub use index::{PlaceIndex, PlaceMatch, PlaceOptions};
pub use kinds::{KIND_SIMILARITY, label_places};
