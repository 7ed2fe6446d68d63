//! A model as binary decisions: one function per stream for writing, reading and pricing.
//!
//! Patches come in Morton order of the cells of one patch size that their centres lie in, so a patch follows a
//! neighbour, and most of what is coded is the difference to it.
//!
//! | file | stream |
//! |---|---|
//! | `syntax` | all streams, level by level |
//! | `poses` | centres by an octree, normals by differences |
//! | `masks` | bitmasks by the pixels around |
//! | `channels` | dictionaries, means and sparse codes of depth and colour |

mod channels;
mod masks;
mod poses;
mod syntax;

pub(super) use syntax::{Streams, code_hscsm};
