//! A model of patches in tiles: read as far as it is needed, decoded tile by tile.

use std::any::Any;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::Arc;

use surfabet_codec::{
    ContentHash, Family, Features, FileFrame, Limits, RECIPE, TILE_INDEX, TILES, Tag, TileEntry,
    TileIndex,
};
use surfabet_geom::{CloudParts, PointCloud, Progress};
use surfabet_models::patches::{self, INTENSITIES, PatchModel, PatchesHeader, PatchesReport};
use surfabet_models::{DecodeOptions, Figures, Region, Report, Summary, SurfaceModel};
use surfabet_recognition::Localizer;

use crate::any_model::AnyModel;
use crate::error::{Error, Result};
use crate::save::with_partial;

/// Bytes that are read of a file first: most frames take less.
const START: u64 = 512;

/// A file, or what stands for one, of which parts are read.
pub trait ReadAt {
    /// Bytes of the whole.
    ///
    /// # Errors
    /// Of the system.
    fn size(&mut self) -> io::Result<u64>;

    /// The `len` bytes from `offset` on; fewer where it ends.
    ///
    /// # Errors
    /// Of the system.
    fn read_at(&mut self, offset: u64, len: usize) -> io::Result<Vec<u8>>;
}

impl ReadAt for File {
    fn size(&mut self) -> io::Result<u64> {
        Ok(self.metadata()?.len())
    }

    fn read_at(&mut self, offset: u64, len: usize) -> io::Result<Vec<u8>> {
        self.seek(SeekFrom::Start(offset))?;
        let mut bytes = Vec::with_capacity(len);
        Read::by_ref(self).take(len as u64).read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}

impl ReadAt for &[u8] {
    fn size(&mut self) -> io::Result<u64> {
        Ok(self.len() as u64)
    }

    fn read_at(&mut self, offset: u64, len: usize) -> io::Result<Vec<u8>> {
        let from = usize::try_from(offset).unwrap_or(usize::MAX).min(<[u8]>::len(self));
        Ok(self[from..(from.saturating_add(len)).min(<[u8]>::len(self))].to_vec())
    }
}

/// What of a model in tiles is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Part {
    /// Points in this box; all without one.
    pub region: Option<Region>,
    /// Level of detail, 0 the coarsest; the finest without one.
    pub level: Option<usize>,
}

/// A model of patches in tiles, or a part of one; immutable. Its tiles are decoded when they are asked for.
#[derive(Debug, Clone)]
pub struct TiledModel {
    index: Arc<TileIndex>,
    /// Bytes of the tiles, in the order of the index; `None` for those that were not asked for.
    tiles: Vec<Option<Arc<[u8]>>>,
    part: Part,
    limits: Limits,
    report: PatchesReport,
}

/// True when the file that begins so holds tiles.
///
/// # Errors
/// As [`FileFrame::read`].
pub fn holds_tiles(start: &[u8], limits: &Limits) -> surfabet_codec::Result<bool> {
    let frame = FileFrame::read(start, limits)?;
    Ok(frame.family == Family::Patches && frame.features.contains(Features::TILES))
}

/// The frame at the start of a file.
fn frame_of(file: &mut dyn ReadAt, limits: &Limits) -> Result<FileFrame, OpenError> {
    let size = file.size()?;
    let start = file.read_at(0, size.min(START) as usize)?;
    match FileFrame::read(&start, limits) {
        Err(surfabet_codec::Error::Truncated { .. } | surfabet_codec::Error::TooLarge { .. })
            if size > START =>
        {
            let all = file.read_at(0, size.min(FileFrame::MOST as u64) as usize)?;
            Ok(FileFrame::read(&all, limits)?)
        }
        other => Ok(other?),
    }
}

/// What can go wrong when a source is read that has no name.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The source could not be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It holds no sound model.
    #[error(transparent)]
    Codec(#[from] surfabet_codec::Error),
    /// A parameter is out of its domain.
    #[error(transparent)]
    Model(#[from] surfabet_models::Error),
}

impl TiledModel {
    /// Reads what is wanted of a file with tiles, which need not be trusted: its frame, the index, and the tiles that meet the
    /// region; `None` for a file without tiles.
    ///
    /// # Errors
    /// Of the system, for a file that is not sound, and for a level that it does not have.
    pub fn open(
        file: &mut dyn ReadAt,
        limits: &Limits,
        part: Part,
    ) -> Result<Option<Self>, OpenError> {
        let frame = frame_of(file, limits)?;
        if frame.family != Family::Patches || !frame.features.contains(Features::TILES) {
            return Ok(None);
        }
        frame.expect_only(&[surfabet_codec::META, TILE_INDEX, TILES])?;
        let meta = section(file, &frame, surfabet_codec::META, limits)?;
        let index = section(file, &frame, TILE_INDEX, limits)?;
        let recipe = match frame.sections.iter().any(|section| section.tag == RECIPE) {
            true => Some(section(file, &frame, RECIPE, limits)?),
            false => None,
        };
        let (start, tiles) = frame.require(TILES)?;
        let recipe = recipe.as_deref();
        let index = TileIndex::read(frame.features, &meta, &index, recipe, tiles.len, limits)?;
        let size = file.size()?;
        let end = frame.sections.iter().try_fold(frame.len, |end, s| end.checked_add(s.len));
        if end != Some(size) {
            let (needed, available) = (end.unwrap_or(u64::MAX), size);
            if needed < size {
                let (section, count) = (Tag::HEADER, size - needed);
                return Err(surfabet_codec::Error::TrailingBytes { section, count }.into());
            }
            return Err(
                surfabet_codec::Error::Truncated { section: TILES, needed, available }.into()
            );
        }
        let level = level_of(&index, part.level)?;
        let mut read = vec![None; index.entries.len()];
        let wanted: Vec<usize> = (0..index.entries.len())
            .filter(|&i| {
                let entry = &index.entries[i];
                let of_level =
                    (part.level.is_none() && part.region.is_none()) || entry.level == level;
                of_level && part.region.is_none_or(|region| meets(&index, entry, &region))
            })
            .collect();
        let bytes: u64 = wanted.iter().map(|&i| index.entries[i].len).sum();
        limits.check_size(bytes)?;
        let end_of = |i: usize| index.entries[i].offset + index.entries[i].len;
        for run in wanted.chunk_by(|&a, &b| index.entries[b].offset == end_of(a)) {
            let (Some(&first), Some(&last)) = (run.first(), run.last()) else { continue };
            let from = index.entries[first].offset;
            // Within the section, whose end is within the file.
            let bytes = file.read_at(start + from, (end_of(last) - from) as usize)?;
            for &i in run {
                let TileEntry { offset, len, checksum, .. } = index.entries[i];
                let at = (offset - from) as usize;
                let tile = bytes.get(at..at + len as usize);
                let tile = tile.filter(|tile| surfabet_codec::checksum(tile) == checksum);
                let damaged = surfabet_codec::Error::ChecksumMismatch { section: TILES };
                read[i] = Some(Arc::from(tile.ok_or(damaged)?));
            }
        }
        // With a region the other levels of detail were not read.
        let level = part.level.or(part.region.map(|_| level));
        let part = Part { region: part.region, level };
        let report = PatchesReport::default();
        Ok(Some(Self { index: Arc::new(index), tiles: read, part, limits: *limits, report }))
    }

    /// A model of these tiles, in any order, each with its bytes.
    ///
    /// # Errors
    /// As [`TileIndex::new`].
    pub fn of_tiles(
        header: surfabet_codec::TiledHeader,
        tiles: Vec<(TileEntry, Arc<[u8]>)>,
    ) -> Result<Self> {
        let place = |entry: &TileEntry| (entry.level, entry.cube);
        let entries = tiles.iter().map(|(entry, _)| *entry).collect();
        let index = TileIndex::new(header, entries)?;
        let mut by_place: std::collections::HashMap<_, _> =
            tiles.into_iter().map(|(entry, bytes)| (place(&entry), bytes)).collect();
        let tiles = index.entries.iter().map(|e| by_place.remove(&place(e))).collect();
        let report = PatchesReport::default();
        let limits = Limits::default();
        Ok(Self { index: Arc::new(index), tiles, part: Part::default(), limits, report })
    }

    /// The model of one tile, from its models at the levels of detail of `plan`, coarsest first; the last is there.
    ///
    /// # Errors
    /// As [`TileIndex::new`], also without the last.
    pub fn of_tile(
        plan: &patches::TilePlan,
        cube: [i32; 3],
        models: &[Option<PatchModel>],
    ) -> Result<Self> {
        let last = models.last().and_then(Option::as_ref).map(PatchModel::header);
        let detail = |level: u32| {
            let last = last.clone().unwrap_or_default();
            let (of_detail, _) = plan.of_detail(level, &patches::PatchesOptions::default());
            PatchesHeader {
                n_points: 0,
                lattice: of_detail.lattice,
                n_patches: 0,
                n_extra: 0,
                extra_size: of_detail.lattice.pixel_size,
                max_error: last.max_error.filter(|_| level + 1 == plan.details),
                border: last.border.map(|_| Default::default()),
                ..last
            }
        };
        let details = (0..plan.details).map(detail).collect();
        let header = surfabet_codec::TiledHeader { details, cubes: plan.cubes, recipe: None };
        let of_levels = models.iter().enumerate();
        let tiles = of_levels.filter_map(|(level, model)| {
            let model = model.as_ref()?;
            let bytes = surfabet_codec::write_tile(model);
            let entry = TileEntry {
                len: bytes.len() as u64,
                checksum: surfabet_codec::checksum(&bytes),
                ..header.entry(level, cube, model)
            };
            Some((entry, bytes.into()))
        });
        let tiles = tiles.collect();
        Self::of_tiles(header.renewed(), tiles)
    }

    /// The model with what its tiles were learned by, so that it can be learned on.
    #[must_use]
    pub fn with_recipe(mut self, recipe: patches::Recipe) -> Self {
        Arc::make_mut(&mut self.index).header.recipe = Some(recipe);
        self
    }

    /// Whether the model was read with the tiles of one level of detail alone.
    pub(crate) fn is_of_one_level(&self) -> bool {
        self.part.level.is_some()
    }

    /// All tiles that are here, with their bytes.
    pub(crate) fn held(&self) -> impl Iterator<Item = (TileEntry, Arc<[u8]>)> {
        let all = self.index.entries.iter().zip(&self.tiles);
        all.filter_map(|(entry, tile)| Some((*entry, tile.clone()?)))
    }

    /// The tiles that are here and may decode to points in a region.
    pub(crate) fn held_in(&self, region: &Region) -> impl Iterator<Item = (TileEntry, Arc<[u8]>)> {
        self.held().filter(|(entry, _)| meets(&self.index, entry, region))
    }

    /// The model of a tile from its bytes.
    pub(crate) fn read_tile(&self, entry: &TileEntry, bytes: &[u8]) -> Result<PatchModel> {
        Ok(self.index.read_tile(entry, bytes, &self.limits)?)
    }

    /// What all tiles share.
    pub fn header(&self) -> &surfabet_codec::TiledHeader {
        &self.index.header
    }

    /// The header of the model of the level of detail that is decoded.
    pub fn patches(&self) -> &PatchesHeader {
        &self.index.header.details[self.level()]
    }

    /// The level of detail that is decoded unless another is asked for.
    pub fn level(&self) -> usize {
        self.part.level.unwrap_or(self.index.header.details.len() - 1)
    }

    /// The tiles of a level that are here.
    fn of_level(&self, level: usize) -> impl Iterator<Item = (&TileEntry, &Arc<[u8]>)> {
        let all = self.index.entries.iter().zip(&self.tiles);
        all.filter(move |(entry, _)| entry.level == level)
            .filter_map(|(entry, tile)| tile.as_ref().map(|tile| (entry, tile)))
    }

    /// The patches of all tiles of the level of detail that are here, on the lattice that they share, tile by tile.
    ///
    /// # Errors
    /// As [`TileIndex::read_tile`].
    pub fn leaves(&self) -> Result<Vec<patches::Leaf>> {
        let mut leaves = Vec::new();
        for (entry, bytes) in self.of_level(self.level()) {
            leaves.extend_from_slice(self.read_tile(entry, bytes)?.leaves());
        }
        Ok(leaves)
    }

    /// The tiles of the level of detail that are here.
    pub fn tiles(&self) -> impl Iterator<Item = &TileEntry> {
        self.of_level(self.level()).map(|(entry, _)| entry)
    }

    /// Number of tiles that are here, and that the file has, of all levels of detail: fewer are here of a part.
    pub fn tile_counts(&self) -> (usize, usize) {
        (self.tiles.iter().flatten().count(), self.index.entries.len())
    }

    /// Corners of the box around a tile in world coordinates, metres.
    pub fn tile_bounds(&self, entry: &TileEntry) -> [[f64; 3]; 2] {
        let lattice = self.patches().lattice;
        let rotation = lattice.orientation.rotation();
        let [low, high] = self.index.header.bounds(entry);
        let end = |k: usize, upper: bool| {
            let of = |a: usize| {
                let (x, y) = (rotation[k][a] * low[a], rotation[k][a] * high[a]);
                if upper { x.max(y) } else { x.min(y) }
            };
            lattice.origin[k] + (0..3).map(of).sum::<f64>()
        };
        [false, true].map(|upper| std::array::from_fn(|k| end(k, upper)))
    }

    /// What the model decodes to, of the points in a region and in the one that it was read with, at a level of detail.
    ///
    /// # Errors
    /// As [`AnyModel::decode`]; for a level that the model does not have.
    pub fn decode_part(
        &self,
        part: Part,
        options: DecodeOptions,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        let level = level_of(&self.index, part.level.or(self.part.level))?;
        if self.part.level.is_some_and(|own| own != level) {
            let own = self.part.level.unwrap_or_default();
            let requirement = format!("{own}, the only level of detail that was loaded");
            return Err(surfabet_models::Error::invalid("level", level, requirement).into());
        }
        let regions: Vec<Region> = part.region.into_iter().chain(self.part.region).collect();
        let wanted: Vec<_> = self
            .of_level(level)
            .filter(|(entry, _)| regions.iter().all(|r| meets(&self.index, entry, r)))
            .collect();
        let mut clouds = Vec::new();
        let mut left = options.max_points;
        for (i, (entry, bytes)) in wanted.iter().enumerate() {
            progress.check().map_err(surfabet_models::Error::from)?;
            progress.update("decoding", i as f32 / wanted.len() as f32);
            let tile = self.index.read_tile(entry, bytes, &self.limits)?;
            let options = DecodeOptions { max_points: left, ..options };
            let cloud = match regions.first() {
                Some(region) => {
                    SurfaceModel::decode_within(&tile, region, options, &Quiet(progress))
                }
                None => tile.decode(options, &Quiet(progress)),
            };
            let cloud = match regions.get(1) {
                Some(second) => cloud.and_then(|all| second.crop(&all)),
                None => cloud,
            };
            let cloud = cloud.map_err(|error| self.whole(error, options.max_points, left))?;
            left = left.saturating_sub(cloud.len() as u64);
            clouds.push(cloud);
        }
        progress.update("decoding", 1.0);
        if clouds.is_empty() {
            clouds.push(self.nothing(options)?);
        }
        Ok(PointCloud::concat(&clouds).0)
    }

    /// The error of a tile as one of the model: limits are those of all tiles together.
    fn whole(
        &self,
        error: surfabet_models::Error,
        limit: u64,
        left: u64,
    ) -> surfabet_models::Error {
        match error {
            surfabet_models::Error::TooManyPoints { resolution, points, .. } => {
                let points = points.saturating_add(limit - left);
                surfabet_models::Error::TooManyPoints { resolution, points, limit }
            }
            other => other,
        }
    }

    /// A cloud without points, with the columns that others have.
    fn nothing(&self, options: DecodeOptions) -> Result<PointCloud> {
        let header = self.patches();
        let mut parts = CloudParts {
            origin: header.lattice.origin,
            colors: header.color.map(|_| Vec::new()),
            normals: options.normals.then(Vec::new),
            ..CloudParts::default()
        };
        for attribute in &header.attributes {
            if attribute.name == INTENSITIES {
                parts.intensities = Some(Vec::new());
            } else {
                let column = attribute.dtype.column_of_integers(std::iter::empty());
                parts.extra.push((attribute.name.clone(), column));
            }
        }
        Ok(PointCloud::from_parts(parts)?.0)
    }

    /// Writes the file, an existing one replaced only when the new one is complete; `note` is a line for people. Returns its
    /// size.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file.
    pub fn save(&self, path: &Path, note: &str) -> Result<u64> {
        let kept = self.kept()?;
        let (head, tail) = kept.index.frame(note)?;
        with_partial(path, |file| {
            file.write_all(&head)?;
            kept.tiles.iter().flatten().try_for_each(|tile| file.write_all(tile))?;
            file.write_all(&tail)
        })
    }

    /// The model with an index of the tiles that are here alone.
    fn kept(&self) -> Result<Self> {
        let kept = Self::of_tiles(self.index.header.clone(), self.held().collect())?;
        Ok(Self { part: self.part, limits: self.limits, ..kept })
    }
}

/// Stops when the other does, but shows no progress: a tile does not know its share of the whole.
pub(crate) struct Quiet<'a>(pub &'a dyn Progress);

impl Progress for Quiet<'_> {
    fn update(&self, _: &'static str, _: f32) {}

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

/// The bytes of a section, checked.
fn section(
    file: &mut dyn ReadAt,
    frame: &FileFrame,
    tag: Tag,
    limits: &Limits,
) -> Result<Vec<u8>, OpenError> {
    let (offset, entry) = frame.require(tag)?;
    limits.check_size(entry.len)?;
    let available = file.size()?.saturating_sub(offset);
    if entry.len > available {
        let needed = entry.len;
        return Err(surfabet_codec::Error::Truncated { section: tag, needed, available }.into());
    }
    let bytes = file.read_at(offset, entry.len as usize)?;
    if surfabet_codec::checksum(&bytes) != entry.checksum {
        return Err(surfabet_codec::Error::ChecksumMismatch { section: tag }.into());
    }
    Ok(bytes)
}

/// The level of detail that was asked for, or the finest.
fn level_of(index: &TileIndex, level: Option<usize>) -> surfabet_models::Result<usize> {
    let n = index.header.details.len();
    match level {
        None => Ok(n - 1),
        Some(level) if level < n => Ok(level),
        Some(level) => {
            let requirement = format!("from 0 to {}, the levels of detail of the file", n - 1);
            Err(surfabet_models::Error::invalid("level", level, requirement))
        }
    }
}

/// Whether a tile may decode to points in a region.
fn meets(index: &TileIndex, entry: &TileEntry, region: &Region) -> bool {
    let lattice = &index.header.details[entry.level].lattice;
    region.meets(lattice.origin, lattice.orientation.rotation(), index.header.bounds(entry))
}

/// Models are equal when their tiles are.
impl PartialEq for TiledModel {
    fn eq(&self, other: &Self) -> bool {
        self.index == other.index && self.tiles == other.tiles && self.part == other.part
    }
}

impl AnyModel for TiledModel {
    fn method(&self) -> &'static str {
        PatchModel::METHOD
    }

    fn to_bytes(&self) -> Result<Vec<u8>> {
        let kept = self.kept()?;
        let (mut bytes, _) = kept.index.frame("")?;
        kept.tiles.iter().flatten().for_each(|tile| bytes.extend_from_slice(tile));
        Ok(bytes)
    }

    fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        self.decode_part(Part::default(), options, progress)
    }

    fn decode_within(
        &self,
        region: &Region,
        options: DecodeOptions,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        let part = Part { region: Some(*region), level: None };
        self.decode_part(part, options, progress)
    }

    fn localizer(&self, progress: &dyn Progress) -> Result<Localizer> {
        let decode = |options: DecodeOptions| match self.decode(options, progress) {
            Ok(cloud) => Ok(cloud),
            Err(Error::Model(error)) => Err(error),
            Err(other) => Err(surfabet_models::Error::Inconsistent(other.to_string())),
        };
        Ok(Localizer::of_decoded(decode, progress)?)
    }

    fn report(&self) -> &Report<dyn Figures> {
        &self.report
    }

    fn summary(&self) -> Summary {
        let header = &self.index.header;
        let patches = self.patches();
        let side = f64::from(header.cubes.side)
            * header.details.last().map_or(0.0, |last| last.lattice.pixel_size);
        let mut summary = Summary::default()
            .with("tiles", self.tiles().count())
            .with("side of a tile (m)", side)
            .with("levels of detail", header.details.len());
        for (level, detail) in header.details.iter().enumerate() {
            let tiles = self.of_level(level);
            let bytes: u64 = tiles.map(|(entry, _)| entry.len).sum();
            summary = summary
                .with(format!("level {level}: resolution (m)"), detail.lattice.pixel_size)
                .with(format!("level {level}: bytes"), bytes);
        }
        summary = summary.with("colour", patches.color.is_some()).with("patches", self.n_parts());
        for attribute in &patches.attributes {
            summary = summary.with(format!("attribute {}", attribute.name), attribute.in_words());
        }
        match patches.max_error {
            Some(bound) => summary.with("max error (m)", bound),
            None => summary,
        }
    }

    fn vocabulary_hash(&self) -> Option<ContentHash> {
        None
    }

    fn shares_vocabulary(&self) -> bool {
        false
    }

    fn keeps_thickness(&self) -> bool {
        PatchModel::KEEPS_THICKNESS
    }

    fn n_parts(&self) -> usize {
        let patches = |(_, bytes): (_, &Arc<[u8]>)| surfabet_codec::patches_of_tile(bytes);
        self.of_level(self.level()).map(patches).sum::<u64>() as usize
    }

    fn n_points(&self) -> u64 {
        self.tiles().map(|entry| entry.n_points).sum()
    }

    fn origin(&self) -> [f64; 3] {
        self.patches().lattice.origin
    }

    fn has_color(&self) -> bool {
        self.patches().color.is_some()
    }

    fn equals(&self, other: &dyn AnyModel) -> bool {
        other.as_any().downcast_ref::<Self>().is_some_and(|other| self == other)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
