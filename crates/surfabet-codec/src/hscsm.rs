//! The file of HSCSM: header, poses, masks, dictionaries or their hash, depth and colour or intensity of all levels.

use surfabet_models::hscsm::{
    HscsmDictionary, HscsmHeader, HscsmModel, LevelDictionary, LevelHeader, MAX_ENTRIES,
    MAX_MASK_SCALE, MAX_SPARSITY, QuantizedDictionary,
};

use crate::bytes::ByteWriter;
use crate::container::{Family, Features};
use crate::error::Result;
use crate::hash::ContentHash;
use crate::header::Fields;
use crate::section::{Layout, Promise, StreamSection, Vocabulary};

/// Most levels of a hierarchy.
const MAX_LEVELS: usize = 16;

/// Least bytes of a level in the header: six doubles and four variable-length integers.
const BYTES_PER_LEVEL: usize = 52;

/// Memory that a patch takes at most beside its mask: pose, means and two full codes.
const BYTES_PER_PATCH: u64 = 64 + 2 * 6 * MAX_SPARSITY as u64;

const POSES: usize = 0;
const MASKS: usize = 1;
const DICTIONARIES: usize = 2;
const DEPTH: usize = 3;
const COLOR: usize = 4;

impl Layout for HscsmModel {
    const FAMILY: Family = Family::Patches;
    const FEATURES: Features = Features::NONE;
    const OPTIONAL_FEATURES: Features = Features::ATTRIBUTES.with(Features::HIERARCHY);
    const STREAM_SECTIONS: &'static [StreamSection] = &[
        StreamSection::new(b"POSE", "poses"),
        StreamSection::new(b"MASK", "masks"),
        StreamSection::vocabulary(b"DICT", b"DREF", "dictionaries"),
        StreamSection::new(b"DPTH", "depth"),
        StreamSection::new(b"COLR", "colour"),
    ];

    fn code_header<F: Fields>(fields: &mut F, header: &mut HscsmHeader) -> Result<()> {
        fields.vector(&mut header.origin)?;
        fields.varint(&mut header.n_points)?;
        let levels = &mut header.levels;
        fields.list("number of levels", levels, BYTES_PER_LEVEL, code_level)?;
        match levels.len() <= MAX_LEVELS {
            true => Ok(()),
            false => {
                Err(fields.corrupt(format!("{} levels, not up to {MAX_LEVELS}", levels.len())))
            }
        }
    }

    fn optional_features(header: &HscsmHeader) -> Features {
        let fine = header.levels.iter().any(|l| l.mask_scale > 1);
        let in_common = header.one_dictionary || header.wide_atoms || header.one_plane || fine;
        let of = |has: bool, feature| if has { feature } else { Features::NONE };
        of(header.intensity.is_some(), Features::ATTRIBUTES)
            .with(of(in_common, Features::HIERARCHY))
    }

    fn code_optional<F: Fields>(
        fields: &mut F,
        header: &mut HscsmHeader,
        features: Features,
    ) -> Result<()> {
        if features.contains(Features::HIERARCHY) {
            code_hierarchy(fields, header)?;
        }
        if !features.contains(Features::ATTRIBUTES) {
            return Ok(());
        }
        let limits = header.intensity.get_or_insert_default();
        fields.f64(&mut limits.low)?;
        fields.f64(&mut limits.high)?;
        limits.check().map_err(|what| fields.corrupt(what))
    }

    fn section_content(header: &HscsmHeader, stream: usize) -> String {
        match (stream, header.intensity) {
            (COLOR, Some(_)) => "intensity".to_owned(),
            _ => Self::STREAM_SECTIONS[stream].content.to_owned(),
        }
    }

    /// Every patch takes a decision or more of each stream, and so does every value of a dictionary.
    fn promises(header: &HscsmHeader) -> Vec<Promise> {
        let planes = header.color_planes() as u64;
        let of_level = |(j, level): (usize, &LevelHeader)| {
            let count = level.n_patches as u64;
            let patches = |stream| Promise { stream, what: "number of patches", count };
            let stored = j == 0 || !header.one_dictionary;
            let entries = if !stored {
                0
            } else {
                level.depth_atoms as u64 + planes * level.color_atoms.unwrap_or(0) as u64
            };
            let values = entries * level.area() as u64;
            let what = "values of a dictionary";
            let dictionary = Promise { stream: DICTIONARIES, what, count: values };
            let color = level.color_atoms.map(|_| patches(COLOR));
            [patches(POSES), patches(MASKS), patches(DEPTH), dictionary].into_iter().chain(color)
        };
        header.levels.iter().enumerate().flat_map(of_level).collect()
    }
}

impl Vocabulary for HscsmDictionary {
    /// Its content is written out in `docs/format.md`.
    fn content_hash(&self) -> ContentHash {
        let mut out = ByteWriter::new();
        let bytes = if self.is_wide() { 2 } else { 1 };
        let mut entries = |dictionary: &QuantizedDictionary| -> Vec<u8> {
            dictionary
                .values()
                .iter()
                .flat_map(|v| v.to_le_bytes().into_iter().take(bytes))
                .collect()
        };
        out.varint(self.levels.len() as u64);
        for level in &self.levels {
            out.f64(level.pixel_size);
            out.varint(u64::from(level.pixels));
            out.varint(level.depth.n_atoms() as u64);
            out.varint(level.color.as_ref().map_or(0, |c| c.n_atoms() as u64 + 1));
            out.bytes(&entries(&level.depth));
            out.bytes(&level.color.as_ref().map(&mut entries).unwrap_or_default());
        }
        ContentHash::of(&out.finish())
    }

    fn without_colors(&self) -> Option<Self> {
        if self.levels.iter().all(|level| level.color.is_none()) {
            return None;
        }
        let plain = |level: &LevelDictionary| LevelDictionary { color: None, ..level.clone() };
        Some(Self { levels: self.levels.iter().map(plain).collect() })
    }
}

/// What the feature "hierarchy in common" adds to the header.
fn code_hierarchy<F: Fields>(fields: &mut F, header: &mut HscsmHeader) -> Result<()> {
    let mut dictionaries = u32::from(header.one_dictionary)
        + 2 * u32::from(header.wide_atoms)
        + 4 * u32::from(header.one_plane);
    fields.bounded("kind of dictionaries", &mut dictionaries, 7)?;
    header.one_dictionary = dictionaries & 1 == 1;
    header.wide_atoms = dictionaries & 2 == 2;
    header.one_plane = dictionaries & 4 == 4;
    for level in &mut header.levels {
        let mut doublings = level.mask_scale.ilog2();
        fields.bounded("doublings of a bitmask", &mut doublings, MAX_MASK_SCALE.ilog2())?;
        level.mask_scale = 1 << doublings;
        // Coded again, so that a reader can check it now that its limits are known.
        let mut pixels = (level.n_patches as u64).saturating_mul(level.mask_area() as u64);
        let expected = pixels;
        fields.count("number of mask pixels", &mut pixels, 1)?;
        if pixels != expected {
            return Err(fields.corrupt(format!("{pixels} mask pixels, not {expected}")));
        }
    }
    Ok(())
}

fn code_level<F: Fields>(fields: &mut F, level: &mut LevelHeader) -> Result<()> {
    level.mask_scale = level.mask_scale.max(1);
    fields.f64(&mut level.pixel_size)?;
    fields.bounded("pixels per side of a patch", &mut level.pixels, 32)?;
    if level.pixels < 2 {
        let what = format!("patches of {} pixels per side, not 2 to 32", level.pixels);
        return Err(fields.corrupt(what));
    }
    let steps = &mut level.steps;
    fields.f64(&mut steps.position)?;
    fields.f64(&mut steps.depth_mean)?;
    fields.f64(&mut steps.depth_code)?;
    fields.f64(&mut steps.color_mean)?;
    fields.f64(&mut steps.color_code)?;
    let mut n_patches = level.n_patches as u64;
    let bytes_each = level.area() as u64 + BYTES_PER_PATCH;
    fields.count("number of patches", &mut n_patches, bytes_each)?;
    // Within the limits, which are those of memory.
    level.n_patches = n_patches as usize;
    let mut depth_atoms = level.depth_atoms as u32;
    fields.bounded("entries of a dictionary", &mut depth_atoms, MAX_ENTRIES as u32)?;
    level.depth_atoms = depth_atoms as usize;
    // Zero: no colour; else one more than the entries of its dictionary.
    let mut color_atoms = level.color_atoms.map(|n| n as u32 + 1);
    fields.optional("entries of a dictionary", &mut color_atoms, MAX_ENTRIES as u32 + 1)?;
    level.color_atoms = color_atoms.map(|n| n as usize - 1);
    Ok(())
}
