//! The sections of the family "planes": what it is, poses, masks of supported tiles, sizes and colours.
//!
//! The streams themselves are said by `surfabet-models`, in one function for both directions; here they become
//! sections. Byte by byte in `docs/format.md`.

use surfabet_models::planes::{MAX_MODEL_TILES, PlaneModel, PlanesHeader, Streams};

use crate::bytes::{ByteReader, ByteWriter};
use crate::container::{Container, ContainerWriter, Family, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::{Error, Result};

const META: Tag = Tag::new(b"META");
const POSES: Tag = Tag::new(b"POSE");
const MASKS: Tag = Tag::new(b"MASK");
const SIZES: Tag = Tag::new(b"SIZE");
const COLOR: Tag = Tag::new(b"COLR");

/// Memory that a patch takes without its tiles.
const BYTES_PER_PATCH: u64 = 1024;

/// Memory that a tile takes, as stored and as restored.
const BYTES_PER_TILE: u64 = 24;

/// The bytes of a file that holds `model`.
///
/// # Errors
/// As [`ContainerWriter::finish`].
pub fn write(model: &PlaneModel) -> Result<Vec<u8>> {
    let mut streams = Streams::from_fn(Encoder::new);
    let Ok(()) = model.write(&mut streams);
    let mut writer = ContainerWriter::new(Family::Planes, Features::NONE)
        .section(META, write_meta(model.header()))
        .section(POSES, streams.poses.finish())
        .section(MASKS, streams.masks.finish())
        .section(SIZES, streams.sizes.finish());
    if model.has_color() {
        writer = writer.section(COLOR, streams.colors.finish());
    }
    writer.finish()
}

/// The model that a parsed file holds.
///
/// # Errors
/// Any error of reading: the content is checked like the container was.
pub fn read(container: &Container<'_>, limits: &Limits) -> Result<PlaneModel> {
    container.expect_family(Family::Planes)?;
    if container.features() != Features::NONE {
        return Err(Error::corrupt(META, 0, "planes need no feature"));
    }
    let header = read_meta(container.require(META)?, limits)?;
    let mut expected = vec![META, POSES, MASKS, SIZES];
    expected.extend(header.color_step.map(|_| COLOR));
    container.expect_only(&expected)?;
    let stream = |tag: Tag| -> Result<Decoder<'_>> {
        let bytes = if expected.contains(&tag) { container.require(tag)? } else { &[] };
        Ok(Decoder::new(tag, bytes))
    };
    let mut streams = Streams {
        poses: stream(POSES)?,
        masks: stream(MASKS)?,
        sizes: stream(SIZES)?,
        colors: stream(COLOR)?,
    };
    // Every patch takes decisions of its own in each of these, in the masks one at least.
    streams.poses.check_count("number of patches", header.n_patches)?;
    streams.masks.check_count("number of patches", header.n_patches)?;
    streams.sizes.check_count("number of patches", header.n_patches)?;
    let most = limits.max_items.min(limits.max_bytes / BYTES_PER_TILE).min(MAX_MODEL_TILES);
    let model = PlaneModel::read(&header, most, &mut streams)?;
    for stream in streams.as_array() {
        stream.finish()?;
    }
    Ok(model)
}

fn write_meta(header: &PlanesHeader) -> Vec<u8> {
    let mut out = ByteWriter::new();
    out.varint(header.n_points);
    out.varint(header.n_outliers);
    header.origin.iter().for_each(|&c| out.f64(c));
    out.signed_varint(i64::from(header.exponent));
    out.f64(header.grid_size);
    // Zero: no colour.
    out.varint(u64::from(header.color_step.unwrap_or(0)));
    out.varint(header.n_patches);
    out.finish()
}

fn read_meta(bytes: &[u8], limits: &Limits) -> Result<PlanesHeader> {
    let mut input = ByteReader::new(META, bytes);
    let n_points = input.varint()?;
    let n_outliers = input.varint()?;
    let origin = [input.f64()?, input.f64()?, input.f64()?];
    let exponent = input.signed_varint()?;
    let exponent = i32::try_from(exponent)
        .map_err(|_| input.corrupt(format!("a position step of 2^{exponent} m")))?;
    let grid_size = input.f64()?;
    let color_step = input.bounded("colour step", 64)? as u32;
    let n_patches = input.varint()?;
    limits.check("number of patches", n_patches, BYTES_PER_PATCH)?;
    input.finish()?;
    Ok(PlanesHeader {
        n_points,
        n_outliers,
        origin,
        exponent,
        grid_size,
        color_step: (color_step > 0).then_some(color_step),
        n_patches,
    })
}
