//! The sections of a model, whatever its method: the header, then one section per stream.

use surfabet_models::{Budget, NoVocabulary, Source, SurfaceModel};

use crate::container::{Container, ContainerWriter, Family, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::{Error, Result};
use crate::hash::ContentHash;
use crate::header::{FieldReader, FieldWriter, Fields, META};
use crate::note::NOTE;

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

    /// What models of clouds without colours use and name of a vocabulary with colours; `None` for all others.
    fn without_colors(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }
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

    /// Features that a file of this method may need beside those.
    const OPTIONAL_FEATURES: Features = Features::NONE;

    /// Sections of the streams, in the order of the file.
    const STREAM_SECTIONS: &'static [StreamSection];

    /// Writes or reads the header.
    ///
    /// # Errors
    /// When reading: for a header that no model has.
    fn code_header<F: Fields>(fields: &mut F, header: &mut Self::Header) -> Result<()>;

    /// The optional features that a file with this header needs.
    fn optional_features(header: &Self::Header) -> Features {
        let _ = header;
        Features::NONE
    }

    /// Writes or reads what the header has more in a file with these optional features.
    ///
    /// # Errors
    /// As [`Layout::code_header`].
    fn code_optional<F: Fields>(
        fields: &mut F,
        header: &mut Self::Header,
        features: Features,
    ) -> Result<()> {
        let _ = (fields, header, features);
        Ok(())
    }

    /// What the section of a stream holds, for people.
    fn section_content(header: &Self::Header, stream: usize) -> String {
        let _ = header;
        Self::STREAM_SECTIONS[stream].content.to_owned()
    }

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
    let free = Features::SHARED_DICTIONARY.with(M::OPTIONAL_FEATURES);
    container.family() == M::FAMILY && container.features().without(free) == M::FEATURES
}

/// Where the content of a stream is.
enum StreamPlace {
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
) -> impl Iterator<Item = StreamPlace> {
    M::STREAM_SECTIONS.iter().enumerate().map(move |(i, section)| match (section.hash, named) {
        (Some(tag), Some(hash)) => StreamPlace::Elsewhere(tag, hash),
        _ if M::has_section(header, i) => StreamPlace::Section(section.tag),
        _ => StreamPlace::Nowhere,
    })
}

/// The features that a file with this header needs. `shared`: it names its vocabulary.
pub(crate) fn features<M: Layout>(header: &M::Header, shared: bool) -> Features {
    let own = M::FEATURES.with(M::optional_features(header));
    if shared { own.with(Features::SHARED_DICTIONARY) } else { own }
}

/// The bytes of a file that holds `model`.
///
/// # Errors
/// As [`ContainerWriter::finish`].
pub fn write<M: Layout>(model: &M) -> Result<Vec<u8>> {
    let mut header = model.header();
    let mut meta = FieldWriter::default();
    let optional = M::optional_features(&header);
    code_all::<M, _>(&mut meta, &mut header, optional)?;
    let mut streams = vec![Encoder::new(); M::STREAMS];
    let Ok(_) = M::code(Source::Model(model), &mut streams);
    let vocabulary = if model.shares_vocabulary() { model.vocabulary() } else { None };
    let named = vocabulary.map(|vocabulary| vocabulary.content_hash());
    let features = features::<M>(&header, named.is_some());
    let mut writer = ContainerWriter::new(M::FAMILY, features).section(META, meta.bytes.finish());
    for (place, stream) in places::<M>(&header, named).zip(streams) {
        writer = match place {
            StreamPlace::Section(tag) => writer.section(tag, stream.finish()),
            StreamPlace::Elsewhere(tag, hash) => writer.section(tag, hash.0.to_vec()),
            StreamPlace::Nowhere => writer,
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
    let plain = vocabulary.and_then(Vocabulary::without_colors);
    let is_plain = plain.as_ref().map(Vocabulary::content_hash) == named;
    let vocabulary = if is_plain { plain.as_ref().or(vocabulary) } else { vocabulary };
    let given =
        named.map(|hash| hash.of_given(vocabulary, Vocabulary::content_hash)).transpose()?;
    let header = read_header::<M>(container, limits)?;
    if container.features() != features::<M>(&header, given.is_some()) {
        let names: Vec<&str> = container.features().names().collect();
        let what = format!("the features {names:?} do not go together with this {}", M::METHOD);
        return Err(Error::corrupt(META, 0, what));
    }

    let mut expected = vec![META];
    let mut streams = Vec::with_capacity(M::STREAMS);
    for (section, place) in M::STREAM_SECTIONS.iter().zip(places::<M>(&header, named)) {
        let bytes = match place {
            StreamPlace::Section(tag) => {
                expected.push(tag);
                container.require(tag)?
            }
            StreamPlace::Elsewhere(hash, _) => {
                expected.push(hash);
                &[]
            }
            StreamPlace::Nowhere => &[],
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

/// Writes or reads a header in a file with these optional features.
pub(crate) fn code_all<M: Layout, F: Fields>(
    fields: &mut F,
    header: &mut M::Header,
    optional: Features,
) -> Result<()> {
    M::code_header(fields, header)?;
    match optional == Features::NONE {
        true => Ok(()),
        false => M::code_optional(fields, header, optional),
    }
}

/// The header of a parsed file.
fn read_header<M: Layout>(container: &Container<'_>, limits: &Limits) -> Result<M::Header> {
    let mut fields = FieldReader::new(container.require(META)?, *limits);
    let mut header = M::Header::default();
    let optional = container.features().without(M::FEATURES.with(Features::SHARED_DICTIONARY));
    code_all::<M, _>(&mut fields, &mut header, optional)?;
    fields.finish()?;
    Ok(header)
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
/// For a header that no model has, and when the file promises the hash of a vocabulary and has none.
pub fn inspect<M: Layout>(container: &Container<'_>) -> Result<FileSummary> {
    // Lists of a header are no longer than its bytes; its counts are not used here.
    let limits = Limits { max_items: u64::MAX, max_bytes: u64::MAX };
    let header = read_header::<M>(container, &limits)?;
    let content = |tag: Tag| {
        if tag == META {
            return "header".to_owned();
        }
        let stream = M::STREAM_SECTIONS.iter().position(|s| s.tag == tag || s.hash == Some(tag));
        match stream {
            Some(i) if M::STREAM_SECTIONS[i].tag == tag => M::section_content(&header, i),
            Some(_) => "hash of the vocabulary".to_owned(),
            None if tag == NOTE => "note".to_owned(),
            None => tag.to_string(),
        }
    };
    let sections = container.sections().iter().map(|s| (content(s.tag), s.bytes.len())).collect();
    Ok(FileSummary { method: M::METHOD, vocabulary: named_vocabulary::<M>(container)?, sections })
}

/// The hash of the vocabulary that a file names; `None` when it holds its own.
fn named_vocabulary<M: Layout>(container: &Container<'_>) -> Result<Option<ContentHash>> {
    match M::STREAM_SECTIONS.iter().find_map(|s| s.hash) {
        Some(tag) => ContentHash::named_by(container, tag),
        None => Ok(None),
    }
}
