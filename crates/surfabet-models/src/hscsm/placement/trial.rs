//! The patch that a seed would give: its pose, and the samples that growth reaches in it.

use std::collections::VecDeque;

use super::field::{Field, Ownership, Scratch};
use super::pixels::{PixelGrid, PixelSums};
use crate::hscsm::frame::{Frame, PatchPose};
use crate::vector::{dot, minus};

/// A patch that could be placed.
pub(super) struct Trial {
    pub pose: PatchPose,
    pub frame: Frame,
    /// Samples it would own, and the pixel of each.
    pub members: Vec<(u32, u16)>,
    /// Pixels with samples.
    pub covered: usize,
    /// Pixels that are set.
    pub set_pixels: usize,
}

/// Free samples of a pixel, each with its place in the frame of the patch.
pub(super) type PixelSamples = Vec<(u32, [f32; 3])>;

impl Field<'_> {
    /// The patch that would describe the surface about point `seed`, centred as near to `wanted` as the seed
    /// allows, with the normal `known` if that fits about as well as the best. `None` without free samples.
    pub(super) fn trial(
        &self,
        ownership: &Ownership,
        seed: usize,
        wanted: [f32; 3],
        known: Option<[f32; 3]>,
        scratch: &mut Scratch,
    ) -> Option<Trial> {
        let PixelGrid { pixel, position_step, .. } = self.grid;
        let size = self.grid.size();
        let point = &self.points.all[seed];
        let free = self.children.of(seed).iter().filter(|&&i| !ownership.owned[i as usize]);
        let distance = |i: u32| {
            let d = minus(self.samples.all[i as usize].position, point.position);
            dot(d, d)
        };
        let seed = *free.min_by(|&&a, &&b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)))?;
        let at = &self.samples.all[seed as usize];
        let plane = self.fit(at, known, &mut scratch.near);

        // The wanted centre, moved along the normal onto the plane and along the axes until it holds the seed.
        let p = at.position;
        let axes = Frame::new(p, plane.normal);
        let inside = 0.5 * (size - pixel);
        let mut wanted = axes.to_local(wanted);
        wanted[0] = wanted[0].clamp(-inside, inside);
        wanted[1] = wanted[1].clamp(-inside, inside);
        wanted[2] = -plane.seed_offset;
        let pose = PatchPose::quantize(axes.to_world(wanted), plane.normal, position_step);
        let frame = pose.frame(position_step);

        self.project(ownership, seed, &frame, &mut scratch.by_pixel);
        let local = frame.to_local(p);
        let mut trial = Trial { pose, frame, members: Vec::new(), covered: 0, set_pixels: 0 };
        self.grow(&scratch.by_pixel, self.grid.pixel_of(local), local[2], &mut trial);
        Some(trial)
    }

    /// Sorts the free samples in the cube of a patch, and the seed, by the pixels they lie in.
    fn project(
        &self,
        ownership: &Ownership,
        seed: u32,
        frame: &Frame,
        by_pixel: &mut Vec<PixelSamples>,
    ) {
        let half = 0.5 * self.grid.size();
        by_pixel.resize_with(self.grid.area(), Vec::new);
        by_pixel.iter_mut().for_each(Vec::clear);
        let reach: [f32; 3] = std::array::from_fn(|a| {
            half * (frame.x[a].abs() + frame.y[a].abs() + frame.z[a].abs()) + self.grid.pixel
        });
        let low = std::array::from_fn(|a| frame.center[a] - reach[a]);
        let high = std::array::from_fn(|a| frame.center[a] + reach[a]);
        self.cells.in_box(low, high, |range| {
            let taken = ownership.above.as_ref().unwrap_or(&ownership.owned);
            for k in range.filter(|&k| ownership.above.is_some() || ownership.free[k] > 0) {
                for &i in self.children.of(k) {
                    let s = &self.samples.all[i as usize];
                    if taken[i as usize] {
                        continue;
                    }
                    let local = frame.to_local(s.position);
                    let within = local.iter().all(|c| c.abs() <= half);
                    if i == seed || (within && self.faces(s, frame.z)) {
                        by_pixel[self.grid.pixel_of(local)].push((i, local));
                    }
                }
            }
        });
    }

    /// Follows the surface from pixel `start` at `depth` over the grid, breadth first. A pixel without accepted
    /// samples passes on the depth that it was expected at, so sparse scans do not fall apart.
    fn grow(&self, by_pixel: &[PixelSamples], start: usize, depth: f32, trial: &mut Trial) {
        let n = self.grid.n;
        let gate = self.rules.gate;
        let z = trial.frame.z;
        let mut expected = vec![f32::NAN; n * n];
        expected[start] = depth;
        let mut queue = VecDeque::from([start]);
        while let Some(pixel) = queue.pop_front() {
            let mut sums = PixelSums::default();
            let before = trial.members.len();
            for &(i, local) in &by_pixel[pixel] {
                if (local[2] - expected[pixel]).abs() <= gate {
                    sums.add(&self.samples.all[i as usize], local, z);
                    trial.members.push((i, pixel as u16));
                }
            }
            let mut reached = expected[pixel];
            if sums.weight > 0.0 {
                reached = sums.depth_mean() as f32;
                trial.covered += 1;
                if self.rules.accept(&sums, pixel, self.grid) {
                    trial.set_pixels += 1;
                } else {
                    trial.members.truncate(before);
                }
            }
            let (row, column) = (pixel / n, pixel % n);
            let neighbours = [
                (column > 0).then(|| pixel - 1),
                (column + 1 < n).then_some(pixel + 1),
                (row > 0).then(|| pixel - n),
                (row + 1 < n).then_some(pixel + n),
            ];
            for next in neighbours.into_iter().flatten() {
                if expected[next].is_nan() {
                    expected[next] = reached;
                    queue.push_back(next);
                }
            }
        }
    }
}
