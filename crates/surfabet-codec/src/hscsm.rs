//! The sections of HSCSM: poses, masks, dictionaries, depth and colour of all levels.
//!
//! `surfabet-models` codes the streams, in one function for both directions; here they become sections. Byte by
//! byte in `docs/format.md`.

use surfabet_models::hscsm::{
    HscsmDictionary, HscsmHeader, HscsmModel, LevelHeader, MAX_ENTRIES, MAX_SPARSITY,
    QuantizedDictionary, Steps, Streams,
};

use crate::bytes::{ByteReader, ByteWriter};
use crate::container::{Container, ContainerWriter, Family, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::Result;
use crate::hash::ContentHash;

const META: Tag = Tag::new(b"META");
const POSES: Tag = Tag::new(b"POSE");
const MASKS: Tag = Tag::new(b"MASK");
const DICTIONARIES: Tag = Tag::new(b"DICT");
const DICTIONARY_HASH: Tag = Tag::new(b"DREF");
const DEPTH: Tag = Tag::new(b"DPTH");
const COLOR: Tag = Tag::new(b"COLR");

/// Most levels of a hierarchy.
const MAX_LEVELS: u64 = 16;

/// Memory that a patch takes at most beside its mask: pose, means and two full codes.
const BYTES_PER_PATCH: u64 = 64 + 2 * 6 * MAX_SPARSITY as u64;

/// The bytes of a file that holds `model`.
///
/// # Errors
/// As [`ContainerWriter::finish`].
pub fn write(model: &HscsmModel) -> Result<Vec<u8>> {
    let mut streams = Streams::from_fn(Encoder::new);
    let Ok(()) = model.write(&mut streams);
    let (features, dictionary) = if model.shares_dictionary() {
        let hash = dictionary_hash(&model.dictionary());
        (Features::SHARED_DICTIONARY, (DICTIONARY_HASH, hash.0.to_vec()))
    } else {
        (Features::NONE, (DICTIONARIES, streams.dictionaries.finish()))
    };
    ContainerWriter::new(Family::Patches, features)
        .section(META, write_meta(&model.header()))
        .section(POSES, streams.poses.finish())
        .section(MASKS, streams.masks.finish())
        .section(dictionary.0, dictionary.1)
        .section(DEPTH, streams.depth.finish())
        .section(COLOR, streams.color.finish())
        .finish()
}

/// The hash by which files name a dictionary; its content is written out in `docs/format.md`.
pub fn dictionary_hash(dictionary: &HscsmDictionary) -> ContentHash {
    let mut out = ByteWriter::new();
    let mut entries = |dictionary: &QuantizedDictionary| -> Vec<u8> {
        dictionary.values().iter().map(|v| v.to_le_bytes()[0]).collect()
    };
    out.varint(dictionary.levels.len() as u64);
    for level in &dictionary.levels {
        out.f64(level.pixel_size);
        out.varint(u64::from(level.pixels));
        out.varint(level.depth.n_atoms() as u64);
        out.varint(level.color.as_ref().map_or(0, |c| c.n_atoms() as u64 + 1));
        out.bytes(&entries(&level.depth));
        out.bytes(&level.color.as_ref().map(&mut entries).unwrap_or_default());
    }
    ContentHash::of(&out.finish())
}

/// The dictionary that a file refers to; `None` when it holds its own.
///
/// # Errors
/// When the file says that it refers to one, and does not.
pub fn shared_dictionary(container: &Container<'_>) -> Result<Option<ContentHash>> {
    ContentHash::named_by(container, DICTIONARY_HASH)
}

/// The model that a parsed file holds. `dictionary` is what a file without dictionaries of its own was made
/// with; it is not used for other files.
///
/// # Errors
/// Any error of reading: the content is checked like the container was.
/// [`MissingDictionary`](crate::Error::MissingDictionary) and
/// [`DictionaryMismatch`](crate::Error::DictionaryMismatch) when the file refers to a dictionary, and none or another is given.
pub fn read(
    container: &Container<'_>,
    limits: &Limits,
    dictionary: Option<&HscsmDictionary>,
) -> Result<HscsmModel> {
    container.expect_family(Family::Patches)?;
    let shared = shared_dictionary(container)?;
    let shared = shared.map(|h| h.of_given(dictionary, dictionary_hash)).transpose()?;
    let stored = if shared.is_some() { DICTIONARY_HASH } else { DICTIONARIES };
    container.expect_only(&[META, POSES, MASKS, stored, DEPTH, COLOR])?;
    let header = read_meta(container.require(META)?, limits)?;
    let stream = |tag| container.require(tag).map(|bytes| Decoder::new(tag, bytes));
    let mut streams = Streams {
        poses: stream(POSES)?,
        masks: stream(MASKS)?,
        dictionaries: match shared {
            None => stream(DICTIONARIES)?,
            Some(_) => Decoder::new(DICTIONARIES, &[]),
        },
        depth: stream(DEPTH)?,
        color: stream(COLOR)?,
    };
    for level in &header.levels {
        check_counts(&streams, level, shared.is_some())?;
    }
    let model = HscsmModel::read(&header, shared, &mut streams)?;
    for stream in streams.as_array() {
        stream.finish()?;
    }
    Ok(model)
}

/// Every patch takes a decision or more of each stream, and so does every value of a dictionary.
fn check_counts(
    streams: &Streams<Decoder<'_>>,
    level: &LevelHeader,
    shares_dictionary: bool,
) -> Result<()> {
    let patches = level.n_patches as u64;
    streams.poses.check_count("number of patches", patches)?;
    streams.masks.check_count("number of patches", patches)?;
    streams.depth.check_count("number of patches", patches)?;
    if level.color_atoms.is_some() {
        streams.color.check_count("number of patches", patches)?;
    }
    if !shares_dictionary {
        let entries = level.depth_atoms as u64 + 3 * level.color_atoms.unwrap_or(0) as u64;
        let values = entries * level.area() as u64;
        streams.dictionaries.check_count("values of a dictionary", values)?;
    }
    Ok(())
}

fn write_meta(header: &HscsmHeader) -> Vec<u8> {
    let mut out = ByteWriter::new();
    header.origin.iter().for_each(|&c| out.f64(c));
    out.varint(header.n_points);
    out.varint(header.levels.len() as u64);
    for level in &header.levels {
        out.f64(level.pixel_size);
        out.varint(u64::from(level.pixels));
        let Steps { position, depth_mean, depth_code, color_mean, color_code } = level.steps;
        for step in [position, depth_mean, depth_code, color_mean, color_code] {
            out.f64(step);
        }
        out.varint(level.n_patches as u64);
        out.varint(level.depth_atoms as u64);
        // Zero: no colour; else one more than the entries of its dictionary.
        out.varint(level.color_atoms.map_or(0, |n| n as u64 + 1));
    }
    out.finish()
}

fn read_meta(bytes: &[u8], limits: &Limits) -> Result<HscsmHeader> {
    let mut input = ByteReader::new(META, bytes);
    let origin = [input.f64()?, input.f64()?, input.f64()?];
    let n_points = input.varint()?;
    let n_levels = input.bounded("number of levels", MAX_LEVELS)?;
    let mut levels = Vec::with_capacity(n_levels);
    for _ in 0..n_levels {
        let pixel_size = input.f64()?;
        let pixels = input.bounded("pixels per side of a patch", 32)? as u32;
        if pixels < 2 {
            return Err(input.corrupt(format!("patches of {pixels} pixels per side, not 2 to 32")));
        }
        let steps = Steps {
            position: input.f64()?,
            depth_mean: input.f64()?,
            depth_code: input.f64()?,
            color_mean: input.f64()?,
            color_code: input.f64()?,
        };
        let area = u64::from(pixels * pixels);
        let n_patches =
            limits.check("number of patches", input.varint()?, area + BYTES_PER_PATCH)?;
        let most = MAX_ENTRIES as u64;
        let depth_atoms = input.bounded("entries of a dictionary", most)?;
        let color_atoms = input.bounded("entries of a dictionary", most + 1)?.checked_sub(1);
        levels.push(LevelHeader { pixel_size, pixels, steps, n_patches, depth_atoms, color_atoms });
    }
    input.finish()?;
    Ok(HscsmHeader { origin, n_points, levels })
}
