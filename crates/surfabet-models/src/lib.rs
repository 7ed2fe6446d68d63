//! Compact models of point clouds, learned from what recurs in them: a folder per method, a file per verb.
//!
//! | method | learns | paper |
//! |---|---|---|
//! | [`patches`] | surface patches on the lattice of the scene | after M. Ruhnke, L. Bo, D. Fox, W. Burgard: Hierarchical Sparse Coded Surface Models, ICRA 2014 |
//! | [`hscsm`] | sparse-coded surface patches | the same |
//! | [`alphabet`] | words by description length, and their places | after M. Ruhnke, B. Steder, G. Grisetti, W. Burgard: Unsupervised Learning of Compact 3D Models Based on the Detection of Recurrent Structures, ICRA 2010 |
//! | [`bic_alphabet`] | words by BIC, and their places | the same |
//! | [`planes`] | planar patches with tiles | R. Lakaemper, L. J. Latecki: Extended EM for Planar Approximation of 3D Data, ICRA 2006 |
//! | [`gas`] | a growing neural gas: neurons with a topology | V. Morell, M. Cazorla, S. Orts-Escolano, J. Garcia-Rodriguez: 3D Maps Representation Using GNG, 2014 |

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

pub use color::to_ycocg;
pub use contract::{Budget, DecodeOptions, NoVocabulary, Source, SurfaceModel};
pub use error::{Error, Result};
pub use quality::Quality;
pub use region::Region;
pub use report::{AttributeFigures, Figures, Named, Report, Stage};
pub use scalar::ScalarScale;
pub use sensor::Sensor;
pub use stages::Stages;
pub use start::ChosenOption;
pub use summary::{Fact, Summary};
use surfabet_geom::vector;
