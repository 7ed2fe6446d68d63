//! The file of patches on a lattice: header, geometry, colour, the points that no patch holds, instances, other attributes.

use surfabet_geom::Dtype;
use surfabet_models::ScalarScale;
use surfabet_models::patches::{
    AttributeContent, AttributeHeader, ColorSteps, FieldCoding, MAX_ATTRIBUTES, MAX_INSTANCES,
    MAX_LABELS, MAX_LEVELS, MAX_NAME, PatchModel, PatchesHeader, PointCoding,
};

use crate::attributes::code_scale;
use crate::container::{Family, Features};
use crate::error::Result;
use crate::header::Fields;
use crate::section::{Layout, Promise, StreamSection};

/// Memory that a patch takes at most, with its places in the map of its neighbours.
const BYTES_PER_PATCH: u64 = 4096;

/// Memory that a point takes which no patch holds.
const BYTES_PER_POINT: u64 = 8;

/// Memory that an instance takes beside the numbers of its sources.
const BYTES_PER_INSTANCE: u64 = 80;

/// Largest component of the orientation's quaternion, zigzag-coded.
const MAX_QUATERNION: u32 = 1 << 22;

const GEOMETRY: usize = 0;
const COLOR: usize = 1;
const POINTS: usize = 2;
const INSTANCES: usize = 3;

/// Streams before those of the attributes beside colour.
const FIRST: usize = 4;

/// Least bytes of an attribute in the header: lengths of name and list, type, kind.
const BYTES_PER_ATTRIBUTE: usize = 4;

/// Sections of all streams that there may be: attributes beside colour are `AT00`, `AT01`, ...
const SECTIONS: [StreamSection; FIRST + MAX_ATTRIBUTES] = {
    let mut all = [StreamSection::new(b"GEOM", "geometry"); FIRST + MAX_ATTRIBUTES];
    all[COLOR] = StreamSection::new(b"COLR", "colour");
    all[POINTS] = StreamSection::new(b"PNTS", "extra points");
    all[INSTANCES] = StreamSection::new(b"INST", "instances");
    let mut i = 0;
    while i < MAX_ATTRIBUTES {
        // Two digits: there are at most 16.
        let tag = [b'A', b'T', b'0' + (i / 10) as u8, b'0' + (i % 10) as u8];
        all[FIRST + i] = StreamSection::new(&tag, "attribute");
        i += 1;
    }
    all
};

impl Layout for PatchModel {
    const FAMILY: Family = Family::Patches;
    const FEATURES: Features = Features::LATTICE;
    const OPTIONAL_FEATURES: Features = Features::ATTRIBUTES
        .with(Features::UNBLENDED)
        .with(Features::BESIDE)
        .with(Features::WHOLE_FIELDS)
        .with(Features::ESTIMATES)
        .with(Features::BORDERS)
        .with(Features::FORWARD_BOUND)
        .with(Features::NEAR_POINTS)
        .with(Features::INSTANCES)
        .with(Features::POINT_PATTERNS);
    const STREAM_SECTIONS: &'static [StreamSection] = &SECTIONS;

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

    fn optional_features(header: &PatchesHeader) -> Features {
        let of = |is_there: bool, features| if is_there { features } else { Features::NONE };
        of(!header.attributes.is_empty(), Features::ATTRIBUTES)
            .with(of(header.unblended, Features::UNBLENDED))
            .with(of(header.coding == FieldCoding::Beside, Features::BESIDE))
            .with(of(header.coding == FieldCoding::Whole, Features::WHOLE_FIELDS))
            .with(of(header.coding == FieldCoding::Estimated, Features::ESTIMATES))
            .with(of(header.border.is_some(), Features::BORDERS))
            .with(of(header.max_error_forward.is_some(), Features::FORWARD_BOUND))
            .with(of(header.n_instances > 0, Features::INSTANCES))
            .with(of_points(header))
    }

    fn code_optional<F: Fields>(
        fields: &mut F,
        header: &mut PatchesHeader,
        features: Features,
    ) -> Result<()> {
        header.unblended = features.contains(Features::UNBLENDED);
        let ways = [Features::BESIDE, Features::WHOLE_FIELDS, Features::ESTIMATES];
        header.coding = match ways.map(|way| features.contains(way)) {
            [false, false, false] => FieldCoding::Parents,
            [true, false, false] => FieldCoding::Beside,
            [false, true, false] => FieldCoding::Whole,
            [false, false, true] => FieldCoding::Estimated,
            _ => return Err(fields.corrupt("two ways to code attributes at once".into())),
        };
        header.border =
            features.contains(Features::BORDERS).then(|| header.border.unwrap_or_default());
        let is_near = features.contains(Features::NEAR_POINTS);
        header.point_coding = match features.contains(Features::POINT_PATTERNS) {
            true if is_near => {
                return Err(fields.corrupt("two ways to code points at once".into()));
            }
            true => PointCoding::Patterns,
            false if is_near => PointCoding::Around,
            false => PointCoding::Alone,
        };
        if features.contains(Features::FORWARD_BOUND) {
            let mut bound = header.max_error_forward.unwrap_or_default();
            fields.f64(&mut bound)?;
            header.max_error_forward = Some(bound);
        }
        if features.contains(Features::INSTANCES) {
            let what = "number of instances";
            fields.count(what, &mut header.n_instances, BYTES_PER_INSTANCE)?;
            if header.n_instances > MAX_INSTANCES {
                let what = format!("{} instances, not up to {MAX_INSTANCES}", header.n_instances);
                return Err(fields.corrupt(what));
            }
        }
        if !features.contains(Features::ATTRIBUTES) {
            return Ok(());
        }
        let what = "number of attributes";
        fields.list(what, &mut header.attributes, BYTES_PER_ATTRIBUTE, code_attribute)?;
        match header.attributes.len() <= MAX_ATTRIBUTES {
            true => Ok(()),
            false => Err(fields.corrupt(format!(
                "{} attributes, not up to {MAX_ATTRIBUTES}",
                header.attributes.len()
            ))),
        }
    }

    fn section_content(header: &PatchesHeader, stream: usize) -> String {
        match stream.checked_sub(FIRST).and_then(|i| header.attributes.get(i)) {
            Some(attribute) => format!("attribute {}", attribute.name),
            None => SECTIONS[stream].content.to_owned(),
        }
    }

    fn has_section(header: &PatchesHeader, stream: usize) -> bool {
        match stream {
            GEOMETRY => true,
            COLOR => header.color.is_some(),
            POINTS => header.n_extra > 0,
            INSTANCES => header.n_instances > 0,
            attribute => attribute - FIRST < header.attributes.len(),
        }
    }

    fn promises(header: &PatchesHeader) -> Vec<Promise> {
        vec![
            Promise { stream: GEOMETRY, what: "number of patches", count: header.n_patches },
            Promise { stream: POINTS, what: "number of points", count: header.n_extra },
            Promise { stream: INSTANCES, what: "number of instances", count: header.n_instances },
        ]
    }
}

/// The feature that says how points beside the patches are coded; none without points.
fn of_points(header: &PatchesHeader) -> Features {
    match header.point_coding {
        _ if header.n_extra == 0 => Features::NONE,
        PointCoding::Alone => Features::NONE,
        PointCoding::Around => Features::NEAR_POINTS,
        PointCoding::Patterns => Features::POINT_PATTERNS,
    }
}

/// Writes or reads what the header has of an attribute: name, number of the type, number of labels (0: a scalar), and the
/// labels or the scale.
fn code_attribute<F: Fields>(fields: &mut F, header: &mut AttributeHeader) -> Result<()> {
    fields.text("name of an attribute", &mut header.name, MAX_NAME as u32)?;
    let number = Dtype::ALL.iter().position(|&dtype| dtype == header.dtype);
    let mut number = number.unwrap_or_default() as u32;
    fields.bounded("type of an attribute", &mut number, Dtype::ALL.len() as u32 - 1)?;
    header.dtype = Dtype::ALL[number as usize];
    let (mut scale, mut labels) = match &header.content {
        AttributeContent::Scalar(scale) => (*scale, Vec::new()),
        AttributeContent::Labels(labels) => (ScalarScale::default(), labels.clone()),
    };
    fields.list("number of labels", &mut labels, 1, |fields, label| fields.signed(label))?;
    header.content = match labels.len() {
        0 => {
            code_scale(fields, &mut scale)?;
            AttributeContent::Scalar(scale)
        }
        1..=MAX_LABELS => AttributeContent::Labels(labels),
        n => return Err(fields.corrupt(format!("{n} labels, not up to {MAX_LABELS}"))),
    };
    Ok(())
}

/// 0, -1, 1, -2, 2, ... as 0, 1, 2, 3, 4, ...
fn zigzag(value: i32) -> u32 {
    (value << 1 ^ value >> 31) as u32
}

/// The inverse of [`zigzag`].
fn unzigzag(code: u32) -> i32 {
    (code >> 1) as i32 ^ -((code & 1) as i32)
}
