//! The images of patches, and the dictionaries that they are coded in.

pub(in crate::hscsm) mod dictionary;
pub(in crate::hscsm) mod images;
