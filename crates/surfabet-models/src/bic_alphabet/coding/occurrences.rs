//! The occurrences of a model: an octree of the cells that hold poses, then in each cell word and pose of every
//! occurrence, by their difference to the one before.

use surfabet_entropy::{Cells, Coder, Octree, SInt, Symbols, UInt};
use surfabet_geom::morton;

use super::code_difference;
use crate::bic_alphabet::model::BicAlphabet;
use crate::bic_alphabet::pose::{BicPose, CELL, ROLLS};
use crate::scans::Upright;

/// Bits of the height of the octree over cells.
const HEIGHT_BITS: u32 = 5;

/// Heights of the octree with models of their own.
const HEIGHTS: u32 = 4;

/// The adaptive models of poses.
struct Models {
    cells: Octree,
    /// Occurrences per cell, less one.
    count: UInt,
    word: Symbols,
    /// Differences of each number of a normal's code to that of the occurrence before.
    normal: [SInt; 2],
    /// Differences of each coordinate to the occurrence before, modulo the cell, by whether the normal points along it.
    offset: Vec<Symbols>,
    /// Difference to the occurrence before.
    roll: Symbols,
}

impl Models {
    fn new(words: usize) -> Self {
        // Sizes of at least one and at most 2^16.
        let symbols = |n: u32| Symbols::new(n).expect("a size that alphabets may have");
        Self {
            cells: Octree::new(HEIGHTS),
            count: UInt::new(),
            word: symbols(words.clamp(1, 1 << 16) as u32),
            normal: [const { SInt::new() }; 2],
            offset: vec![symbols(CELL as u32); 6],
            roll: symbols(ROLLS),
        }
    }
}

/// Poses and words of the `n` occurrences of a model.
pub(in crate::bic_alphabet) fn code_occurrences<C: Coder>(
    coder: &mut C,
    alphabet: &BicAlphabet,
    low: [i32; 3],
    given: (&[BicPose], &[u32]),
    n: usize,
) -> Result<(Vec<BicPose>, Vec<u32>), C::Error> {
    let (mut poses, mut words) = (Vec::new(), Vec::new());
    if n == 0 {
        return Ok((poses, words));
    }
    if alphabet.is_empty() {
        return Err(coder.corrupt(format!("{n} occurrences of no word")));
    }
    let mut models = Models::new(alphabet.len());
    let keys: Vec<u64> = given.0.iter().map(|p| p.order(low).0).collect();
    let span = keys.last().map_or(0, |key| u64::BITS - key.leading_zeros());
    let height = coder.bypass(u64::from(span.div_ceil(3)), HEIGHT_BITS)? as u32;
    if height > morton::BITS {
        return Err(coder.corrupt(format!("cells over 2^{height}")));
    }
    let mut found = Vec::new();
    let mut cells = Cells::new(&keys, height, n);
    while let Some(cell) = cells.next(coder, &mut models.cells)? {
        found.push(cell);
    }

    let mut before = BicPose::default();
    for cell in found {
        let wanted = cell.given.len().saturating_sub(1) as u32;
        let count = coder.uint(&mut models.count, wanted)? as usize + 1;
        if count > n - poses.len() {
            return Err(coder.corrupt(format!("more than {n} occurrences")));
        }
        for i in cell.given.start..cell.given.start + count {
            let pose = given.0.get(i).copied().unwrap_or_default();
            let word = given.1.get(i).copied().unwrap_or_default();
            words.push(coder.symbol(&mut models.word, word)?);
            before = code_pose(coder, &mut models, alphabet.upright(), pose, before, low, cell.at)?;
            poses.push(before);
        }
    }
    if poses.len() != n {
        return Err(coder.corrupt(format!("{} occurrences instead of {n}", poses.len())));
    }
    Ok((poses, words))
}

/// One pose in a known cell, after the one `before`.
fn code_pose<C: Coder>(
    coder: &mut C,
    models: &mut Models,
    upright: Upright,
    pose: BicPose,
    before: BicPose,
    low: [i32; 3],
    cell: [u32; 3],
) -> Result<BicPose, C::Error> {
    let mut read = BicPose::default();
    for a in 0..2 {
        read.normal[a] =
            code_difference(coder, &mut models.normal[a], pose.normal[a], before.normal[a])?;
    }
    if upright == Upright::ViewDirection {
        let turn = pose.roll.wrapping_sub(before.roll);
        let turn = coder.symbol(&mut models.roll, u32::from(turn))?;
        read.roll = before.roll.wrapping_add(turn as u8);
    }
    let along = main_axis(read.normal);
    for a in 0..3 {
        let model = &mut models.offset[2 * a + usize::from(along == a)];
        let wanted = (i64::from(pose.position[a]) - i64::from(before.position[a]))
            .rem_euclid(i64::from(CELL));
        let difference = coder.symbol(model, wanted as u32)? as i32;
        let offset = (before.position[a].rem_euclid(CELL) + difference).rem_euclid(CELL);
        // Cells have 21 bits and the lowest is within ±2^20, so that this stays below 2^27.
        read.position[a] = (low[a] + cell[a] as i32) * CELL + offset;
    }
    Ok(read)
}

/// The axis that a normal's octahedral code is nearest to.
fn main_axis(normal: [i8; 2]) -> usize {
    let [u, v] = normal.map(|c| i32::from(c).abs());
    // |x| + |y| + |z| = 127 on the octahedron.
    let z = (127 - u - v).abs();
    if z >= u && z >= v { 2 } else { usize::from(v > u) }
}
