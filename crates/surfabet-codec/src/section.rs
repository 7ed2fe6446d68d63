//! The sections of a model, whatever its method: the header, then one section per stream.

use surfabet_models::{Budget, NoVocabulary, Source, SurfaceModel};

use crate::container::{Container, ContainerWriter, Family, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::{Error, Result};
use crate::hash::ContentHash;
use crate::header::{FieldReader, FieldWriter, Fields, META};

/// A stream's section.
#[derive(Debug, Clone, Copy)]
pub struct StreamSection {
    /// Its name.
    pub tag: Tag,
    /// What it holds, for people.
    pub content: &'static str,
    /// For a vocabulary: the name of the section that holds its hash instead.
    pub hash: Option<Tag>,
}

impl StreamSection {
    pub(crate) const fn new(tag: &[u8; 4], content: &'static str) -> Self {
        Self { tag: Tag::new(tag), content, hash: None }
    }

    pub(crate) const fn vocabulary(tag: &[u8; 4], hash: &[u8; 4], content: &'static str) -> Self {
        Self { tag: Tag::new(tag), content, hash: Some(Tag::new(hash)) }
    }
}

/// A number of things that a stream must be long enough for.
#[derive(Debug, Clone, Copy)]
pub struct Promise {
    /// Index of the stream.
    pub stream: usize,
    /// What is counted.
    pub what: &'static str,
    /// How many; each takes at least one binary decision in the stream.
    pub count: u64,
}

/// A dictionary or alphabet that files can name instead of holding it.
pub trait Vocabulary {
    /// The hash by which files name it.
    fn content_hash(&self) -> ContentHash;
}

impl Vocabulary for NoVocabulary {
    fn content_hash(&self) -> ContentHash {
        match *self {}
    }
}

/// How the file of a model is laid out; byte by byte in `docs/format.md`.
pub trait Layout: SurfaceModel<Vocabulary: Vocabulary> {
    /// The family that the container names.
    const FAMILY: Family;

    /// Features that every file of this method needs.
    const FEATURES: Features;

    /// Sections of the streams, in the order of the file.
    const STREAM_SECTIONS: &'static [StreamSection];

    /// Writes or reads the header.
    ///
    /// # Errors
    /// When reading: for a header that no model has.
    fn code_header<F: Fields>(fields: &mut F, header: &mut Self::Header) -> Result<()>;

    /// True when the stream of a number has a section in the file.
    fn has_section(header: &Self::Header, stream: usize) -> bool {
        let _ = (header, stream);
        true
    }

    /// What the header promises of the streams, to be checked before anything is allocated.
    fn promises(header: &Self::Header) -> Vec<Promise>;
}

/// True when a container holds a model of this method.
pub fn holds<M: Layout>(container: &Container<'_>) -> bool {
    let own = container.features().without(Features::SHARED_DICTIONARY);
    container.family() == M::FAMILY && own == M::FEATURES
}

/// Where the content of a stream is.
enum Place {
    /// In this section.
    Section(Tag),
    /// In another file; this section holds its hash, which is this.
    Elsewhere(Tag, ContentHash),
    /// The stream is empty and has no section.
    Nowhere,
}

/// Where the streams of a file are, one after the other; `named` is the hash of the vocabulary that it names.
fn places<M: Layout>(
    header: &M::Header,
    named: Option<ContentHash>,
) -> impl Iterator<Item = Place> {
    M::STREAM_SECTIONS.iter().enumerate().map(move |(i, section)| match (section.hash, named) {
        (Some(tag), Some(hash)) => Place::Elsewhere(tag, hash),
        _ if M::has_section(header, i) => Place::Section(section.tag),
        _ => Place::Nowhere,
    })
}

/// The features that the file of a method needs. `shared`: it names its vocabulary.
fn features<M: Layout>(shared: bool) -> Features {
    if shared { M::FEATURES.with(Features::SHARED_DICTIONARY) } else { M::FEATURES }
}

/// The bytes of a file that holds `model`.
///
/// # Errors
/// As [`ContainerWriter::finish`].
pub fn write<M: Layout>(model: &M) -> Result<Vec<u8>> {
    let mut header = model.header();
    let mut meta = FieldWriter::default();
    M::code_header(&mut meta, &mut header)?;
    let mut streams = vec![Encoder::new(); M::STREAMS];
    let Ok(_) = M::code(Source::Model(model), &mut streams);
    let vocabulary = if model.shares_vocabulary() { model.vocabulary() } else { None };
    let named = vocabulary.map(|vocabulary| vocabulary.content_hash());
    let features = features::<M>(named.is_some());
    let mut writer = ContainerWriter::new(M::FAMILY, features).section(META, meta.bytes.finish());
    for (place, stream) in places::<M>(&header, named).zip(streams) {
        writer = match place {
            Place::Section(tag) => writer.section(tag, stream.finish()),
            Place::Elsewhere(tag, hash) => writer.section(tag, hash.0.to_vec()),
            Place::Nowhere => writer,
        };
    }
    writer.finish()
}

/// The model that a parsed file holds. `vocabulary` is for files that name theirs; others ignore it.
///
/// # Errors
/// Any error of reading: the content is checked as the container was. [`Error::MissingDictionary`] and
/// [`Error::DictionaryMismatch`] when the file names its vocabulary, and none or another is given.
pub fn read<M: Layout>(
    container: &Container<'_>,
    limits: &Limits,
    vocabulary: Option<&M::Vocabulary>,
) -> Result<M> {
    container.expect_family(M::FAMILY)?;
    let named = named_vocabulary::<M>(container)?;
    let given =
        named.map(|hash| hash.of_given(vocabulary, Vocabulary::content_hash)).transpose()?;
    if container.features() != features::<M>(given.is_some()) {
        let names: Vec<&str> = container.features().names().collect();
        let what = format!("the features {names:?} do not go together with {}", M::METHOD);
        return Err(Error::corrupt(META, 0, what));
    }
    let mut fields = FieldReader::new(container.require(META)?, *limits);
    let mut header = M::Header::default();
    M::code_header(&mut fields, &mut header)?;
    fields.finish()?;

    let mut expected = vec![META];
    let mut streams = Vec::with_capacity(M::STREAMS);
    for (section, place) in M::STREAM_SECTIONS.iter().zip(places::<M>(&header, named)) {
        let bytes = match place {
            Place::Section(tag) => {
                expected.push(tag);
                container.require(tag)?
            }
            Place::Elsewhere(hash, _) => {
                expected.push(hash);
                &[]
            }
            Place::Nowhere => &[],
        };
        streams.push(Decoder::new(section.tag, bytes));
    }
    container.expect_only(&expected)?;
    for Promise { stream, what, count } in M::promises(&header) {
        let is_given = given.is_some() && M::STREAM_SECTIONS[stream].hash.is_some();
        if !is_given {
            streams[stream].check_count(what, count)?;
        }
    }
    let budget = Budget { items: limits.max_items, bytes: limits.max_bytes };
    let source = Source::Streams { header: &header, vocabulary: given, budget };
    let model = M::code(source, &mut streams)?;
    for stream in streams {
        stream.finish()?;
    }
    model.ok_or_else(|| Error::corrupt(META, 0, "nothing was read"))
}

/// What a file holds, known without decoding it.
#[derive(Debug, Clone, PartialEq)]
pub struct FileSummary {
    /// Name of the method.
    pub method: &'static str,
    /// Hash of the vocabulary that the file names instead of holding it.
    pub vocabulary: Option<ContentHash>,
    /// What each section holds, for people, and its bytes, in the order of the file.
    pub sections: Vec<(String, usize)>,
}

/// What a file of this method holds.
///
/// # Errors
/// When the file promises the hash of a vocabulary and has none.
pub fn inspect<M: Layout>(container: &Container<'_>) -> Result<FileSummary> {
    let sections = container.sections().iter().map(|section| {
        let content = content::<M>(section.tag);
        (content.map_or_else(|| section.tag.to_string(), str::to_owned), section.bytes.len())
    });
    Ok(FileSummary {
        method: M::METHOD,
        vocabulary: named_vocabulary::<M>(container)?,
        sections: sections.collect(),
    })
}

/// The hash of the vocabulary that a file names; `None` when it holds its own.
fn named_vocabulary<M: Layout>(container: &Container<'_>) -> Result<Option<ContentHash>> {
    match M::STREAM_SECTIONS.iter().find_map(|s| s.hash) {
        Some(tag) => ContentHash::named_by(container, tag),
        None => Ok(None),
    }
}

/// What the section `tag` of a file of this method holds, for people.
fn content<M: Layout>(tag: Tag) -> Option<&'static str> {
    if tag == META {
        return Some("header");
    }
    M::STREAM_SECTIONS.iter().find_map(|section| {
        if section.tag == tag {
            Some(section.content)
        } else {
            (section.hash == Some(tag)).then_some("hash of the vocabulary")
        }
    })
}
