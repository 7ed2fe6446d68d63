//! What every model promises, each promise once: the tests of `tests/contract.rs` call these for every method.
//!
//! A new method needs its [`Scene`] and a line there.

use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use proptest::prelude::*;
use surfabet::{Container, DecodeOptions, KnownVocabulary, Model, PointCloud, Save, Silent};
use surfabet_codec::bytes::ByteWriter;
use surfabet_codec::header::Fields;
use surfabet_codec::{Error as CodecError, Features, Layout, Tag, Vocabulary};
use surfabet_models::Error;

use crate::files::{
    LIMITS, assert_same_numbers, codec_error, golden, put_together, read, sections,
};
use crate::interrupts::{assert_stops_in_every_stage, assert_stops_when_asked};
use crate::scenes::{Scene, SharesVocabulary};

/// Spacing at which small models are decoded, metres.
const SPACING: f64 = 0.02;

/// Most points that a damaged file is decoded to.
const MOST_POINTS: u64 = 100_000;

/// Tag of the header's section.
const META: Tag = Tag::new(b"META");

/// The model of the method's small scene, learned once per process.
pub fn small<M: Scene>() -> &'static M {
    static MODELS: Mutex<BTreeMap<TypeId, &'static (dyn Any + Send + Sync)>> =
        Mutex::new(BTreeMap::new());
    // A test that fails elsewhere does not spoil the models that were learned.
    let mut models = MODELS.lock().unwrap_or_else(PoisonError::into_inner);
    let model = *models.entry(TypeId::of::<M>()).or_insert_with(|| {
        let learned: &'static M = Box::leak(Box::new(M::learn(&M::cloud(), &Silent).unwrap()));
        learned
    });
    model.downcast_ref().unwrap()
}

fn small_file<M: Scene>() -> Vec<u8> {
    small::<M>().to_bytes().unwrap()
}

/// A file of the features of the small scene's, with these sections.
fn like_small<M: Scene>(sections: &[(Tag, Vec<u8>)]) -> Vec<u8> {
    put_together::<M>(M::optional_features(&small::<M>().header()), sections)
}

/// Ways to decode that differ in every option.
fn decodings<M: Scene>() -> Vec<DecodeOptions> {
    let base = DecodeOptions::default();
    let mut all = vec![
        base,
        DecodeOptions { resolution: Some(SPACING), normals: true, ..base },
        DecodeOptions { resolution: Some(1.0), ..base },
    ];
    if M::KEEPS_THICKNESS {
        all.push(DecodeOptions { resolution: Some(SPACING), as_measured: true, ..base });
    }
    all
}

fn decoded<M: Scene>(model: &M, options: DecodeOptions) -> PointCloud {
    model.decode(options, &Silent).unwrap()
}

/// A file gives the model back: equal, with the same bytes and the same clouds.
pub fn a_file_gives_the_model_back<M: Scene>() {
    let (model, file) = (small::<M>(), small_file::<M>());
    let again: M = read(&file).unwrap();
    assert_eq!(again, *model);
    assert_eq!(again.to_bytes().unwrap(), file);
    assert_eq!(again.header(), model.header());
    assert_eq!(again.summary(), model.summary());
    assert_eq!((again.n_points(), again.origin()), (M::cloud().len() as u64, model.origin()));
    assert_eq!((again.n_parts(), again.has_color()), (model.n_parts(), model.has_color()));
    assert!(model.n_parts() > 0);
    for options in decodings::<M>() {
        let cloud = decoded(model, options);
        assert_eq!(decoded(&again, options), cloud);
        assert!(!cloud.is_empty());
        assert_eq!(cloud.normals().is_some(), options.normals);
        assert_eq!(cloud.colors().is_some(), model.has_color());
        let lost = model.report().not_kept.iter().map(String::as_str);
        let has = |attribute: &str| cloud.attributes().contains(&attribute);
        let scene = M::cloud();
        let kept = scene.attributes().into_iter().filter(|a| !lost.clone().any(|lost| lost == *a));
        for attribute in kept.filter(|a| !["normals", "ranges", "viewpoints"].contains(a)) {
            assert!(has(attribute), "{attribute} is neither kept nor told");
        }
    }
}

/// Saving writes the bytes, and what was written is opened as the same model.
pub fn a_saved_file_opens<M: Scene>() {
    let folder = std::env::temp_dir().join(format!("surfabet-contract-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(format!("{}.sfb", M::METHOD));
    let size = small::<M>().save(&path).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), small_file::<M>());
    assert_eq!(size, small_file::<M>().len() as u64);
    let opened = Model::open(&path, &LIMITS).unwrap();
    assert!(opened.as_any_model().equals(small::<M>()));
    std::fs::remove_file(&path).unwrap();
    let missing = Model::open(&path, &LIMITS).unwrap_err().to_string();
    assert!(missing.contains(path.to_str().unwrap()), "{missing}");
}

/// Models are equal when their files are: the report, which a file does not hold, does not count.
pub fn equality_ignores_the_report<M: Scene>() {
    let (model, again) = (small::<M>(), read::<M>(&small_file::<M>()).unwrap());
    assert!(!model.report().stages.is_empty() && !model.report().stop_reason.is_empty());
    assert!(again.report().stages.is_empty() && again.report().stop_reason.is_empty());
    assert_ne!(again.report(), model.report());
    assert_eq!(again, *model);
    let most: Vec<usize> = (1..M::cloud().len()).collect();
    let other = M::learn(&M::cloud().select(&most).unwrap(), &Silent).unwrap();
    assert_ne!(other, *model);
    assert_ne!(other.to_bytes().unwrap(), small_file::<M>());
}

/// What is known of a file without decoding it.
pub fn a_file_is_inspected<M: Scene>() {
    let file = small_file::<M>();
    let container = Container::parse(&file, &LIMITS).unwrap();
    let found = Model::inspect(&container).unwrap();
    assert_eq!((found.method, found.vocabulary), (M::METHOD, None));
    let bytes: usize = found.sections.iter().map(|(_, bytes)| bytes).sum();
    assert_eq!(bytes + container.overhead(), file.len());
    for ((content, bytes), section) in found.sections.iter().zip(container.sections()) {
        assert_ne!(*content, section.tag.to_string(), "a section without a description");
        assert_eq!(*bytes, section.bytes.len());
        assert!(*bytes > 0, "{content} is empty: the scene does not exercise it");
    }
}

/// Cut at any byte, a file is an error.
pub fn every_truncation_is_an_error<M: Scene>() {
    let file = small_file::<M>();
    for end in 0..file.len() {
        assert!(Model::from_bytes(&file[..end], &LIMITS).is_err(), "{end} of {}", file.len());
    }
}

/// With any bit flipped, a file is an error or gives the same model.
pub fn every_flipped_bit_is_an_error_or_harmless<M: Scene>() {
    let file = small_file::<M>();
    for bit in 0..8 * file.len() {
        let mut damaged = file.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        if let Ok(found) = Model::from_bytes(&damaged, &LIMITS) {
            assert!(found.as_any_model().equals(small::<M>()), "bit {bit}");
        }
    }
}

/// Whatever is read from a file, damaged or not, can be used: it decodes or says that it has too many points, it can
/// be priced and summed up, and its bytes give it back.
pub fn assert_usable<M: Scene>(model: &M) {
    for options in decodings::<M>() {
        match model.decode(DecodeOptions { max_points: MOST_POINTS, ..options }, &Silent) {
            Ok(cloud) => assert!(cloud.len() as u64 <= MOST_POINTS),
            Err(Error::TooManyPoints { limit, .. }) => assert_eq!(limit, MOST_POINTS),
            Err(other) => panic!("{other:?} of {model:?}"),
        }
    }
    model.summary();
    assert!(model.price().iter().all(|bytes| bytes.is_finite()));
    assert_eq!(read::<M>(&model.to_bytes().unwrap()).unwrap(), *model);
}

/// The file is refused for what it holds, or gives a model that can be used.
fn assert_refused_or_usable<M: Scene>(file: &[u8]) {
    match read::<M>(file) {
        Ok(model) => assert_usable(&model),
        Err(surfabet::Error::Codec(_)) => {}
        Err(other) => panic!("{other:?}"),
    }
}

/// Flipped bits and missing ends of every section, behind checksums that are right.
pub fn damage_behind_valid_checksums_is_refused_or_harmless<M: Scene>() {
    let all = sections(&small_file::<M>());
    let with = |at: usize, bytes: Vec<u8>| {
        let mut damaged = all.clone();
        damaged[at].1 = bytes;
        assert_refused_or_usable::<M>(&like_small::<M>(&damaged));
    };
    for (at, (_, bytes)) in all.iter().enumerate() {
        for bit in 0..8 * bytes.len() {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            with(at, damaged);
        }
        for length in 0..bytes.len() {
            with(at, bytes[..length].to_vec());
        }
    }
}

/// The same of one section of the file of any model; and cut at any byte the file is an error.
pub fn damage_of_a_section_is_refused_or_harmless<M: Scene>(model: &M, of: Tag) {
    let file = model.to_bytes().unwrap();
    let all = sections(&file);
    for end in 0..file.len() {
        assert!(Model::from_bytes(&file[..end], &LIMITS).is_err(), "{end} of {}", file.len());
    }
    let features = M::optional_features(&model.header());
    assert!(all.iter().any(|(tag, _)| *tag == of), "no section {of}");
    for (at, (_, bytes)) in all.iter().enumerate().filter(|(_, (tag, _))| *tag == of) {
        let with = |bytes: Vec<u8>| {
            let mut damaged = all.clone();
            damaged[at].1 = bytes;
            assert_refused_or_usable::<M>(&put_together::<M>(features, &damaged));
        };
        for bit in 0..8 * bytes.len() {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            with(damaged);
        }
        (0..bytes.len()).for_each(|length| with(bytes[..length].to_vec()));
    }
}

/// Random bytes in place of some sections, behind checksums that are right.
pub fn random_sections_are_refused_or_harmless<M: Scene>() {
    let all = sections(&small_file::<M>());
    let some_bytes = || prop::option::of(prop::collection::vec(any::<u8>(), 0..300));
    let replaced = prop::collection::vec(some_bytes(), all.len());
    proptest!(ProptestConfig::with_cases(128), |(replaced in replaced)| {
        let forged: Vec<_> = all
            .iter()
            .zip(replaced)
            .map(|((tag, bytes), new)| (*tag, new.unwrap_or_else(|| bytes.clone())))
            .collect();
        assert_refused_or_usable::<M>(&like_small::<M>(&forged));
    });
}

/// A field of a header.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Field {
    Unsigned,
    Signed,
    Double,
    Single,
    Bounded(&'static str, u32),
    Count(&'static str),
    List(&'static str),
}

/// Something that a header must not, or need not, be trusted with.
#[derive(Debug, Clone, Copy)]
enum Value {
    Unsigned(u64),
    Signed(i64),
    Float(f64),
}

impl Field {
    /// Values that must be refused, and the words of the error that names them.
    fn refused(self) -> Vec<(Value, &'static str)> {
        let counts = |what| {
            let values = [u64::MAX, 1 << 40, LIMITS.max_items + 1];
            values.map(|n| (Value::Unsigned(n), what)).to_vec()
        };
        match self {
            Self::Unsigned | Self::Signed => Vec::new(),
            Self::Double | Self::Single => [f64::NAN, f64::INFINITY, f64::NEG_INFINITY]
                .map(|v| (Value::Float(v), "META"))
                .to_vec(),
            Self::Bounded(what, limit) => {
                [u64::MAX, u64::from(limit) + 1].map(|n| (Value::Unsigned(n), what)).to_vec()
            }
            Self::Count(what) | Self::List(what) => counts(what),
        }
    }

    /// Values that some model may have.
    fn strange(self) -> Vec<Value> {
        match self {
            Self::Signed => {
                [i64::MIN, i64::MAX, i64::from(i32::MIN), i64::from(i32::MAX), -1, 0, 1]
                    .map(Value::Signed)
                    .to_vec()
            }
            Self::Double | Self::Single => {
                let largest = if self == Self::Single { f64::from(f32::MAX) } else { f64::MAX };
                [-1.0, 0.0, 1e-300, -largest, largest, 1e9, 1e-9].map(Value::Float).to_vec()
            }
            Self::Bounded(_, limit) => [0, 1, limit].map(|n| Value::Unsigned(n.into())).to_vec(),
            Self::Unsigned | Self::Count(_) | Self::List(_) => {
                [0, 1, 2, 1000, LIMITS.max_items, u64::MAX].map(Value::Unsigned).to_vec()
            }
        }
    }
}

/// Writes a header as a file holds it, with another value in one of its fields.
struct Forger {
    bytes: ByteWriter,
    fields: Vec<Field>,
    forged: Option<(usize, Value)>,
}

impl Forger {
    /// The header of `model`, and its fields in order.
    fn header<M: Layout>(model: &M, forged: Option<(usize, Value)>) -> (Vec<u8>, Vec<Field>) {
        let mut forger = Self { bytes: ByteWriter::new(), fields: Vec::new(), forged };
        let mut header = model.header();
        M::code_header(&mut forger, &mut header).unwrap();
        let optional = M::optional_features(&header);
        if optional != Features::NONE {
            M::code_optional(&mut forger, &mut header, optional).unwrap();
        }
        (forger.bytes.finish(), forger.fields)
    }

    /// Notes the next field; writes the value in its place, if there is one.
    fn takes_another(&mut self, field: Field) -> bool {
        self.fields.push(field);
        let Some((_, value)) = self.forged.filter(|(at, _)| at + 1 == self.fields.len()) else {
            return false;
        };
        match value {
            Value::Unsigned(value) => self.bytes.varint(value),
            Value::Signed(value) => self.bytes.signed_varint(value),
            Value::Float(value) if field == Field::Single => self.bytes.f32(value as f32),
            Value::Float(value) => self.bytes.f64(value),
        }
        true
    }
}

impl Fields for Forger {
    fn varint(&mut self, value: &mut u64) -> surfabet_codec::Result<()> {
        if !self.takes_another(Field::Unsigned) {
            self.bytes.varint(*value);
        }
        Ok(())
    }

    fn signed(&mut self, value: &mut i64) -> surfabet_codec::Result<()> {
        if !self.takes_another(Field::Signed) {
            self.bytes.signed_varint(*value);
        }
        Ok(())
    }

    fn f64(&mut self, value: &mut f64) -> surfabet_codec::Result<()> {
        if !self.takes_another(Field::Double) {
            self.bytes.f64(*value);
        }
        Ok(())
    }

    fn f32(&mut self, value: &mut f32) -> surfabet_codec::Result<()> {
        if !self.takes_another(Field::Single) {
            self.bytes.f32(*value);
        }
        Ok(())
    }

    fn bounded(
        &mut self,
        what: &'static str,
        value: &mut u32,
        limit: u32,
    ) -> surfabet_codec::Result<()> {
        if !self.takes_another(Field::Bounded(what, limit)) {
            self.bytes.varint(u64::from(*value));
        }
        Ok(())
    }

    fn count(&mut self, what: &'static str, value: &mut u64, _: u64) -> surfabet_codec::Result<()> {
        if !self.takes_another(Field::Count(what)) {
            self.bytes.varint(*value);
        }
        Ok(())
    }

    fn list<T: Default>(
        &mut self,
        what: &'static str,
        values: &mut Vec<T>,
        _: usize,
        mut item: impl FnMut(&mut Self, &mut T) -> surfabet_codec::Result<()>,
    ) -> surfabet_codec::Result<()> {
        if !self.takes_another(Field::List(what)) {
            self.bytes.varint(values.len() as u64);
        }
        values.iter_mut().try_for_each(|value| item(self, value))
    }

    fn corrupt(&self, what: String) -> CodecError {
        CodecError::corrupt(META, self.bytes.len(), what)
    }
}

/// Huge counts, numbers that are none, and strange ones in every field of the header, behind a checksum that is right.
pub fn hostile_headers_are_refused_by_name<M: Scene>() {
    let all = sections(&small_file::<M>());
    let (header, fields) = Forger::header(small::<M>(), None);
    assert_eq!((all[0].0, &all[0].1), (META, &header));
    let file = |forged: (usize, Value)| {
        let mut forged_sections = all.clone();
        forged_sections[0].1 = Forger::header(small::<M>(), Some(forged)).0;
        like_small::<M>(&forged_sections)
    };
    for (at, field) in fields.iter().enumerate() {
        for (value, name) in field.refused() {
            let error = codec_error::<M>(&file((at, value)));
            let message = error.to_string();
            assert!(message.contains(name), "{field:?} of {value:?}: {message}");
        }
        for value in field.strange() {
            assert_refused_or_usable::<M>(&file((at, value)));
        }
    }
}

/// Nothing may follow the file, the header, or any stream.
pub fn trailing_bytes_are_refused_everywhere<M: Scene>() {
    let file = small_file::<M>();
    let mut longer = file.clone();
    longer.push(0);
    assert!(matches!(codec_error::<M>(&longer), CodecError::TrailingBytes { .. }));
    let all = sections(&file);
    for (at, (tag, _)) in all.iter().enumerate() {
        let mut longer = all.clone();
        // More than the decoder reads ahead.
        longer[at].1.extend([1; 16]);
        let error = codec_error::<M>(&like_small::<M>(&longer));
        let named = matches!(error, CodecError::TrailingBytes { section, .. } if section == *tag);
        assert!(named, "{tag}: {error:?}");
    }
}

/// A file has the sections of its method, each once, and no others but those that may be skipped.
pub fn sections_are_those_of_the_method<M: Scene>() {
    let all = sections(&small_file::<M>());
    for (at, (tag, _)) in all.iter().enumerate() {
        let mut fewer = all.clone();
        fewer.remove(at);
        let error = codec_error::<M>(&like_small::<M>(&fewer));
        assert_eq!(error, CodecError::MissingSection { section: *tag });
    }
    let with = |tag: &[u8; 4]| {
        let mut more = all.clone();
        more.push((Tag::new(tag), vec![1, 2, 3]));
        like_small::<M>(&more)
    };
    let error = codec_error::<M>(&with(b"WHAT"));
    assert!(
        matches!(error, CodecError::UnknownSection { section, .. } if section == Tag::new(b"WHAT")),
        "{error:?}"
    );
    // A small first letter: it may be skipped.
    assert_eq!(read::<M>(&with(b"what")).unwrap(), *small::<M>());
}

/// A stream takes the bytes that its price says, no more and no less.
///
/// The last byte is cut to whole ones, and to those that tell the final interval of the range coder from others when
/// zeros follow: at most 9/8 byte more than the interval's width says, and less than it by k bytes once in 256^k
/// files. Prices come from a table of 2^12 probabilities, exact to half a percent of a long stream.
pub fn prices_are_the_lengths_of_the_streams<M: Scene>() {
    let file = small_file::<M>();
    let container = Container::parse(&file, &LIMITS).unwrap();
    let prices = small::<M>().price();
    assert_eq!((prices.len(), M::STREAM_SECTIONS.len()), (M::STREAMS, M::STREAMS));
    for (price, stream) in prices.iter().zip(M::STREAM_SECTIONS) {
        let bytes = container.section(stream.tag).map_or(0, <[u8]>::len) as f64;
        let excess = bytes - price;
        assert!(excess.abs() < 2.0 + 0.005 * price, "{}: {bytes} for {price}", stream.content);
    }
}

/// The same bytes and the same cloud come from any number of threads.
pub fn threads_change_nothing<M: Scene>() {
    let cloud = M::cloud();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let model = M::learn(&cloud, &Silent).unwrap();
            let clouds = decodings::<M>().into_iter().map(|options| decoded(&model, options));
            (model.to_bytes().unwrap(), clouds.collect::<Vec<_>>())
        })
    };
    let one = with(1);
    assert_eq!(one.0, small_file::<M>());
    assert_eq!(with(2), one);
    assert_eq!(with(8), one);
}

/// Where `learn` promises it, the points may come in any order.
pub fn points_come_in_any_order_where_promised<M: Scene>() {
    let cloud = M::cloud();
    let n = cloud.len();
    let reversed: Vec<usize> = (0..n).rev().collect();
    // Every index once: 7919 is prime and does not divide the number of points.
    assert_ne!(n % 7919, 0);
    let shuffled: Vec<usize> = (0..n).map(|i| i * 7919 % n).collect();
    for order in [reversed, shuffled] {
        let model = M::learn(&cloud.select(&order).unwrap(), &Silent).unwrap();
        if M::ANY_ORDER {
            assert_eq!(model.to_bytes().unwrap(), small_file::<M>());
        }
        assert_eq!(model.n_points(), n as u64);
    }
}

/// Learning and decoding end when the caller asks, whenever that is.
pub fn work_stops_when_asked<M: Scene>() {
    let cloud = M::cloud();
    assert_stops_when_asked(|progress| M::learn(&cloud, progress));
    let stages = assert_stops_in_every_stage(|progress| M::learn(&cloud, progress));
    assert!(!stages.is_empty());
    for options in decodings::<M>() {
        assert_stops_when_asked(|progress| small::<M>().decode(options, progress));
    }
}

/// Options of decoding are checked by every method in the same way.
pub fn decode_options_are_refused_alike<M: Scene>() {
    let model = small::<M>();
    let base = DecodeOptions::default();
    for resolution in [0.0, -0.01, f64::NAN, f64::INFINITY] {
        let found = model.decode(DecodeOptions { resolution: Some(resolution), ..base }, &Silent);
        let named = matches!(&found, Err(Error::InvalidParameter(p)) if p.name == "resolution");
        assert!(named, "{resolution}: {found:?}");
    }
    let measured = model.decode(DecodeOptions { as_measured: true, ..base }, &Silent);
    match measured {
        Ok(_) => assert!(M::KEEPS_THICKNESS),
        Err(Error::InvalidParameter(p)) if p.name == "as_measured" => assert!(!M::KEEPS_THICKNESS),
        other => panic!("{other:?}"),
    }
    for options in decodings::<M>() {
        let n = decoded(model, options).len() as u64;
        for limit in [0, n - 1] {
            let found = model.decode(DecodeOptions { max_points: limit, ..options }, &Silent);
            let named = matches!(found, Err(Error::TooManyPoints { limit: l, .. }) if l == limit);
            assert!(named, "{limit} of {n}: {found:?}");
        }
    }
    for resolution in [1e-9, 1e-300] {
        let found = model.decode(DecodeOptions { resolution: Some(resolution), ..base }, &Silent);
        match found {
            Err(Error::TooManyPoints { .. }) => {}
            // Words hold no more points than they were learned with.
            Ok(cloud) => assert!(cloud.len() < 100 * decoded(model, base).len()),
            other => panic!("{resolution}: {other:?}"),
        }
    }
}

/// Name of the method's files of the release, without the suffix.
fn golden_name<M: Scene>() -> String {
    format!("{}_0_1", M::METHOD.replace('-', "_"))
}

/// Writes the golden file of this release.
pub fn write_golden<M: Scene>() {
    let name = golden_name::<M>();
    small::<M>().save(golden(&format!("{name}.sfb"))).unwrap();
    std::fs::write(golden(&format!("{name}.txt")), small::<M>().listing()).unwrap();
}

/// Files of release 0.1 are read, decode to what they did, and are written as they were.
pub fn files_of_release_0_1_stay_readable<M: Scene>() {
    let name = golden_name::<M>();
    let file = std::fs::read(golden(&format!("{name}.sfb"))).unwrap();
    let container = Container::parse(&file, &LIMITS).unwrap();
    assert_eq!(container.needed_version().to_string(), "0.1");
    let model: M = read(&file).unwrap();
    assert_eq!(model.to_bytes().unwrap(), file);
    assert_eq!(model.n_points(), M::cloud().len() as u64);
    let expected = std::fs::read_to_string(golden(&format!("{name}.txt"))).unwrap();
    assert_same_numbers(&model.listing(), &expected, M::tolerance);
}

/// A file may name its words by their hash: it is smaller then, and read with these words and no others.
pub fn a_vocabulary_describes_another_scene<M: SharesVocabulary>() {
    let cloud = M::cloud();
    let words = small::<M>().vocabulary().unwrap();
    let most: Vec<usize> = (cloud.len() / 4..cloud.len()).collect();
    let other = cloud.select(&most).unwrap();
    let model = M::describe(&other, &words, &Silent).unwrap();
    assert!(model.shares_vocabulary() && !small::<M>().shares_vocabulary());
    assert_eq!(model.vocabulary().as_ref(), Some(&words));
    assert_eq!(model.n_points(), other.len() as u64);
    let file = model.to_bytes().unwrap();

    let hash = words.content_hash();
    let container = Container::parse(&file, &LIMITS).unwrap();
    let found = Model::inspect(&container).unwrap();
    assert_eq!((found.method, found.vocabulary), (M::METHOD, Some(hash)));
    let stream = M::STREAM_SECTIONS.iter().find(|stream| stream.hash.is_some()).unwrap();
    assert!(container.section(stream.tag).is_none());

    let with =
        |words: &M::Vocabulary| Model::from_bytes_with(&file, &LIMITS, KnownVocabulary::new(words));
    let again = with(&words).unwrap();
    assert!(again.as_any_model().equals(&model));
    assert_eq!(again.to_bytes().unwrap(), file);
    for options in decodings::<M>() {
        assert_eq!(again.decode(options, &Silent).unwrap(), decoded(&model, options));
    }
    let error = codec_error::<M>(&file);
    assert!(matches!(error, CodecError::MissingDictionary { .. }), "{error:?}");
    let own = M::learn(&other, &Silent).unwrap().vocabulary().unwrap();
    assert_ne!(own, words);
    let error = with(&own).unwrap_err();
    let mismatch = matches!(error, surfabet::Error::Codec(CodecError::DictionaryMismatch { .. }));
    assert!(mismatch, "{error:?}");
    // Words of another method are none.
    let error = Model::from_bytes_with(&file, &LIMITS, KnownVocabulary::new(&0_u8)).unwrap_err();
    assert!(error.to_string().contains(&hash.to_string()), "{error}");
    for end in 0..file.len() {
        let cut = Model::from_bytes_with(&file[..end], &LIMITS, KnownVocabulary::new(&words));
        assert!(cut.is_err(), "{end} of {}", file.len());
    }
    // A file that holds its words is read with any others beside it.
    let file = small_file::<M>();
    let beside = Model::from_bytes_with(&file, &LIMITS, KnownVocabulary::new(&own)).unwrap();
    assert!(beside.as_any_model().equals(small::<M>()));

    assert_stops_when_asked(|progress| M::describe(&other, &words, progress));
}
