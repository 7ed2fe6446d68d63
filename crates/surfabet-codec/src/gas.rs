//! The sections of the family "gas": what it is, its topology, positions, normals, sizes and colours.
//!
//! The streams themselves are said by `surfabet-models`, in one function for both directions; here they become
//! sections. Byte by byte in `docs/format.md`.

use surfabet_models::gas::{GasHeader, GasModel, Streams};

use crate::bytes::{ByteReader, ByteWriter};
use crate::container::{Container, ContainerWriter, Family, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::{Error, Result};

const META: Tag = Tag::new(b"META");
const TOPOLOGY: Tag = Tag::new(b"TOPO");
const POSITIONS: Tag = Tag::new(b"POSN");
const NORMALS: Tag = Tag::new(b"NORM");
const SIZES: Tag = Tag::new(b"SIZE");
const COLOR: Tag = Tag::new(b"COLR");

/// Memory that a neuron takes while it is read.
const BYTES_PER_NEURON: u64 = 256;

/// Memory that an edge takes while it is read.
const BYTES_PER_EDGE: u64 = 64;

/// The bytes of a file that holds `model`.
///
/// # Errors
/// As [`ContainerWriter::finish`].
pub fn write(model: &GasModel) -> Result<Vec<u8>> {
    let mut streams = Streams::from_fn(Encoder::new);
    let Ok(()) = model.write(&mut streams);
    let mut writer = ContainerWriter::new(Family::Gas, Features::NONE)
        .section(META, write_meta(model.header()))
        .section(TOPOLOGY, streams.topology.finish())
        .section(POSITIONS, streams.positions.finish())
        .section(NORMALS, streams.normals.finish())
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
pub fn read(container: &Container<'_>, limits: &Limits) -> Result<GasModel> {
    container.expect_family(Family::Gas)?;
    if container.features() != Features::NONE {
        return Err(Error::corrupt(META, 0, "a gas needs no feature"));
    }
    let header = read_meta(container.require(META)?, limits)?;
    let mut expected = vec![META, TOPOLOGY, POSITIONS, NORMALS, SIZES];
    expected.extend(header.color_step.map(|_| COLOR));
    container.expect_only(&expected)?;
    let stream = |tag: Tag| -> Result<Decoder<'_>> {
        let bytes = if expected.contains(&tag) { container.require(tag)? } else { &[] };
        Ok(Decoder::new(tag, bytes))
    };
    let mut streams = Streams {
        topology: stream(TOPOLOGY)?,
        positions: stream(POSITIONS)?,
        normals: stream(NORMALS)?,
        sizes: stream(SIZES)?,
        colors: stream(COLOR)?,
    };
    // Every neuron takes a decision of its own here, and every edge one or its part of a number of new neurons.
    streams.sizes.check_count("number of neurons", header.n_neurons)?;
    streams.topology.check_count("number of neurons", header.n_neurons)?;
    let model = GasModel::read(&header, &mut streams)?;
    for stream in streams.as_array() {
        stream.finish()?;
    }
    Ok(model)
}

fn write_meta(header: &GasHeader) -> Vec<u8> {
    let mut out = ByteWriter::new();
    out.varint(header.n_points);
    header.origin.iter().for_each(|&c| out.f64(c));
    out.signed_varint(i64::from(header.exponent));
    // Zero: no colour.
    out.varint(u64::from(header.color_step.unwrap_or(0)));
    out.f64(header.mean_error);
    out.varint(header.n_neurons);
    out.varint(header.n_edges);
    out.finish()
}

fn read_meta(bytes: &[u8], limits: &Limits) -> Result<GasHeader> {
    let mut input = ByteReader::new(META, bytes);
    let n_points = input.varint()?;
    let origin = [input.f64()?, input.f64()?, input.f64()?];
    let exponent = input.signed_varint()?;
    let exponent = i32::try_from(exponent)
        .map_err(|_| input.corrupt(format!("a position step of 2^{exponent} m")))?;
    let color_step = input.bounded("colour step", 64)? as u32;
    let mean_error = input.f64()?;
    let n_neurons = input.varint()?;
    limits.check("number of neurons", n_neurons, BYTES_PER_NEURON)?;
    let n_edges = input.varint()?;
    limits.check("number of edges", n_edges, BYTES_PER_EDGE)?;
    input.finish()?;
    Ok(GasHeader {
        n_points,
        origin,
        exponent,
        color_step: (color_step > 0).then_some(color_step),
        mean_error,
        n_neurons,
        n_edges,
    })
}
