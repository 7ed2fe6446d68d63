//! The file of planes: header, poses, masks of supported tiles, sizes, colours and intensities.

use surfabet_models::planes::{PlaneModel, PlanesHeader};

use crate::attributes::code_scale;
use crate::container::{Family, Features};
use crate::error::Result;
use crate::header::Fields;
use crate::section::{Layout, Promise, StreamSection};

/// Memory that a patch takes without its tiles.
const BYTES_PER_PATCH: u64 = 1024;

const POSES: usize = 0;
const MASKS: usize = 1;
const SIZES: usize = 2;
const COLORS: usize = 3;
const INTENSITIES: usize = 4;

impl Layout for PlaneModel {
    const FAMILY: Family = Family::Planes;
    const FEATURES: Features = Features::NONE;
    const OPTIONAL_FEATURES: Features = Features::ATTRIBUTES;
    const STREAM_SECTIONS: &'static [StreamSection] = &[
        StreamSection::new(b"POSE", "poses"),
        StreamSection::new(b"MASK", "masks"),
        StreamSection::new(b"SIZE", "sizes"),
        StreamSection::new(b"COLR", "colour"),
        StreamSection::new(b"INTS", "intensity"),
    ];

    fn code_header<F: Fields>(fields: &mut F, header: &mut PlanesHeader) -> Result<()> {
        fields.varint(&mut header.n_points)?;
        fields.varint(&mut header.n_outliers)?;
        fields.vector(&mut header.origin)?;
        fields.signed_32("exponent of the position step", &mut header.exponent)?;
        fields.f64(&mut header.grid_size)?;
        fields.optional("colour step", &mut header.color_step, 64)?;
        fields.count("number of patches", &mut header.n_patches, BYTES_PER_PATCH)
    }

    fn optional_features(header: &PlanesHeader) -> Features {
        if header.intensity.is_some() { Features::ATTRIBUTES } else { Features::NONE }
    }

    fn code_optional<F: Fields>(
        fields: &mut F,
        header: &mut PlanesHeader,
        _features: Features,
    ) -> Result<()> {
        code_scale(fields, header.intensity.get_or_insert_default())
    }

    fn has_section(header: &PlanesHeader, stream: usize) -> bool {
        match stream {
            COLORS => header.color_step.is_some(),
            INTENSITIES => header.intensity.is_some(),
            _ => true,
        }
    }

    /// Every patch takes a decision of its own in each of these.
    fn promises(header: &PlanesHeader) -> Vec<Promise> {
        let of = |stream| Promise { stream, what: "number of patches", count: header.n_patches };
        [POSES, MASKS, SIZES].map(of).into()
    }
}
