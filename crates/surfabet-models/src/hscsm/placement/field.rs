//! The samples of a level, and what a patch at some place would take of them (section III-A).
//!
//! A patch is a height field, so two surfaces in one cube (the faces of a thin wall, a table top and its
//! underside) must not be averaged. Three things keep them apart: a patch takes only samples that were seen from
//! its front, where viewpoints are known; it grows from its seed pixel by pixel, accepting only samples
//! close to the depth reached so far; and above the lowest level pixels whose samples deviate too much are
//! masked out.

use std::collections::VecDeque;

use surfabet_geom::Moments;

use crate::groups::Groups;
use crate::hscsm::frame::{Frame, PatchPose};
use crate::hscsm::samples::cells::Cells;
use crate::hscsm::samples::{Sample, Samples};
use crate::vector::{dot, minus};

/// Radii of the neighbourhoods that compete for the normal of a patch, in patch sizes. The plane that explains
/// most points wins, so that a patch beside a corner follows one wall and not the diagonal.
const FIT_RADII: [f32; 4] = [0.7, 0.5, 0.35, 0.25];

/// Radius of the neighbourhood that gives the normal of a candidate, in patch sizes.
const CANDIDATE_RADIUS: f32 = 0.4;

/// A point counts for a plane within this distance, in pixels.
const PLANE_GATE: f32 = 1.5;

/// Points about a seed that are looked at to find its plane, at most: more make it slower, not better.
const FIT_POINTS: usize = 512;

/// An aligned patch keeps the normal of the patch it was found from when that explains at least this share of
/// what the best plane explains: parallel neighbours join without gaps.
const SAME_NORMAL: f32 = 0.95;

/// The plane of a seed is fitted to the points on it at most this often; it moves little after the second time.
const REFITS: usize = 4;

/// Refitting ends when the normal turns by less than this, radians.
const SAME_ANGLE: f32 = 1e-3;

/// Points whose second variance is below this fraction of the first lie on a line.
const LINE: f64 = 1e-6;

/// Above the lowest level the mean place of a pixel's samples is off its centre by at most this many pixels:
/// beyond, the surface ends inside the pixel, and the smaller pixels of the level below follow its rim. Samples
/// of a quarter of a pixel that cover all of one are off by an eighth at most.
const MAX_PIXEL_OFFSET: f64 = 0.2;

/// Most pixels of a patch.
const MAX_AREA: usize = 32 * 32;

/// Pixel grid of a patch.
#[derive(Debug, Clone, Copy)]
pub(in crate::hscsm) struct Grid {
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

    /// Pixels of a patch.
    pub fn area(&self) -> usize {
        self.n * self.n
    }

    /// Row-major pixel of frame coordinates; positions on or past the rim belong to the pixel at the rim.
    pub fn pixel_of(&self, local: [f32; 3]) -> usize {
        let half = 0.5 * self.size();
        // A cast of a negative number saturates at zero.
        let index = |c: f32| (((c + half) / self.pixel) as usize).min(self.n - 1);
        index(local[1]) * self.n + index(local[0])
    }
}

/// What a level accepts.
#[derive(Debug, Clone, Copy)]
pub(in crate::hscsm) struct Rules {
    /// Largest step in depth, metres, that growth accepts between neighbouring pixels.
    pub gate: f32,
    /// Fewest pixels with samples of a patch.
    pub min_covered: usize,
    /// Fewest pixels of a patch that are left when those above the largest deviations are masked out.
    pub min_pixels: usize,
    /// Largest variance of depth in a pixel, square metres (rho_max_depth squared).
    pub max_depth_variance: f64,
    /// Largest variance of colour in a pixel (rho_max_rgb squared).
    pub max_color_variance: f64,
}

/// Weighted sums over the samples of a pixel.
#[derive(Clone, Copy, Default)]
struct PixelSums {
    weight: f64,
    count: f64,
    /// Along the patch's x- and y-axes, without weights: where samples are, not how well they were seen.
    place: [f64; 2],
    depth: f64,
    depth_square: f64,
    color: [f64; 3],
    color_square: f64,
}

impl PixelSums {
    /// Adds a sample at `local` of a frame with unit normal `z`.
    fn add(&mut self, s: &Sample, local: [f32; 3], z: [f32; 3]) {
        let [xx, xy, xz, yy, yz, zz] = s.covariance;
        let spread = z[0] * (z[0] * xx + 2.0 * (z[1] * xy + z[2] * xz))
            + z[1] * (z[1] * yy + 2.0 * z[2] * yz)
            + z[2] * z[2] * zz;
        let (w, d) = (f64::from(s.weight), f64::from(local[2]));
        self.weight += w;
        self.count += 1.0;
        self.place[0] += f64::from(local[0]);
        self.place[1] += f64::from(local[1]);
        self.depth += w * d;
        self.depth_square += w * (d * d + f64::from(spread));
        let color = s.color.map(f64::from);
        (0..3).for_each(|c| self.color[c] += w * color[c]);
        let square = color.iter().map(|c| c * c).sum::<f64>() / 3.0;
        self.color_square += w * (square + f64::from(s.color_variance));
    }

    fn depth_mean(&self) -> f64 {
        self.depth / self.weight
    }

    fn depth_variance(&self) -> f64 {
        let mean = self.depth_mean();
        self.depth_square / self.weight - mean * mean
    }

    fn color_variance(&self) -> f64 {
        let means = self.color.map(|c| c / self.weight);
        self.color_square / self.weight - means.iter().map(|c| c * c).sum::<f64>() / 3.0
    }
}

impl Rules {
    /// True when all pixels are accepted.
    fn is_open(&self) -> bool {
        self.min_covered == 0
            && self.max_depth_variance == f64::INFINITY
            && self.max_color_variance == f64::INFINITY
    }

    /// True when depth and colour of a pixel deviate no more than allowed.
    fn steady(&self, sums: &PixelSums) -> bool {
        sums.depth_variance() <= self.max_depth_variance
            && sums.color_variance() <= self.max_color_variance
    }

    /// True when the samples of a pixel are described by a mean over all of it.
    fn accept(&self, sums: &PixelSums, pixel: usize, grid: Grid) -> bool {
        let half = 0.5 * (grid.n as f64 - 1.0);
        let side = f64::from(grid.pixel);
        let off =
            |sum: f64, index: usize| (sum / sums.count - (index as f64 - half) * side).abs() / side;
        self.max_depth_variance == f64::INFINITY
            || self.steady(sums)
                && off(sums.place[0], pixel % grid.n) <= MAX_PIXEL_OFFSET
                && off(sums.place[1], pixel / grid.n) <= MAX_PIXEL_OFFSET
    }
}

/// Which samples are owned, and how many free ones each point has.
pub(in crate::hscsm) struct Ownership {
    /// By sample.
    pub owned: Vec<bool>,
    /// By point.
    pub free: Vec<u32>,
}

/// A patch that could be placed.
pub(in crate::hscsm) struct Trial {
    pub pose: PatchPose,
    pub frame: Frame,
    /// Samples it would own, and the pixel of each.
    pub members: Vec<(u32, u16)>,
    /// Pixels with samples.
    pub covered: usize,
    /// Pixels that are set.
    pub set_pixels: usize,
}

struct Plane {
    normal: [f32; 3],
    /// Distance of the seed from the plane along the normal.
    seed_offset: f32,
}

/// A point about a seed.
struct Neighbour {
    /// From the seed, metres.
    offset: [f32; 3],
    /// Its squared length.
    squared: f32,
    weight: f32,
}

/// Memory that trials use again and again.
#[derive(Default)]
pub(in crate::hscsm) struct Scratch {
    sums: Vec<PixelSums>,
    by_pixel: Vec<Vec<(u32, [f32; 3])>>,
    near: Vec<Neighbour>,
    offsets: Vec<([f32; 3], f32)>,
}

/// The samples, of half a pixel of the lowest level, and the points of about a pixel that they are merged to.
pub(in crate::hscsm) struct Field<'a> {
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
    cells: Cells,
    pub grid: Grid,
    pub rules: Rules,
}

impl<'a> Field<'a> {
    /// The field of the level whose pixels were doubled `doublings` times.
    pub fn new(samples: &'a Samples, doublings: u32, grid: Grid, rules: Rules) -> Self {
        let (points, children) = samples.coarser(doublings.max(1));
        let point_doublings = u32::from(doublings > 0);
        let mut parents = vec![0; samples.len()];
        for point in 0..points.len() {
            for &i in children.of(point) {
                parents[i as usize] = point as u32;
            }
        }
        // Cells of about half a patch: few to look up, few points in vain.
        let cells = Cells::new(&points, (grid.n / 2).max(1).ilog2() + point_doublings);
        let positions = points.all.iter().map(|s| s.position).collect();
        Self { samples, points, point_doublings, positions, children, parents, cells, grid, rules }
    }

    /// One point per pixel-sized cube: the middle one along the Morton curve.
    pub fn candidates(&self) -> Vec<u32> {
        let cube = |k: u32| self.points.all[k as usize].key >> (3 * self.point_doublings);
        let all: Vec<u32> = (0..self.points.len() as u32).collect();
        all.chunk_by(|&a, &b| cube(a) == cube(b)).map(|c| c[c.len() / 2]).collect()
    }

    /// Counts the samples of each point that the levels above have left, which `owned` tells.
    pub fn ownership(&self, owned: Vec<bool>) -> Ownership {
        let left = |k: usize| self.children.of(k).iter().filter(|&&i| !owned[i as usize]).count();
        let free = (0..self.points.len()).map(|k| left(k) as u32).collect();
        Ownership { owned, free }
    }

    /// True when `s` was seen from the side that `normal` points to, or nothing is known of it.
    fn faces(&self, s: &Sample, normal: [f32; 3]) -> bool {
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

    /// The least-squares plane of weighted points, turned to where `view` points, or up without one.
    fn plane(
        points: impl Iterator<Item = ([f32; 3], f32)>,
        view: Option<[f32; 3]>,
    ) -> Option<Plane> {
        let moments = Moments::of_offsets(points);
        let axes = moments.principal_axes()?;
        // Points on a line, or one point, have no plane.
        if axes.variances[1] <= LINE * axes.variances[2] {
            return None;
        }
        let mut normal = axes.normal().map(|c| c as f32);
        let flip = match view {
            Some(v) => dot(v, normal) < 0.0,
            // Without a viewpoint both signs are as good: the last non-zero coordinate is made positive.
            None => normal.iter().rev().find(|c| c.abs() > 1e-6).is_some_and(|c| *c < 0.0),
        };
        if flip {
            normal = normal.map(|c| -c);
        }
        let mean = moments.mean().map(|c| c as f32);
        Some(Plane { normal, seed_offset: -dot(mean, normal) })
    }

    fn view_of(&self, s: &Sample) -> Option<[f32; 3]> {
        (self.samples.has_views && s.view != [0.0; 3]).then_some(s.view)
    }

    /// Normal of point `k` as a candidate, from one neighbourhood.
    pub fn candidate_normal(&self, k: usize, scratch: &mut Scratch) -> [f32; 3] {
        let radius = CANDIDATE_RADIUS * self.grid.size();
        let at = &self.points.all[k];
        let view = self.view_of(at);
        let offsets = &mut scratch.offsets;
        offsets.clear();
        self.near(at.position, radius, |i, p| {
            let d = minus(p, at.position);
            if dot(d, d) < radius * radius {
                let s = &self.points.all[i];
                if view.is_none_or(|v| self.faces(s, v)) {
                    offsets.push((d, s.weight));
                }
            }
        });
        Self::plane(offsets.iter().copied(), view)
            .map_or_else(|| view.unwrap_or([0.0, 0.0, 1.0]), |plane| plane.normal)
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
            .filter(|&i| sums[i].weight > 0.0 && self.rules.steady(&sums[i]))
            .count();
        scratch.sums = sums;
        if covered < self.rules.min_covered { 0 } else { set }
    }

    /// The plane about `seed` that most points lie on, or the one with the normal `known` if as good. Owned points
    /// count as well: what is left between patches continues their surface, where alone it would be a mere strip.
    fn fit(&self, seed: &Sample, known: Option<[f32; 3]>, near: &mut Vec<Neighbour>) -> Plane {
        let view = self.view_of(seed);
        let size = self.grid.size();
        let gate = PLANE_GATE * self.grid.pixel;
        let radius = FIT_RADII[0] * size;
        near.clear();
        self.near(seed.position, radius, |k, p| {
            let d = minus(p, seed.position);
            let squared = dot(d, d);
            if squared < radius * radius {
                let s = &self.points.all[k];
                // Only what was seen from the seed's side may shape the plane.
                if view.is_none_or(|v| self.faces(s, v)) {
                    near.push(Neighbour { offset: d, squared, weight: s.weight });
                }
            }
        });
        let every = near.len().div_ceil(FIT_POINTS).max(1);
        let local = || near.iter().step_by(every);
        let explained =
            |normal: [f32; 3]| local().filter(|l| dot(l.offset, normal).abs() < gate).count();
        let mut best: Option<(usize, Plane)> = None;
        for radius in FIT_RADII {
            let limit = radius * radius * size * size;
            let within = local().filter(|l| l.squared < limit).map(|l| (l.offset, l.weight));
            let Some(plane) = Self::plane(within, view) else { continue };
            let explained = explained(plane.normal);
            if best.as_ref().is_none_or(|(most, _)| explained > *most) {
                best = Some((explained, plane));
            }
        }
        let Some((most, first)) = best else {
            // One or two points, or a line of them: they look at the sensor, or up.
            let normal = view.unwrap_or([0.0, 0.0, 1.0]);
            return Plane { normal, seed_offset: 0.0 };
        };
        let on = |normal: [f32; 3]| {
            local()
                .filter(move |l| dot(l.offset, normal).abs() < gate)
                .map(|l| (l.offset, l.weight))
        };
        if let Some(normal) = known
            && explained(normal) as f32 >= SAME_NORMAL * most as f32
        {
            let moments = Moments::of_offsets(on(normal));
            let seed_offset = -dot(moments.mean().map(|c| c as f32), normal);
            return Plane { normal, seed_offset };
        }
        // The first plane may lie between two sheets; parallels to it through the seed lead to the seed's own.
        let mut found = Plane { seed_offset: 0.0, ..first };
        for _ in 0..REFITS {
            match Self::plane(on(found.normal), view) {
                Some(plane) if plane.seed_offset.abs() <= 2.0 * gate => {
                    let turn = minus(plane.normal, found.normal);
                    found = plane;
                    if dot(turn, turn) < SAME_ANGLE * SAME_ANGLE {
                        break;
                    }
                }
                _ => break,
            }
        }
        found
    }

    /// The patch that would describe the surface about point `seed`, centred as near to `wanted` as the seed
    /// allows, with the normal `known` if that fits about as well as the best. `None` without free samples.
    pub fn trial(
        &self,
        ownership: &Ownership,
        seed: usize,
        wanted: [f32; 3],
        known: Option<[f32; 3]>,
        scratch: &mut Scratch,
    ) -> Option<Trial> {
        let Grid { pixel, position_step, .. } = self.grid;
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

        let half = 0.5 * size;
        let by_pixel = &mut scratch.by_pixel;
        by_pixel.resize_with(self.grid.area(), Vec::new);
        by_pixel.iter_mut().for_each(Vec::clear);
        let reach: [f32; 3] = std::array::from_fn(|a| {
            half * (frame.x[a].abs() + frame.y[a].abs() + frame.z[a].abs()) + pixel
        });
        let low = std::array::from_fn(|a| frame.center[a] - reach[a]);
        let high = std::array::from_fn(|a| frame.center[a] + reach[a]);
        self.cells.in_box(low, high, |range| {
            for k in range.filter(|&k| ownership.free[k] > 0) {
                for &i in self.children.of(k) {
                    let s = &self.samples.all[i as usize];
                    if ownership.owned[i as usize] {
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
        let local = frame.to_local(p);
        let mut trial = Trial { pose, frame, members: Vec::new(), covered: 0, set_pixels: 0 };
        self.grow(by_pixel, self.grid.pixel_of(local), local[2], &mut trial);
        Some(trial)
    }

    /// Follows the surface from pixel `start` at `depth` over the grid, breadth first. A pixel without accepted
    /// samples passes on the depth that it was expected at, so sparse scans do not fall apart.
    fn grow(&self, by_pixel: &[Vec<(u32, [f32; 3])>], start: usize, depth: f32, trial: &mut Trial) {
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
