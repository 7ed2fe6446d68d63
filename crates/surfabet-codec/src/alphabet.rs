//! The sections of the family "alphabet": words, where they occur, and the colours there.
//!
//! The streams themselves are said by `surfabet-models`, in one function for both directions; here they become
//! sections. Byte by byte in `docs/format.md`.

use surfabet_models::alphabet::{
    Alphabet, AlphabetModel, Channels, Header, MAX_SCALE, MAX_WORDS, SigmaRule,
};
use surfabet_models::scans::Deviation;

use crate::bytes::{ByteReader, ByteWriter};
use crate::container::{Container, ContainerWriter, Family, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::{Error, Result};
use crate::hash::ContentHash;

const META: Tag = Tag::new(b"META");
const WORDS: Tag = Tag::new(b"WORD");
const WORDS_HASH: Tag = Tag::new(b"WREF");
const OCCURRENCES: Tag = Tag::new(b"OCCR");
const CHANNELS: Tag = Tag::new(b"CHAN");

/// Memory that an occurrence takes at most while it is read.
const BYTES_PER_OCCURRENCE: u64 = 512;

/// Largest coordinate of a sensor, units.
const MAX_SENSOR: i64 = 1 << 41;

/// The bytes of a file that holds `model`.
///
/// # Errors
/// As [`ContainerWriter::finish`].
pub fn write(model: &AlphabetModel) -> Result<Vec<u8>> {
    let (mut occurrences, mut channels) = (Encoder::new(), Encoder::new());
    let Ok(()) = model.write(&mut occurrences, &mut channels);
    let (features, words) = if model.shares_alphabet() {
        let hash = alphabet_hash(model.alphabet());
        (Features::SHARED_DICTIONARY, (WORDS_HASH, hash.0.to_vec()))
    } else {
        (Features::NONE, (WORDS, words(model.alphabet())))
    };
    let mut writer = ContainerWriter::new(Family::Alphabet, features)
        .section(META, write_meta(model))
        .section(words.0, words.1)
        .section(OCCURRENCES, occurrences.finish());
    if model.attributes().is_some() {
        writer = writer.section(CHANNELS, channels.finish());
    }
    writer.finish()
}

fn words(alphabet: &Alphabet) -> Vec<u8> {
    let mut encoder = Encoder::new();
    let Ok(_) = alphabet.code(&mut encoder, alphabet.words().len());
    encoder.finish()
}

/// The hash by which files name an alphabet: of its radius, scales and number of words as in the header, and of its
/// section.
pub fn alphabet_hash(alphabet: &Alphabet) -> ContentHash {
    let mut out = ByteWriter::new();
    write_sizes(&mut out, alphabet);
    out.bytes(&words(alphabet));
    ContentHash::of(&out.finish())
}

/// The model that a parsed file holds; `alphabet` is for files that name theirs.
///
/// # Errors
/// Any error of reading; [`Error::MissingDictionary`] and [`Error::DictionaryMismatch`] when the file names its
/// alphabet, and none or another is given.
pub fn read(
    container: &Container<'_>,
    limits: &Limits,
    alphabet: Option<&Alphabet>,
) -> Result<AlphabetModel> {
    container.expect_family(Family::Alphabet)?;
    let shared = container.features() == Features::SHARED_DICTIONARY;
    if !shared && container.features() != Features::NONE {
        return Err(Error::corrupt(META, 0, "an alphabet has no other feature than being shared"));
    }
    let meta = read_meta(container.require(META)?, limits)?;
    let mut expected = vec![META, if shared { WORDS_HASH } else { WORDS }, OCCURRENCES];
    expected.extend((meta.channels.count() > 0).then_some(CHANNELS));
    container.expect_only(&expected)?;

    let wrong = |e: surfabet_models::Error| Error::corrupt(META, 0, e.to_string());
    let alphabet = if let Some(expected) = ContentHash::named_by(container, WORDS_HASH)? {
        expected.of_given(alphabet, alphabet_hash)?.clone()
    } else {
        let mut decoder = Decoder::new(WORDS, container.require(WORDS)?);
        decoder.check_count("number of words", meta.n_words as u64)?;
        let plane = Alphabet::plane(meta.radius, meta.scales).map_err(wrong)?;
        let said = plane.code(&mut decoder, meta.n_words)?;
        decoder.finish()?;
        Alphabet::new(meta.radius, meta.scales, said).map_err(wrong)?
    };
    let sizes = (alphabet.radius(), alphabet.scales(), alphabet.words().len());
    if sizes != (meta.radius, meta.scales, meta.n_words) {
        return Err(Error::corrupt(META, 0, "sizes of another alphabet"));
    }
    let mut occurrences = Decoder::new(OCCURRENCES, container.require(OCCURRENCES)?);
    occurrences.check_count("number of occurrences", meta.n_occurrences as u64)?;
    let bytes = container.section(CHANNELS).unwrap_or(&[]);
    let mut channels = Decoder::new(CHANNELS, bytes);
    let model = AlphabetModel::read(
        meta.header,
        alphabet,
        meta.n_occurrences,
        meta.channels,
        shared,
        &mut occurrences,
        &mut channels,
    )?;
    occurrences.finish()?;
    channels.finish()?;
    Ok(model)
}

struct Meta {
    header: Header,
    radius: f64,
    scales: u32,
    n_words: usize,
    n_occurrences: usize,
    channels: Channels,
}

fn write_sizes(out: &mut ByteWriter, alphabet: &Alphabet) {
    out.f64(alphabet.radius());
    out.varint(u64::from(alphabet.scales()));
    out.varint(alphabet.words().len() as u64);
}

fn write_meta(model: &AlphabetModel) -> Vec<u8> {
    let header = model.header();
    let mut out = ByteWriter::new();
    write_sizes(&mut out, model.alphabet());
    out.varint(header.n_points);
    out.varint(model.len() as u64);
    header.origin.iter().for_each(|&c| out.f64(c));
    out.f32(header.spacing as f32);
    // For the reader's information only; zero: no range was known.
    out.f32(header.deviation.sigma_scale as f32);
    out.f32(header.deviation.angular_resolution.unwrap_or(0.0) as f32);
    out.f32(header.deviation.noise.unwrap_or(0.0) as f32);
    out.varint(header.rule.per_range);
    out.varint(header.rule.constant);
    out.varint(header.sensors.len() as u64);
    header.sensors.iter().flatten().for_each(|&c| out.signed_varint(c));
    let channels = model.attributes().map(|a| a.channels);
    // Zero: no colour.
    out.varint(u64::from(channels.and_then(|c| c.color_step).unwrap_or(0)));
    let intensities = channels.and_then(|c| c.intensities);
    out.u8(u8::from(intensities.is_some()));
    intensities.iter().flatten().for_each(|&v| out.f32(v));
    out.finish()
}

fn read_meta(bytes: &[u8], limits: &Limits) -> Result<Meta> {
    let mut input = ByteReader::new(META, bytes);
    let radius = input.f64()?;
    let scales = input.bounded("number of scales", u64::from(MAX_SCALE) + 1)? as u32;
    let n_words = input.bounded("number of words", u64::from(MAX_WORDS))?;
    let n_points = input.varint()?;
    let n_occurrences = input.varint()?;
    let n_occurrences =
        limits.check("number of occurrences", n_occurrences, BYTES_PER_OCCURRENCE)?;
    let origin = [input.f64()?, input.f64()?, input.f64()?];
    let mut single = || -> Result<f64> { Ok(f64::from(input.f32()?)) };
    let [spacing, scale, alpha, noise] = [single()?, single()?, single()?, single()?];
    let rule = SigmaRule { per_range: input.varint()?, constant: input.varint()? };
    let n_sensors = input.count("number of sensors", 3)?;
    let mut sensors = Vec::with_capacity(n_sensors);
    for _ in 0..n_sensors {
        let sensor = [input.signed_varint()?, input.signed_varint()?, input.signed_varint()?];
        if sensor.iter().any(|c| c.abs() > MAX_SENSOR) {
            return Err(input.corrupt(format!("a sensor at {sensor:?} is out of range")));
        }
        sensors.push(sensor);
    }
    if sensors.len() > usize::from(u16::MAX) || !sensors.is_sorted() {
        return Err(input.corrupt("sensors are too many or not in order"));
    }
    let step = input.bounded("colour step", 255)? as u32;
    let intensities = match input.u8()? {
        0 => None,
        1 => {
            let range = [input.f32()?, input.f32()?];
            if !(range[0] <= range[1] && range.iter().all(|v| v.is_finite())) {
                return Err(input.corrupt(format!("intensities from {} to {}", range[0], range[1])));
            }
            Some(range)
        }
        other => return Err(input.corrupt(format!("{other} ranges of intensity"))),
    };
    if !origin.iter().all(|c| c.is_finite()) || !(0.25..=4.0).contains(&spacing) {
        return Err(input.corrupt(format!("an origin of {origin:?} or a spacing of {spacing}")));
    }
    input.finish()?;
    let deviation =
        Deviation { scale, angular_resolution: (alpha > 0.0).then_some(alpha), noise: Some(noise) };
    Ok(Meta {
        header: Header { n_points, origin, spacing, deviation, rule, sensors },
        radius,
        scales,
        n_words,
        n_occurrences,
        channels: Channels { color_step: (step > 0).then_some(step), intensities },
    })
}
