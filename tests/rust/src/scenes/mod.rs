//! A small scene of every method, for what all of them promise alike: see [`crate::contract`].

mod alphabet;
mod bic_alphabet;
mod gas;
mod hscsm;
mod patches;
mod planes;

pub use alphabet::windows;
pub use bic_alphabet::step;
pub use gas::sphere;
pub use planes::room;

use surfabet::{Layout, PointCloud, Progress};
use surfabet_models::Result;

/// What the contract needs of a method beside the method itself.
pub trait Scene: Layout {
    /// True when `learn` promises the same model for any order of the points.
    const ANY_ORDER: bool;

    /// A cloud that is learned in a moment, away from the origin and with everything that the model keeps, so that
    /// every section of its file holds something.
    fn cloud() -> PointCloud;

    /// The model of [`Scene::cloud`], or of a cloud like it.
    ///
    /// # Errors
    /// Those of learning.
    fn learn(cloud: &PointCloud, progress: &dyn Progress) -> Result<Self>;

    /// What decoding gives, as lines of numbers: the golden file of a release holds it.
    fn listing(&self) -> String;

    /// How far a number of the listing may be off on another machine, by its column and value.
    fn tolerance(column: usize, value: f64) -> f64;
}

/// A method whose files can share a dictionary or an alphabet.
pub trait SharesVocabulary: Scene {
    /// As [`Scene::learn`], by the words of another model.
    ///
    /// # Errors
    /// Those of describing.
    fn describe(
        cloud: &PointCloud,
        vocabulary: &Self::Vocabulary,
        progress: &dyn Progress,
    ) -> Result<Self>;
}
