//! The file of patches on a lattice: header, geometry, colour and the points that no patch holds.

use surfabet_models::patches::{ColorSteps, MAX_LEVELS, PatchModel, PatchesHeader};

use crate::container::{Family, Features};
use crate::error::Result;
use crate::header::Fields;
use crate::section::{Layout, Promise, StreamSection};

/// Memory that a patch takes at most, with its places in the map of its neighbours.
const BYTES_PER_PATCH: u64 = 4096;

/// Memory that a point takes which no patch holds.
const BYTES_PER_POINT: u64 = 8;

/// Largest component of the orientation's quaternion, zigzag-coded.
const MAX_QUATERNION: u32 = 1 << 22;

const GEOMETRY: usize = 0;
const COLOR: usize = 1;
const POINTS: usize = 2;

impl Layout for PatchModel {
    const FAMILY: Family = Family::Patches;
    const FEATURES: Features = Features::LATTICE;
    const STREAM_SECTIONS: &'static [StreamSection] = &[
        StreamSection::new(b"GEOM", "geometry"),
        StreamSection::new(b"COLR", "colour"),
        StreamSection::new(b"PNTS", "extra points"),
    ];

    fn code_header<F: Fields>(fields: &mut F, header: &mut PatchesHeader) -> Result<()> {
        let lattice = &mut header.lattice;
        fields.varint(&mut header.n_points)?;
        fields.vector(&mut lattice.origin)?;
        for c in &mut lattice.orientation.quaternion {
            let mut code = zigzag(*c);
            fields.bounded("component of the orientation", &mut code, MAX_QUATERNION)?;
            *c = unzigzag(code);
        }
        fields.f64(&mut lattice.pixel_size)?;
        fields.bounded("number of levels", &mut lattice.levels, MAX_LEVELS)?;
        fields.bounded("depth step", &mut lattice.depth_step, 256)?;
        fields.count("number of patches", &mut header.n_patches, BYTES_PER_PATCH)?;
        // Steps of zero: no colour.
        let mut steps = header.color.unwrap_or(ColorSteps { luma: 0, chroma: 0 });
        fields.bounded("colour step", &mut steps.luma, 4096)?;
        fields.bounded("colour step", &mut steps.chroma, 4096)?;
        header.color = (steps.luma > 0).then_some(steps);
        fields.count("number of points", &mut header.n_extra, BYTES_PER_POINT)?;
        fields.f64(&mut header.extra_size)?;
        // Zero: no bound was asked for.
        let mut bound = header.max_error.unwrap_or(0.0);
        fields.f64(&mut bound)?;
        header.max_error = (bound != 0.0).then_some(bound);
        Ok(())
    }

    fn has_section(header: &PatchesHeader, stream: usize) -> bool {
        match stream {
            COLOR => header.color.is_some(),
            POINTS => header.n_extra > 0,
            _ => true,
        }
    }

    fn promises(header: &PatchesHeader) -> Vec<Promise> {
        vec![
            Promise { stream: GEOMETRY, what: "number of patches", count: header.n_patches },
            Promise { stream: POINTS, what: "number of points", count: header.n_extra },
        ]
    }
}

/// 0, -1, 1, -2, 2, ... as 0, 1, 2, 3, 4, ...
fn zigzag(value: i32) -> u32 {
    (value << 1 ^ value >> 31) as u32
}

/// The inverse of [`zigzag`].
fn unzigzag(code: u32) -> i32 {
    (code >> 1) as i32 ^ -((code & 1) as i32)
}
