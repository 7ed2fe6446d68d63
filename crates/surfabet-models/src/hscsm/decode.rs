//! A model back into a cloud (section III-B, eq. 2 and 3), at any spacing.
//!
//! Each patch is a continuous surface: between pixel centres depth and colour are interpolated inside the mask.
//! Every set pixel yields points, so nothing that the model covers is lost at a coarse spacing either.

use surfabet_geom::{CloudParts, PointCloud, Progress};

use super::frame::Frame;
use super::intensity::IntensityLimits;
use super::model::{Channel, HscsmModel, Level};
use crate::color::{rounded, to_rgb};
use crate::contract::DecodeOptions;
use crate::error::{Result, check_points};
use crate::points::Points;

impl HscsmModel {
    /// The model as a cloud. Points come patch by patch; their number and order are not those of the input.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] for a spacing that is not positive, [`crate::Error::TooManyPoints`] above the
    /// limit, [`crate::Error::Cancelled`] when the caller asks to stop.
    pub fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        let finest = self.levels().iter().map(Level::mask_pixel).fold(f64::INFINITY, f64::min);
        options.expect_thin()?;
        let resolution = options.spacing(0.5 * finest)?;
        check_points(resolution, self.points_at(resolution), options.max_points)?;
        let mut all = Points::default();
        for level in self.levels() {
            let decoder = LevelDecoder::new(level, self.intensity(), resolution, options.normals);
            let patches: Vec<usize> = (0..level.len()).collect();
            all.extend(&patches, BLOCK, progress, |patches, points| {
                patches.iter().for_each(|&i| decoder.decode(i, points));
            })?;
        }
        progress.update("decoding", 1.0);
        let parts = CloudParts {
            origin: self.origin(),
            colors: self.has_color().then_some(all.colors),
            intensities: self.has_intensity().then_some(all.intensities),
            normals: options.normals.then_some(all.normals),
            positions: all.positions,
            ..CloudParts::default()
        };
        Ok(PointCloud::from_parts(parts)?.0)
    }

    /// Most points that are decoded at a spacing of `resolution` metres.
    pub(super) fn points_at(&self, resolution: f64) -> f64 {
        let of_level = |l: &Level| {
            let per_side = l.mask_pixel() / sampling(l, resolution).spacing.min(l.mask_pixel());
            l.set_pixels() as f64 * per_side * per_side
        };
        self.levels().iter().map(of_level).sum()
    }
}

/// Patches that one task decodes.
const BLOCK: usize = 64;

/// How a level is sampled at a given resolution.
struct Sampling {
    /// Distance of the samples, metres; divides the mask pixel or the patch evenly.
    spacing: f64,
    /// Samples per side of a mask pixel; zero when the spacing is coarser than one.
    per_pixel: usize,
    /// Cells per side of a patch when the spacing is coarser than a mask pixel.
    per_patch: usize,
}

fn sampling(level: &Level, resolution: f64) -> Sampling {
    let pixel = level.mask_pixel();
    // The small slack keeps 0.01 / 0.005 at two samples although neither is exact in binary.
    let per_pixel = (pixel / resolution - 1e-9).ceil().max(1.0);
    if resolution <= pixel * (1.0 + 1e-9) {
        let spacing = pixel / per_pixel;
        return Sampling { spacing, per_pixel: per_pixel as usize, per_patch: 0 };
    }
    let size = level.pixel_size * f64::from(level.pixels);
    let per_patch = (size / resolution - 1e-9).ceil().max(1.0);
    Sampling { spacing: size / per_patch, per_pixel: 0, per_patch: per_patch as usize }
}

struct LevelDecoder<'a> {
    level: &'a Level,
    sampling: Sampling,
    depth_atoms: Vec<f32>,
    color_atoms: Vec<f32>,
    /// Of intensities, which the colour images then are.
    limits: Option<IntensityLimits>,
    normals: bool,
}

/// Depth and colour of one patch at its pixels.
struct Pixels {
    n: usize,
    /// True where a pixel has a set mask pixel.
    set: Vec<bool>,
    depth: Vec<f32>,
    /// Planes of red, green and blue, or one of grey; empty without colour.
    color: Vec<f32>,
}

/// Which of the `n` x `n` pixels of a patch have a set mask pixel.
fn set_pixels(mask: &[u8], n: usize, scale: usize) -> Vec<bool> {
    let mut set = vec![false; n * n];
    for (row, line) in mask.chunks(n * scale).enumerate() {
        for (column, _) in line.iter().enumerate().filter(|(_, m)| **m != 0) {
            set[row / scale * n + column / scale] = true;
        }
    }
    set
}

/// Adds Σ λ d over the entries of patch `i` (eq. 3) to `image`.
fn add_code(channel: &Channel, atoms: &[f32], step: f64, i: usize, image: &mut [f32]) {
    let (entries, coefficients) = channel.codes.of(i);
    let n = image.len();
    for (&entry, &coefficient) in entries.iter().zip(coefficients) {
        let lambda = (f64::from(coefficient) * step) as f32;
        let atom = &atoms[usize::from(entry) * n..(usize::from(entry) + 1) * n];
        image.iter_mut().zip(atom).for_each(|(value, d)| *value += lambda * d);
    }
}

impl<'a> LevelDecoder<'a> {
    fn new(
        level: &'a Level,
        limits: Option<IntensityLimits>,
        resolution: f64,
        normals: bool,
    ) -> Self {
        Self {
            level,
            sampling: sampling(level, resolution),
            depth_atoms: level.depth.dictionary.atoms(),
            color_atoms: level.color.as_ref().map(|c| c.dictionary.atoms()).unwrap_or_default(),
            limits,
            normals,
        }
    }

    /// Depth and colour images of patch `i` (eq. 2).
    fn pixels(&self, i: usize) -> Pixels {
        let level = self.level;
        let area = level.area();
        let mean = (f64::from(level.depth.means[i]) * level.steps.depth_mean) as f32;
        let mut depth = vec![mean; area];
        add_code(&level.depth, &self.depth_atoms, level.steps.depth_code, i, &mut depth);
        let mut color = Vec::new();
        if let Some(channel) = &level.color {
            let planes = level.color_planes();
            let mean = |c: usize| {
                (f64::from(channel.means[planes * i + c]) * level.steps.color_mean) as f32
            };
            if planes == 1 {
                color.resize(area, mean(0));
            } else {
                for mean in to_rgb([mean(0), mean(1), mean(2)]) {
                    color.resize(color.len() + area, mean);
                }
            }
            add_code(channel, &self.color_atoms, level.steps.color_code, i, &mut color);
        }
        let set = set_pixels(level.mask(i), level.pixels as usize, level.mask_scale as usize);
        Pixels { n: level.pixels as usize, set, depth, color }
    }

    fn decode(&self, i: usize, points: &mut Points) {
        let pixels = self.pixels(i);
        let scale = self.level.mask_scale as usize;
        let n = pixels.n * scale;
        let frame = self.level.poses[i].frame(self.level.steps.position as f32);
        // Pixel coordinates of mask coordinates.
        let of_mask = |at: f32| (at + 0.5) / scale as f32 - 0.5;
        let mask = self.level.mask(i);
        let set = (0..n * n).filter(|&p| mask[p] != 0);
        if self.sampling.per_pixel > 0 {
            let m = self.sampling.per_pixel;
            let at = |whole: usize, part: usize| {
                of_mask(whole as f32 + (part as f32 + 0.5) / m as f32 - 0.5)
            };
            for pixel in set {
                for sub in 0..m * m {
                    let at = [at(pixel % n, sub % m), at(pixel / n, sub / m)];
                    self.emit(&pixels, &frame, at, points);
                }
            }
        } else {
            // One point per coarse cell that has a set pixel, at the mean of its set pixels.
            let cells = self.sampling.per_patch;
            let cell_of = |c: usize| (c * cells / n).min(cells - 1);
            let mut sums = vec![([0.0_f32; 2], 0.0_f32); cells * cells];
            for pixel in set {
                let (column, row) = (pixel % n, pixel / n);
                let sum = &mut sums[cell_of(row) * cells + cell_of(column)];
                sum.0[0] += column as f32;
                sum.0[1] += row as f32;
                sum.1 += 1.0;
            }
            for (sum, count) in sums.iter().filter(|(_, count)| *count > 0.0) {
                self.emit(&pixels, &frame, sum.map(|s| of_mask(s / count)), points);
            }
        }
    }

    /// One point at pixel coordinates `at` (0 is the centre of the first pixel).
    fn emit(&self, pixels: &Pixels, frame: &Frame, at: [f32; 2], points: &mut Points) {
        let corners = Corners::around(pixels, at);
        let depth = corners.mean(&pixels.depth);
        let pixel = self.level.pixel_size as f32;
        let center = 0.5 * (pixels.n as f32 - 1.0);
        let local = [(at[0] - center) * pixel, (at[1] - center) * pixel, depth];
        points.positions.push(frame.to_world(local));
        if !pixels.color.is_empty() {
            let area = pixels.n * pixels.n;
            // The one plane of grey stands for all three.
            let last = pixels.color.len() / area - 1;
            let rgb: [f32; 3] = std::array::from_fn(|c| {
                let plane = c.min(last) * area;
                corners.mean(&pixels.color[plane..plane + area])
            });
            match self.limits {
                Some(limits) => points.intensities.push(limits.intensity(rgb)),
                None => points.colors.push(rounded(rgb)),
            }
        }
        if self.normals {
            let slope = corners.slope(pixels);
            let length = (slope[0] * slope[0] + slope[1] * slope[1] + pixel * pixel).sqrt();
            points.normals.push(std::array::from_fn(|a| {
                (pixel * frame.z[a] - slope[0] * frame.x[a] - slope[1] * frame.y[a]) / length
            }));
        }
    }
}

/// The set pixels about a position and their bilinear weights, which sum to one.
struct Corners {
    pixels: [usize; 4],
    weights: [f32; 4],
    low: [usize; 2],
}

impl Corners {
    fn around(pixels: &Pixels, at: [f32; 2]) -> Self {
        let n = pixels.n;
        let last = (n - 1) as f32;
        let clamped = at.map(|c| c.clamp(0.0, last));
        let low = clamped.map(|c| (c as usize).min(n - 2));
        let part: [f32; 2] = std::array::from_fn(|a| clamped[a] - low[a] as f32);
        let mut corners = Self { pixels: [0; 4], weights: [0.0; 4], low };
        let mut total = 0.0;
        for k in 0..4 {
            let (dx, dy) = (k % 2, k / 2);
            let pixel = (low[1] + dy) * n + low[0] + dx;
            let wx = if dx == 1 { part[0] } else { 1.0 - part[0] };
            let wy = if dy == 1 { part[1] } else { 1.0 - part[1] };
            corners.pixels[k] = pixel;
            corners.weights[k] = if pixels.set[pixel] { wx * wy } else { 0.0 };
            total += corners.weights[k];
        }
        if total > 0.0 {
            corners.weights = corners.weights.map(|w| w / total);
        } else {
            // Only a mean over a coarse cell can fall between unset pixels: take the nearest set one.
            let distance = |p: usize| {
                let (dx, dy) = ((p % n) as f32 - at[0], (p / n) as f32 - at[1]);
                dx * dx + dy * dy
            };
            let set = (0..n * n).filter(|&p| pixels.set[p]);
            if let Some(nearest) = set.min_by(|&a, &b| distance(a).total_cmp(&distance(b))) {
                corners.pixels[0] = nearest;
                corners.weights = [1.0, 0.0, 0.0, 0.0];
            }
        }
        corners
    }

    fn mean(&self, image: &[f32]) -> f32 {
        (0..4).map(|k| self.weights[k] * image[self.pixels[k]]).sum()
    }

    /// Change of depth per pixel along columns and rows, from the set pixels alone.
    fn slope(&self, pixels: &Pixels) -> [f32; 2] {
        let n = pixels.n;
        let value = |x: usize, y: usize| {
            let pixel = y * n + x;
            (pixels.set[pixel]).then(|| pixels.depth[pixel])
        };
        let difference = |a: Option<f32>, b: Option<f32>| Some(b? - a?);
        let [x, y] = self.low;
        let mean = |pairs: [Option<f32>; 2]| {
            let known: Vec<f32> = pairs.into_iter().flatten().collect();
            known.iter().sum::<f32>() / known.len().max(1) as f32
        };
        [
            mean([
                difference(value(x, y), value(x + 1, y)),
                difference(value(x, y + 1), value(x + 1, y + 1)),
            ]),
            mean([
                difference(value(x, y), value(x, y + 1)),
                difference(value(x + 1, y), value(x + 1, y + 1)),
            ]),
        ]
    }
}
