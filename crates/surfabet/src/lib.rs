//! Compact 3D models of point clouds, learned from what recurs in them.
//!
//! This crate is what other programs embed: it re-exports the types of the crates below and adds [`Model`], the
//! model in a `.sfb` file whatever its method.
//!
//! ```
//! use surfabet::{DecodeOptions, Limits, Model, PatchesOptions, PointCloud, Save, Silent, patches};
//!
//! // A square of 0.3 m, a point every 5 mm.
//! let points = (0..3600).map(|i| [(i % 60) as f32 * 0.005, (i / 60) as f32 * 0.005, 1.0]).collect();
//! let (cloud, _) = PointCloud::from_positions(points);
//!
//! let options = PatchesOptions { resolution: Some(0.01), ..PatchesOptions::default() };
//! let model = patches::learn(&cloud, &options, &Silent)?;
//! let file = model.to_bytes()?;
//! assert!(file.len() < 400);
//!
//! let again = Model::from_bytes(&file, &Limits::default())?.decode(
//!     DecodeOptions { resolution: Some(0.005), ..DecodeOptions::default() },
//!     &Silent,
//! )?;
//! // Depths are rounded to 7.5 mm.
//! assert!(again.positions().iter().all(|p| (p[2] - 1.0).abs() < 0.004));
//! # Ok::<(), surfabet::Error>(())
//! ```

mod any_model;
mod error;
mod model;
mod registry;
mod save;
mod sessions;
mod tiled;

pub use any_model::AnyModel;
pub use error::{Error, Result};
pub use model::{KnownVocabulary, Model};
pub use save::{Save, write};
pub use sessions::Updated;
pub use surfabet_codec::{
    Container, ContentHash, Family, FileSummary, Layout, Limits, MAX_NOTE, TileEntry, TiledHeader,
    Vocabulary, note, with_note, write_tile,
};
pub use surfabet_geom as geom;
pub use surfabet_geom::{
    CloudParts, Column, DroppedValues, PointCloud, Progress, Silent, Viewpoints,
};
pub use surfabet_models::alphabet::{self, Alphabet, AlphabetModel, AlphabetOptions, Occurrence};
pub use surfabet_models::bic_alphabet::{self, BicAlphabet, BicAlphabetModel, BicAlphabetOptions};
pub use surfabet_models::gas::{self, GasModel, GasOptions};
pub use surfabet_models::hscsm::{self, HscsmDictionary, HscsmModel, HscsmOptions};
pub use surfabet_models::options::{self, Options};
pub use surfabet_models::patches::{self, PatchModel, PatchesOptions};
pub use surfabet_models::planes::{self, PlaneModel, PlanesOptions};
pub use surfabet_models::scans::{Deviation, Upright};
pub use surfabet_models::{
    AttributeFigures, ChosenOption, DecodeOptions, Fact, Figures, Named, Region, Report,
    ScalarScale, Sensor, Stage, Summary, SurfaceModel,
};
pub use surfabet_recognition as recognition;
pub use surfabet_sparse as sparse;
pub use tiled::{OpenError, Part, ReadAt, TiledModel, holds_tiles};
