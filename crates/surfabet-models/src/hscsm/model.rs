//! The model M(H, D_depth, D_rgb, I) of section III, in the integers that a file stores.
//!
//! Everything is quantised when it is learned, so a model decodes to the same cloud before it is saved and after
//! it is read back.

use surfabet_entropy::Coder;
use surfabet_geom::morton::encode_wide;
use surfabet_geom::octahedral;

use super::channels::dictionary::{HscsmDictionary, LevelDictionary, QuantizedDictionary};
use super::coding::{Streams, code_hscsm};
use super::frame::{NORMAL_BITS, PatchPose};
use super::intensity::IntensityLimits;
use super::order;
use super::report::HscsmReport;
use crate::error::{Error, Result};
use crate::report::Beside;

/// Largest absolute lattice coordinate of a patch centre.
pub const MAX_POSITION: i32 = 1 << 28;

/// Most dictionary entries in one patch's code.
pub const MAX_SPARSITY: usize = 64;

/// Most entries of a dictionary.
pub const MAX_ENTRIES: usize = 1 << 16;

/// Most mask pixels per side of a pixel, for [`super::MAX_LEVELS`] levels.
pub const MAX_MASK_SCALE: u32 = 1 << 7;

/// Mask pixels of a patch of `pixels` x `pixels` pixels.
pub(super) fn mask_area(pixels: u32, mask_scale: u32) -> usize {
    let side = (pixels * mask_scale) as usize;
    side * side
}

/// What the integers of a level are multiplied with.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Steps {
    /// Lattice of patch centres, metres.
    pub position: f64,
    /// Mean depth of a patch, metres.
    pub depth_mean: f64,
    /// Coefficients of the depth dictionary's unit-norm entries, metres.
    pub depth_code: f64,
    /// Mean colour of a patch, 0..255.
    pub color_mean: f64,
    /// Coefficients of the colour dictionary's unit-norm entries, 0..255.
    pub color_code: f64,
}

/// Sparse codes c of all patches of a level: for each patch, which dictionary entries and how much of each.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Codes {
    /// Entries of patch i are `offsets[i]..offsets[i + 1]` of the other two columns; one more than patches.
    pub offsets: Vec<u32>,
    /// Dictionary entry, growing within a patch.
    pub atoms: Vec<u16>,
    /// Coefficient λ in steps, never zero.
    pub coefficients: Vec<i32>,
}

impl Codes {
    /// Dictionary entries and coefficients of patch `i`.
    pub fn of(&self, i: usize) -> (&[u16], &[i32]) {
        let range = self.offsets[i] as usize..self.offsets[i + 1] as usize;
        (&self.atoms[range.clone()], &self.coefficients[range])
    }

    fn check(&self, patches: usize, dictionary: &QuantizedDictionary) -> Result<(), String> {
        let used = self.atoms.len();
        if self.offsets.len() != patches + 1
            || self.offsets.first() != Some(&0)
            || self.offsets.last().map(|&o| o as usize) != Some(used)
            || self.coefficients.len() != used
            || self.offsets.windows(2).any(|w| w[0] > w[1])
        {
            return Err(format!("codes of {patches} patches do not line up"));
        }
        if let Some(w) = self.offsets.windows(2).find(|w| (w[1] - w[0]) as usize > MAX_SPARSITY) {
            return Err(format!("a code of {} entries, more than {MAX_SPARSITY}", w[1] - w[0]));
        }
        let n_atoms = dictionary.n_atoms();
        if let Some(w) = self.offsets.windows(2).find(|w| (w[1] - w[0]) as usize > n_atoms) {
            return Err(format!("a code of {} in {n_atoms} entries", w[1] - w[0]));
        }
        match self.atoms.iter().find(|&&a| usize::from(a) >= n_atoms) {
            Some(atom) => Err(format!("a code uses entry {atom} of a dictionary of {n_atoms}")),
            None => Ok(()),
        }
    }
}

/// One channel of a level: its dictionary, and mean and code of every patch.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Channel {
    /// Entries shared by all patches of the level.
    pub dictionary: QuantizedDictionary,
    /// Mean of each patch in steps: one value for depth; luma, orange and green chroma for colour, or grey.
    pub means: Vec<i32>,
    /// Sparse code of what remains.
    pub codes: Codes,
}

impl Channel {
    fn check(&self, name: &str, patches: usize, area: usize, planes: usize) -> Result<(), String> {
        if self.means.len() != patches * planes {
            return Err(format!("{} {name} means for {patches} patches", self.means.len()));
        }
        if self.dictionary.n_features() != area * planes {
            return Err(format!(
                "{name} dictionary entries have {} values, patches have {}",
                self.dictionary.n_features(),
                area * planes
            ));
        }
        self.codes.check(patches, &self.dictionary).map_err(|e| format!("{name} {e}"))
    }
}

/// All patches of one size and pixel size (h = (ps, pr), section III).
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Side of a pixel (pr), metres.
    pub pixel_size: f64,
    /// Pixels per side of a patch, so that ps = `pixels` times `pixel_size`.
    pub pixels: u32,
    /// Quantiser steps.
    pub steps: Steps,
    /// Pose T of each patch.
    pub poses: Vec<PatchPose>,
    /// Mask pixels per side of a pixel: 1, or a power of two where bitmasks are finer than images.
    pub mask_scale: u32,
    /// Bitmask b of each patch, row-major, 1 where a mask pixel is set; one byte per mask pixel.
    pub masks: Vec<u8>,
    /// Depth along the normal.
    pub depth: Channel,
    /// Red, green and blue, where the cloud had colours, or grey of its intensities.
    pub color: Option<Channel>,
}

impl Level {
    /// Number of patches.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// True without patches.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Pixels of a patch.
    pub fn area(&self) -> usize {
        (self.pixels * self.pixels) as usize
    }

    /// Side of a mask pixel, metres.
    pub fn mask_pixel(&self) -> f64 {
        self.pixel_size / f64::from(self.mask_scale)
    }

    /// Bitmask of patch `i`.
    pub fn mask(&self, i: usize) -> &[u8] {
        let area = mask_area(self.pixels, self.mask_scale);
        &self.masks[i * area..(i + 1) * area]
    }

    /// Number of set mask pixels.
    pub fn set_pixels(&self) -> usize {
        self.masks.iter().filter(|&&m| m != 0).count()
    }

    /// Area that set mask pixels cover, square metres of their patches' planes.
    pub fn covered_area(&self) -> f64 {
        self.set_pixels() as f64 * self.mask_pixel() * self.mask_pixel()
    }

    /// Planes of a colour image: three, or one of grey.
    pub fn color_planes(&self) -> usize {
        let grey = |c: &Channel| c.dictionary.n_features() == self.area();
        if self.color.as_ref().is_some_and(grey) { 1 } else { 3 }
    }

    /// True when a value of its dictionaries has more than 8 bits.
    fn has_wide_atoms(&self) -> bool {
        let color = self.color.as_ref().is_some_and(|c| c.dictionary.is_wide());
        self.depth.dictionary.is_wide() || color
    }

    /// The header of this level in the file.
    pub fn header(&self) -> LevelHeader {
        LevelHeader {
            pixel_size: self.pixel_size,
            pixels: self.pixels,
            steps: self.steps,
            mask_scale: self.mask_scale,
            n_patches: self.len(),
            depth_atoms: self.depth.dictionary.n_atoms(),
            color_atoms: self.color.as_ref().map(|c| c.dictionary.n_atoms()),
        }
    }

    fn check(&self) -> Result<(), String> {
        let header = self.header();
        header.check()?;
        let (n, area) = (self.len(), self.area());
        if self.masks.len() != n * mask_area(self.pixels, self.mask_scale) {
            return Err(format!("{} mask pixels for {n} patches", self.masks.len()));
        }
        if let Some(p) = self
            .poses
            .iter()
            .flat_map(|p| p.position)
            .find(|c| !(-MAX_POSITION..=MAX_POSITION).contains(c))
        {
            return Err(format!("a patch centre at lattice coordinate {p} is out of range"));
        }
        let half = octahedral::half(NORMAL_BITS) as u16;
        if self.poses.iter().flat_map(|p| p.normal).any(|c| c.unsigned_abs() > half) {
            return Err(format!("a normal's code is beyond {half}"));
        }
        let (_, cells) = order::cells(&self.poses, header.steps_per_cell());
        if !cells.is_sorted_by_key(|&cell| encode_wide(cell)) {
            return Err("patches are not in the Morton order of their cells".to_owned());
        }
        self.depth.check("depth", n, area, 1)?;
        self.color.as_ref().map_or(Ok(()), |c| c.check("colour", n, area, self.color_planes()))
    }
}

/// The header of a level in the file.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LevelHeader {
    /// Side of a pixel (pr), metres.
    pub pixel_size: f64,
    /// Pixels per side of a patch, 2 to 32.
    pub pixels: u32,
    /// Quantiser steps.
    pub steps: Steps,
    /// Mask pixels per side of a pixel.
    pub mask_scale: u32,
    /// Number of patches.
    pub n_patches: usize,
    /// Entries of the depth dictionary.
    pub depth_atoms: usize,
    /// Entries of the colour dictionary, where there are colours or intensities.
    pub color_atoms: Option<usize>,
}

impl LevelHeader {
    /// Pixels of a patch.
    pub fn area(&self) -> usize {
        (self.pixels * self.pixels) as usize
    }

    /// Mask pixels of a patch.
    pub fn mask_area(&self) -> usize {
        mask_area(self.pixels, self.mask_scale)
    }

    /// Position steps per side of the cells that order the patches.
    pub(super) fn steps_per_cell(&self) -> i32 {
        order::steps_per_cell(self.pixel_size, self.pixels, self.steps.position)
    }

    /// Checks that all numbers are in their domains.
    fn check(&self) -> Result<(), String> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let steps = self.steps;
        let all = [
            ("pixel size", self.pixel_size),
            ("position step", steps.position),
            ("depth mean step", steps.depth_mean),
            ("depth code step", steps.depth_code),
            ("colour mean step", steps.color_mean),
            ("colour code step", steps.color_code),
        ];
        if let Some((name, value)) = all.iter().find(|(_, v)| !positive(*v)) {
            return Err(format!("{name} is {value}, but must be positive"));
        }
        if !(2..=32).contains(&self.pixels) {
            return Err(format!("patches of {} pixels per side, not 2 to 32", self.pixels));
        }
        if !self.mask_scale.is_power_of_two() || self.mask_scale > MAX_MASK_SCALE {
            let scale = self.mask_scale;
            return Err(format!(
                "{scale} mask pixels per pixel, no power of two up to {MAX_MASK_SCALE}"
            ));
        }
        let most = self.depth_atoms.max(self.color_atoms.unwrap_or(0));
        if most > MAX_ENTRIES {
            return Err(format!("a dictionary of {most} entries, more than {MAX_ENTRIES}"));
        }
        Ok(())
    }
}

/// The header of a model in the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HscsmHeader {
    /// World position that poses are relative to, metres.
    pub origin: [f64; 3],
    /// Points of the cloud that the model was learned from.
    pub n_points: u64,
    /// The levels, coarsest first.
    pub levels: Vec<LevelHeader>,
    /// What grey stands for, where the colour images are intensities.
    pub intensity: Option<IntensityLimits>,
    /// True when all levels have the same dictionaries, which a file then holds once.
    pub one_dictionary: bool,
    /// True when values of dictionaries have up to 16 bits instead of 8.
    pub wide_atoms: bool,
    /// True when colour images have one plane, of grey.
    pub one_plane: bool,
}

impl HscsmHeader {
    /// Planes of a colour image.
    pub fn color_planes(&self) -> usize {
        if self.one_plane { 1 } else { 3 }
    }

    /// Checks that all numbers are in their domains.
    fn check(&self) -> Result<()> {
        check_origin(self.origin)?;
        let sizes = |l: &LevelHeader| (l.pixels, l.depth_atoms, l.color_atoms);
        if self.one_dictionary && self.levels.windows(2).any(|w| sizes(&w[0]) != sizes(&w[1])) {
            return Err(Error::Inconsistent("one dictionary, and levels that differ".to_owned()));
        }
        for (j, level) in self.levels.iter().enumerate() {
            level.check().map_err(|e| Error::Inconsistent(format!("level {j}: {e}")))?;
        }
        check_intensity(self.intensity, self.levels.iter().map(|l| l.color_atoms.is_some()))
    }
}

/// Checks the limits of intensities; `has_images`: whether each level has colour images, which then show them.
fn check_intensity(
    limits: Option<IntensityLimits>,
    mut has_images: impl Iterator<Item = bool>,
) -> Result<()> {
    let Some(limits) = limits else { return Ok(()) };
    limits.check().map_err(Error::Inconsistent)?;
    match has_images.all(|has| has) {
        true => Ok(()),
        false => Err(Error::Inconsistent("intensities, and a level without images".to_owned())),
    }
}

fn check_origin(origin: [f64; 3]) -> Result<()> {
    if origin.iter().any(|c| !c.is_finite()) {
        return Err(Error::Inconsistent(format!("origin {origin:?} is not finite")));
    }
    Ok(())
}

/// What a [`HscsmModel`] is made of, before it is checked.
#[derive(Debug, Clone, PartialEq)]
pub struct HscsmModelParts {
    /// World position that poses are relative to, metres.
    pub origin: [f64; 3],
    /// Points of the cloud that the model was learned from.
    pub n_points: u64,
    /// The hierarchy H, coarsest level first.
    pub levels: Vec<Level>,
    /// What grey stands for, where the colour images are intensities.
    pub intensity: Option<IntensityLimits>,
    /// True when the dictionaries are those of another model, which a file then refers to.
    pub shares_vocabulary: bool,
    /// True when all levels have the same dictionaries, which a file then holds once.
    pub one_dictionary: bool,
}

/// A cloud as sparse-coded surface patches; immutable.
#[derive(Debug, Clone, PartialEq)]
pub struct HscsmModel {
    parts: HscsmModelParts,
    report: Beside<HscsmReport>,
}

impl HscsmModel {
    /// Checks that the parts fit together.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] naming the first contradiction.
    pub fn from_parts(parts: HscsmModelParts) -> Result<Self> {
        check_origin(parts.origin)?;
        for (j, level) in parts.levels.iter().enumerate() {
            level.check().map_err(|e| Error::Inconsistent(format!("level {j}: {e}")))?;
        }
        check_intensity(parts.intensity, parts.levels.iter().map(|l| l.color.is_some()))?;
        let planes = parts.levels.first().map_or(3, Level::color_planes);
        if parts.levels.iter().any(|l| l.color_planes() != planes) {
            return Err(Error::Inconsistent("levels of one and of three planes".to_owned()));
        }
        if planes == 1 && parts.intensity.is_none() {
            return Err(Error::Inconsistent("colours of one plane".to_owned()));
        }
        let entries = |l: &Level| {
            let color = l.color.as_ref().map(|c| c.dictionary.clone());
            (l.pixels, l.depth.dictionary.clone(), color)
        };
        let differ = |w: &[Level]| entries(&w[0]) != entries(&w[1]);
        if parts.one_dictionary && parts.levels.windows(2).any(differ) {
            let what = "one dictionary for all levels, and levels that have another";
            return Err(Error::Inconsistent(what.to_owned()));
        }
        Ok(Self { parts, report: Beside::default() })
    }

    pub(super) fn with_report(mut self, report: HscsmReport) -> Self {
        self.report = Beside(report);
        self
    }

    /// The header in the file, before the streams.
    pub fn header(&self) -> HscsmHeader {
        HscsmHeader {
            origin: self.origin(),
            n_points: self.n_points(),
            levels: self.levels().iter().map(Level::header).collect(),
            intensity: self.intensity(),
            one_dictionary: self.one_dictionary(),
            one_plane: self.one_plane(),
            wide_atoms: self.levels().iter().any(Level::has_wide_atoms),
        }
    }

    /// Writes the streams.
    ///
    /// # Errors
    /// Those of the coders.
    pub(super) fn write<C: Coder>(&self, streams: &mut Streams<'_, C>) -> Result<(), C::Error> {
        let shared = self.shares_vocabulary().then(|| self.dictionary());
        code_hscsm(streams, &self.header(), shared.as_ref(), Some(self.levels()))?;
        Ok(())
    }

    /// Reads the streams that [`HscsmModel::write`] wrote; `shared` are the dictionaries of a file that does not
    /// hold its own.
    ///
    /// # Errors
    /// Those of the coders, also for a header or content that no model has.
    pub(super) fn read<C: Coder>(
        header: &HscsmHeader,
        shared: Option<&HscsmDictionary>,
        streams: &mut Streams<'_, C>,
    ) -> Result<Self, C::Error> {
        header.check().map_err(|e| streams.poses.corrupt(e.to_string()))?;
        let parts = HscsmModelParts {
            origin: header.origin,
            n_points: header.n_points,
            levels: code_hscsm(streams, header, shared, None)?,
            intensity: header.intensity,
            shares_vocabulary: shared.is_some(),
            one_dictionary: header.one_dictionary,
        };
        Self::from_parts(parts).map_err(|e| streams.poses.corrupt(e.to_string()))
    }

    /// World position that poses are relative to, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.parts.origin
    }

    /// Points of the cloud that the model was learned from.
    pub fn n_points(&self) -> u64 {
        self.parts.n_points
    }

    /// The hierarchy H, coarsest level first.
    pub fn levels(&self) -> &[Level] {
        &self.parts.levels
    }

    /// True when the dictionaries are those of another model, which a file then refers to.
    pub fn shares_vocabulary(&self) -> bool {
        self.parts.shares_vocabulary
    }

    /// True when all levels have the same dictionaries, which a file then holds once.
    pub fn one_dictionary(&self) -> bool {
        self.parts.one_dictionary
    }

    /// True when colour images have one plane, of grey.
    fn one_plane(&self) -> bool {
        self.levels().first().is_some_and(|l| l.color_planes() == 1)
    }

    /// The dictionaries of all levels.
    pub fn dictionary(&self) -> HscsmDictionary {
        let level = |l: &Level| LevelDictionary {
            pixel_size: l.pixel_size,
            pixels: l.pixels,
            depth: l.depth.dictionary.clone(),
            color: l.color.as_ref().map(|c| c.dictionary.clone()),
        };
        HscsmDictionary { levels: self.levels().iter().map(level).collect() }
    }

    /// Number of patches over all levels.
    pub fn len(&self) -> usize {
        self.parts.levels.iter().map(Level::len).sum()
    }

    /// True without patches.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// True when the patches carry colour.
    pub fn has_color(&self) -> bool {
        !self.has_intensity() && self.parts.levels.iter().any(|l| l.color.is_some())
    }

    /// True when the patches carry intensities, in the place of colours.
    pub fn has_intensity(&self) -> bool {
        self.parts.intensity.is_some()
    }

    /// The intensities that grey levels 0 and 255 stand for; `None` without intensities.
    pub fn intensity(&self) -> Option<IntensityLimits> {
        self.parts.intensity
    }

    /// How the model was learned; empty for a model read from a file.
    pub fn report(&self) -> &HscsmReport {
        &self.report.0
    }
}
