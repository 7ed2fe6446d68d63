//! The channels of a level, depth and colour: images of the patches, their means, dictionaries and sparse codes.

pub(in crate::hscsm) mod dictionary;
pub(in crate::hscsm) mod images;
pub(in crate::hscsm) mod means;
