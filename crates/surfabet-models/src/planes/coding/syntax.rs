//! How patches are said in binary decisions: one function for writing, reading and pricing.
//!
//! Patches come one after the other, those that most points support first. Walls of a building share few directions:
//! a normal is said by its offset from one said before, or that one's opposite, where that is near. Masks go by the
//! tiles around, colours by those to the left and above.

use surfabet_entropy::{Bit, Coder, SInt, UInt};
use surfabet_geom::octahedral;

use crate::color::MAX_COLOR_CODE;
use crate::planes::model::{
    DIRECTIONS, MAX_COORDINATE, MAX_DOUBLINGS, MAX_MODEL_TILES, MAX_PATCH_TILES, NORMAL_BITS,
    PARTS, PlaneModel, PlanesHeader, StoredPatch,
};
use crate::size_code::MAX_SIZE_CODE;

/// Directions that are remembered, the last used first.
const MAX_REFERENCES: usize = 16;

/// Largest offset of a normal from one said before that is worth saying so: 5 degrees or less.
const NEAR: i32 = 2048;

/// Directions in a quarter turn.
const QUARTER: i32 = DIRECTIONS as i32 / 4;

/// The streams of a model of planes.
#[derive(Debug)]
pub(in crate::planes) struct Streams<'a, C> {
    /// Positions, normals and directions.
    pub poses: &'a mut C,
    /// Which tiles are supported.
    pub masks: &'a mut C,
    /// Numbers and sizes of tiles, standard deviations, numbers of points.
    pub sizes: &'a mut C,
    /// Colours of supported tiles.
    pub colors: &'a mut C,
}

impl PlaneModel {
    /// Writes the streams.
    ///
    /// # Errors
    /// Those of the coders.
    pub(in crate::planes) fn write<C: Coder>(
        &self,
        streams: &mut Streams<'_, C>,
    ) -> Result<(), C::Error> {
        let given = Some(self.stored());
        code_patches(streams, self.header(), MAX_MODEL_TILES, given, |_| ())
    }

    /// Reads the streams that [`PlaneModel::write`] wrote, of at most `max_tiles` tiles in all.
    ///
    /// # Errors
    /// Those of the coders, also for a header or content that no model has.
    pub(in crate::planes) fn read<C: Coder>(
        header: &PlanesHeader,
        max_tiles: u64,
        streams: &mut Streams<'_, C>,
    ) -> Result<Self, C::Error> {
        header.check().map_err(|e| streams.poses.corrupt(e.to_string()))?;
        let mut stored = Vec::new();
        code_patches(streams, header, max_tiles, None, |patch| stored.push(patch))?;
        Self::from_stored(header.clone(), stored).map_err(|e| streams.masks.corrupt(e.to_string()))
    }
}

/// A direction that others may be near to.
#[derive(Debug, Clone, Copy)]
struct Reference {
    normal: [i16; 2],
    direction: u16,
}

impl Reference {
    /// The same plane seen from its other side: the octahedron's opposite point, and the first axis of tiles there.
    fn opposite(self) -> Self {
        let half = octahedral::half(NORMAL_BITS);
        let [u, v] = self.normal.map(i32::from);
        let away = |magnitude: i32, side: i32| if side > 0 { -magnitude } else { magnitude };
        let normal = [away(half - v.abs(), u), away(half - u.abs(), v)].map(|c| c as i16);
        let turned = (2 * QUARTER - i32::from(self.direction)).rem_euclid(4 * QUARTER);
        Self { normal, direction: turned as u16 }
    }

    /// Largest difference of a code's numbers.
    fn off(self, normal: [i16; 2]) -> i32 {
        let off = |a: usize| (i32::from(normal[a]) - i32::from(self.normal[a])).abs();
        off(0).max(off(1))
    }
}

/// Every adaptive model, and what the patches before said.
struct State {
    position: [SInt; 3],
    reference: UInt,
    normal: [SInt; 4],
    quarter: [Bit; 6],
    turn: [SInt; 2],
    doublings: UInt,
    shape: [UInt; 2],
    last: [UInt; 2],
    deviation: SInt,
    count: SInt,
    supported: Vec<Bit>,
    luma: [SInt; 3],
    chroma: [SInt; 4],
    references: Vec<Reference>,
    /// Standard deviation and number of points of the patch before.
    before: [u8; 2],
    color: [i16; 3],
    tiles: u64,
}

impl State {
    fn new() -> Self {
        Self {
            position: [const { SInt::new() }; 3],
            reference: UInt::new(),
            normal: [const { SInt::new() }; 4],
            quarter: [Bit::new(); 6],
            turn: [const { SInt::new() }; 2],
            doublings: UInt::new(),
            shape: [const { UInt::new() }; 2],
            last: [const { UInt::new() }; 2],
            deviation: SInt::new(),
            count: SInt::new(),
            supported: vec![Bit::with_memory(Bit::MAX_MEMORY); 1 << 6],
            luma: [const { SInt::new() }; 3],
            chroma: [const { SInt::new() }; 4],
            references: Vec::new(),
            before: [0; 2],
            color: [0; 3],
            tiles: 0,
        }
    }
}

/// Writes, reads or prices patches. `given` is what to write; in any case each of them is taken.
fn code_patches<C: Coder>(
    streams: &mut Streams<'_, C>,
    header: &PlanesHeader,
    max_tiles: u64,
    given: Option<&[StoredPatch]>,
    mut take: impl FnMut(StoredPatch),
) -> Result<(), C::Error> {
    let mut state = State::new();
    let nothing = StoredPatch::default();
    for i in 0..header.n_patches as usize {
        let wanted = given.map_or(&nothing, |patches| &patches[i]);
        let mut patch = StoredPatch::default();
        code_pose(streams.poses, &mut state, wanted, &mut patch)?;
        code_sizes(streams.sizes, &mut state, max_tiles, wanted, &mut patch)?;
        patch.supported = code_mask(streams.masks, &mut state, wanted, patch.shape)?;
        if header.color_step.is_some() {
            patch.colors = code_colors(streams.colors, &mut state, wanted, &patch)?;
        }
        state.before = [patch.deviation, patch.count];
        take(patch);
    }
    Ok(())
}

/// An integer by its difference to what is expected, checked against its domain.
fn code_offset<C: Coder>(
    coder: &mut C,
    model: &mut SInt,
    expected: i32,
    wanted: i32,
    domain: std::ops::RangeInclusive<i32>,
    what: &str,
) -> Result<i32, C::Error> {
    let off = coder.sint(model, wanted - expected)?;
    let value = i64::from(expected) + i64::from(off);
    match i32::try_from(value) {
        Ok(value) if domain.contains(&value) => Ok(value),
        _ => Err(coder.corrupt(format!("{what} of {value}, not {domain:?}"))),
    }
}

fn code_pose<C: Coder>(
    coder: &mut C,
    state: &mut State,
    wanted: &StoredPatch,
    patch: &mut StoredPatch,
) -> Result<(), C::Error> {
    for axis in 0..3 {
        let (model, to) = (&mut state.position[axis], wanted.position[axis]);
        let domain = -MAX_COORDINATE..=MAX_COORDINATE;
        patch.position[axis] = code_offset(coder, model, 0, to, domain, "a coordinate")?;
    }
    let number = coder.uint(&mut state.reference, closest(&state.references, wanted.normal))?;
    let reference = match number.checked_sub(1) {
        None => None,
        Some(n) if (n / 2) as usize >= state.references.len() => {
            return Err(coder.corrupt(format!("direction {n} of {}", 2 * state.references.len())));
        }
        Some(n) => {
            state.references[..=(n / 2) as usize].rotate_right(1);
            let reference = state.references[0];
            Some(if n % 2 == 1 { reference.opposite() } else { reference })
        }
    };
    let near = usize::from(reference.is_some());
    let expected = reference.unwrap_or(Reference { normal: [0; 2], direction: 0 });
    let half = octahedral::half(NORMAL_BITS);
    for axis in 0..2 {
        let model = &mut state.normal[2 * near + axis];
        let (from, to) = (i32::from(expected.normal[axis]), i32::from(wanted.normal[axis]));
        patch.normal[axis] = code_offset(coder, model, from, to, -half..=half, "a normal")? as i16;
    }
    // Rectangles of one direction of planes are about parallel, if not to the same axis.
    let turn = i32::from(wanted.direction) - i32::from(expected.direction) + QUARTER / 2;
    let quarter = turn.div_euclid(QUARTER).rem_euclid(4);
    let bits = &mut state.quarter[3 * near..3 * near + 3];
    let high = coder.bit(&mut bits[0], quarter >= 2)?;
    let low = coder.bit(&mut bits[1 + usize::from(high)], quarter % 2 == 1)?;
    let quarter = 2 * i32::from(high) + i32::from(low);
    let domain = -QUARTER / 2..=QUARTER / 2 - 1;
    let rest = turn.rem_euclid(QUARTER) - QUARTER / 2;
    let rest = code_offset(coder, &mut state.turn[near], 0, rest, domain, "a turn")?;
    let direction = i32::from(expected.direction) + quarter * QUARTER + rest;
    patch.direction = direction.rem_euclid(4 * QUARTER) as u16;
    if reference.is_none() {
        let reference = Reference { normal: patch.normal, direction: patch.direction };
        state.references.truncate(MAX_REFERENCES - 1);
        state.references.insert(0, reference);
    }
    Ok(())
}

/// Number of the direction that a normal is said from: 0 for none, then two for each, the second its opposite.
fn closest(references: &[Reference], normal: [i16; 2]) -> u32 {
    let both = references.iter().flat_map(|r| [*r, r.opposite()]);
    let off = both.enumerate().map(|(i, r)| (r.off(normal), i));
    off.min().filter(|(off, _)| *off <= NEAR).map_or(0, |(_, i)| i as u32 + 1)
}

fn code_sizes<C: Coder>(
    coder: &mut C,
    state: &mut State,
    max_tiles: u64,
    wanted: &StoredPatch,
    patch: &mut StoredPatch,
) -> Result<(), C::Error> {
    let doublings = coder.uint(&mut state.doublings, u32::from(wanted.doublings))?;
    if doublings > u32::from(MAX_DOUBLINGS) {
        return Err(coder.corrupt(format!("tiles of 2^{doublings} grid sizes")));
    }
    patch.doublings = doublings as u8;
    for axis in 0..2 {
        let model = &mut state.shape[axis];
        let less = coder.uint(model, wanted.shape[axis].wrapping_sub(1))?;
        patch.shape[axis] = less.saturating_add(1);
    }
    let [nx, ny] = patch.shape.map(u64::from);
    // Of numbers below 2^32 each.
    let tiles = nx * ny;
    state.tiles = state.tiles.saturating_add(tiles);
    if tiles > MAX_PATCH_TILES {
        return Err(coder.corrupt(format!("{nx} x {ny} tiles, more than {MAX_PATCH_TILES}")));
    }
    if state.tiles > max_tiles {
        return Err(coder.corrupt(format!("more than {max_tiles} tiles")));
    }
    for axis in 0..2 {
        let model = &mut state.last[axis];
        let less = coder.uint(model, u32::from(PARTS.wrapping_sub(wanted.last[axis])))?;
        if less >= u32::from(PARTS) {
            return Err(coder.corrupt(format!("a last tile less {less} eighths")));
        }
        patch.last[axis] = PARTS - less as u8;
    }
    let domain = 0..=i32::from(MAX_SIZE_CODE);
    let [deviation, count] = state.before.map(i32::from);
    let (model, to) = (&mut state.deviation, i32::from(wanted.deviation));
    let what = "a standard deviation";
    patch.deviation = code_offset(coder, model, deviation, to, domain.clone(), what)? as u8;
    let (model, to) = (&mut state.count, i32::from(wanted.count));
    patch.count = code_offset(coder, model, count, to, domain, "a number of points")? as u8;
    Ok(())
}

fn code_mask<C: Coder>(
    coder: &mut C,
    state: &mut State,
    wanted: &StoredPatch,
    shape: [u32; 2],
) -> Result<Vec<bool>, C::Error> {
    let [nx, ny] = shape.map(|n| n as usize);
    let mut said: Vec<bool> = Vec::new();
    for y in 0..ny {
        for x in 0..nx {
            // Columns and rows back; outside there is nothing.
            let at = |left: isize, up: usize| {
                let column = x.wrapping_add_signed(-left);
                let inside = column < nx && up <= y;
                usize::from(inside && said[(y - up) * nx + column])
            };
            let context = at(1, 0) << 5
                | at(0, 1) << 4
                | at(1, 1) << 3
                | at(-1, 1) << 2
                | at(2, 0) << 1
                | at(0, 2);
            let value = wanted.supported.get(y * nx + x).copied().unwrap_or_default();
            said.push(coder.bit(&mut state.supported[context], value)?);
        }
    }
    Ok(said)
}

fn code_colors<C: Coder>(
    coder: &mut C,
    state: &mut State,
    wanted: &StoredPatch,
    patch: &StoredPatch,
) -> Result<Vec<[i16; 3]>, C::Error> {
    let nx = patch.shape[0] as usize;
    let mut said: Vec<[i16; 3]> = Vec::new();
    let mut above: Vec<Option<[i16; 3]>> = vec![None; nx];
    for row in patch.supported.chunks(nx) {
        let mut left = None;
        for (x, _) in row.iter().enumerate() {
            if !row[x] {
                (above[x], left) = (None, None);
                continue;
            }
            let (expected, n) = match (left, above[x]) {
                (Some(a), Some(b)) => {
                    let mean = |c: usize| (i32::from(a[c]) + i32::from(b[c]) + 1).div_euclid(2);
                    ([mean(0), mean(1), mean(2)], 2)
                }
                (Some(one), None) | (None, Some(one)) => (one.map(i32::from), 1),
                (None, None) => (state.color.map(i32::from), 0),
            };
            let to = wanted.colors.get(said.len()).copied().unwrap_or_default();
            let mut color = [0; 3];
            let mut active = 0;
            for channel in 0..3 {
                let model = match channel {
                    0 => &mut state.luma[n],
                    _ => &mut state.chroma[2 * (channel - 1) + active],
                };
                let limit = i32::from(MAX_COLOR_CODE);
                let (from, to) = (expected[channel], i32::from(to[channel]));
                let value = code_offset(coder, model, from, to, -limit..=limit, "a colour")?;
                color[channel] = value as i16;
                active = usize::from((value - from).abs() > 1);
            }
            said.push(color);
            (above[x], left, state.color) = (Some(color), Some(color), color);
        }
    }
    Ok(said)
}
