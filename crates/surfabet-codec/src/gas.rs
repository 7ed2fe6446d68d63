//! The file of a gas: header, topology, positions, normals, sizes, colours and intensities.

use surfabet_models::gas::{GasHeader, GasModel};

use crate::attributes::code_scale;
use crate::container::{Family, Features};
use crate::error::Result;
use crate::header::Fields;
use crate::section::{Layout, Promise, StreamSection};

/// Memory that a neuron takes while it is read.
const BYTES_PER_NEURON: u64 = 256;

/// Memory that an edge takes while it is read.
const BYTES_PER_EDGE: u64 = 64;

const TOPOLOGY: usize = 0;
const SIZES: usize = 3;
const COLORS: usize = 4;
const INTENSITIES: usize = 5;

impl Layout for GasModel {
    const FAMILY: Family = Family::Gas;
    const FEATURES: Features = Features::NONE;
    const OPTIONAL_FEATURES: Features = Features::ATTRIBUTES;
    const STREAM_SECTIONS: &'static [StreamSection] = &[
        StreamSection::new(b"TOPO", "topology"),
        StreamSection::new(b"POSN", "positions"),
        StreamSection::new(b"NORM", "normals"),
        StreamSection::new(b"SIZE", "sizes"),
        StreamSection::new(b"COLR", "colour"),
        StreamSection::new(b"INTS", "intensity"),
    ];

    fn code_header<F: Fields>(fields: &mut F, header: &mut GasHeader) -> Result<()> {
        fields.varint(&mut header.n_points)?;
        fields.vector(&mut header.origin)?;
        fields.signed_32("exponent of the position step", &mut header.exponent)?;
        fields.optional("colour step", &mut header.color_step, 64)?;
        fields.f64(&mut header.mean_error)?;
        fields.count("number of neurons", &mut header.n_neurons, BYTES_PER_NEURON)?;
        fields.count("number of edges", &mut header.n_edges, BYTES_PER_EDGE)
    }

    fn optional_features(header: &GasHeader) -> Features {
        if header.intensity.is_some() { Features::ATTRIBUTES } else { Features::NONE }
    }

    fn code_optional<F: Fields>(
        fields: &mut F,
        header: &mut GasHeader,
        _features: Features,
    ) -> Result<()> {
        code_scale(fields, header.intensity.get_or_insert_default())
    }

    fn has_section(header: &GasHeader, stream: usize) -> bool {
        match stream {
            COLORS => header.color_step.is_some(),
            INTENSITIES => header.intensity.is_some(),
            _ => true,
        }
    }

    /// Every neuron takes a decision of its own in the sizes. In the topology every neuron but those found by edges
    /// does, and every edge takes one or its part of a number of new neurons.
    fn promises(header: &GasHeader) -> Vec<Promise> {
        let of = |stream| Promise { stream, what: "number of neurons", count: header.n_neurons };
        vec![of(SIZES), of(TOPOLOGY)]
    }
}
