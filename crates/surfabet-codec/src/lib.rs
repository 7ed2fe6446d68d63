//! Bytes of the `.sfb` file: container, entropy coder and one section format per model family.
//!
//! The layout of every byte is written down in `docs/format.md`. What is read from a file is never trusted:
//! counts are bounded by the bytes that remain and by [`Limits`] before anything is allocated, every section
//! has a checksum, and whatever steers the entropy decoder is integer arithmetic, so that all platforms read
//! the same symbols.
//!
//! ```
//! use surfabet_codec::{Container, ContainerWriter, Family, Features, Limits, Tag};
//! use surfabet_codec::{Decoder, Encoder, models::SInt};
//!
//! const DEPTH: Tag = Tag::new(b"DPTH");
//! let residuals = [0, -1, 2, 0, 0, 1];
//!
//! let (mut encoder, mut model) = (Encoder::new(), SInt::new());
//! for value in residuals {
//!     encoder.sint(&mut model, value);
//! }
//! let file = ContainerWriter::new(Family::Patches, Features::NONE)
//!     .section(DEPTH, encoder.finish())
//!     .finish()?;
//!
//! let container = Container::parse(&file, &Limits::default())?;
//! let (mut decoder, mut model) = (Decoder::new(DEPTH, container.require(DEPTH)?), SInt::new());
//! for value in residuals {
//!     assert_eq!(decoder.sint(&mut model)?, value);
//! }
//! decoder.finish()?;
//! # Ok::<(), surfabet_codec::Error>(())
//! ```

mod alphabet;
mod attributes;
mod bic_alphabet;
pub mod bytes;
mod container;
mod entropy;
mod error;
mod gas;
mod hash;
pub mod header;
mod hscsm;
pub mod models;
mod note;
mod patches;
mod planes;
mod section;
mod tiles;

pub use container::{
    Container, ContainerWriter, Family, Features, FileFrame, Limits, Section, SectionEntry, Tag,
    Version,
};
pub use entropy::{Decoder, Encoder};
pub use error::{Error, Result};
pub use hash::ContentHash;
pub use header::META;
pub use note::{MAX_NOTE, note, with_note};
pub use section::{
    FileSummary, Layout, Promise, StreamSection, Vocabulary, holds, inspect, read, write,
};
pub use tiles::{
    MAX_DETAILS, RECIPE, TILE_INDEX, TILES, TileEntry, TileIndex, TiledHeader, checksum,
    inspect_tiles, patches_of_tile, write_tile,
};
