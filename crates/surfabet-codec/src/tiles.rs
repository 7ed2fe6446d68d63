//! Files of patches in tiles: what all share, an index, and the tiles, each of which is read alone.
//!
//! Byte by byte in `docs/format.md`, section 5.7.

use surfabet_geom::morton;
use surfabet_models::patches::{
    Border, Cubes, PatchModel, PatchesHeader, PointCoding, Recipe, Views,
};
use surfabet_models::{Budget, Sensor, Source, SurfaceModel};

use crate::bytes::{ByteReader, ByteWriter};
use crate::container::{Container, ContainerWriter, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::{Error, Result};
use crate::header::{FieldReader, FieldWriter, Fields, META};
use crate::note::NOTE;
use crate::section::{FileSummary, Layout, Promise, code_all, features};

/// Tag of the index.
pub const TILE_INDEX: Tag = Tag::new(b"TIDX");

/// Tag of the tiles.
pub const TILES: Tag = Tag::new(b"TILE");

/// Tag of what tiles were learned by; readers that only decode may skip it.
pub const RECIPE: Tag = Tag::new(b"plan");

/// Most levels of detail.
pub const MAX_DETAILS: usize = 8;

/// Least bytes of a tile in the index: place, points, bytes, checksum, box.
const BYTES_PER_ENTRY: usize = 13;

/// Least bytes of the header of a level of detail.
const BYTES_PER_DETAIL: usize = 50;

/// Largest coordinate of a cube: their pixels fit the lattice.
const MAX_CUBE: i64 = (1 << 20) - 1;

/// Largest side of a cube, finest pixels.
const MAX_SIDE: u32 = 1 << 20;

/// What all tiles share.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TiledHeader {
    /// The headers of the models of each level of detail, coarsest first; counts are sums over the tiles of the level.
    pub details: Vec<PatchesHeader>,
    /// The cubes, in finest pixels of the last level of detail.
    pub cubes: Cubes,
    /// What tiles were learned by, where the map can be learned on.
    pub recipe: Option<Recipe>,
}

/// A tile in the index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileEntry {
    /// Level of detail, 0 the coarsest.
    pub level: usize,
    /// Which cube it is.
    pub cube: [i32; 3],
    /// Points that it was learned from.
    pub n_points: u64,
    /// Lower corner of the box that it decodes to, in squares of its coarsest patches from the lower corner of the cube.
    pub low: [i32; 3],
    /// Sides of that box.
    pub extent: [u32; 3],
    /// Place of its bytes in the section of the tiles.
    pub offset: u64,
    /// Number of its bytes.
    pub len: u64,
    /// Checksum of its bytes.
    pub checksum: u32,
}

impl TiledHeader {
    /// Finest pixels of a level of detail along the side of a cube, as a factor: pixels of the last level per pixel.
    pub fn factor(&self, level: usize) -> f64 {
        let pixel = |header: &PatchesHeader| header.lattice.pixel_size;
        match self.details.last() {
            Some(last) => pixel(&self.details[level]) / pixel(last),
            None => 1.0,
        }
    }

    /// Whether tiles say how their points are coded.
    pub fn is_renewed(&self) -> bool {
        self.details.iter().any(|detail| detail.point_coding == PointCoding::Patterns)
    }

    /// For tiles of which some are learned by this version: each says how its points are coded, and some may be of an older map.
    #[must_use]
    pub fn renewed(mut self) -> Self {
        self.details.iter_mut().for_each(|detail| detail.point_coding = PointCoding::Patterns);
        self
    }

    /// The cube of a tile in finest pixels of its level of detail.
    fn border(&self, entry: &TileEntry) -> Border {
        let factor = self.factor(entry.level);
        let Border { low, side } = self.cubes.border(entry.cube);
        let scaled = |c: i64| (c as f64 / factor).round() as i64;
        Border { low: low.map(scaled), side: scaled(side) }
    }

    /// A tile's place in an index, still without its bytes: the cube, the points and the box of a model.
    pub fn entry(&self, level: usize, cube: [i32; 3], model: &PatchModel) -> TileEntry {
        let square = f64::from(model.lattice().tile_pixels());
        let factor = self.factor(level);
        let corner = self.cubes.corner(cube).map(|c| c as f64 / factor);
        let [low, high] = model.bounds().unwrap_or([corner; 2]);
        let squares = |c: f64, a: usize| (c - corner[a]) / square;
        let low: [i32; 3] = std::array::from_fn(|a| squares(low[a], a).floor() as i32);
        let extent = std::array::from_fn(|a| {
            (squares(high[a], a).ceil() - f64::from(low[a])).max(0.0) as u32
        });
        let n_points = model.n_points();
        TileEntry { level, cube, n_points, low, extent, offset: 0, len: 0, checksum: 0 }
    }

    /// The box of a tile, metres along the axes of the lattice from its zero.
    pub fn bounds(&self, entry: &TileEntry) -> [[f64; 3]; 2] {
        let lattice = &self.details[entry.level].lattice;
        let square = f64::from(lattice.tile_pixels()) * lattice.pixel_size;
        let last = self.details.last().map_or(0.0, |header| header.lattice.pixel_size);
        let corner = self.cubes.corner(entry.cube).map(|c| c as f64 * last);
        let low: [f64; 3] = std::array::from_fn(|a| corner[a] + f64::from(entry.low[a]) * square);
        [low, std::array::from_fn(|a| low[a] + f64::from(entry.extent[a]) * square)]
    }

    /// Writes or reads the fields.
    fn code<F: Fields>(&mut self, fields: &mut F, features: Features) -> Result<()> {
        let optional = features.without(Features::LATTICE.with(Features::TILES));
        fields.list(
            "number of levels of detail",
            &mut self.details,
            BYTES_PER_DETAIL,
            |f, h| code_all::<PatchModel, _>(f, h, optional),
        )?;
        let mut side = self.cubes.side as u32;
        fields.bounded("side of a tile", &mut side, MAX_SIDE)?;
        self.cubes.side = side as i32;
        for c in &mut self.cubes.offset {
            let mut at = *c as u32;
            fields.bounded("corner of the tiles", &mut at, side)?;
            *c = at as i32;
        }
        Ok(())
    }

    /// What no file has.
    fn check(&self) -> Result<()> {
        let fail = |what: String| Err(Error::corrupt(META, 0, what));
        let n = self.details.len();
        if !(1..=MAX_DETAILS).contains(&n) {
            return fail(format!("{n} levels of detail, not 1 to {MAX_DETAILS}"));
        }
        let last = &self.details[n - 1].lattice;
        let square = last.tile_pixels();
        if self.cubes.side < square || self.cubes.side % square != 0 {
            let side = self.cubes.side;
            return fail(format!("tiles of {side} pixels with squares of {square}"));
        }
        for (level, header) in self.details.iter().enumerate() {
            let lattice = &header.lattice;
            if let Err(what) = lattice.check() {
                return fail(what.to_string());
            }
            let same = lattice.origin == last.origin && lattice.orientation == last.orientation;
            let factor = self.factor(level);
            if !same || !(1.0..=1e6).contains(&factor) {
                return fail(format!("level of detail {level} has another frame than the last"));
            }
            if header.n_patches > 0 || header.n_extra > 0 {
                return fail("numbers of patches in the place of those of the tiles".into());
            }
            if header.n_instances > 0 {
                return fail("instances in a map of tiles".into());
            }
            let other = |a: &PatchesHeader| (a.color.is_some(), a.unblended, a.coding);
            let first = &self.details[0];
            if other(header) != other(first) || header.attributes != first.attributes {
                return fail(format!(
                    "level of detail {level} has other attributes than the first"
                ));
            }
        }
        Ok(())
    }

    /// Features that a file with this header needs.
    fn features(&self) -> Features {
        let of = |header| features::<PatchModel>(header, false);
        let all = self.details.iter().map(of).fold(Features::TILES, Features::with);
        // The headers have no points, so that these features are not among theirs.
        match self.is_renewed() {
            true => all.with(Features::POINT_PATTERNS),
            false => all,
        }
    }
}

/// Writes or reads what tiles were learned by.
fn code_recipe<F: Fields>(fields: &mut F, recipe: &mut Recipe) -> Result<()> {
    fields.f64(&mut recipe.density)?;
    fields.f64(&mut recipe.tolerance)?;
    let mut gap = recipe.layer_gap.unwrap_or(0.0);
    fields.f64(&mut gap)?;
    recipe.layer_gap = (gap != 0.0).then_some(gap);
    let views = [Views::None, Views::Viewpoints, Views::Normals];
    recipe.views = one_of(fields, "kind of views", recipe.views, &views)?;
    let sensors = [Sensor::StructuredLight, Sensor::Constant];
    recipe.sensor = one_of(fields, "kind of sensor", recipe.sensor, &sensors)?;
    fields.f64(&mut recipe.rate)?;
    fields.f64(&mut recipe.completeness)?;
    fields.f64(&mut recipe.color_rate)?;
    fields.f64(&mut recipe.attribute_rate)?;
    fields.bounded("number of rounds", &mut recipe.rounds, u32::MAX)
}

/// Writes or reads the number of one of some values.
fn one_of<F: Fields, T: Copy + PartialEq>(
    fields: &mut F,
    what: &'static str,
    value: T,
    all: &[T],
) -> Result<T> {
    let mut number = all.iter().position(|other| *other == value).unwrap_or(0) as u32;
    fields.bounded(what, &mut number, all.len() as u32 - 1)?;
    // `bounded` has checked it.
    Ok(all.get(number as usize).copied().unwrap_or(value))
}

/// The bytes of a tile: numbers of patches and points beside them, lengths of the streams, streams.
pub fn write_tile(model: &PatchModel) -> Vec<u8> {
    let header = model.header();
    let mut streams = vec![Encoder::new(); PatchModel::STREAMS];
    let Ok(_) = PatchModel::code(Source::Model(model), &mut streams);
    let mut bytes = ByteWriter::new();
    bytes.varint(header.n_patches);
    bytes.varint(header.n_extra);
    if header.n_extra > 0 {
        // A size below zero says that the points are coded by patterns.
        let has_patterns = header.point_coding == PointCoding::Patterns;
        bytes.f64(if has_patterns { -header.extra_size } else { header.extra_size });
    }
    let present = |i: &usize| PatchModel::has_section(&header, *i);
    let streams: Vec<Vec<u8>> = streams
        .into_iter()
        .enumerate()
        .filter(|(i, _)| present(i))
        .map(|(_, stream)| stream.finish())
        .collect();
    streams.iter().for_each(|stream| bytes.varint(stream.len() as u64));
    streams.iter().for_each(|stream| bytes.bytes(stream));
    bytes.finish()
}

/// What a file holds but for the tiles themselves.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TileIndex {
    /// What all tiles share.
    pub header: TiledHeader,
    /// All tiles, level by level, then along a space-filling curve: the order of their bytes.
    pub entries: Vec<TileEntry>,
}

impl TileIndex {
    /// The index of these tiles, in any order; their bytes follow one another in the order of the index.
    ///
    /// # Errors
    /// [`Error::Corrupt`] for a header that no file has, two tiles of one level at one place, and places out of range.
    pub fn new(header: TiledHeader, mut entries: Vec<TileEntry>) -> Result<Self> {
        header.check()?;
        let range = |e: &TileEntry| e.cube.iter().all(|&c| i64::from(c).abs() <= MAX_CUBE);
        if let Some(entry) = entries.iter().find(|e| !range(e) || e.level >= header.details.len()) {
            let what =
                format!("a tile of level {} at {:?} is out of range", entry.level, entry.cube);
            return Err(Error::corrupt(TILE_INDEX, 0, what));
        }
        let lows: Vec<[i32; 3]> =
            (0..header.details.len()).map(|level| lowest(&entries, level)).collect();
        let place = |e: &TileEntry| (e.level, key(e.cube, lows[e.level]));
        entries.sort_by_key(place);
        if let Some(pair) = entries.windows(2).find(|pair| place(&pair[0]) == place(&pair[1])) {
            let what = format!("two tiles at {:?}", pair[0].cube);
            return Err(Error::corrupt(TILE_INDEX, 0, what));
        }
        let mut offset = 0;
        for entry in &mut entries {
            entry.offset = offset;
            offset += entry.len;
        }
        let mut index = Self { header, entries };
        let mut counted = index.header.clone();
        index.count(&mut counted);
        index.header = counted;
        Ok(index)
    }

    /// Bytes of all tiles.
    pub fn tile_bytes(&self) -> u64 {
        self.entries.iter().map(|entry| entry.len).sum()
    }

    /// The bytes that stand in a file before the tiles, which follow in the order of the index; with a note, also those that
    /// stand behind them.
    ///
    /// # Errors
    /// As [`ContainerWriter::finish`].
    pub fn frame(&self, note: &str) -> Result<(Vec<u8>, Vec<u8>)> {
        let features = self.header.features();
        let mut header = self.header.clone();
        let mut meta = FieldWriter::default();
        header.code(&mut meta, features)?;
        let sum = |sum: u32, e: &TileEntry| crc32c::crc32c_combine(sum, e.checksum, e.len as usize);
        let checksum = self.entries.iter().fold(crc32c::crc32c(&[]), sum);
        let mut writer = ContainerWriter::new(PatchModel::FAMILY, features)
            .section(META, meta.bytes.finish())
            .section(TILE_INDEX, self.write());
        if let Some(mut recipe) = header.recipe {
            let mut fields = FieldWriter::default();
            code_recipe(&mut fields, &mut recipe)?;
            writer = writer.section(RECIPE, fields.bytes.finish());
        }
        writer = writer.section_elsewhere(TILES, self.tile_bytes(), checksum);
        let note = note.as_bytes().to_vec();
        if !note.is_empty() {
            writer = writer.section(NOTE, note.clone());
        }
        let mut head = writer.finish()?;
        head.truncate(head.len() - note.len());
        Ok((head, note))
    }

    /// Sets the counts of points to those of the tiles.
    fn count(&self, header: &mut TiledHeader) {
        for (level, detail) in header.details.iter_mut().enumerate() {
            let of_level = self.entries.iter().filter(|entry| entry.level == level);
            detail.n_points = of_level.map(|entry| entry.n_points).sum();
        }
    }

    fn write(&self) -> Vec<u8> {
        let mut bytes = ByteWriter::new();
        for level in 0..self.header.details.len() {
            let entries = || self.entries.iter().filter(|entry| entry.level == level);
            let low = lowest(&self.entries, level);
            bytes.varint(entries().count() as u64);
            low.iter().for_each(|&c| bytes.signed_varint(i64::from(c)));
            let mut next = 0;
            for entry in entries() {
                let place = key(entry.cube, low);
                bytes.varint(place - next);
                next = place + 1;
                bytes.varint(entry.n_points);
                bytes.varint(entry.len);
                bytes.u32(entry.checksum);
                entry.low.iter().for_each(|&c| bytes.signed_varint(i64::from(c)));
                entry.extent.iter().for_each(|&c| bytes.varint(u64::from(c)));
            }
        }
        bytes.finish()
    }

    /// Reads `META`, the index and what tiles were learned by, where that is there, of a file with `features`, whose tiles have
    /// `tile_bytes` in all.
    ///
    /// # Errors
    /// Any error of reading; nothing is trusted.
    pub fn read(
        features: Features,
        meta: &[u8],
        index: &[u8],
        recipe: Option<&[u8]>,
        tile_bytes: u64,
        limits: &Limits,
    ) -> Result<Self> {
        let mut fields = FieldReader::new(meta, *limits);
        let mut header = TiledHeader::default();
        header.code(&mut fields, features)?;
        fields.finish()?;
        header.check()?;
        if let Some(bytes) = recipe {
            let mut fields = FieldReader::new(bytes, *limits);
            let mut recipe = Recipe::default();
            code_recipe(&mut fields, &mut recipe)?;
            fields.finish()?;
            recipe.check().map_err(|what| Error::corrupt(RECIPE, 0, what.to_string()))?;
            header.recipe = Some(recipe);
        }
        if features != header.features() {
            let names: Vec<&str> = features.names().collect();
            let what = format!("the features {names:?} do not go together with these tiles");
            return Err(Error::corrupt(META, 0, what));
        }
        let mut bytes = ByteReader::new(TILE_INDEX, index);
        let mut entries = Vec::new();
        let mut offset = 0_u64;
        for level in 0..header.details.len() {
            read_level(&mut bytes, level, &mut entries, &mut offset)?;
        }
        bytes.finish()?;
        if offset != tile_bytes {
            let what = format!("tiles of {offset} bytes in a section of {tile_bytes}");
            return Err(Error::corrupt(TILE_INDEX, 0, what));
        }
        let read = Self { header, entries };
        let mut counted = read.header.clone();
        read.count(&mut counted);
        if counted != read.header {
            return Err(Error::corrupt(TILE_INDEX, 0, "points of tiles do not add up"));
        }
        Ok(read)
    }

    /// Checks the bytes of a tile and reads it.
    ///
    /// # Errors
    /// Any error of reading; nothing is trusted.
    pub fn read_tile(
        &self,
        entry: &TileEntry,
        bytes: &[u8],
        limits: &Limits,
    ) -> Result<PatchModel> {
        if bytes.len() as u64 != entry.len || crc32c::crc32c(bytes) != entry.checksum {
            return Err(Error::ChecksumMismatch { section: TILES });
        }
        let mut reader = ByteReader::new(TILES, bytes);
        let mut header = self.header.details[entry.level].clone();
        header.n_points = entry.n_points;
        header.border = header.border.map(|_| self.header.border(entry));
        header.n_patches = reader.varint()?;
        header.n_extra = reader.varint()?;
        let of_map = header.point_coding;
        header.point_coding = PointCoding::Around;
        if header.n_extra > 0 {
            header.extra_size = reader.f64()?;
            if of_map == PointCoding::Patterns && header.extra_size < 0.0 {
                header.extra_size = -header.extra_size;
                header.point_coding = PointCoding::Patterns;
            }
        }
        let of_tile = PatchModel::STREAM_SECTIONS.iter().enumerate();
        let lengths = of_tile.map(|(i, _)| match PatchModel::has_section(&header, i) {
            true => reader.varint(),
            false => Ok(0),
        });
        let lengths: Vec<u64> = lengths.collect::<Result<_>>()?;
        let mut streams = Vec::with_capacity(PatchModel::STREAMS);
        for (section, len) in PatchModel::STREAM_SECTIONS.iter().zip(lengths) {
            let len = usize::try_from(len).unwrap_or(usize::MAX);
            streams.push(Decoder::new(section.tag, reader.bytes(len)?));
        }
        reader.finish()?;
        for Promise { stream, what, count } in PatchModel::promises(&header) {
            limits.check(what, count, 1)?;
            streams[stream].check_count(what, count)?;
        }
        let budget = Budget { items: limits.max_items, bytes: limits.max_bytes };
        let source = Source::Streams { header: &header, vocabulary: None, budget };
        let model = PatchModel::code(source, &mut streams)?;
        for stream in streams {
            stream.finish()?;
        }
        model.ok_or_else(|| Error::corrupt(TILES, 0, "nothing was read"))
    }
}

/// The checksum of some bytes, as the index has it.
pub fn checksum(bytes: &[u8]) -> u32 {
    crc32c::crc32c(bytes)
}

/// Number of patches that the bytes of a tile begin with; 0 for bytes that do not.
pub fn patches_of_tile(bytes: &[u8]) -> u64 {
    ByteReader::new(TILES, bytes).varint().unwrap_or(0)
}

/// What a file with tiles holds; `None` for one without.
///
/// # Errors
/// For a header or an index that no file has.
pub fn inspect_tiles(container: &Container<'_>) -> Result<Option<FileSummary>> {
    if !container.features().contains(Features::TILES) {
        return Ok(None);
    }
    let limits = Limits { max_items: u64::MAX, max_bytes: u64::MAX };
    let (meta, tiles) = (container.require(META)?, container.require(TILES)?);
    let recipe = container.sections().iter().find(|s| s.tag == RECIPE).map(|s| s.bytes);
    let index = container.require(TILE_INDEX)?;
    let n_bytes = tiles.len() as u64;
    let index = TileIndex::read(container.features(), meta, index, recipe, n_bytes, &limits)?;
    let name = |tag: Tag| match tag {
        META => "header".to_owned(),
        TILE_INDEX => "index of the tiles".to_owned(),
        RECIPE => "how tiles are learned".to_owned(),
        NOTE => "note".to_owned(),
        other => other.to_string(),
    };
    let mut sections = Vec::new();
    for section in container.sections() {
        if section.tag != TILES {
            sections.push((name(section.tag), section.bytes.len()));
            continue;
        }
        let n = index.header.details.len();
        for level in 0..n {
            let of_level = index.entries.iter().filter(|entry| entry.level == level);
            let bytes = of_level.map(|entry| entry.len).sum::<u64>() as usize;
            let tiles = if n == 1 { "tiles".to_owned() } else { format!("tiles of level {level}") };
            sections.push((tiles, bytes));
        }
    }
    Ok(Some(FileSummary { method: PatchModel::METHOD, vocabulary: None, sections }))
}

/// Reads the tiles of a level of detail; `offset` is the place of the next tile's bytes.
fn read_level(
    bytes: &mut ByteReader<'_>,
    level: usize,
    entries: &mut Vec<TileEntry>,
    offset: &mut u64,
) -> Result<()> {
    let n = bytes.count("number of tiles", BYTES_PER_ENTRY)?;
    let mut low = [0_i64; 3];
    for c in &mut low {
        *c = bytes.signed_varint()?;
        if c.abs() > MAX_CUBE {
            return Err(bytes.corrupt(format!("a tile at {c} is out of range")));
        }
    }
    let mut next = 0_u64;
    entries.reserve(n);
    for _ in 0..n {
        let place = bytes.varint()?.checked_add(next).filter(|&p| p < 1 << 63);
        let place = place.ok_or_else(|| bytes.corrupt("a tile beyond the last place"))?;
        next = place + 1;
        let at = morton::decode(place);
        let cube = std::array::from_fn(|a| low[a] + at[a] as i64);
        if cube.iter().any(|c: &i64| c.abs() > MAX_CUBE) {
            return Err(bytes.corrupt(format!("a tile at {cube:?} is out of range")));
        }
        let (n_points, len, checksum) = (bytes.varint()?, bytes.varint()?, bytes.u32()?);
        let mut entry = TileEntry {
            level,
            cube: cube.map(|c| c as i32),
            n_points,
            low: [0; 3],
            extent: [0; 3],
            offset: *offset,
            len,
            checksum,
        };
        for c in &mut entry.low {
            let read = bytes.signed_varint()?;
            *c = i32::try_from(read).map_err(|_| bytes.corrupt(format!("a box from {read}")))?;
        }
        for c in &mut entry.extent {
            *c = bytes.bounded("side of a box", u64::from(u32::MAX))? as u32;
        }
        let end = offset.checked_add(len);
        *offset = end.ok_or_else(|| bytes.corrupt("tiles of more than 2^64 bytes"))?;
        entries.push(entry);
    }
    Ok(())
}

/// The least coordinates of the cubes of a level; zero without any.
fn lowest(entries: &[TileEntry], level: usize) -> [i32; 3] {
    let of_level = || entries.iter().filter(|entry| entry.level == level);
    std::array::from_fn(|a| of_level().map(|e| e.cube[a]).min().unwrap_or(0))
}

/// Place of a cube along the curve, counted from `low`.
fn key(cube: [i32; 3], low: [i32; 3]) -> u64 {
    morton::encode(std::array::from_fn(|a| (i64::from(cube[a]) - i64::from(low[a])) as u64))
}
