//! Compact models of point clouds, learned from what recurs in them: a folder per family, a file per verb.
//!
//! | family | learns | paper |
//! |---|---|---|
//! | [`alphabet`] | recurrent local scans and their places | M. Ruhnke, B. Steder, G. Grisetti, W. Burgard: Unsupervised Learning of Compact 3D Models Based on the Detection of Recurrent Structures, ICRA 2010 |
//! | [`gas`] | a growing neural gas: neurons with a topology | V. Morell, M. Cazorla, S. Orts-Escolano, J. Garcia-Rodriguez: 3D Maps Representation Using GNG, 2014 |
//! | [`patches`] | sparse-coded surface patches | M. Ruhnke, L. Bo, D. Fox, W. Burgard: Hierarchical Sparse Coded Surface Models, ICRA 2014 |
//! | [`planes`] | planar patches with tiles | R. Lakaemper, L. J. Latecki: Extended EM for Planar Approximation of 3D Data, ICRA 2006 |

pub mod alphabet;
mod attribute_error;
pub mod bic_alphabet;
mod color;
mod contract;
mod error;
mod extent;
pub mod gas;
mod groups;
pub mod hscsm;
pub mod options;
pub mod patches;
pub mod planes;
mod points;
mod quality;
pub mod recognition;
mod region;
mod report;
mod scalar;
pub mod scans;
mod sensor;
mod size_code;
mod spread;
mod stages;
mod start;
mod summary;

pub use contract::{Budget, DecodeOptions, NoVocabulary, Source, SurfaceModel};
pub use error::{Error, Result};
pub use quality::Quality;
pub use region::Region;
pub use report::{AttributeFigures, Figures, Named, Report, Stage};
pub use scalar::ScalarScale;
pub use sensor::Sensor;
pub use start::ChosenOption;
pub use summary::{Fact, Summary};
use surfabet_geom::vector;
