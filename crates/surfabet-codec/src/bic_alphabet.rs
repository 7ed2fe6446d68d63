//! The sections of the family "alphabet" when it was chosen by the Bayesian information criterion: what it is, its
//! words, and where they occur.
//!
//! The streams themselves are said by `surfabet-models`, in one function for both directions; here they become
//! sections. Byte by byte in `docs/format.md`.

use surfabet_models::bic_alphabet::{
    BicAlphabet, BicAlphabetModel, BicHeader, BicShape, MAX_CELL, MAX_WORDS,
};
use surfabet_models::scans::Upright;

use crate::bytes::{ByteReader, ByteWriter};
use crate::container::{Container, ContainerWriter, Family, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::{Error, Result};
use crate::hash::ContentHash;

const META: Tag = Tag::new(b"META");
const WORDS: Tag = Tag::new(b"WORD");
const WORDS_HASH: Tag = Tag::new(b"WREF");
const POSES: Tag = Tag::new(b"POSE");

/// Memory that an occurrence takes while it is read.
const BYTES_PER_OCCURRENCE: u64 = 64;

/// Memory that a word takes at most beside its points.
const BYTES_PER_WORD: u64 = 2048;

/// Memory that a point of a word takes.
const BYTES_PER_POINT: u64 = 8;

const UPRIGHT: [Upright; 3] = [Upright::WorldX, Upright::WorldZ, Upright::ViewDirection];

/// The bytes of a file that holds `model`.
///
/// # Errors
/// As [`ContainerWriter::finish`].
pub fn write(model: &BicAlphabetModel) -> Result<Vec<u8>> {
    let mut poses = Encoder::new();
    let Ok(()) = model.write(&mut poses);
    let alphabet = model.alphabet();
    let (features, words) = if model.shares_alphabet() {
        let features = Features::BIC_ALPHABET.with(Features::SHARED_DICTIONARY);
        (features, (WORDS_HASH, alphabet_hash(alphabet).0.to_vec()))
    } else {
        let mut words = Encoder::new();
        let Ok(()) = alphabet.write(&mut words);
        (Features::BIC_ALPHABET, (WORDS, words.finish()))
    };
    ContainerWriter::new(Family::Alphabet, features)
        .section(META, write_meta(model))
        .section(words.0, words.1)
        .section(POSES, poses.finish())
        .finish()
}

/// The hash by which files name an alphabet; its content is written out in `docs/format.md`.
pub fn alphabet_hash(alphabet: &BicAlphabet) -> ContentHash {
    let mut out = ByteWriter::new();
    write_shape(&mut out, alphabet);
    let byte = |v: &i8| v.to_le_bytes()[0];
    for word in alphabet.words() {
        out.varint(word.points.len() as u64);
        out.bytes(&word.points.as_flattened().iter().map(byte).collect::<Vec<u8>>());
        out.bytes(&word.descriptor.iter().map(byte).collect::<Vec<u8>>());
    }
    ContentHash::of(&out.finish())
}

/// The alphabet that a file refers to; `None` when it holds its own.
///
/// # Errors
/// When the file says that it refers to one, and does not.
pub fn shared_alphabet(container: &Container<'_>) -> Result<Option<ContentHash>> {
    ContentHash::named_by(container, WORDS_HASH)
}

/// The model that a parsed file holds. `alphabet` is what a file without words of its own was made with; other files
/// do not look at it.
///
/// # Errors
/// Any error of reading: the content is checked like the container was. [`Error::MissingDictionary`] and
/// [`Error::DictionaryMismatch`] when the file refers to an alphabet, and none or another is given.
pub fn read(
    container: &Container<'_>,
    limits: &Limits,
    alphabet: Option<&BicAlphabet>,
) -> Result<BicAlphabetModel> {
    container.expect_family(Family::Alphabet)?;
    let shared = shared_alphabet(container)?;
    let shared = shared.map(|h| h.of_given(alphabet, alphabet_hash)).transpose()?;
    let base = if shared.is_some() { Features::SHARED_DICTIONARY } else { Features::NONE };
    if container.features() != Features::BIC_ALPHABET.with(base) {
        return Err(Error::corrupt(META, 0, "an alphabet by BIC can only be shared or not"));
    }
    let stored = if shared.is_some() { WORDS_HASH } else { WORDS };
    container.expect_only(&[META, stored, POSES])?;
    let meta = read_meta(container.require(META)?, limits)?;
    let alphabet = match shared {
        Some(alphabet) => {
            if alphabet.shape() != meta.shape || alphabet.len() != meta.words {
                return Err(Error::corrupt(
                    META,
                    0,
                    "sizes of another alphabet than the one named",
                ));
            }
            alphabet.clone()
        }
        None => {
            let mut words = Decoder::new(WORDS, container.require(WORDS)?);
            words.check_count("number of words", meta.words as u64)?;
            let most = limits.max_items.min(limits.max_bytes / BYTES_PER_POINT);
            let most = usize::try_from(most).unwrap_or(usize::MAX);
            let alphabet = BicAlphabet::read(meta.shape, meta.words, most, &mut words)?;
            words.finish()?;
            alphabet
        }
    };
    let mut poses = Decoder::new(POSES, container.require(POSES)?);
    poses.check_count("number of occurrences", meta.occurrences as u64)?;
    let is_shared = shared.is_some();
    let model =
        BicAlphabetModel::read(meta.header, alphabet, meta.occurrences, is_shared, &mut poses)?;
    poses.finish()?;
    Ok(model)
}

struct Meta {
    header: BicHeader,
    shape: BicShape,
    words: usize,
    occurrences: usize,
}

fn write_shape(out: &mut ByteWriter, alphabet: &BicAlphabet) {
    let BicShape { radius, descriptor_pixels, upright } = alphabet.shape();
    out.f64(radius);
    out.varint(u64::from(descriptor_pixels));
    // Every rule is in the list.
    out.varint(UPRIGHT.iter().position(|u| *u == upright).unwrap_or(0) as u64);
    out.varint(alphabet.len() as u64);
}

fn write_meta(model: &BicAlphabetModel) -> Vec<u8> {
    let BicHeader { n_points, origin, epsilon, low } = model.header();
    let mut out = ByteWriter::new();
    out.varint(n_points);
    origin.iter().for_each(|&c| out.f64(c));
    write_shape(&mut out, model.alphabet());
    out.f64(epsilon);
    low.iter().for_each(|&c| out.signed_varint(i64::from(c)));
    out.varint(model.len() as u64);
    out.finish()
}

fn read_meta(bytes: &[u8], limits: &Limits) -> Result<Meta> {
    let mut input = ByteReader::new(META, bytes);
    let n_points = input.varint()?;
    let origin = [input.f64()?, input.f64()?, input.f64()?];
    let radius = input.f64()?;
    let descriptor_pixels = input.bounded("pixels per side of a descriptor", 32)? as u32;
    let upright = UPRIGHT[input.bounded("upright rule", UPRIGHT.len() as u64 - 1)?];
    let words = input.bounded("number of words", MAX_WORDS as u64)?;
    limits.check("number of words", words as u64, BYTES_PER_WORD)?;
    let epsilon = input.f64()?;
    let mut low = [0; 3];
    for c in &mut low {
        let value = input.signed_varint()?;
        *c = i32::try_from(value)
            .ok()
            .filter(|v| v.unsigned_abs() <= MAX_CELL as u32)
            .ok_or_else(|| input.corrupt(format!("a lowest cell of {value}")))?;
    }
    let count = input.varint()?;
    let occurrences = limits.check("number of occurrences", count, BYTES_PER_OCCURRENCE)?;
    input.finish()?;
    let header = BicHeader { n_points, origin, epsilon, low };
    let shape = BicShape { radius, descriptor_pixels, upright };
    Ok(Meta { header, shape, words, occurrences })
}
