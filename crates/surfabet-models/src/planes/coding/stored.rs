//! A patch in the integers that a file stores.

use surfabet_geom::octahedral;

use crate::planes::model::PlanesHeader;
use crate::planes::patch::{Frame, Patch};
use crate::planes::tiles::{MAX_TILES, Tiles};
use crate::size_code::{size_code, size_of_code};
use crate::vector;

/// Largest coordinate in position steps, so that positions are exact in single precision.
pub const MAX_COORDINATE: i32 = 1 << 23;

/// Bits of each of the two numbers of a normal: within 0.0025 degrees.
pub const NORMAL_BITS: u32 = 16;

/// Directions of the first axis in a full turn.
pub const DIRECTIONS: u32 = 4096;

/// Parts of a tile's side in which the last column and row are measured.
pub const PARTS: u8 = 8;

/// Largest power of two that a tile's side is of the grid size.
pub const MAX_DOUBLINGS: u8 = 40;

/// Most tiles of a patch, supported or not: those that learning allows, and what rounding adds.
pub const MAX_PATCH_TILES: u64 = 2 * MAX_TILES as u64;

/// Standard deviations are stored in this share of a position step.
const DEVIATION_UNIT: f64 = 0.125;

/// A patch as it is stored.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct StoredPatch {
    /// Middle of the rectangle in position steps from the model's origin.
    pub position: [i32; 3],
    /// Octahedral code of the normal, `NORMAL_BITS` bits each.
    pub normal: [i16; 2],
    /// Direction of the first axis in the plane, in [`DIRECTIONS`] of a turn.
    pub direction: u16,
    /// The side of a tile is the grid size times two to this power.
    pub doublings: u8,
    /// Number of tiles along both axes.
    pub shape: [u32; 2],
    /// Extent of the last column and row in [`PARTS`] of a tile's side, 1 to [`PARTS`].
    pub last: [u8; 2],
    /// Code of the standard deviation of the support: zero for 0, else `2^((code - 1) / 4)` eighths of a position step.
    pub deviation: u8,
    /// Code of the number of points that support it: zero for 0, else `2^((code - 1) / 4)`.
    pub count: u8,
    /// For each tile, along the first axis first, whether it is supported.
    pub supported: Vec<bool>,
    /// Luma and two chromas of each supported tile, in steps; empty without colours.
    pub colors: Vec<[i16; 3]>,
    /// Intensity of each supported tile, in steps; empty without intensities.
    pub intensities: Vec<i32>,
}

impl StoredPatch {
    /// A fitted patch in integers, without colours and intensities.
    pub fn rounded(patch: &Patch, header: &PlanesHeader) -> Self {
        let step = header.position_step();
        let tiles = &patch.tiles;
        let [low, size] = [tiles.low(), tiles.size()];
        let middle = patch.frame.at(std::array::from_fn(|a| low[a] + 0.5 * size[a]));
        let limit = f64::from(MAX_COORDINATE);
        let position = middle.map(|c| (c / step).round().clamp(-limit, limit) as i32);
        let code = octahedral::encode(patch.frame.normal.map(|c| c as f32), NORMAL_BITS);
        let normal = code.map(|c| c as i16);
        let [x, y, _] = {
            let frame = plain_frame([0; 3], normal, step);
            frame.local(patch.frame.u.map(|c| c as f32))
        };
        let turn = y.atan2(x).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
        let direction = (turn * f64::from(DIRECTIONS)).round() as u32 % DIRECTIONS;
        let shape = tiles.shape();
        let edge = tiles.edge();
        let last = std::array::from_fn(|a| {
            let left = size[a] / edge - (shape[a] as f64 - 1.0);
            (left * f64::from(PARTS)).ceil().clamp(1.0, f64::from(PARTS)) as u8
        });
        Self {
            position,
            normal,
            direction: direction as u16,
            doublings: (edge / header.grid_size).log2().round() as u8,
            shape: shape.map(|n| n as u32),
            last,
            deviation: size_code(patch.standard_deviation / (DEVIATION_UNIT * step)),
            count: size_code(patch.n_supporting() as f64),
            supported: tiles.supported().to_vec(),
            colors: Vec::new(),
            intensities: Vec::new(),
        }
    }

    /// The patch that the integers describe; without its points.
    pub fn restored(&self, header: &PlanesHeader) -> Patch {
        let step = header.position_step();
        let turn = std::f64::consts::TAU * f64::from(self.direction) / f64::from(DIRECTIONS);
        let frame = plain_frame(self.position, self.normal, step).turned([turn.cos(), turn.sin()]);
        let edge = header.grid_size * f64::from(self.doublings).exp2();
        let size: [f64; 2] = std::array::from_fn(|a| {
            let last = f64::from(self.last[a]) / f64::from(PARTS);
            edge * (f64::from(self.shape[a]) - 1.0 + last)
        });
        let shape = self.shape.map(|n| n as usize);
        let mut tiles = Tiles::of_shape(size.map(|s| -0.5 * s), size, edge, shape);
        tiles.support(self.supported.clone());
        let mut patch = Patch::bare(frame, tiles);
        patch.standard_deviation = DEVIATION_UNIT * step * size_of_code(self.deviation);
        patch
    }

    /// What is wrong with a stored self.
    pub fn check(&self, header: &PlanesHeader) -> Result<(), String> {
        if self.position.iter().any(|c| c.abs() > MAX_COORDINATE) {
            return Err(format!("a position of {:?} steps", self.position));
        }
        if u32::from(self.direction) >= DIRECTIONS {
            return Err(format!("direction {} of {DIRECTIONS}", self.direction));
        }
        if self.doublings > MAX_DOUBLINGS {
            return Err(format!("tiles of 2^{} grid sizes", self.doublings));
        }
        let [nx, ny] = self.shape.map(u64::from);
        if self.shape.contains(&0) || nx * ny > MAX_PATCH_TILES {
            return Err(format!("{:?} tiles", self.shape));
        }
        if self.last.iter().any(|&l| !(1..=PARTS).contains(&l)) {
            return Err(format!("a last tile of {:?} eighths", self.last));
        }
        if self.supported.len() as u64 != nx * ny {
            return Err(format!("{} tiles in a mask of {:?}", self.supported.len(), self.shape));
        }
        let supported = self.supported.iter().filter(|s| **s).count();
        if supported == 0 {
            return Err("no supported tile".into());
        }
        let colors = if header.color_step.is_some() { supported } else { 0 };
        if self.colors.len() != colors {
            return Err(format!("{} colours for {colors} tiles", self.colors.len()));
        }
        let intensities = if header.intensity.is_some() { supported } else { 0 };
        if self.intensities.len() != intensities {
            let found = self.intensities.len();
            return Err(format!("{found} intensities for {intensities} tiles"));
        }
        Ok(())
    }
}

/// The frame that a patch's plane has with direction zero.
fn plain_frame(position: [i32; 3], normal: [i16; 2], step: f64) -> Frame {
    let normal = octahedral::integer_direction(normal.map(i32::from), NORMAL_BITS).map(f64::from);
    let length = vector::length(normal);
    Frame::with_normal(position.map(|c| f64::from(c) * step), normal.map(|c| c / length))
}
