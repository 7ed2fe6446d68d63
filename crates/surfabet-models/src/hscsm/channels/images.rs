//! Depth image, colour image and bitmask of a patch (section III, figure 2).
//!
//! A pixel's depth is the weighted mean distance of its samples from the patch plane along the normal, its
//! colour their weighted mean colour; its bit is set when the patch owns samples in it.

use surfabet_base::parallel;

use crate::hscsm::placement::{OwnedPatch, PixelGrid};
use crate::hscsm::samples::Samples;

/// The images of all patches, patch after patch, row-major; values at unset pixels are zero.
#[derive(Debug, Clone)]
pub(in crate::hscsm) struct Images {
    /// Metres along the normal.
    pub depth: Vec<f32>,
    /// All of red, then green, then blue of a patch, or its one plane of grey, 0 to 255.
    pub color: Option<Vec<f32>>,
    /// 1 where a pixel is set.
    pub mask: Vec<u8>,
    /// The bitmask: 1 where a mask pixel is set. Finer than the images where there are several mask pixels per pixel.
    pub bitmask: Vec<u8>,
}

/// Projects the samples of each patch into its frame, with `mask_scale` mask pixels per side of a pixel and colour
/// images of `planes` planes.
pub(in crate::hscsm) fn project(
    samples: &Samples,
    placed: &[OwnedPatch],
    grid: PixelGrid,
    mask_scale: u32,
    planes: usize,
) -> Images {
    let area = grid.n * grid.n;
    let scale = mask_scale as usize;
    let fine = PixelGrid { pixel: grid.pixel / mask_scale as f32, n: grid.n * scale, ..grid };
    let one = |patch: &OwnedPatch| {
        let frame = patch.pose.frame(grid.position_step);
        let mut sums = vec![[0.0_f64; 5]; area];
        let mut bitmask = vec![0; fine.area()];
        for &i in &patch.members {
            let sample = &samples.all[i as usize];
            let local = frame.to_local(sample.position);
            let at = fine.pixel_of(local);
            bitmask[at] = 1;
            let w = f64::from(sample.weight);
            let sum = &mut sums[at / fine.n / scale * grid.n + at % fine.n / scale];
            sum[0] += w;
            sum[1] += w * f64::from(local[2]);
            (0..3).for_each(|c| sum[2 + c] += w * f64::from(sample.color[c]));
        }
        // Zero where a pixel is not set.
        let mean =
            |sum: &[f64; 5], i: usize| if sum[0] > 0.0 { (sum[i] / sum[0]) as f32 } else { 0.0 };
        let plane = |i: usize| sums.iter().map(move |sum| mean(sum, i));
        Images {
            depth: plane(1).collect(),
            color: samples.has_color.then(|| (2..2 + planes).flat_map(plane).collect()),
            mask: sums.iter().map(|sum| u8::from(sum[0] > 0.0)).collect(),
            bitmask,
        }
    };
    let all: Vec<Images> = parallel::map(placed, one);
    let mut images = Images {
        depth: Vec::with_capacity(placed.len() * area),
        color: samples.has_color.then(|| Vec::with_capacity(placed.len() * area * planes)),
        mask: Vec::with_capacity(placed.len() * area),
        bitmask: Vec::with_capacity(placed.len() * fine.area()),
    };
    for of_patch in all {
        images.depth.extend(of_patch.depth);
        if let (Some(all), Some(color)) = (&mut images.color, of_patch.color) {
            all.extend(color);
        }
        images.mask.extend(of_patch.mask);
        images.bitmask.extend(of_patch.bitmask);
    }
    images
}
