//! The sections of the family "patches" when these lie on a lattice: what they are, their geometry, their colour,
//! and the points that no patch holds.
//!
//! The streams themselves are said by `surfabet-models`, in one function for both directions; here they become
//! sections. Byte by byte in `docs/format.md`.

use surfabet_models::patches::{
    ColorSteps, Lattice, MAX_LEVELS, Orientation, PatchModel, PatchesHeader, PatchesLimits,
};

use crate::bytes::{ByteReader, ByteWriter};
use crate::container::{Container, ContainerWriter, Family, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::{Error, Result};

const META: Tag = Tag::new(b"META");
const GEOMETRY: Tag = Tag::new(b"GEOM");
const COLOR: Tag = Tag::new(b"COLR");
const POINTS: Tag = Tag::new(b"PNTS");

/// Memory that a patch takes at most, with its places in the map of its neighbours.
const BYTES_PER_PATCH: u64 = 4096;

/// Memory that a cell of colour takes while it is read.
const BYTES_PER_NODE: u64 = 64;

/// The bytes of a file that holds `model`.
///
/// # Errors
/// As [`ContainerWriter::finish`].
pub fn write(model: &PatchModel) -> Result<Vec<u8>> {
    let (mut geometry, mut color, mut points) = (Encoder::new(), Encoder::new(), Encoder::new());
    let Ok(()) = model.write(&mut geometry, &mut color, &mut points);
    let header = model.header();
    let mut writer = ContainerWriter::new(Family::Patches, Features::LATTICE)
        .section(META, write_meta(&header))
        .section(GEOMETRY, geometry.finish());
    if header.color.is_some() {
        writer = writer.section(COLOR, color.finish());
    }
    if header.n_extra > 0 {
        writer = writer.section(POINTS, points.finish());
    }
    writer.finish()
}

/// The model that a parsed file holds.
///
/// # Errors
/// Any error of reading: the content is checked like the container was.
pub fn read(container: &Container<'_>, limits: &Limits) -> Result<PatchModel> {
    container.expect_family(Family::Patches)?;
    if container.features() != Features::LATTICE {
        let what = "patches on a lattice have no shared dictionary, and no other feature";
        return Err(Error::corrupt(META, 0, what));
    }
    let header = read_meta(container.require(META)?, limits)?;
    let mut expected = vec![META, GEOMETRY];
    expected.extend(header.color.map(|_| COLOR));
    expected.extend((header.n_extra > 0).then_some(POINTS));
    container.expect_only(&expected)?;
    let stream = |tag: Tag| -> Result<Decoder<'_>> {
        let bytes = if expected.contains(&tag) { container.require(tag)? } else { &[] };
        Ok(Decoder::new(tag, bytes))
    };
    let (mut geometry, mut color, mut points) =
        (stream(GEOMETRY)?, stream(COLOR)?, stream(POINTS)?);
    geometry.check_count("number of patches", header.n_patches)?;
    points.check_count("number of points", header.n_extra)?;
    let limits = PatchesLimits { nodes: limits.max_items.min(limits.max_bytes / BYTES_PER_NODE) };
    let model = PatchModel::read(&header, limits, &mut geometry, &mut color, &mut points)?;
    for stream in [geometry, color, points] {
        stream.finish()?;
    }
    Ok(model)
}

fn write_meta(header: &PatchesHeader) -> Vec<u8> {
    let mut out = ByteWriter::new();
    out.varint(header.n_points);
    let lattice = &header.lattice;
    lattice.origin.iter().for_each(|&c| out.f64(c));
    for c in lattice.orientation.quaternion {
        out.varint(zigzag(c));
    }
    out.f64(lattice.pixel_size);
    out.varint(u64::from(lattice.levels));
    out.varint(u64::from(lattice.depth_step));
    out.varint(header.n_patches);
    // Zero: no colour.
    let steps = header.color.map_or((0, 0), |c| (c.luma, c.chroma));
    out.varint(u64::from(steps.0));
    out.varint(u64::from(steps.1));
    out.varint(header.n_extra);
    out.f64(header.extra_size);
    // Zero: no bound was asked for.
    out.f64(header.max_error.unwrap_or(0.0));
    out.finish()
}

fn read_meta(bytes: &[u8], limits: &Limits) -> Result<PatchesHeader> {
    let mut input = ByteReader::new(META, bytes);
    let n_points = input.varint()?;
    let origin = [input.f64()?, input.f64()?, input.f64()?];
    let mut quaternion = [0; 4];
    for c in &mut quaternion {
        *c = unzigzag(input.bounded("component of the orientation", 1 << 22)? as u32);
    }
    let pixel_size = input.f64()?;
    let levels = input.bounded("number of levels", u64::from(MAX_LEVELS))? as u32;
    let depth_step = input.bounded("depth step", 256)? as u32;
    let n_patches = input.varint()?;
    limits.check("number of patches", n_patches, BYTES_PER_PATCH)?;
    let luma = input.bounded("colour step", 4096)? as u32;
    let chroma = input.bounded("colour step", 4096)? as u32;
    let color = (luma > 0).then_some(ColorSteps { luma, chroma });
    let n_extra = input.varint()?;
    limits.check("number of points", n_extra, 8)?;
    let extra_size = input.f64()?;
    let bound = input.f64()?;
    let max_error = (bound != 0.0).then_some(bound);
    let orientation = Orientation { quaternion };
    input.finish()?;
    Ok(PatchesHeader {
        n_points,
        lattice: Lattice { origin, orientation, pixel_size, levels, depth_step },
        n_patches,
        color,
        n_extra,
        extra_size,
        max_error,
    })
}

fn zigzag(value: i32) -> u64 {
    u64::from((value << 1 ^ value >> 31) as u32)
}

fn unzigzag(value: u32) -> i32 {
    (value >> 1) as i32 ^ -((value & 1) as i32)
}
