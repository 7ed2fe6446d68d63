//! The one error type of this crate.

use std::borrow::Cow;

use surfabet_base::{Cancelled, InvalidParameter};

use crate::container::{Family, Tag, Version};
use crate::hash::ContentHash;

/// Shorthand for results of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can go wrong with the bytes of a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file does not begin with the magic number.
    #[error(
        "not an .sfb file: it begins with bytes {found:02x?}, an .sfb file with [89, 53, 46, 42]"
    )]
    NotSfb {
        /// The first bytes of the file, at most four.
        found: Vec<u8>,
    },
    /// The layout of the container is newer than this program.
    #[error(
        "the file has container version {found}, this program reads up to {supported}; \
         read it with surfabet {needed} or newer"
    )]
    UnsupportedVersion {
        /// Container version of the file.
        found: u8,
        /// Newest container version that this program reads.
        supported: u8,
        /// Oldest surfabet that reads the file.
        needed: Version,
    },
    /// The file needs features that this program does not have.
    #[error(
        "the file needs features {bits:#x}, unknown to surfabet {current}; \
         read it with surfabet {needed} or newer",
        current = Version::CURRENT
    )]
    UnknownFeature {
        /// The required-feature bits unknown here.
        bits: u64,
        /// Oldest surfabet that reads the file.
        needed: Version,
    },
    /// The file needs features that only development states before the first release had.
    #[error(
        "the file was written by a development state before surfabet 0.1, with estimates of colours \
         (feature bits {bits:#x}) that no release reads; encode its cloud again"
    )]
    RetiredFeature {
        /// The required-feature bits.
        bits: u64,
    },
    /// The file holds a model family that this program does not have.
    #[error(
        "the file holds model family {found}, unknown to surfabet {current}; \
         read it with surfabet {needed} or newer",
        current = Version::CURRENT
    )]
    UnknownFamily {
        /// Number of the family.
        found: u8,
        /// Oldest surfabet that reads the file.
        needed: Version,
    },
    /// The file holds another family of model than was asked for.
    #[error("the file holds a model of family {found}, not {expected}; open it as {found}")]
    WrongFamily {
        /// The family asked for.
        expected: Family,
        /// The family in the file.
        found: Family,
    },
    /// The file has a section whose meaning is unknown and that must not be skipped.
    #[error(
        "the file has an unknown section {section}; it was written by another surfabet \
         ({needed} or newer)"
    )]
    UnknownSection {
        /// Tag of the section.
        section: Tag,
        /// Oldest surfabet that reads the file.
        needed: Version,
    },
    /// A section that the family needs is not there.
    #[error(
        "the file has no section {section}, which its model family needs; it was cut or edited"
    )]
    MissingSection {
        /// Tag of the section.
        section: Tag,
    },
    /// Two sections have the same tag.
    #[error("section {section} occurs twice; every section may occur once")]
    DuplicateSection {
        /// Tag of the section.
        section: Tag,
    },
    /// The bytes of a section are not those that were written.
    #[error("checksum of section {section} does not match: the file is damaged, fetch it again")]
    ChecksumMismatch {
        /// Tag of the section.
        section: Tag,
    },
    /// The data end early.
    #[error("section {section} ends early: {needed} more bytes needed, {available} there")]
    Truncated {
        /// Tag of the section.
        section: Tag,
        /// Bytes that the next item takes.
        needed: u64,
        /// Bytes left for it.
        available: u64,
    },
    /// Bytes follow the last item.
    #[error("{count} bytes follow the end of section {section}, where nothing may stand")]
    TrailingBytes {
        /// Tag of the section.
        section: Tag,
        /// How many bytes follow.
        count: u64,
    },
    /// A value contradicts the format.
    #[error("section {section} is corrupt at byte {offset}: {what}")]
    Corrupt {
        /// Tag of the section.
        section: Tag,
        /// What is wrong, with values.
        what: String,
        /// Byte offset within the section, as far as known.
        offset: usize,
    },
    /// A count in the file is larger than the caller or the remaining bytes allow.
    #[error("{what} is {value}, above the limit of {limit}; {remedy}")]
    TooLarge {
        /// What is counted.
        what: &'static str,
        /// The count.
        value: u64,
        /// The most that is allowed.
        limit: u64,
        /// How to get on.
        remedy: &'static str,
    },
    /// A parameter is outside its domain.
    #[error(transparent)]
    InvalidParameter(#[from] InvalidParameter),
    /// The shared dictionary given is not the one the file was made with.
    #[error(
        "the file was made with dictionary {expected}, the one given is {found}; give the former"
    )]
    DictionaryMismatch {
        /// Hash that the file names.
        expected: ContentHash,
        /// Hash of the dictionary given.
        found: ContentHash,
    },
    /// A size that no alphabet has.
    #[error(transparent)]
    InvalidAlphabet(#[from] surfabet_entropy::InvalidAlphabet),
    /// The file refers to a dictionary, and none was given.
    #[error(
        "the file was made with dictionary {expected} and does not hold it; give the model that does"
    )]
    MissingDictionary {
        /// Hash that the file names.
        expected: ContentHash,
    },
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl Error {
    /// A parameter outside its domain, with its value spelled out.
    pub fn invalid(
        name: &'static str,
        value: impl std::fmt::Display,
        requirement: impl Into<Cow<'static, str>>,
    ) -> Self {
        InvalidParameter::new(name, value, requirement).into()
    }

    /// A value at byte `offset` of `section` that contradicts the format.
    pub fn corrupt(section: Tag, offset: usize, what: impl Into<String>) -> Self {
        Self::Corrupt { section, what: what.into(), offset }
    }
}
