//! The sections of the family "patches": poses, masks, dictionaries, depth and colour of all levels.
//!
//! Patches come in Morton order of the cells of one patch size that their centres lie in, so a patch follows a
//! neighbour, and most of what is stored is the difference to it. Byte by byte in `docs/format.md`.

use surfabet_geom::morton::encode_wide;
use surfabet_models::hscsm::order::{self, steps_per_cell};
use surfabet_models::hscsm::{
    Channel, Codes, HscsmDictionary, HscsmModel, HscsmModelParts, Level, MAX_POSITION,
    MAX_SPARSITY, PatchPose, QuantizedDictionary, Steps,
};

use crate::bytes::{ByteReader, ByteWriter};
use crate::container::{Container, ContainerWriter, Family, Features, Limits, Tag};
use crate::entropy::{Decoder, Encoder};
use crate::error::{Error, Result};
use crate::hash::ContentHash;
use crate::models::{Bit, SInt, Symbols, UInt};

const META: Tag = Tag::new(b"META");
const POSES: Tag = Tag::new(b"POSE");
const MASKS: Tag = Tag::new(b"MASK");
const DICTIONARIES: Tag = Tag::new(b"DICT");
const DICTIONARY_HASH: Tag = Tag::new(b"DREF");
const DEPTH: Tag = Tag::new(b"DPTH");
const COLOR: Tag = Tag::new(b"COLR");

/// Bits of the height of the octree over patch centres.
const HEIGHT_BITS: u32 = 6;

/// Most levels of a hierarchy.
const MAX_LEVELS: u64 = 16;

/// Memory that a patch takes at most beside its mask: pose, means and two full codes.
const BYTES_PER_PATCH: u64 = 64 + 2 * 6 * MAX_SPARSITY as u64;

/// The bytes of a file that holds `model`.
///
/// # Errors
/// As [`ContainerWriter::finish`].
pub fn write(model: &HscsmModel) -> Result<Vec<u8>> {
    let mut poses = Encoder::new();
    let mut masks = Encoder::new();
    let mut dictionaries = Encoder::new();
    let mut depth = Encoder::new();
    let mut color = Encoder::new();
    for level in model.levels() {
        write_poses(&mut poses, level)?;
        write_masks(&mut masks, level);
        write_dictionary(&mut dictionaries, &level.depth.dictionary);
        write_channel(&mut depth, &level.depth, 1)?;
        if let Some(channel) = &level.color {
            write_dictionary(&mut dictionaries, &channel.dictionary);
            write_channel(&mut color, channel, 3)?;
        }
    }
    let (features, dictionary) = if model.shares_dictionary() {
        let hash = dictionary_hash(&model.dictionary());
        (Features::SHARED_DICTIONARY, (DICTIONARY_HASH, hash.0.to_vec()))
    } else {
        (Features::NONE, (DICTIONARIES, dictionaries.finish()))
    };
    ContainerWriter::new(Family::Patches, features)
        .section(META, write_meta(model))
        .section(POSES, poses.finish())
        .section(MASKS, masks.finish())
        .section(dictionary.0, dictionary.1)
        .section(DEPTH, depth.finish())
        .section(COLOR, color.finish())
        .finish()
}

/// The hash by which files name a dictionary; its content is written out in `docs/format.md`.
pub fn dictionary_hash(dictionary: &HscsmDictionary) -> ContentHash {
    let mut out = ByteWriter::new();
    let mut entries = |dictionary: &QuantizedDictionary| -> Vec<u8> {
        dictionary.values().iter().map(|v| v.to_le_bytes()[0]).collect()
    };
    out.varint(dictionary.levels.len() as u64);
    for level in &dictionary.levels {
        out.f64(level.pixel_size);
        out.varint(u64::from(level.pixels));
        out.varint(level.depth.n_atoms() as u64);
        out.varint(level.color.as_ref().map_or(0, |c| c.n_atoms() as u64 + 1));
        out.bytes(&entries(&level.depth));
        out.bytes(&level.color.as_ref().map(&mut entries).unwrap_or_default());
    }
    ContentHash::of(&out.finish())
}

/// The dictionary that a file refers to; `None` when it holds its own.
///
/// # Errors
/// When the file says that it refers to one, and does not.
pub fn shared_dictionary(container: &Container<'_>) -> Result<Option<ContentHash>> {
    ContentHash::named_by(container, DICTIONARY_HASH)
}

/// The model that a parsed file holds. `dictionary` is what a file without dictionaries of its own was made
/// with; other files do not look at it.
///
/// # Errors
/// Any error of reading: the content is checked like the container was. [`Error::MissingDictionary`] and
/// [`Error::DictionaryMismatch`] when the file refers to a dictionary, and none or another is given.
pub fn read(
    container: &Container<'_>,
    limits: &Limits,
    dictionary: Option<&HscsmDictionary>,
) -> Result<HscsmModel> {
    container.expect_family(Family::Patches)?;
    let shared = shared_dictionary(container)?;
    let shared = shared.map(|h| h.of_given(dictionary, dictionary_hash)).transpose()?;
    let stored = if shared.is_some() { DICTIONARY_HASH } else { DICTIONARIES };
    container.expect_only(&[META, POSES, MASKS, stored, DEPTH, COLOR])?;
    let stream = |tag| container.require(tag).map(|bytes| Decoder::new(tag, bytes));
    let mut poses = stream(POSES)?;
    let mut masks = stream(MASKS)?;
    let mut dictionaries = match shared {
        None => Some(stream(DICTIONARIES)?),
        Some(_) => None,
    };
    let mut depth = stream(DEPTH)?;
    let mut color = stream(COLOR)?;
    let meta = read_meta(container.require(META)?, limits)?;
    let mut levels = Vec::with_capacity(meta.levels.len());
    for (j, of) in meta.levels.iter().enumerate() {
        let area = (of.pixels * of.pixels) as usize;
        let level = shared.and_then(|dictionary| dictionary.levels.get(j));
        // A stored dictionary or that of the same level of the shared one, which must have the size that the file
        // says.
        let mut entries = |n_features, n_atoms, shared: Option<&QuantizedDictionary>| {
            if let Some(stream) = &mut dictionaries {
                return read_dictionary(stream, n_features, n_atoms);
            }
            let fits =
                |d: &&QuantizedDictionary| d.n_features() == n_features && d.n_atoms() == n_atoms;
            shared.filter(fits).cloned().ok_or_else(|| {
                let what = format!("level {j} is not one of the dictionary that the file names");
                Error::corrupt(META, 0, what)
            })
        };
        let depth_dictionary = entries(area, of.depth_atoms, level.map(|l| &l.depth))?;
        let depth = read_channel(&mut depth, depth_dictionary, of.patches, 1)?;
        let color = match of.color_atoms {
            None => None,
            Some(atoms) => {
                let shared = level.and_then(|l| l.color.as_ref());
                let dictionary = entries(3 * area, atoms, shared)?;
                Some(read_channel(&mut color, dictionary, of.patches, 3)?)
            }
        };
        levels.push(Level {
            pixel_size: of.pixel_size,
            pixels: of.pixels,
            steps: of.steps,
            poses: read_poses(&mut poses, of)?,
            masks: read_masks(&mut masks, of)?,
            depth,
            color,
        });
    }
    for stream in [poses, masks, depth, color].into_iter().chain(dictionaries) {
        stream.finish()?;
    }
    let parts = HscsmModelParts {
        origin: meta.origin,
        n_points: meta.n_points,
        levels,
        shared_dictionary: shared.is_some(),
    };
    HscsmModel::from_parts(parts).map_err(|e| Error::corrupt(META, 0, e.to_string()))
}

/// What the header says of a level.
struct LevelMeta {
    pixel_size: f64,
    pixels: u32,
    steps: Steps,
    patches: usize,
    depth_atoms: usize,
    color_atoms: Option<usize>,
}

struct Meta {
    origin: [f64; 3],
    n_points: u64,
    levels: Vec<LevelMeta>,
}

fn write_meta(model: &HscsmModel) -> Vec<u8> {
    let mut out = ByteWriter::new();
    model.origin().iter().for_each(|&c| out.f64(c));
    out.varint(model.n_points());
    out.varint(model.levels().len() as u64);
    for level in model.levels() {
        out.f64(level.pixel_size);
        out.varint(u64::from(level.pixels));
        let Steps { position, depth_mean, depth_code, color_mean, color_code } = level.steps;
        for step in [position, depth_mean, depth_code, color_mean, color_code] {
            out.f64(step);
        }
        out.varint(level.len() as u64);
        out.varint(level.depth.dictionary.n_atoms() as u64);
        // Zero: no colour; else one more than the entries of its dictionary.
        let color = level.color.as_ref().map_or(0, |c| c.dictionary.n_atoms() as u64 + 1);
        out.varint(color);
    }
    out.finish()
}

fn read_meta(bytes: &[u8], limits: &Limits) -> Result<Meta> {
    let mut input = ByteReader::new(META, bytes);
    let origin = [input.f64()?, input.f64()?, input.f64()?];
    let n_points = input.varint()?;
    let n_levels = input.bounded("number of levels", MAX_LEVELS)?;
    let mut levels = Vec::with_capacity(n_levels);
    for _ in 0..n_levels {
        let pixel_size = input.f64()?;
        let pixels = input.bounded("pixels per side of a patch", 32)? as u32;
        if pixels < 2 {
            return Err(input.corrupt(format!("patches of {pixels} pixels per side, not 2 to 32")));
        }
        let steps = Steps {
            position: input.f64()?,
            depth_mean: input.f64()?,
            depth_code: input.f64()?,
            color_mean: input.f64()?,
            color_code: input.f64()?,
        };
        let area = u64::from(pixels * pixels);
        let patches = limits.check("number of patches", input.varint()?, area + BYTES_PER_PATCH)?;
        let depth_atoms = input.bounded("entries of a dictionary", 65_536)?;
        let color_atoms = input.bounded("entries of a dictionary", 65_537)?.checked_sub(1);
        levels.push(LevelMeta { pixel_size, pixels, steps, patches, depth_atoms, color_atoms });
    }
    input.finish()?;
    Ok(Meta { origin, n_points, levels })
}

/// Octree over the cells of patch centres: how often each of the eight children is occupied, by depth above the
/// leaves, child and number of occupied children before it.
struct OctreeModels(Vec<Bit>);

impl OctreeModels {
    const DEPTHS: usize = 3;

    fn new() -> Self {
        Self(vec![Bit::new(); Self::DEPTHS * 64])
    }

    fn child(&mut self, height: u32, child: usize, occupied: usize) -> &mut Bit {
        let depth = (height as usize).min(Self::DEPTHS) - 1;
        // `occupied` counts earlier children, of which there are at most seven.
        &mut self.0[depth * 64 + child * 8 + occupied]
    }
}

/// How the poses within a cell are coded.
struct PoseModels {
    /// Difference of each coordinate to the previous patch's, modulo the cell.
    offset: [Symbols; 3],
    /// Difference of each coordinate of the normal's code to the previous patch's.
    normal: [SInt; 2],
}

impl PoseModels {
    fn new(steps_per_cell: i32) -> Result<Self> {
        let symbols = || Symbols::new(steps_per_cell as u32);
        Ok(Self {
            offset: [symbols()?, symbols()?, symbols()?],
            normal: [SInt::new(), SInt::new()],
        })
    }
}

fn write_poses(out: &mut Encoder, level: &Level) -> Result<()> {
    if level.is_empty() {
        return Ok(());
    }
    let side = steps_per_cell(level.pixel_size, level.pixels, level.steps.position);
    let (low, cells) = order::cells(&level.poses, side);
    let span = cells.iter().flatten().copied().fold(0, u32::max);
    let height = u32::BITS - span.leading_zeros();
    let mut corner = SInt::new();
    low.iter().for_each(|&c| out.sint(&mut corner, c));
    out.bypass(u64::from(height), HEIGHT_BITS);

    let mut keys: Vec<u128> = Vec::new();
    let mut counts: Vec<u32> = Vec::new();
    for key in cells.iter().map(|&c| encode_wide(c)) {
        match (keys.last(), counts.last_mut()) {
            (Some(last), Some(count)) if *last == key => *count += 1,
            (Some(last), _) if *last > key => {
                let requirement = "the Morton order of their cells";
                return Err(Error::invalid("order of patches", "another", requirement));
            }
            _ => {
                keys.push(key);
                counts.push(1);
            }
        }
    }
    let mut octree = OctreeModels::new();
    write_octree(out, &mut octree, &keys, height);

    let mut count = UInt::new();
    let mut models = PoseModels::new(side)?;
    let mut poses = level.poses.iter();
    let mut previous = PatchPose::default();
    for n in counts {
        out.uint(&mut count, n - 1);
        for pose in poses.by_ref().take(n as usize) {
            for a in 0..3 {
                let difference = i64::from(pose.position[a]) - i64::from(previous.position[a]);
                let within_cell = difference.rem_euclid(i64::from(side)) as u32;
                out.symbol(&mut models.offset[a], within_cell);
            }
            for a in 0..2 {
                let difference = i32::from(pose.normal[a]) - i32::from(previous.normal[a]);
                out.sint(&mut models.normal[a], difference);
            }
            previous = *pose;
        }
    }
    Ok(())
}

/// Writes which children hold any of the sorted `keys`, depth first.
fn write_octree(out: &mut Encoder, models: &mut OctreeModels, keys: &[u128], height: u32) {
    if height == 0 {
        return;
    }
    let shift = 3 * (height - 1);
    let child_of = |key: u128| (key >> shift) as usize & 7;
    let mut occupied = 0;
    let mut rest = keys;
    for child in 0..8 {
        let here = rest.partition_point(|&key| child_of(key) == child);
        // The last child of a node without others is certain.
        if child < 7 || occupied > 0 {
            out.bit(models.child(height, child, occupied), here > 0);
        }
        if here > 0 {
            occupied += 1;
            write_octree(out, models, &rest[..here], height - 1);
        }
        rest = &rest[here..];
    }
}

fn read_poses(input: &mut Decoder<'_>, level: &LevelMeta) -> Result<Vec<PatchPose>> {
    if level.patches == 0 {
        return Ok(Vec::new());
    }
    input.check_count("number of patches", level.patches as u64)?;
    let side = steps_per_cell(level.pixel_size, level.pixels, level.steps.position);
    let mut corner = SInt::new();
    let mut low = [0; 3];
    for c in &mut low {
        *c = input.sint(&mut corner)?;
    }
    let height = input.bypass(HEIGHT_BITS)? as u32;
    let limit = MAX_POSITION / side + 2;
    if height > 30 || low.iter().any(|c| c.abs() > limit) {
        return Err(input.corrupt(format!("cells from {low:?} over 2^{height} are out of range")));
    }
    let mut octree = OctreeModels::new();
    let mut cells = Vec::new();
    read_octree(input, &mut octree, &mut cells, [0; 3], height, level.patches)?;

    let mut count = UInt::new();
    let mut models = PoseModels::new(side)?;
    let mut poses = Vec::with_capacity(level.patches);
    let mut previous = PatchPose::default();
    for cell in cells {
        let n = u64::from(input.uint(&mut count)?) + 1;
        if n > (level.patches - poses.len()) as u64 {
            return Err(input.corrupt(format!("more poses than {} patches", level.patches)));
        }
        for _ in 0..n {
            let mut pose = PatchPose::default();
            for a in 0..3 {
                let difference = input.symbol(&mut models.offset[a])? as i32;
                let predicted = previous.position[a].rem_euclid(side);
                let offset = (predicted + difference).rem_euclid(side);
                // Cells are below 2^30 and within MAX_POSITION / side + 2 + 2^30 of zero; i64 holds them.
                let at =
                    (i64::from(low[a]) + i64::from(cell[a])) * i64::from(side) + i64::from(offset);
                pose.position[a] = i32::try_from(at)
                    .ok()
                    .filter(|c| c.abs() <= MAX_POSITION)
                    .ok_or_else(|| input.corrupt(format!("a patch centre at {at} steps")))?;
            }
            for a in 0..2 {
                let difference = input.sint(&mut models.normal[a])?;
                let code = i64::from(previous.normal[a]) + i64::from(difference);
                pose.normal[a] = i16::try_from(code)
                    .map_err(|_| input.corrupt(format!("a normal's code of {code}")))?;
            }
            poses.push(pose);
            previous = pose;
        }
    }
    if poses.len() == level.patches {
        Ok(poses)
    } else {
        Err(input.corrupt(format!("{} poses for {} patches", poses.len(), level.patches)))
    }
}

fn read_octree(
    input: &mut Decoder<'_>,
    models: &mut OctreeModels,
    cells: &mut Vec<[i32; 3]>,
    corner: [i32; 3],
    height: u32,
    limit: usize,
) -> Result<()> {
    if height == 0 {
        if cells.len() == limit {
            return Err(input.corrupt(format!("more occupied cells than {limit} patches")));
        }
        cells.push(corner);
        return Ok(());
    }
    let mut occupied = 0;
    for child in 0..8_usize {
        let certain = child == 7 && occupied == 0;
        if certain || input.bit(models.child(height, child, occupied))? {
            occupied += 1;
            let corner =
                std::array::from_fn(|a| corner[a] | ((child >> a & 1) as i32) << (height - 1));
            read_octree(input, models, cells, corner, height - 1, limit)?;
        }
    }
    Ok(())
}

/// Models of mask pixels, by six neighbours coded before and whether the pixel is in the first row or column.
struct MaskModels {
    full: Bit,
    pixel: Vec<Bit>,
}

impl MaskModels {
    fn new() -> Self {
        Self { full: Bit::new(), pixel: vec![Bit::with_memory(Bit::MAX_MEMORY); 256] }
    }

    /// The model of the pixel after those in `before`, row-major.
    fn at(&mut self, before: &[u8], n: usize) -> &mut Bit {
        let (row, column) = ((before.len() / n) as i32, (before.len() % n) as i32);
        let pixel = |dy: i32, dx: i32| {
            let (y, x) = (row - dy, column + dx);
            let inside = y >= 0 && (0..n as i32).contains(&x);
            // Rows above and pixels to the left are in `before`.
            usize::from(inside && before[y as usize * n + x as usize] != 0)
        };
        let mut context = usize::from(row == 0) | usize::from(column == 0) << 1;
        for (dy, dx) in [(0, -1), (1, 0), (1, -1), (1, 1), (0, -2), (2, 0)] {
            context = context << 1 | pixel(dy, dx);
        }
        &mut self.pixel[context]
    }
}

fn write_masks(out: &mut Encoder, level: &Level) {
    let mut models = MaskModels::new();
    for i in 0..level.len() {
        let mask = level.mask(i);
        let full = mask.iter().all(|&m| m != 0);
        out.bit(&mut models.full, full);
        if !full {
            for at in 0..mask.len() {
                out.bit(models.at(&mask[..at], level.pixels as usize), mask[at] != 0);
            }
        }
    }
}

fn read_masks(input: &mut Decoder<'_>, level: &LevelMeta) -> Result<Vec<u8>> {
    let area = (level.pixels * level.pixels) as usize;
    input.check_count("number of patches", level.patches as u64)?;
    let mut models = MaskModels::new();
    let mut masks = Vec::with_capacity(level.patches * area);
    for _ in 0..level.patches {
        if input.bit(&mut models.full)? {
            masks.resize(masks.len() + area, 1);
        } else {
            let from = masks.len();
            for _ in 0..area {
                let bit = input.bit(models.at(&masks[from..], level.pixels as usize))?;
                masks.push(u8::from(bit));
            }
        }
    }
    Ok(masks)
}

/// Values of dictionary entries, by the sum of the values to the left and above.
struct EntryModels(Vec<SInt>);

impl EntryModels {
    /// Sums beyond this share a model.
    const REACH: i32 = 12;

    fn new() -> Self {
        Self(vec![SInt::new(); 2 * Self::REACH as usize + 1])
    }

    /// The model of the value after those in `before`, in an entry of planes of `side` x `side` values.
    fn at(&mut self, before: &[i8], side: usize) -> &mut SInt {
        let at = before.len();
        let left = if at.is_multiple_of(side) { 0 } else { i32::from(before[at - 1]) };
        let in_plane = at % (side * side);
        let above = if in_plane >= side { i32::from(before[at - side]) } else { 0 };
        let context = (left + above).clamp(-Self::REACH, Self::REACH) + Self::REACH;
        &mut self.0[context as usize]
    }
}

/// Side of the square planes that an entry of `n_features` values consists of: one for depth, three for colour.
fn plane_side(n_features: usize) -> usize {
    let one = n_features.isqrt();
    if one * one == n_features { one } else { (n_features / 3).isqrt() }
}

fn write_dictionary(out: &mut Encoder, dictionary: &QuantizedDictionary) {
    let n = dictionary.n_features();
    let mut models = EntryModels::new();
    for entry in dictionary.values().chunks(n.max(1)) {
        for at in 0..n {
            out.sint(models.at(&entry[..at], plane_side(n)), i32::from(entry[at]));
        }
    }
}

fn read_dictionary(
    input: &mut Decoder<'_>,
    n_features: usize,
    n_atoms: usize,
) -> Result<QuantizedDictionary> {
    input.check_count("values of a dictionary", n_features as u64 * n_atoms as u64)?;
    let mut models = EntryModels::new();
    let mut values = Vec::with_capacity(n_features * n_atoms);
    for _ in 0..n_atoms {
        let from = values.len();
        for _ in 0..n_features {
            let value = input.sint(models.at(&values[from..], plane_side(n_features)))?;
            let value = i8::try_from(value)
                .map_err(|_| input.corrupt(format!("a dictionary value of {value}")))?;
            values.push(value);
        }
    }
    QuantizedDictionary::new(n_features, values).map_err(|e| input.corrupt(e.to_string()))
}

/// Models of a channel's means and codes.
struct ChannelModels {
    /// Difference of a plane's mean to the previous patch's.
    mean: Vec<SInt>,
    /// Entries per code, by those of the previous patch.
    count: [UInt; 4],
    atom: Symbols,
    /// Magnitude and sign of a coefficient, by the size of the code.
    coefficient: [SInt; 4],
}

impl ChannelModels {
    fn new(planes: usize, n_atoms: usize) -> Result<Self> {
        Ok(Self {
            mean: vec![SInt::new(); planes],
            count: std::array::from_fn(|_| UInt::new()),
            atom: Symbols::new(n_atoms.max(1) as u32)?,
            coefficient: std::array::from_fn(|_| SInt::new()),
        })
    }
}

fn write_channel(out: &mut Encoder, channel: &Channel, planes: usize) -> Result<()> {
    let mut models = ChannelModels::new(planes, channel.dictionary.n_atoms())?;
    let mut previous_mean = vec![0; planes];
    let mut previous_count = 0;
    for (i, means) in channel.means.chunks(planes).enumerate() {
        for (plane, &mean) in means.iter().enumerate() {
            // Differences may wrap around; the reader's sums do as well.
            out.sint(&mut models.mean[plane], mean.wrapping_sub(previous_mean[plane]));
        }
        previous_mean.copy_from_slice(means);
        let (atoms, coefficients) = channel.codes.of(i);
        out.uint(&mut models.count[previous_count.min(3)], atoms.len() as u32);
        previous_count = atoms.len();
        for (&atom, &coefficient) in atoms.iter().zip(coefficients) {
            out.symbol(&mut models.atom, u32::from(atom));
            out.sint(&mut models.coefficient[(atoms.len() - 1).min(3)], coefficient);
        }
    }
    Ok(())
}

fn read_channel(
    input: &mut Decoder<'_>,
    dictionary: QuantizedDictionary,
    patches: usize,
    planes: usize,
) -> Result<Channel> {
    input.check_count("number of patches", patches as u64)?;
    let n_atoms = dictionary.n_atoms();
    let mut models = ChannelModels::new(planes, n_atoms)?;
    let mut means = Vec::with_capacity(patches * planes);
    let mut previous_mean = vec![0_i32; planes];
    let mut previous_count = 0;
    let mut codes = Codes::default();
    codes.offsets.reserve(patches + 1);
    codes.offsets.push(0);
    for _ in 0..patches {
        for (plane, previous) in previous_mean.iter_mut().enumerate() {
            *previous = previous.wrapping_add(input.sint(&mut models.mean[plane])?);
            means.push(*previous);
        }
        let count = input.uint(&mut models.count[previous_count.min(3)])? as usize;
        if count > n_atoms.min(MAX_SPARSITY) {
            return Err(input.corrupt(format!("a code of {count} in {n_atoms} entries")));
        }
        previous_count = count;
        for _ in 0..count {
            codes.atoms.push(input.symbol(&mut models.atom)? as u16);
            let coefficient = input.sint(&mut models.coefficient[(count - 1).min(3)])?;
            codes.coefficients.push(coefficient);
        }
        let end = u32::try_from(codes.atoms.len())
            .map_err(|_| input.corrupt("more than 2^32 coefficients"))?;
        codes.offsets.push(end);
    }
    Ok(Channel { dictionary, means, codes })
}
