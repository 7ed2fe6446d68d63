//! What models are asked: where a scan was taken, where something else like an example is, what recurs, which place this is.
//!
//! | folder | what is asked | of models of |
//! |---|---|---|
//! | [`locate`] | where in a model a scan was taken | any method |
//! | [`places`] | which of many places a scan or a model shows, and which places are of one kind | any method, in words |
//! | `similarity` | how alike two places are ([`place_similarity`]), and what each consists of ([`word_histogram`]) | alphabets |
//! | `find` | other places that look like an example ([`find()`], [`find_examples`]) | alphabets |
//! | `recurring` | classes of things that occur again and again ([`recurring()`]) | alphabets |
//! | `surface` | no question: samples of a model's surface in smooth pieces, for `find` and `recurring` | |
//!
//! `constants` has the tuned constants of `find`, `recurring`, `similarity` and `surface`; those of `locate` stand in its folder.

mod constants;
mod find;
pub mod locate;
pub mod places;
mod recurring;
mod similarity;
mod surface;

pub use find::{Example, FindOptions, Found, Region, find, find_examples};
pub use locate::{Localizer, LocateOptions, Located, Location, Prior, Refusal};
pub use places::{PlaceIndex, PlaceMatch, PlaceOptions, label_places};
pub use recurring::{RecurringClass, RecurringOptions, recurring};
pub use similarity::{PlaceSignature, WordShare, place_similarity, word_histogram};
