//! Recognition on models, whatever their method.
//!
//! [`locate`] finds where in a saved model a scan was taken, [`places`] which of many places a model shows, and which are of one
//! kind. Finding, recurring things and place similarity on words are part of the method whose words they compare, in
//! `surfabet_models::recognition`.

pub mod locate;
pub mod places;

pub use locate::{Localizer, LocateOptions, Located, Location, Prior, Refusal};
pub use places::{PlaceIndex, PlaceMatch, PlaceOptions, label_places};
