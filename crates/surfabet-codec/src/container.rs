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
    /// The patches lie on a lattice, with thickness, and colour on cells of their own.
    pub const LATTICE: Self = Self(2);
    /// The words of the alphabet are points of the scene, chosen by the Bayesian information criterion.
    pub const BIC_ALPHABET: Self = Self(4);
    /// The model carries attributes beside colour.
    pub const ATTRIBUTES: Self = Self(8);

    /// Points have the attributes of the cell that they lie in.
    pub const UNBLENDED: Self = Self(16);

    /// Levels of a hierarchy have finer bitmasks than images, or one dictionary in common.
    pub const HIERARCHY: Self = Self(32);

    /// Colours and scalars of patches are also predicted from what is coded beside them.
    pub const BESIDE: Self = Self(64);

    /// Patches stand in tiles that are read one by one.
    pub const TILES: Self = Self(128);

    /// The header of patches has a bound on the distance of decoded points to the input.
    pub const FORWARD_BOUND: Self = Self(256);

    /// Points beside patches are coded given those around.
    pub const NEAR_POINTS: Self = Self(512);

    /// Parts of patches are given once more at other places.
    pub const INSTANCES: Self = Self(1024);

    /// Colours and scalars of patches are whole numbers, with models of several contexts at once.
    pub const WHOLE_FIELDS: Self = Self(2048);

    /// Colours and scalars of tiles are corrected at their borders.
    pub const BORDERS: Self = Self(4096);

    /// Points beside patches are coded given the pattern of those around.
    pub const POINT_PATTERNS: Self = Self(8192);

    /// Colours and scalars of patches are coded with estimates of small networks beside the models.
    pub const ESTIMATES: Self = Self(32_768);

    /// Set by development states before the first release, whose networks were others; no longer read.
    const RETIRED: Self = Self(16_384);

    /// Every feature known here, its name, and the release that introduced it.
    const KNOWN: [(Self, &'static str, Version); 15] = [
        (Self::SHARED_DICTIONARY, "shared dictionary", Version { major: 0, minor: 1 }),
        (Self::LATTICE, "patches on a lattice", Version { major: 0, minor: 1 }),
        (Self::BIC_ALPHABET, "alphabet by BIC", Version { major: 0, minor: 1 }),
        (Self::ATTRIBUTES, "attributes", Version { major: 0, minor: 1 }),
        (Self::UNBLENDED, "attributes without blending", Version { major: 0, minor: 1 }),
        (Self::HIERARCHY, "hierarchy in common", Version { major: 0, minor: 1 }),
        (Self::BESIDE, "attributes predicted from those beside", Version { major: 0, minor: 1 }),
        (Self::TILES, "tiles", Version { major: 0, minor: 1 }),
        (Self::FORWARD_BOUND, "bound on decoded points", Version { major: 0, minor: 1 }),
        (Self::NEAR_POINTS, "points given those around", Version { major: 0, minor: 1 }),
        (Self::INSTANCES, "instances", Version { major: 0, minor: 1 }),
        (Self::WHOLE_FIELDS, "attributes in whole numbers", Version { major: 0, minor: 1 }),
        (Self::BORDERS, "attributes corrected at borders", Version { major: 0, minor: 1 }),
        (Self::POINT_PATTERNS, "points given the pattern around", Version { major: 0, minor: 1 }),
        (Self::ESTIMATES, "attributes with estimates", Version { major: 0, minor: 1 }),
    ];

    /// The bits.
    pub fn bits(self) -> u64 {
        self.0
    }

    /// These features and those of `other`.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// These features but for those of `other`.
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
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
    /// Checks the size of a file before it is read.
    ///
    /// # Errors
    /// [`Error::TooLarge`] above `max_bytes`.
    pub fn check_size(&self, bytes: u64) -> Result<()> {
        if bytes <= self.max_bytes {
            return Ok(());
        }
        Err(Error::TooLarge {
            what: "size of the file",
            value: bytes,
            limit: self.max_bytes,
            remedy: "raise max_bytes if you trust the file",
        })
    }

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
    sections: Vec<(Tag, Content)>,
}

/// Content of a section that is written.
#[derive(Debug, Clone)]
enum Content {
    Bytes(Vec<u8>),
    /// Bytes that the caller puts into their place.
    Elsewhere {
        len: u64,
        checksum: u32,
    },
}

impl Content {
    fn len(&self) -> u64 {
        match self {
            Self::Bytes(bytes) => bytes.len() as u64,
            Self::Elsewhere { len, .. } => *len,
        }
    }

    fn checksum(&self) -> u32 {
        match self {
            Self::Bytes(bytes) => crc32c::crc32c(bytes),
            Self::Elsewhere { checksum, .. } => *checksum,
        }
    }
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
        self.sections.push((tag, Content::Bytes(bytes)));
        self
    }

    /// Appends a section of `len` bytes with this checksum, which [`ContainerWriter::finish`] leaves out: they are to be
    /// put between the bytes of the sections before and after it.
    #[must_use]
    pub fn section_elsewhere(mut self, tag: Tag, len: u64, checksum: u32) -> Self {
        self.sections.push((tag, Content::Elsewhere { len, checksum }));
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
        for (tag, content) in &self.sections {
            header.bytes(&tag.0);
            header.varint(content.len());
            header.u32(content.checksum());
        }
        let mut file = header.finish();
        let checksum = crc32c::crc32c(&file);
        file.extend_from_slice(&checksum.to_le_bytes());
        for (_, content) in &self.sections {
            if let Content::Bytes(bytes) = content {
                file.extend_from_slice(bytes);
            }
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

/// Refuses what does not begin as an `.sfb` file, and what is larger than the caller allows.
fn check_start(file: &[u8], limits: &Limits) -> Result<()> {
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
    Ok(())
}

/// A section as the table has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SectionEntry {
    /// Its name.
    pub tag: Tag,
    /// Number of its bytes.
    pub len: u64,
    /// Checksum of its bytes.
    pub checksum: u32,
}

/// What stands before the sections of a file, for readers that take parts of these.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileFrame {
    /// Family of the model inside.
    pub family: Family,
    /// Features without which the file cannot be read.
    pub features: Features,
    /// Sections one after another, as the table has them.
    pub sections: Vec<SectionEntry>,
    /// Where the first section begins.
    pub len: u64,
}

impl FileFrame {
    /// Most bytes that a frame takes: with all sections that there may be.
    pub const MOST: usize = 64 + MAX_SECTIONS * (MIN_ENTRY + 9);

    /// Reads the first bytes of a file: [`FileFrame::MOST`] are always enough.
    ///
    /// # Errors
    /// As [`Container::parse`].
    pub fn read(start: &[u8], limits: &Limits) -> Result<Self> {
        check_start(start, limits)?;
        let mut reader = ByteReader::new(Tag::HEADER, start);
        let Header { family, features, table, .. } = Header::read(&mut reader, start)?;
        Ok(Self { family, features, sections: table, len: reader.offset() as u64 })
    }

    /// Where a section begins in the file, and its entry.
    ///
    /// # Errors
    /// [`Error::MissingSection`]; [`Error::Corrupt`] for lengths beyond 64 bits.
    pub fn require(&self, tag: Tag) -> Result<(u64, SectionEntry)> {
        let mut offset = self.len;
        for entry in &self.sections {
            if entry.tag == tag {
                return Ok((offset, *entry));
            }
            let end = offset.checked_add(entry.len);
            offset = end.ok_or_else(|| {
                Error::corrupt(Tag::HEADER, 0, "sections of more than 2^64 bytes")
            })?;
        }
        Err(Error::MissingSection { section: tag })
    }

    /// Refuses sections that are neither in `known` nor skippable.
    ///
    /// # Errors
    /// [`Error::UnknownSection`] for the first of them.
    pub fn expect_only(&self, known: &[Tag]) -> Result<()> {
        let strange = |e: &&SectionEntry| !known.contains(&e.tag) && !e.tag.is_skippable();
        match self.sections.iter().find(strange) {
            Some(entry) => Err(Error::UnknownSection {
                section: entry.tag,
                needed: self.features.needed_version(),
            }),
            None => Ok(()),
        }
    }
}

/// What stands before the sections.
struct Header {
    family: Family,
    features: Features,
    needed: Version,
    table: Vec<SectionEntry>,
}

impl Header {
    /// Reads from the start of `file` and checks everything but the sections.
    fn read(reader: &mut ByteReader<'_>, file: &[u8]) -> Result<Self> {
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
        let table = read_table(reader)?;
        let table_end = reader.offset();
        if crc32c::crc32c(&file[..table_end]) != reader.u32()? {
            return Err(Error::ChecksumMismatch { section: Tag::HEADER });
        }
        if features.0 & Features::RETIRED.0 != 0 {
            return Err(Error::RetiredFeature { bits: Features::RETIRED.0 });
        }
        if features.unknown_bits() != 0 {
            return Err(Error::UnknownFeature { bits: features.unknown_bits(), needed });
        }
        let family =
            Family::from_number(family).ok_or(Error::UnknownFamily { found: family, needed })?;
        let tags: Vec<Tag> = table.iter().map(|entry| entry.tag).collect();
        check_unique(&tags)?;
        Ok(Self { family, features, needed, table })
    }
}

/// The number of sections, and an entry for each.
fn read_table(reader: &mut ByteReader<'_>) -> Result<Vec<SectionEntry>> {
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
        table.push(SectionEntry { tag: Tag(tag), len: reader.varint()?, checksum: reader.u32()? });
    }
    Ok(table)
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
    /// [`Error::NotSfb`], [`Error::UnsupportedVersion`], [`Error::UnknownFeature`], [`Error::RetiredFeature`], [`Error::UnknownFamily`] for
    /// files that this program does not read; [`Error::TooLarge`] above `limits`; [`Error::Truncated`],
    /// [`Error::ChecksumMismatch`], [`Error::TrailingBytes`], [`Error::DuplicateSection`], [`Error::Corrupt`]
    /// for damaged ones. A version or feature is only believed after the header's checksum was, except that
    /// another container version cannot be checked.
    pub fn parse(file: &'a [u8], limits: &Limits) -> Result<Self> {
        check_start(file, limits)?;
        let mut reader = ByteReader::new(Tag::HEADER, file);
        let Header { family, features, needed, table } = Header::read(&mut reader, file)?;
        let overhead = reader.offset();
        let mut sections = Vec::with_capacity(table.len());
        for SectionEntry { tag, len, checksum } in table {
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const ONE: Tag = Tag::new(b"ONE1");
    const TWO: Tag = Tag::new(b"TWO2");
    const NOTE: Tag = Tag::new(b"note");

    fn writer() -> ContainerWriter {
        ContainerWriter::new(Family::Patches, Features::NONE)
            .section(ONE, vec![1, 2, 3])
            .section(TWO, vec![])
            .section(NOTE, (0..200).collect())
    }

    fn parse(file: &[u8]) -> Result<Container<'_>> {
        Container::parse(file, &Limits::default())
    }

    #[test]
    fn sections_come_back_in_order() {
        let file = writer().finish().unwrap();
        let container = parse(&file).unwrap();
        assert_eq!(container.family(), Family::Patches);
        assert_eq!(container.features(), Features::NONE);
        assert_eq!(container.needed_version(), Version::FIRST);
        let tags: Vec<Tag> = container.sections().iter().map(|section| section.tag).collect();
        assert_eq!(tags, [ONE, TWO, NOTE]);
        assert_eq!(container.require(ONE), Ok(&[1, 2, 3][..]));
        assert_eq!(container.section(TWO), Some(&[][..]));
        let missing = Tag::new(b"NONE");
        assert_eq!(container.section(missing), None);
        assert_eq!(container.require(missing), Err(Error::MissingSection { section: missing }));
        assert_eq!(container.overhead() + 203, file.len());
    }

    #[test]
    fn overhead_is_small() {
        let empty = ContainerWriter::new(Family::Gas, Features::NONE).finish().unwrap();
        assert_eq!(empty.len(), 14);
        // 9 bytes per section, one more from 128 bytes on.
        assert_eq!(writer().finish().unwrap().len(), 14 + 3 * 9 + 1 + 203);
    }

    #[test]
    fn the_bytes_are_those_of_the_format() {
        let file = ContainerWriter::new(Family::Patches, Features::SHARED_DICTIONARY)
            .section(ONE, b"123456789".to_vec())
            .finish()
            .unwrap();
        // CRC-32C of "123456789" is the check value of the catalogues, 0xe3069283.
        let mut expected = b"\x89SFB\x01\x00\x01\x02\x01\x01ONE1\x09\x83\x92\x06\xe3".to_vec();
        let checksum = crc32c::crc32c(&expected).to_le_bytes();
        expected.extend(checksum);
        expected.extend(b"123456789");
        assert_eq!(file, expected);
    }

    #[test]
    fn every_cut_is_an_error() {
        let file = writer().finish().unwrap();
        for len in 0..file.len() {
            let error = parse(&file[..len]).unwrap_err();
            let right = match len {
                0 => matches!(error, Error::NotSfb { .. }),
                _ => matches!(error, Error::Truncated { .. } | Error::TooLarge { .. }),
            };
            assert!(right, "cut to {len}: {error}");
        }
    }

    #[test]
    fn every_flipped_bit_is_an_error() {
        let file = writer().finish().unwrap();
        for bit in 0..8 * file.len() {
            let mut flipped = file.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(parse(&flipped).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn a_flip_in_a_section_names_it() {
        let mut file = writer().finish().unwrap();
        *file.last_mut().unwrap() ^= 1;
        assert_eq!(parse(&file), Err(Error::ChecksumMismatch { section: NOTE }));
    }

    #[test]
    fn trailing_bytes_are_an_error() {
        let mut file = writer().finish().unwrap();
        file.extend([0; 5]);
        let expected = Error::TrailingBytes { section: Tag::HEADER, count: 5 };
        assert_eq!(parse(&file), Err(expected));
    }

    #[test]
    fn other_files_are_told_apart() {
        for file in [&b""[..], b"ply\nformat", b"\x89PNG\r\n", b"\x88SFB"] {
            assert!(matches!(parse(file), Err(Error::NotSfb { .. })), "{file:?}");
        }
        let message = parse(b"ply\nformat").unwrap_err().to_string();
        assert!(message.contains("[70, 6c, 79, 0a]"), "{message}");
    }

    /// A file with the header that `change` makes of the writer.
    fn changed(change: impl Fn(&mut ContainerWriter)) -> Vec<u8> {
        let mut writer = writer();
        change(&mut writer);
        writer.finish().unwrap()
    }

    #[test]
    fn retired_features_say_who_wrote_them() {
        let file = changed(|writer| writer.features = Features(16_384 | Features::LATTICE.0));
        let error = parse(&file).unwrap_err();
        assert_eq!(error, Error::RetiredFeature { bits: 16_384 });
        let message = error.to_string();
        assert!(message.contains("before surfabet 0.1") && message.contains("encode"), "{message}");
        // The bits beside it are read.
        for bits in [8192, 32_768] {
            assert!(parse(&changed(|writer| writer.features = Features(bits))).is_ok());
        }
    }

    #[test]
    fn unknown_features_name_the_version_needed() {
        let needed = Version { major: 3, minor: 7 };
        let file = changed(|writer| {
            writer.features = Features(Features::SHARED_DICTIONARY.0 | 1 << 40);
            writer.needed = needed;
        });
        let error = parse(&file).unwrap_err();
        assert_eq!(error, Error::UnknownFeature { bits: 1 << 40, needed });
        let message = error.to_string();
        assert!(message.contains("surfabet 3.7 or newer"), "{message}");
        assert!(message.contains("surfabet 0.1;"), "{message}");
    }

    #[test]
    fn unknown_families_and_layouts_name_the_version_needed() {
        let needed = Version { major: 2, minor: 0 };
        let file = changed(|writer| {
            writer.family = 200;
            writer.needed = needed;
        });
        assert_eq!(parse(&file), Err(Error::UnknownFamily { found: 200, needed }));
        let mut file = file;
        file[4] = 9;
        let error = parse(&file).unwrap_err();
        assert_eq!(error, Error::UnsupportedVersion { found: 9, supported: 1, needed });
        assert!(error.to_string().contains("surfabet 2.0 or newer"), "{error}");
    }

    #[test]
    fn families_are_checked() {
        let file = writer().finish().unwrap();
        let container = parse(&file).unwrap();
        assert_eq!(container.expect_family(Family::Patches), Ok(()));
        let error = container.expect_family(Family::Gas).unwrap_err();
        assert_eq!(error, Error::WrongFamily { expected: Family::Gas, found: Family::Patches });
        for family in Family::ALL {
            assert_eq!(Family::from_number(family as u8), Some(family));
        }
    }

    #[test]
    fn unknown_sections_are_refused_unless_skippable() {
        let file = writer().finish().unwrap();
        let container = parse(&file).unwrap();
        assert_eq!(container.expect_only(&[ONE, TWO]), Ok(()));
        let needed = Version::FIRST;
        let expected = Error::UnknownSection { section: TWO, needed };
        assert_eq!(container.expect_only(&[ONE, NOTE]), Err(expected));
    }

    #[test]
    fn duplicate_sections_are_refused_on_both_sides() {
        for tag in [ONE, NOTE, Tag::HEADER] {
            let again = if tag == NOTE { ONE } else { tag };
            let error = writer().section(again, vec![9]).finish().unwrap_err();
            assert_eq!(error, Error::DuplicateSection { section: again });
        }
        // The writer makes none, so rename a section in the table and mend the checksum.
        let mut file = writer().finish().unwrap();
        let (first, second) = (10, 10 + 9);
        assert_eq!(&file[first..first + 4], b"ONE1");
        assert_eq!(&file[second..second + 4], b"TWO2");
        file.copy_within(first..first + 4, second);
        mend(&mut file, 10 + 3 * 9 + 1);
        assert_eq!(parse(&file), Err(Error::DuplicateSection { section: ONE }));
    }

    /// Sets the checksum of the header, whose table ends at `table_end`.
    fn mend(file: &mut [u8], table_end: usize) {
        let checksum = crc32c::crc32c(&file[..table_end]).to_le_bytes();
        file[table_end..table_end + 4].copy_from_slice(&checksum);
    }

    #[test]
    fn lengths_that_lie_are_refused_before_anything_is_read() {
        let mut header = ByteWriter::new();
        header.bytes(&MAGIC);
        header.bytes(&[CONTAINER_VERSION, 0, 1, 2, 0, 1]);
        header.bytes(b"ONE1");
        header.varint(u64::MAX);
        header.u32(0);
        let mut file = header.finish();
        let checksum = crc32c::crc32c(&file);
        file.extend(checksum.to_le_bytes());
        let expected = Error::Truncated { section: ONE, needed: u64::MAX, available: 0 };
        assert_eq!(parse(&file), Err(expected));

        let mut header = ByteWriter::new();
        header.bytes(&MAGIC);
        header.bytes(&[CONTAINER_VERSION, 0, 1, 2, 0]);
        header.varint(1 << 60);
        let file = header.finish();
        assert!(matches!(parse(&file), Err(Error::TooLarge { value, .. }) if value == 1 << 60));
    }

    #[test]
    fn limits_hold() {
        let file = writer().finish().unwrap();
        let limits = Limits { max_bytes: 100, max_items: 10 };
        let error = Container::parse(&file, &limits).unwrap_err();
        assert!(matches!(error, Error::TooLarge { limit: 100, .. }));
        assert_eq!(limits.check("points", 10, 10), Ok(10));
        assert!(limits.check("points", 10, 11).is_err());
        assert!(limits.check("points", 11, 0).is_err());
        let message = limits.check("points", 11, 1).unwrap_err().to_string();
        assert!(message.contains("points is 11, above the limit of 10"), "{message}");
        assert!(limits.check("points", u64::MAX, u64::MAX).is_err());
    }

    #[test]
    fn too_many_sections_are_refused() {
        let mut writer = ContainerWriter::new(Family::Planes, Features::NONE);
        for i in 0..257_u32 {
            let hex = format!("{i:04x}");
            let mut tag = [0; 4];
            tag.copy_from_slice(hex.as_bytes());
            writer = writer.section(Tag(tag), vec![]);
        }
        assert!(matches!(writer.finish(), Err(Error::TooLarge { value: 257, limit: 256, .. })));
    }

    #[test]
    fn this_version_is_that_of_the_package() {
        let package = [env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR")].join(".");
        assert_eq!(Version::CURRENT.to_string(), package);
        let known = Features::KNOWN.iter().map(|(_, _, since)| *since);
        assert!(known.max().is_none_or(|since| since <= Version::CURRENT));
    }

    #[test]
    fn features_have_names() {
        assert_eq!(Features::NONE.names().count(), 0);
        let features = Features::NONE.with(Features::SHARED_DICTIONARY);
        assert!(features.contains(Features::SHARED_DICTIONARY));
        assert_eq!(features.names().collect::<Vec<_>>(), ["shared dictionary"]);
    }

    proptest! {
        #[test]
        fn any_sections_round_trip(
            sections in prop::collection::btree_map(
                prop::array::uniform4(0x21_u8..0x7f).prop_filter("no header", |t| t != b"HEAD"),
                prop::collection::vec(any::<u8>(), 0..300),
                0..20,
            ),
        ) {
            let mut writer = ContainerWriter::new(Family::Alphabet, Features::NONE);
            for (tag, bytes) in &sections {
                writer = writer.section(Tag(*tag), bytes.clone());
            }
            let file = writer.finish()?;
            let container = parse(&file)?;
            prop_assert_eq!(container.sections().len(), sections.len());
            for (section, (tag, bytes)) in container.sections().iter().zip(&sections) {
                prop_assert_eq!(section.tag, Tag(*tag));
                prop_assert_eq!(section.bytes, &bytes[..]);
            }
        }

        #[test]
        fn hostile_headers_with_right_checksums_do_no_harm(
            fixed in prop::array::uniform3(0..6_u8),
            features in prop_oneof![0..4_u64, any::<u64>()],
            count in prop_oneof![0..6_u64, any::<u64>()],
            table in prop::collection::vec(
                (
                    prop::array::uniform4(0x1e_u8..0x24),
                    prop_oneof![0..9_u64, any::<u64>()],
                    prop_oneof![Just(0), any::<u32>()],
                ),
                0..6,
            ),
            body in prop::collection::vec(any::<u8>(), 0..30),
        ) {
            let mut header = ByteWriter::new();
            header.bytes(&MAGIC);
            header.u8(CONTAINER_VERSION);
            header.bytes(&fixed);
            header.varint(features);
            header.varint(count);
            for (tag, len, checksum) in &table {
                header.bytes(tag);
                header.varint(*len);
                header.u32(*checksum);
            }
            let mut file = header.finish();
            file.extend(crc32c::crc32c(&file).to_le_bytes());
            file.extend(body);
            if let Ok(container) = parse(&file) {
                let inside: usize = container.sections().iter().map(|s| s.bytes.len()).sum();
                prop_assert_eq!(container.overhead() + inside, file.len());
            }
        }

        #[test]
        fn garbage_is_refused(bytes: Vec<u8>) {
            let mut file = MAGIC.to_vec();
            file.push(CONTAINER_VERSION);
            file.extend(bytes);
            prop_assert!(parse(&file).is_err());
        }
    }
}
