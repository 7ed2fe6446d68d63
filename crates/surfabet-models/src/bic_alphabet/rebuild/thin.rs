//! Which points of one occurrence are kept (eq. 3), given those kept before them near by.

use pulp::{Arch, Simd, WithSimd};

use super::stamp::{NO_POINT, Stamp};
use crate::bic_alphabet::pose::Frame;

/// Points that are compared at once.
const LANES: usize = 8;

/// A point of an occurrence that is kept, in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::bic_alphabet) struct KeptPoint {
    pub position: [f32; 3],
    /// Its number among the points of its word, from the middle outwards.
    pub number: u16,
}

/// Kept points near an occurrence, by coordinate; places beyond the last are infinitely far away.
#[derive(Debug, Clone, Default)]
pub(super) struct Thinner {
    near: [Vec<f32>; 3],
    len: usize,
    /// By point of the word.
    is_kept: Vec<bool>,
    /// The kept points of one occurrence, while they are not in a list.
    pub kept: Vec<KeptPoint>,
}

impl Thinner {
    /// Forgets the kept points.
    pub fn clear(&mut self) {
        self.near.iter_mut().for_each(Vec::clear);
        self.len = 0;
    }

    /// Adds a kept point.
    #[inline(always)]
    pub fn push(&mut self, position: [f32; 3]) {
        if self.len == self.near[0].len() {
            let room = self.len + LANES;
            self.near.iter_mut().for_each(|column| column.resize(room, f32::INFINITY));
        }
        for (column, c) in self.near.iter_mut().zip(position) {
            column[self.len] = c;
        }
        self.len += 1;
    }

    /// Adds the points of `kept` within `reach` of an occurrence's middle.
    #[inline]
    pub fn push_near(&mut self, kept: &[KeptPoint], middle: [f32; 3], reach: f32) {
        for point in kept {
            let p = point.position;
            let d: [f32; 3] = std::array::from_fn(|a| p[a] - middle[a]);
            if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= reach * reach {
                self.push(p);
            }
        }
    }

    /// Appends the points of a word at `frame` that keep `epsilon` from the points pushed so far and from each other,
    /// from the middle outwards.
    pub fn keep(&mut self, stamp: &Stamp, frame: &Frame, epsilon: f32, out: &mut Vec<KeptPoint>) {
        // Compiled a second time for AVX2: the same operations on each lane.
        Arch::new().dispatch(Keep { thinner: self, stamp, frame, epsilon, out });
    }
}

/// The arguments of [`Thinner::keep`].
struct Keep<'a> {
    thinner: &'a mut Thinner,
    stamp: &'a Stamp,
    frame: &'a Frame,
    epsilon: f32,
    out: &'a mut Vec<KeptPoint>,
}

impl WithSimd for Keep<'_> {
    type Output = ();

    // Inlined, so that it is compiled for what the processor has.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { thinner, stamp, frame, epsilon, out } = self;
        let limit = epsilon * epsilon;
        thinner.is_kept.clear();
        for (&point, blockers) in stamp.points.iter().zip(&stamp.blockers) {
            let is_kept = &mut thinner.is_kept;
            let blocks = |&k: &u16| k != NO_POINT && is_kept[usize::from(k)];
            if blockers.iter().any(blocks) {
                is_kept.push(false);
                continue;
            }
            let position = frame.place(point);
            let clear = is_clear(&thinner.near, position, limit);
            thinner.is_kept.push(clear);
            if clear {
                let number = (thinner.is_kept.len() - 1) as u16;
                out.push(KeptPoint { position, number });
                thinner.push(position);
            }
        }
    }
}

/// True when no point in the columns is nearer to `position` than the root of `limit`.
#[inline(always)]
fn is_clear([x, y, z]: &[Vec<f32>; 3], position: [f32; 3], limit: f32) -> bool {
    let columns = x.chunks_exact(LANES).zip(y.chunks_exact(LANES)).zip(z.chunks_exact(LANES));
    for ((x, y), z) in columns {
        let mut nearest = [0.0_f32; LANES];
        for lane in 0..LANES {
            let (dx, dy, dz) =
                (x[lane] - position[0], y[lane] - position[1], z[lane] - position[2]);
            nearest[lane] = dx * dx + dy * dy + dz * dz;
        }
        let mut any = false;
        for squared in nearest {
            any |= squared < limit;
        }
        if any {
            return false;
        }
    }
    true
}
