//! The pixel grid of a patch, and the pixels that a level accepts.

use crate::hscsm::samples::Sample;

/// Pixel grid of a patch.
#[derive(Debug, Clone, Copy)]
pub(in crate::hscsm) struct PixelGrid {
    /// Side of a pixel, metres.
    pub pixel: f32,
    /// Pixels per side.
    pub n: usize,
    /// Step of the lattice that patch centres lie on, metres.
    pub position_step: f32,
}

impl PixelGrid {
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
    /// Pixels that the mean place of a pixel's samples is off its centre, at most.
    pub max_pixel_offset: f64,
}

/// Weighted sums over the samples of a pixel.
#[derive(Clone, Copy, Default)]
pub(in crate::hscsm) struct PixelSums {
    pub weight: f64,
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
    pub fn add(&mut self, s: &Sample, local: [f32; 3], z: [f32; 3]) {
        let [xx, xy, xz, yy, yz, zz] = s.covariance;
        // z^T C z, the variance of the sample's points along the normal.
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

    /// Weighted mean depth of the samples.
    pub fn depth_mean(&self) -> f64 {
        self.depth / self.weight
    }

    /// Weighted variance of the points' depths: between samples, and along the normal within each.
    fn depth_variance(&self) -> f64 {
        let mean = self.depth_mean();
        self.depth_square / self.weight - mean * mean
    }

    /// Weighted variance of the points' colours, mean of the three channels.
    fn color_variance(&self) -> f64 {
        let means = self.color.map(|c| c / self.weight);
        self.color_square / self.weight - means.iter().map(|c| c * c).sum::<f64>() / 3.0
    }
}

impl Rules {
    /// True when all pixels are accepted.
    pub fn is_open(&self) -> bool {
        self.min_covered == 0
            && self.max_depth_variance == f64::INFINITY
            && self.max_color_variance == f64::INFINITY
    }

    /// True when depth and colour of a pixel deviate no more than allowed.
    pub fn is_steady(&self, sums: &PixelSums) -> bool {
        sums.depth_variance() <= self.max_depth_variance
            && sums.color_variance() <= self.max_color_variance
    }

    /// True when the samples of a pixel are described by a mean over all of it: they deviate little, and their mean place
    /// is near its centre.
    pub fn accept(&self, sums: &PixelSums, pixel: usize, grid: PixelGrid) -> bool {
        let half = 0.5 * (grid.n as f64 - 1.0);
        let side = f64::from(grid.pixel);
        let off =
            |sum: f64, index: usize| (sum / sums.count - (index as f64 - half) * side).abs() / side;
        self.is_open()
            || self.is_steady(sums)
                && off(sums.place[0], pixel % grid.n) <= self.max_pixel_offset
                && off(sums.place[1], pixel / grid.n) <= self.max_pixel_offset
    }
}
