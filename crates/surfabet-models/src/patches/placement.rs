//! Where patches go, and which patch owns which sample (section III-A).
//!
//! SCSM spreads patches by spatial subsampling. Here the seeds come from a grid of cells of one patch size,
//! fullest first; a placed patch then proposes the four positions next to it along its own x- and y-axes, which
//! keeps neighbours aligned and their number low. Every sample ends up in exactly one patch: coverage is full by
//! construction, and no surface is stored twice.
//!
//! A patch is a height field, so two surfaces in one cube (the faces of a thin wall, a table top and its
//! underside) must not be averaged. Two things keep them apart: a patch takes only samples that were seen from
//! its front, where viewpoints are known; and it grows from its seed pixel by pixel, accepting only samples
//! close to the depth reached so far.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, HashSet, VecDeque};

use rayon::prelude::*;
use surfabet_geom::{Moments, Progress};

use super::frame::{Frame, PatchPose, add_scaled, dot, sub};
use super::samples::Samples;
use crate::error::Result;

/// Radii of the neighbourhoods that compete for the normal of a patch, in patch sizes. The plane that explains
/// most samples wins, so that a patch beside a corner follows one wall and not the diagonal.
const FIT_RADII: [f32; 4] = [0.7, 0.5, 0.35, 0.25];

/// A sample counts for a plane within this distance, in pixels.
const PLANE_GATE: f32 = 1.5;

/// Largest depth step, in pixels, that growth accepts between neighbouring pixels. With one pixel, no pixel
/// averages over more than twice its own width in depth; what lies beyond becomes a layer of its own.
const GROWTH_GATE: f32 = 1.0;

/// Samples about a seed that are looked at to find its plane, at most: more make it slower, not better.
const FIT_SAMPLES: usize = 2048;

/// An aligned position is taken when at least this fraction of its pixels would be set.
const ALIGNED_COVERAGE: f32 = 0.5;

/// Samples whose second variance is below this fraction of the first lie on a line.
const LINE: f64 = 1e-6;

/// Pixel grid of a patch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    /// Side of a pixel, metres.
    pub pixel: f32,
    /// Pixels per side.
    pub n: usize,
    /// Step of the lattice that patch centres lie on, metres.
    pub position_step: f32,
}

impl Grid {
    /// Side of a patch, metres.
    pub fn size(&self) -> f32 {
        self.pixel * self.n as f32
    }

    /// Row-major pixel of frame coordinates; positions on or past the rim belong to the pixel at the rim.
    pub fn pixel_of(&self, local: [f32; 3]) -> usize {
        let index = |c: f32| {
            let i = ((c + 0.5 * self.size()) / self.pixel).floor();
            (i.max(0.0) as usize).min(self.n - 1)
        };
        index(local[1]) * self.n + index(local[0])
    }
}

/// One placed patch and the samples it owns.
#[derive(Debug, Clone)]
pub(super) struct Placed {
    pub pose: PatchPose,
    pub members: Vec<u32>,
}

struct Trial {
    pose: PatchPose,
    frame: Frame,
    members: Vec<u32>,
    set_pixels: usize,
}

struct Plane {
    normal: [f32; 3],
    /// Distance of the seed from the plane along the normal.
    seed_offset: f32,
}

struct Placer {
    /// Positions, weights and views in the order of the cells, so that neighbours are close in memory; an index
    /// of a sample in this file is its place in that order.
    positions: Vec<[f32; 3]>,
    weights: Vec<f32>,
    views: Option<Vec<[f32; 3]>>,
    grid: Grid,
    cells: Cells,
    owned: Vec<bool>,
    /// Samples about the place looked at; kept to save allocations.
    near: Vec<u32>,
    /// Unowned samples and their depths in each pixel of the patch looked at; kept to save allocations.
    by_pixel: Vec<Vec<(u32, f32)>>,
}

/// Samples by cell of one patch size.
struct Cells {
    size: f32,
    /// Samples of each cell, as a range of places.
    ranges: Vec<(u32, u32)>,
    by_key: HashMap<[i32; 3], u32>,
    keys: Vec<[i32; 3]>,
    /// Cell of each place.
    of_place: Vec<u32>,
}

impl Cells {
    /// The cells of `positions`, and the order of the samples that makes cells contiguous.
    fn new(positions: &[[f32; 3]], size: f32) -> (Self, Vec<u32>) {
        let key = |p: &[f32; 3]| p.map(|c| (c / size).floor() as i32);
        let mut keyed: Vec<([i32; 3], u32)> =
            positions.par_iter().enumerate().map(|(i, p)| (key(p), i as u32)).collect();
        keyed.par_sort_unstable();
        let mut cells = Self {
            size,
            ranges: Vec::new(),
            by_key: HashMap::new(),
            keys: Vec::new(),
            of_place: Vec::with_capacity(positions.len()),
        };
        for (place, &(key, _)) in (0..).zip(&keyed) {
            if cells.keys.last() != Some(&key) {
                cells.by_key.insert(key, cells.keys.len() as u32);
                cells.keys.push(key);
                cells.ranges.push((place, place));
            }
            let cell = cells.keys.len() - 1;
            cells.ranges[cell].1 = place + 1;
            cells.of_place.push(cell as u32);
        }
        (cells, keyed.into_iter().map(|(_, i)| i).collect())
    }

    fn samples(&self, cell: usize) -> std::ops::Range<u32> {
        let (from, to) = self.ranges[cell];
        from..to
    }

    fn center(&self, cell: usize) -> [f32; 3] {
        self.keys[cell].map(|k| (k as f32 + 0.5) * self.size)
    }

    /// Collects the samples of all cells that a cube of half side `reach` about `center` touches.
    fn gather(&self, center: [f32; 3], reach: f32, into: &mut Vec<u32>) {
        into.clear();
        let low = center.map(|c| ((c - reach) / self.size).floor() as i32);
        let high = center.map(|c| ((c + reach) / self.size).floor() as i32);
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    if let Some(&cell) = self.by_key.get(&[x, y, z]) {
                        into.extend(self.samples(cell as usize));
                    }
                }
            }
        }
    }
}

/// Places patches until every sample is owned.
pub(super) fn place(samples: &Samples, grid: Grid, progress: &dyn Progress) -> Result<Vec<Placed>> {
    let (cells, order) = Cells::new(&samples.positions, grid.size());
    let mut unowned: Vec<u32> = cells.ranges.iter().map(|(a, b)| b - a).collect();
    let mut heap: BinaryHeap<(u32, Reverse<u32>)> =
        unowned.iter().enumerate().map(|(cell, &count)| (count, Reverse(cell as u32))).collect();
    let total = samples.len();
    let owned = vec![false; total];
    let by_pixel = vec![Vec::new(); grid.n * grid.n];
    let in_order = |values: &[[f32; 3]]| order.iter().map(|&i| values[i as usize]).collect();
    let mut placer = Placer {
        positions: in_order(&samples.positions),
        weights: order.iter().map(|&i| samples.weights[i as usize]).collect(),
        views: samples.views.as_deref().map(in_order),
        grid,
        cells,
        owned,
        near: Vec::new(),
        by_pixel,
    };
    let mut placed: Vec<Placed> = Vec::new();
    let mut aligned: VecDeque<[f32; 3]> = VecDeque::new();
    let mut tried: HashSet<[i32; 3]> = HashSet::new();
    let mut done = 0;

    loop {
        if placed.len() % 64 == 0 {
            progress.check()?;
            progress.update("placing patches", done as f32 / total.max(1) as f32);
        }
        let trial = if let Some(center) = aligned.pop_front() {
            let Some(seed) = placer.nearest_unowned(center, 0.5 * grid.size()) else { continue };
            let trial = placer.trial(seed, center);
            if (trial.set_pixels as f32) < ALIGNED_COVERAGE * (grid.n * grid.n) as f32 {
                continue;
            }
            trial
        } else if let Some((count, Reverse(cell))) = heap.pop() {
            let left = unowned[cell as usize];
            if left != count {
                if left > 0 {
                    heap.push((left, Reverse(cell)));
                }
                continue;
            }
            let seed = placer.seed_of(cell as usize);
            let trial = placer.trial(seed, placer.cells.center(cell as usize));
            heap.push((count, Reverse(cell)));
            trial
        } else {
            break;
        };
        for &i in &trial.members {
            placer.owned[i as usize] = true;
            unowned[placer.cells.of_place[i as usize] as usize] -= 1;
        }
        done += trial.members.len();
        let Frame { center, x, y, .. } = trial.frame;
        let size = grid.size();
        for (direction, sign) in [(x, 1.0), (x, -1.0), (y, 1.0), (y, -1.0)] {
            let next = add_scaled(center, sign * size, direction);
            // A position within a quarter patch of one tried before would only repeat it.
            if tried.insert(next.map(|c| (4.0 * c / size).round() as i32)) {
                aligned.push_back(next);
            }
        }
        let members = trial.members.iter().map(|&i| order[i as usize]).collect();
        placed.push(Placed { pose: trial.pose, members });
    }
    Ok(placed)
}

impl Placer {
    /// The unowned sample of a cell nearest to the mean of its unowned samples: it lies on a surface, where
    /// the mean itself may lie between two.
    fn seed_of(&self, cell: usize) -> u32 {
        let free = || self.cells.samples(cell).filter(|&i| !self.owned[i as usize]);
        let mut sum = [0.0_f64; 3];
        let mut count = 0.0;
        for i in free() {
            let p = self.positions[i as usize];
            (0..3).for_each(|a| sum[a] += f64::from(p[a]));
            count += 1.0;
        }
        let mean = sum.map(|s| (s / f64::max(count, 1.0)) as f32);
        self.nearest_to(mean, free()).unwrap_or_default()
    }

    fn nearest_to(&self, target: [f32; 3], candidates: impl Iterator<Item = u32>) -> Option<u32> {
        let distance = |i: u32| {
            let d = sub(self.positions[i as usize], target);
            dot(d, d)
        };
        candidates.min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)))
    }

    fn nearest_unowned(&mut self, center: [f32; 3], radius: f32) -> Option<u32> {
        let mut near = std::mem::take(&mut self.near);
        self.cells.gather(center, radius, &mut near);
        let seed =
            self.nearest_to(center, near.iter().copied().filter(|&i| !self.owned[i as usize]));
        self.near = near;
        let d = sub(self.positions[seed? as usize], center);
        seed.filter(|_| dot(d, d) <= radius * radius)
    }

    /// True when sample `i` was seen from the side that `normal` points to, or nothing is known of it.
    fn faces(&self, i: u32, normal: [f32; 3]) -> bool {
        self.views.as_ref().is_none_or(|views| dot(views[i as usize], normal) > 0.0)
    }

    /// The plane about sample `seed` that most unowned samples lie on.
    fn fit(&self, seed: u32) -> Plane {
        let p = self.positions[seed as usize];
        let toward_sensor = self.views.as_ref().map(|v| v[seed as usize]);
        let size = self.grid.size();
        let gate = PLANE_GATE * self.grid.pixel;
        // Only what was seen from the seed's side may shape the plane.
        let every = self.near.len().div_ceil(FIT_SAMPLES).max(1);
        let local: Vec<([f32; 3], f32, u32)> = self
            .near
            .iter()
            .step_by(every)
            .filter(|&&i| toward_sensor.is_none_or(|v| self.faces(i, v)))
            .map(|&i| {
                let d = sub(self.positions[i as usize], p);
                (d, dot(d, d), i)
            })
            .filter(|&(_, d2, _)| d2 < FIT_RADII[0] * FIT_RADII[0] * size * size)
            .collect();
        let plane_of = |keep: &dyn Fn(&([f32; 3], f32, u32)) -> bool| {
            let mut moments = Moments::default();
            for &(d, _, i) in local.iter().filter(|l| keep(l)) {
                moments.add(d.map(f64::from), f64::from(self.weights[i as usize]));
            }
            let axes = moments.principal_axes()?;
            // Points on a line, or one point, have no plane.
            if axes.variances[1] <= LINE * axes.variances[2] {
                return None;
            }
            let mut normal = axes.normal().map(|c| c as f32);
            let flip = match toward_sensor {
                Some(v) => dot(v, normal) < 0.0,
                // Without a viewpoint both signs are as good: the last non-zero coordinate is made positive.
                None => normal.iter().rev().find(|c| c.abs() > 1e-6).is_some_and(|c| *c < 0.0),
            };
            if flip {
                normal = normal.map(|c| -c);
            }
            let mean = moments.mean().map(|c| c as f32);
            Some(Plane { normal, seed_offset: -dot(mean, normal) })
        };
        let mut best: Option<(usize, Plane)> = None;
        for radius in FIT_RADII {
            let limit = radius * radius * size * size;
            let Some(plane) = plane_of(&|l| l.1 < limit) else { continue };
            let explained = local
                .iter()
                .filter(|(d, _, i)| !self.owned[*i as usize] && dot(*d, plane.normal).abs() < gate)
                .count();
            if best.as_ref().is_none_or(|(most, _)| explained > *most) {
                best = Some((explained, plane));
            }
        }
        let Some((_, first)) = best else {
            // One or two samples, or a line of them: they look at the sensor, or up.
            let normal = toward_sensor.unwrap_or([0.0, 0.0, 1.0]);
            return Plane { normal, seed_offset: 0.0 };
        };
        let refined = plane_of(&|(d, _, _)| dot(*d, first.normal).abs() < gate);
        match refined {
            Some(plane) if plane.seed_offset.abs() <= 2.0 * gate => plane,
            _ => Plane { seed_offset: 0.0, ..first },
        }
    }

    /// The patch that would describe the surface about `seed`, centred as near to `wanted` as the seed allows.
    fn trial(&mut self, seed: u32, wanted: [f32; 3]) -> Trial {
        let Grid { pixel, position_step, .. } = self.grid;
        let size = self.grid.size();
        let p = self.positions[seed as usize];
        let mut near = std::mem::take(&mut self.near);
        self.cells.gather(p, FIT_RADII[0] * size, &mut near);
        self.near = near;
        let plane = self.fit(seed);

        // The wanted centre, moved along the normal onto the plane and along the axes until it holds the seed.
        let axes = Frame::new(p, plane.normal);
        let inside = 0.5 * (size - pixel);
        let mut wanted = axes.to_local(wanted);
        wanted[0] = wanted[0].clamp(-inside, inside);
        wanted[1] = wanted[1].clamp(-inside, inside);
        wanted[2] = -plane.seed_offset;
        let pose = PatchPose::quantize(axes.to_world(wanted), plane.normal, position_step);
        let frame = pose.frame(position_step);

        let mut near = std::mem::take(&mut self.near);
        self.cells.gather(frame.center, 0.5 * size * 3.0_f32.sqrt(), &mut near);
        let half = 0.5 * size;
        let mut by_pixel = std::mem::take(&mut self.by_pixel);
        by_pixel.iter_mut().for_each(Vec::clear);
        for &i in &near {
            if self.owned[i as usize] {
                continue;
            }
            let local = frame.to_local(self.positions[i as usize]);
            let within = local.iter().all(|c| c.abs() <= half);
            if i == seed || (within && self.faces(i, frame.z)) {
                by_pixel[self.grid.pixel_of(local)].push((i, local[2]));
            }
        }
        self.near = near;

        let gate = GROWTH_GATE * pixel;
        let seed_local = frame.to_local(p);
        let (members, set_pixels) =
            self.grow(&by_pixel, self.grid.pixel_of(seed_local), seed_local[2], gate);
        self.by_pixel = by_pixel;
        Trial { pose, frame, members, set_pixels }
    }

    /// Follows the surface from pixel `start` at `depth` over the grid, breadth first. A pixel without accepted
    /// samples passes on the depth that it was expected at, so sparse scans do not fall apart.
    fn grow(
        &self,
        by_pixel: &[Vec<(u32, f32)>],
        start: usize,
        depth: f32,
        gate: f32,
    ) -> (Vec<u32>, usize) {
        let n = self.grid.n;
        let mut expected = vec![f32::NAN; n * n];
        expected[start] = depth;
        let mut queue = VecDeque::from([start]);
        let mut members = Vec::new();
        let mut set_pixels = 0;
        while let Some(pixel) = queue.pop_front() {
            let (mut sum, mut weight) = (0.0_f64, 0.0_f64);
            for &(i, d) in &by_pixel[pixel] {
                if (d - expected[pixel]).abs() <= gate {
                    let w = f64::from(self.weights[i as usize]);
                    sum += w * f64::from(d);
                    weight += w;
                    members.push(i);
                }
            }
            let reached = if weight > 0.0 {
                set_pixels += 1;
                (sum / weight) as f32
            } else {
                expected[pixel]
            };
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
        (members, set_pixels)
    }
}
