//! Points merged into samples of half a pixel: the sub-sampled cloud P' of section III-A.
//!
//! A sample keeps what the pixels need: the weighted mean of position and colour, the total weight, and the mean
//! direction to the sensors that saw it.

use rayon::prelude::*;
use surfabet_geom::{PointCloud, Progress};

use super::frame::{dot, sub};
use super::options::PatchOptions;
use crate::error::Result;

/// Side of the cells that points are merged in, in pixels.
const SAMPLE_SIZE: f64 = 0.5;

/// Bits of a cell coordinate in a sort key.
const KEY_BITS: u32 = 21;

/// Samples that one task merges.
const BLOCK: usize = 1 << 14;

/// Merged points, relative to the cloud's origin, in the order of their cells.
#[derive(Debug, Clone, Default)]
pub(super) struct Samples {
    /// Weighted mean position, metres.
    pub positions: Vec<[f32; 3]>,
    /// Weighted mean colour, 0 to 255.
    pub colors: Option<Vec<[f32; 3]>>,
    /// Sum of the points' weights.
    pub weights: Vec<f32>,
    /// Unit direction towards the sensors, weighted mean; zero where they cancel out.
    pub views: Option<Vec<[f32; 3]>>,
}

/// Sums over the points of a cell.
#[derive(Default)]
struct Sums {
    weight: f64,
    position: [f64; 3],
    color: [f64; 3],
    view: [f64; 3],
}

/// One merged sample: position, colour, weight, view.
type Sample = ([f32; 3], [f32; 3], f32, [f32; 3]);

impl Samples {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Merges the points of `cloud`, each weighted by what its sensor's depth error makes of its range.
    ///
    /// The cloud must span less than 2^21 cells; [`learn`](super::learn) checks its extent before.
    pub fn merge(
        cloud: &PointCloud,
        options: &PatchOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let cell = (SAMPLE_SIZE * options.resolution) as f32;
        let key = |p: &[f32; 3]| {
            p.iter().fold(0_u64, |key, c| {
                // Shifting by half the range makes every coordinate of a checked cloud positive.
                let index = (c / cell).floor() as i64 + (1 << (KEY_BITS - 1));
                key << KEY_BITS | index.clamp(0, (1 << KEY_BITS) - 1) as u64
            })
        };
        let positions = cloud.positions();
        let mut order: Vec<(u64, u32)> =
            positions.par_iter().enumerate().map(|(i, p)| (key(p), i as u32)).collect();
        progress.check()?;
        order.par_sort_unstable();
        progress.check()?;
        let mut starts: Vec<usize> = (0..order.len())
            .into_par_iter()
            .filter(|&i| i == 0 || order[i - 1].0 != order[i].0)
            .collect();
        starts.push(order.len());
        let merged: Vec<Sample> = (0..starts.len() - 1)
            .into_par_iter()
            .with_min_len(BLOCK)
            .map(|s| merge_cell(cloud, options, &order[starts[s]..starts[s + 1]]))
            .collect();
        progress.check()?;
        Ok(Self {
            positions: merged.par_iter().map(|s| s.0).collect(),
            colors: cloud.colors().map(|_| merged.par_iter().map(|s| s.1).collect()),
            weights: merged.par_iter().map(|s| s.2).collect(),
            views: cloud.viewpoints().map(|_| merged.par_iter().map(|s| s.3).collect()),
        })
    }
}

fn merge_cell(cloud: &PointCloud, options: &PatchOptions, points: &[(u64, u32)]) -> Sample {
    let mut sums = Sums::default();
    for &(_, i) in points {
        let i = i as usize;
        let weight = cloud.ranges().map_or(1.0, |r| f64::from(options.sensor.weight(r[i])));
        let p = cloud.positions()[i];
        sums.weight += weight;
        (0..3).for_each(|a| sums.position[a] += weight * f64::from(p[a]));
        if let Some(colors) = cloud.colors() {
            (0..3).for_each(|c| sums.color[c] += weight * f64::from(colors[i][c]));
        }
        if let Some(sensor) = cloud.local_viewpoint(i) {
            let v = unit(sub(sensor, p));
            (0..3).for_each(|a| sums.view[a] += weight * f64::from(v[a]));
        }
    }
    let mean = |sum: [f64; 3]| sum.map(|s| (s / sums.weight) as f32);
    (mean(sums.position), mean(sums.color), sums.weight as f32, unit(mean(sums.view)))
}

/// `v` at unit length; zero stays zero.
fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(v, v).sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { v }
}
