//! Depth image, colour image and bitmask of a patch (section III, figure 2).
//!
//! A pixel's depth is the weighted mean distance of its samples from the patch plane along the normal, its
//! colour their weighted mean colour; its bit is set when the patch owns samples in it.

use rayon::prelude::*;

use crate::hscsm::placement::{OwnedPatch, PixelGrid};
use crate::hscsm::samples::Samples;

/// The images of all patches, patch after patch, row-major; values at unset pixels are zero.
#[derive(Debug, Clone)]
pub(in crate::hscsm) struct Images {
    /// Metres along the normal.
    pub depth: Vec<f32>,
    /// All of red, then green, then blue of a patch, 0 to 255.
    pub color: Option<Vec<f32>>,
    /// 1 where a pixel is set.
    pub mask: Vec<u8>,
}

/// Projects the samples of each patch into its frame.
pub(in crate::hscsm) fn project(
    samples: &Samples,
    placed: &[OwnedPatch],
    grid: PixelGrid,
) -> Images {
    let area = grid.n * grid.n;
    let mut images = Images {
        depth: vec![0.0; placed.len() * area],
        color: samples.has_color.then(|| vec![0.0; placed.len() * area * 3]),
        mask: vec![0; placed.len() * area],
    };
    let one =
        |patch: &OwnedPatch, depth: &mut [f32], mask: &mut [u8], color: Option<&mut [f32]>| {
            let frame = patch.pose.frame(grid.position_step);
            let mut sums = vec![[0.0_f64; 5]; area];
            for &i in &patch.members {
                let sample = &samples.all[i as usize];
                let local = frame.to_local(sample.position);
                let w = f64::from(sample.weight);
                let sum = &mut sums[grid.pixel_of(local)];
                sum[0] += w;
                sum[1] += w * f64::from(local[2]);
                (0..3).for_each(|c| sum[2 + c] += w * f64::from(sample.color[c]));
            }
            for (pixel, sum) in sums.iter().enumerate().filter(|(_, s)| s[0] > 0.0) {
                mask[pixel] = 1;
                depth[pixel] = (sum[1] / sum[0]) as f32;
            }
            if let Some(color) = color {
                for (pixel, sum) in sums.iter().enumerate().filter(|(_, s)| s[0] > 0.0) {
                    (0..3).for_each(|c| color[c * area + pixel] = (sum[2 + c] / sum[0]) as f32);
                }
            }
        };
    let planes = (images.depth.par_chunks_mut(area), images.mask.par_chunks_mut(area));
    match &mut images.color {
        Some(color) => placed
            .par_iter()
            .zip(planes.0)
            .zip(planes.1)
            .zip(color.par_chunks_mut(3 * area))
            .for_each(|(((patch, depth), mask), color)| one(patch, depth, mask, Some(color))),
        None => placed
            .par_iter()
            .zip(planes.0)
            .zip(planes.1)
            .for_each(|((patch, depth), mask)| one(patch, depth, mask, None)),
    }
    images
}
