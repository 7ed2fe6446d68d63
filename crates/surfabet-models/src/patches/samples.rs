//! Points merged into samples of half a pixel: the sub-sampled cloud P' of section III-A.
//!
//! A sample keeps what the pixels need: the weighted mean of position and colour, the total weight, and the mean
//! direction to the sensors that saw it.

use rayon::prelude::*;
use surfabet_geom::{PointCloud, Progress, VoxelGrid};

use super::frame::{dot, sub};
use super::options::PatchOptions;
use crate::error::Result;

/// Side of the cells that points are merged in, in pixels.
const SAMPLE_SIZE: f64 = 0.5;

/// Merged points, relative to the cloud's origin.
#[derive(Debug, Clone)]
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
