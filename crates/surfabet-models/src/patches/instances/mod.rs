//! Instances: parts of a model that it has once more, moved to where the scene shows the same again.
//!
//! An instance gives some patches and points beside the patches, with their attributes, at another place. These are coded; what
//! another instance gives is no source, so that there are no chains.
//!
//! | file | what |
//! |---|---|
//! | `motion` | where an instance stands: mirrored, turned about one axis of the lattice, and shifted |
//! | `coding` | instances as binary decisions |
//! | `order` | what is coded first, and what an instance gives again |
//! | `model` | what a model knows of its instances |

pub(in crate::patches) mod coding;
mod model;
mod motion;
pub(in crate::patches) mod order;

pub(in crate::patches) use coding::Blocks;
pub use motion::{Motion, Place};

/// Most instances of a file: every one of them may ask for a decision about every patch.
pub const MAX_INSTANCES: u64 = 4096;

/// Patches of a model, and points beside them, given once more.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Instance {
    /// Where it stands.
    pub place: Place,
    /// Numbers of its patches in the order of the file, growing.
    pub patches: Vec<u32>,
    /// Numbers of its points beside the patches in the order of the file, growing.
    pub points: Vec<u32>,
}

/// All instances of a model.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Instances {
    /// The axis of the lattice that all of them turn about.
    pub axis: u8,
    /// One after the other.
    pub all: Vec<Instance>,
}

impl Instances {
    /// Number of patches that are given once more.
    pub fn n_patches(&self) -> u64 {
        self.all.iter().map(|instance| instance.patches.len() as u64).sum()
    }

    /// Number of points beside the patches that are given once more.
    pub fn n_points(&self) -> u64 {
        self.all.iter().map(|instance| instance.points.len() as u64).sum()
    }

    /// The motions of all instances.
    pub(in crate::patches) fn motions(&self) -> Vec<Motion> {
        self.all.iter().map(|instance| Motion::new(instance.place, self.axis)).collect()
    }
}
