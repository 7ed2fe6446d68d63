//! Recognition on models, whatever their method.
//!
//! [`locate`] finds where in a saved model a scan was taken. Finding and place similarity on words are part of the method whose
//! words they compare, in `surfabet_models::recognition`.

pub mod locate;

pub use locate::{Localizer, LocateOptions, Located, Location, Prior, Refusal};
