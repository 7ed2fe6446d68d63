//! Middles, normals and directions of patches.
//!
//! The walls of a building share few directions. A normal is predicted by that of a patch before, or its opposite, where
//! one is near.

use surfabet_entropy::{Bit, Coder, SInt, UInt};
use surfabet_geom::octahedral;

use super::stored::{DIRECTIONS, MAX_COORDINATE, NORMAL_BITS, StoredPatch};
use super::syntax::code_residual;

/// Directions that are remembered, the last used first.
const MAX_REFERENCES: usize = 16;

/// Largest residual of a normal for which a reference is used: 5 degrees or less.
const NEAR: i32 = 2048;

/// Directions in a quarter turn.
const QUARTER: i32 = DIRECTIONS as i32 / 4;

/// Adaptive models of the poses, and the directions before.
pub(super) struct PoseModels {
    position: [SInt; 3],
    reference: UInt,
    /// Two without a reference, two with one.
    normal: [SInt; 4],
    /// Three without a reference, three with one.
    quarter: [Bit; 6],
    turn: [SInt; 2],
    references: Vec<Reference>,
}

impl PoseModels {
    pub fn new() -> Self {
        Self {
            position: [const { SInt::new() }; 3],
            reference: UInt::new(),
            normal: [const { SInt::new() }; 4],
            quarter: [Bit::new(); 6],
            turn: [const { SInt::new() }; 2],
            references: Vec::new(),
        }
    }
}

/// A direction of a patch coded before, which predicts that of others.
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

    /// Largest difference of the two numbers of a normal's code.
    fn distance(self, normal: [i16; 2]) -> i32 {
        let along = |a: usize| (i32::from(normal[a]) - i32::from(self.normal[a])).abs();
        along(0).max(along(1))
    }
}

/// Codes middle, normal and direction of a patch.
pub(super) fn code_pose<C: Coder>(
    coder: &mut C,
    models: &mut PoseModels,
    wanted: &StoredPatch,
    patch: &mut StoredPatch,
) -> Result<(), C::Error> {
    for axis in 0..3 {
        let (model, to) = (&mut models.position[axis], wanted.position[axis]);
        let domain = -MAX_COORDINATE..=MAX_COORDINATE;
        patch.position[axis] = code_residual(coder, model, 0, to, domain, "a coordinate")?;
    }
    let number = coder.uint(&mut models.reference, closest(&models.references, wanted.normal))?;
    let reference = match number.checked_sub(1) {
        None => None,
        Some(n) if (n / 2) as usize >= models.references.len() => {
            return Err(coder.corrupt(format!("direction {n} of {}", 2 * models.references.len())));
        }
        Some(n) => {
            models.references[..=(n / 2) as usize].rotate_right(1);
            let reference = models.references[0];
            Some(if n % 2 == 1 { reference.opposite() } else { reference })
        }
    };
    let near = usize::from(reference.is_some());
    let predicted = reference.unwrap_or(Reference { normal: [0; 2], direction: 0 });
    let half = octahedral::half(NORMAL_BITS);
    for axis in 0..2 {
        let model = &mut models.normal[2 * near + axis];
        let (from, to) = (i32::from(predicted.normal[axis]), i32::from(wanted.normal[axis]));
        patch.normal[axis] =
            code_residual(coder, model, from, to, -half..=half, "a normal")? as i16;
    }
    // Rectangles of one direction of planes are about parallel, if not to the same axis.
    let turn = i32::from(wanted.direction) - i32::from(predicted.direction) + QUARTER / 2;
    let quarter = turn.div_euclid(QUARTER).rem_euclid(4);
    let bits = &mut models.quarter[3 * near..3 * near + 3];
    let high = coder.bit(&mut bits[0], quarter >= 2)?;
    let low = coder.bit(&mut bits[1 + usize::from(high)], quarter % 2 == 1)?;
    let quarter = 2 * i32::from(high) + i32::from(low);
    let domain = -QUARTER / 2..=QUARTER / 2 - 1;
    let rest = turn.rem_euclid(QUARTER) - QUARTER / 2;
    let rest = code_residual(coder, &mut models.turn[near], 0, rest, domain, "a turn")?;
    let direction = i32::from(predicted.direction) + quarter * QUARTER + rest;
    patch.direction = direction.rem_euclid(4 * QUARTER) as u16;
    if reference.is_none() {
        let reference = Reference { normal: patch.normal, direction: patch.direction };
        models.references.truncate(MAX_REFERENCES - 1);
        models.references.insert(0, reference);
    }
    Ok(())
}

/// Number of the reference that predicts a normal best: 0 for none, then two for each, the second its opposite.
fn closest(references: &[Reference], normal: [i16; 2]) -> u32 {
    let both = references.iter().flat_map(|r| [*r, r.opposite()]);
    let distances = both.enumerate().map(|(i, r)| (r.distance(normal), i));
    distances.min().filter(|(distance, _)| *distance <= NEAR).map_or(0, |(_, i)| i as u32 + 1)
}
