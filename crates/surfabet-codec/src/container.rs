//! The container that all model families share: magic, versions, family, features, checked sections.
//!
//! Byte by byte in `docs/format.md`.

use std::fmt;

use crate::bytes::{ByteReader, ByteWriter};
use crate::error::{Error, Result};

/// First bytes of every `.sfb` file. The first is no ASCII and no UTF-8, so that no text file is taken for one.
pub(crate) const MAGIC: [u8; 4] = [0x89, b'S', b'F', b'B'];

/// Version of the container's own layout.
pub(crate) const CONTAINER_VERSION: u8 = 1;

/// Most sections that a file may have; far above what any family writes.
const MAX_SECTIONS: usize = 256;

/// Least bytes of a section's entry in the table: tag, length of one byte, checksum.
const MIN_ENTRY: usize = 9;

/// A release of surfabet, as far as the format is concerned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Version {
    /// Major number.
    pub major: u8,
    /// Minor number.
    pub minor: u8,
}

impl Version {
    /// The first release, which reads every file without required features.
    pub const FIRST: Self = Self { major: 0, minor: 1 };
    /// This release.
    pub const CURRENT: Self = Self { major: 0, minor: 1 };
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

/// The family of the model in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Family {
    /// Words of an alphabet and their occurrences.
    Alphabet = 1,
    /// Surface patches over a dictionary.
    Patches = 2,
    /// Planes with extent and supported tiles.
    Planes = 3,
    /// A neural gas: neurons and edges.
    Gas = 4,
}

impl Family {
    /// Every family, with the number that stands for it in the file.
    pub const ALL: [Self; 4] = [Self::Alphabet, Self::Patches, Self::Planes, Self::Gas];

    /// The name users type.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alphabet => "alphabet",
            Self::Patches => "patches",
            Self::Planes => "planes",
            Self::Gas => "gas",
        }
    }

    fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|family| *family as u8 == number)
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Features without which a file cannot be read, one bit each.
///
/// A new way to code something gets a new bit and the release that introduces it; older releases then refuse
/// the file by naming that release, instead of misreading it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Features(u64);

impl Features {
    /// Nothing beyond the first release.
    pub const NONE: Self = Self(0);
    /// The dictionary is not inside: the file names a shared one by its hash.
    pub const SHARED_DICTIONARY: Self = Self(1);

    /// Every feature known here, its name, and the release that introduced it.
    const KNOWN: [(Self, &'static str, Version); 1] =
        [(Self::SHARED_DICTIONARY, "shared dictionary", Version { major: 0, minor: 1 })];

    /// The bits.
    pub fn bits(self) -> u64 {
        self.0
    }

    /// These features and those of `other`.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// True when all of `other` is among these.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Names of the features, for people.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        let present = move |(feature, _, _): &(Self, _, _)| self.contains(*feature);
        Self::KNOWN.into_iter().filter(present).map(|(_, name, _)| name)
    }

    /// Bits that no known feature has.
    fn unknown_bits(self) -> u64 {
        Self::KNOWN.iter().fold(self.0, |bits, (feature, _, _)| bits & !feature.0)
    }

    /// The oldest release that knows all of these.
    fn needed_version(self) -> Version {
        let since = Self::KNOWN.iter().filter(|(feature, _, _)| self.contains(*feature));
        since.map(|(_, _, version)| *version).max().unwrap_or(Version::FIRST)
    }
}

/// Name of a section: four printable ASCII characters.
///
/// A tag that begins with a small letter marks a section that may be skipped by a reader that does not know
/// it; any other unknown section is an error.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Tag([u8; 4]);

impl Tag {
    /// The header itself, in errors; no section may be called so.
    pub const HEADER: Self = Self(*b"HEAD");

    /// A tag known at compile time.
    ///
    /// # Panics
    /// When a byte is not a printable ASCII character other than the blank: at compile time for constants.
    pub const fn new(tag: &[u8; 4]) -> Self {
        let mut i = 0;
        while i < 4 {
            assert!(tag[i].is_ascii_graphic(), "a tag has four printable characters");
            i += 1;
        }
        Self(*tag)
    }

    /// The four bytes.
    pub fn as_bytes(&self) -> [u8; 4] {
        self.0
    }

    /// True when readers that do not know the section skip it.
    pub fn is_skippable(self) -> bool {
        self.0[0].is_ascii_lowercase()
    }
}

impl fmt::Display for Tag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.escape_ascii())
    }
}

impl fmt::Debug for Tag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Tag({self})")
    }
}

/// What a caller is ready to spend on a file that it may not trust.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Most points, patches, words or other items that a file may ask for.
    pub max_items: u64,
    /// Most bytes of the file, and of any one thing allocated to decode it.
    pub max_bytes: u64,
}

impl Default for Limits {
    /// 500 million items, 8 GiB.
    fn default() -> Self {
        Self { max_items: 500_000_000, max_bytes: 8 << 30 }
    }
}

impl Limits {
    /// Checks a number of items of which each will take `bytes_each` bytes of memory, before it is allocated.
    ///
    /// # Errors
    /// [`Error::TooLarge`] above `max_items` or `max_bytes`.
    pub fn check(&self, what: &'static str, count: u64, bytes_each: u64) -> Result<usize> {
        let limit = self.max_items.min(self.max_bytes / bytes_each.max(1));
        match usize::try_from(count) {
            Ok(small) if count <= limit => Ok(small),
            _ => Err(Error::TooLarge {
                what,
                value: count,
                limit,
                remedy: "raise max_items or max_bytes if you trust the file",
            }),
        }
    }
}

/// Puts a file together.
#[derive(Debug, Clone)]
pub struct ContainerWriter {
    family: u8,
    features: Features,
    needed: Version,
    sections: Vec<(Tag, Vec<u8>)>,
}

impl ContainerWriter {
    /// A file of `family` that needs `features` to be read.
    pub fn new(family: Family, features: Features) -> Self {
        Self {
            family: family as u8,
            features,
            needed: features.needed_version(),
            sections: Vec::new(),
        }
    }

    /// Appends a section; sections stay in this order.
    #[must_use]
    pub fn section(mut self, tag: Tag, bytes: Vec<u8>) -> Self {
        self.sections.push((tag, bytes));
        self
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// [`Error::DuplicateSection`], also for a section called as the header;
    /// [`Error::TooLarge`] with more than 256 sections.
    pub fn finish(self) -> Result<Vec<u8>> {
        check_section_count(self.sections.len() as u64)?;
        let tags: Vec<Tag> = self.sections.iter().map(|(tag, _)| *tag).collect();
        check_unique(&tags)?;

        let mut header = ByteWriter::new();
        header.bytes(&MAGIC);
        header.u8(CONTAINER_VERSION);
        header.u8(self.needed.major);
        header.u8(self.needed.minor);
        header.u8(self.family);
        header.varint(self.features.0);
        header.varint(self.sections.len() as u64);
        for (tag, bytes) in &self.sections {
            header.bytes(&tag.0);
            header.varint(bytes.len() as u64);
            header.u32(crc32c::crc32c(bytes));
        }
        let mut file = header.finish();
        let checksum = crc32c::crc32c(&file);
        file.extend_from_slice(&checksum.to_le_bytes());
        for (_, bytes) in &self.sections {
            file.extend_from_slice(bytes);
        }
        Ok(file)
    }
}

fn check_section_count(count: u64) -> Result<()> {
    if count <= MAX_SECTIONS as u64 {
        return Ok(());
    }
    Err(Error::TooLarge {
        what: "number of sections",
        value: count,
        limit: MAX_SECTIONS as u64,
        remedy: "no model has so many, so the file is damaged: fetch it again",
    })
}

fn check_unique(tags: &[Tag]) -> Result<()> {
    let mut sorted = tags.to_vec();
    sorted.push(Tag::HEADER);
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(Error::DuplicateSection { section: pair[0] }),
        None => Ok(()),
    }
}

/// One section of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Section<'a> {
    /// Its name.
    pub tag: Tag,
    /// Its content, checked against its checksum.
    pub bytes: &'a [u8],
}

/// A file taken apart, with every length and checksum verified.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Container<'a> {
    family: Family,
    features: Features,
    needed: Version,
    overhead: usize,
    sections: Vec<Section<'a>>,
}

impl<'a> Container<'a> {
    /// Takes the bytes of a whole file apart.
    ///
    /// # Errors
    /// [`Error::NotSfb`], [`Error::UnsupportedVersion`], [`Error::UnknownFeature`], [`Error::UnknownFamily`] for
    /// files that this program does not read; [`Error::TooLarge`] above `limits`; [`Error::Truncated`],
    /// [`Error::ChecksumMismatch`], [`Error::TrailingBytes`], [`Error::DuplicateSection`], [`Error::Corrupt`]
    /// for damaged ones. A version or feature is only believed after the header's checksum was, except that
    /// another container version cannot be checked.
    pub fn parse(file: &'a [u8], limits: &Limits) -> Result<Self> {
        let head = &file[..file.len().min(MAGIC.len())];
        if head != MAGIC {
            // A prefix of the magic is a file cut short rather than something else.
            if !head.is_empty() && MAGIC.starts_with(head) {
                let section = Tag::HEADER;
                let (needed, available) = (MAGIC.len() as u64, head.len() as u64);
                return Err(Error::Truncated { section, needed, available });
            }
            return Err(Error::NotSfb { found: head.to_vec() });
        }
        if file.len() as u64 > limits.max_bytes {
            return Err(Error::TooLarge {
                what: "length of the file in bytes",
                value: file.len() as u64,
                limit: limits.max_bytes,
                remedy: "raise max_bytes if you trust the file",
            });
        }
        let mut reader = ByteReader::new(Tag::HEADER, file);
        reader.bytes(MAGIC.len())?;
        let version = reader.u8()?;
        let needed = Version { major: reader.u8()?, minor: reader.u8()? };
        if version != CONTAINER_VERSION {
            return Err(Error::UnsupportedVersion {
                found: version,
                supported: CONTAINER_VERSION,
                needed,
            });
        }
        let family = reader.u8()?;
        let features = Features(reader.varint()?);
        let count = reader.count("number of sections", MIN_ENTRY)?;
        check_section_count(count as u64)?;
        let mut table = Vec::with_capacity(count);
        for _ in 0..count {
            let offset = reader.offset();
            let mut tag = [0; 4];
            tag.copy_from_slice(reader.bytes(4)?);
            if !tag.iter().all(u8::is_ascii_graphic) {
                let what = format!("section name {:02x?} is not printable", tag);
                return Err(Error::corrupt(Tag::HEADER, offset, what));
            }
            table.push((Tag(tag), reader.varint()?, reader.u32()?));
        }
        let table_end = reader.offset();
        if crc32c::crc32c(&file[..table_end]) != reader.u32()? {
            return Err(Error::ChecksumMismatch { section: Tag::HEADER });
        }
        if features.unknown_bits() != 0 {
            return Err(Error::UnknownFeature { bits: features.unknown_bits(), needed });
        }
        let family =
            Family::from_number(family).ok_or(Error::UnknownFamily { found: family, needed })?;
        let tags: Vec<Tag> = table.iter().map(|(tag, _, _)| *tag).collect();
        check_unique(&tags)?;

        let overhead = reader.offset();
        let mut sections = Vec::with_capacity(count);
        for (tag, len, checksum) in table {
            let available = reader.remaining() as u64;
            let truncated = Error::Truncated { section: tag, needed: len, available };
            let len = usize::try_from(len).map_err(|_| truncated.clone())?;
            let bytes = reader.bytes(len).map_err(|_| truncated)?;
            if crc32c::crc32c(bytes) != checksum {
                return Err(Error::ChecksumMismatch { section: tag });
            }
            sections.push(Section { tag, bytes });
        }
        reader.finish()?;
        Ok(Self { family, features, needed, overhead, sections })
    }

    /// Family of the model inside.
    pub fn family(&self) -> Family {
        self.family
    }

    /// [`Error::WrongFamily`] unless the model inside is of family `expected`.
    pub fn expect_family(&self, expected: Family) -> Result<()> {
        let found = self.family;
        if found == expected { Ok(()) } else { Err(Error::WrongFamily { expected, found }) }
    }

    /// Features without which the file cannot be read.
    pub fn features(&self) -> Features {
        self.features
    }

    /// Oldest surfabet that reads the file.
    pub fn needed_version(&self) -> Version {
        self.needed
    }

    /// Bytes that are in no section: header, table and checksums.
    pub fn overhead(&self) -> usize {
        self.overhead
    }

    /// All sections, in the order of the file.
    pub fn sections(&self) -> &[Section<'a>] {
        &self.sections
    }

    /// Content of the section `tag`, if there is one.
    pub fn section(&self, tag: Tag) -> Option<&'a [u8]> {
        self.sections.iter().find(|section| section.tag == tag).map(|section| section.bytes)
    }

    /// Content of the section `tag`.
    ///
    /// # Errors
    /// [`Error::MissingSection`].
    pub fn require(&self, tag: Tag) -> Result<&'a [u8]> {
        self.section(tag).ok_or(Error::MissingSection { section: tag })
    }

    /// Refuses sections that are neither in `known` nor skippable.
    ///
    /// # Errors
    /// [`Error::UnknownSection`] for the first of them.
    pub fn expect_only(&self, known: &[Tag]) -> Result<()> {
        let strange = |s: &&Section<'_>| !known.contains(&s.tag) && !s.tag.is_skippable();
        match self.sections.iter().find(strange) {
            Some(Section { tag, .. }) => {
                Err(Error::UnknownSection { section: *tag, needed: self.needed })
            }
            None => Ok(()),
        }
    }
}
