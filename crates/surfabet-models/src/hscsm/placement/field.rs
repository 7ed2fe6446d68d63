//! The samples of a level, and what a patch at some place would take of them (section III-A).
//!
//! A patch is a height field, so two surfaces in one cube (the faces of a thin wall, a table top and its
//! underside) must not be averaged. Three things keep them apart: a patch takes only samples that were seen from
//! its front, where viewpoints are known; it grows from its seed pixel by pixel, accepting only samples
//! close to the depth reached so far; and above the lowest level pixels whose samples deviate too much are
//! masked out.

use super::pixels::{PixelGrid, PixelSums, Rules};
use super::plane::SeedNeighbour;
use super::trial::PixelSamples;
use crate::groups::Groups;
use crate::hscsm::constants::PLANE_GATE;
use crate::hscsm::frame::Frame;
use crate::hscsm::samples::cells::SampleCells;
use crate::hscsm::samples::{Sample, Samples};
use crate::vector::dot;

/// Most pixels of a patch.
const MAX_AREA: usize = 32 * 32;

/// Which samples are owned, and how many free ones each point has.
pub(super) struct Ownership {
    /// By sample.
    pub owned: Vec<bool>,
    /// By sample, whether levels above own it: what this level may not show. `None` where patches do not overlap.
    pub above: Option<Vec<bool>>,
    /// By point.
    pub free: Vec<u32>,
}

/// Memory that trials use again and again.
#[derive(Default)]
pub(super) struct Scratch {
    sums: Vec<PixelSums>,
    pub by_pixel: Vec<PixelSamples>,
    pub near: Vec<SeedNeighbour>,
    pub offsets: Vec<([f32; 3], f32)>,
}

/// The samples, of half a pixel of the lowest level, and the points of about a pixel that they are merged to.
pub(super) struct Field<'a> {
    pub samples: &'a Samples,
    /// The sub-sampled cloud that coverage is counted on: of a pixel at the lowest level, which has no least
    /// coverage, of half a pixel above it, so that every pixel of a covered surface holds a point.
    pub points: Samples,
    /// Doublings from a point's cell to a pixel.
    pub point_doublings: u32,
    /// Their positions again, close together in memory.
    positions: Vec<[f32; 3]>,
    /// Samples of each point.
    pub children: Groups,
    /// Point of each sample.
    pub parents: Vec<u32>,
    pub cells: SampleCells,
    pub grid: PixelGrid,
    pub rules: Rules,
}

impl<'a> Field<'a> {
    /// The field of the level whose pixels were doubled `doublings` times.
    pub fn new(samples: &'a Samples, doublings: u32, grid: PixelGrid, rules: Rules) -> Self {
        let (points, children) = samples.coarser(doublings.max(1));
        let point_doublings = u32::from(doublings > 0);
        let mut parents = vec![0; samples.len()];
        for point in 0..points.len() {
            for &i in children.of(point) {
                parents[i as usize] = point as u32;
            }
        }
        // Cells of about half a patch: few to look up, few points in vain.
        let cells = SampleCells::new(&points, (grid.n / 2).max(1).ilog2() + point_doublings);
        let positions = points.all.iter().map(|s| s.position).collect();
        Self { samples, points, point_doublings, positions, children, parents, cells, grid, rules }
    }

    /// One point per pixel-sized cube: the middle one along the Morton curve.
    pub fn candidates(&self) -> Vec<u32> {
        let cube = |k: u32| self.points.all[k as usize].key >> (3 * self.point_doublings);
        let all: Vec<u32> = (0..self.points.len() as u32).collect();
        all.chunk_by(|&a, &b| cube(a) == cube(b)).map(|c| c[c.len() / 2]).collect()
    }

    /// Counts the samples of each point that the levels above have left, given which are `owned`.
    /// Patches that are not `disjoint` show what others of the level own.
    pub fn ownership(&self, owned: Vec<bool>, disjoint: bool) -> Ownership {
        let left = |k: usize| self.children.of(k).iter().filter(|&&i| !owned[i as usize]).count();
        let free = (0..self.points.len()).map(|k| left(k) as u32).collect();
        let above = (!disjoint).then(|| owned.clone());
        Ownership { owned, above, free }
    }

    /// True when `s` was seen from the side that `normal` points to, or nothing is known of it.
    pub fn faces(&self, s: &Sample, normal: [f32; 3]) -> bool {
        !self.samples.has_views || s.view == [0.0; 3] || dot(s.view, normal) > 0.0
    }

    /// Points of the cells about a ball.
    pub fn near(&self, center: [f32; 3], radius: f32, mut each: impl FnMut(usize, [f32; 3])) {
        let (low, high) = (center.map(|c| c - radius), center.map(|c| c + radius));
        self.cells.in_box(low, high, |range| {
            for (k, p) in range.clone().zip(&self.positions[range]) {
                each(k, *p);
            }
        });
    }

    /// Approximate coverage of the patch at `center` with that normal: set pixels, counted on the points.
    pub fn score(
        &self,
        ownership: &Ownership,
        center: [f32; 3],
        normal: [f32; 3],
        scratch: &mut Scratch,
    ) -> usize {
        let frame = Frame::new(center, normal);
        let half = 0.5 * self.grid.size();
        let gate = self.rules.gate.max(PLANE_GATE * self.grid.pixel);
        // The corner of the box about the plate of the patch.
        let reach: [f32; 3] = std::array::from_fn(|a| {
            half * (frame.x[a].abs() + frame.y[a].abs()) + gate * frame.z[a].abs()
        });
        let low = std::array::from_fn(|a| center[a] - reach[a]);
        let high = std::array::from_fn(|a| center[a] + reach[a]);
        let each = |visit: &mut dyn FnMut(usize, &Sample, [f32; 3])| {
            self.cells.in_box(low, high, |range| {
                for (i, p) in range.clone().zip(&self.positions[range]) {
                    let local = frame.to_local(*p);
                    if local[2].abs() <= gate
                        && local[0].abs() <= half
                        && local[1].abs() <= half
                        && ownership.free[i] > 0
                    {
                        let s = &self.points.all[i];
                        if self.faces(s, normal) {
                            visit(self.grid.pixel_of(local), s, local);
                        }
                    }
                }
            });
        };
        if self.rules.is_open() {
            let mut set = [0_u64; MAX_AREA / 64];
            each(&mut |pixel, _, _| set[pixel / 64] |= 1 << (pixel % 64));
            return set.iter().map(|word| word.count_ones() as usize).sum();
        }
        let mut sums = std::mem::take(&mut scratch.sums);
        sums.clear();
        sums.resize(self.grid.area(), PixelSums::default());
        each(&mut |pixel, s, local| sums[pixel].add(s, local, frame.z));
        let covered = sums.iter().filter(|s| s.weight > 0.0).count();
        let set = (0..sums.len())
            .filter(|&i| sums[i].weight > 0.0 && self.rules.is_steady(&sums[i]))
            .count();
        scratch.sums = sums;
        if covered < self.rules.min_covered { 0 } else { set }
    }
}
