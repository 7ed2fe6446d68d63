//! What both methods share in making points: options, limits and the gathering of what many tasks made.

use rayon::prelude::*;
use surfabet_geom::Progress;

use crate::error::{Result, positive};

/// How to decode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecodeOptions {
    /// Spacing of the points, metres; `None`: half of the finest level's pixel.
    pub resolution: Option<f64>,
    /// Fill the thickness that the scan had, where the model keeps it.
    pub as_measured: bool,
    /// Give each point the normal of its patch surface.
    pub normals: bool,
    /// Refuse to produce more points than this.
    pub max_points: u64,
}

impl Default for DecodeOptions {
    fn default() -> Self {
        Self { resolution: None, as_measured: false, normals: false, max_points: 2_000_000_000 }
    }
}

impl DecodeOptions {
    /// Spacing in force for pixels of `pixel` metres on the finest level.
    pub(crate) fn spacing(&self, pixel: f64) -> Result<f64> {
        let spacing = self.resolution.unwrap_or(0.5 * pixel);
        positive("resolution", spacing, "a positive number of metres")?;
        Ok(spacing)
    }
}

/// Points of some patches.
#[derive(Default)]
pub(crate) struct Points {
    pub positions: Vec<[f32; 3]>,
    pub colors: Vec<[u8; 3]>,
    pub normals: Vec<[f32; 3]>,
}

impl Points {
    /// Adds what `make` makes of `patches`, `block` of them at a time, in their order.
    pub fn extend<T: Sync>(
        &mut self,
        patches: &[T],
        block: usize,
        progress: &dyn Progress,
        make: impl Fn(&[T], &mut Self) + Sync,
    ) -> Result<()> {
        let made: Vec<Result<Self>> = patches
            .par_chunks(block)
            .map(|patches| {
                progress.check()?;
                let mut points = Self::default();
                make(patches, &mut points);
                Ok(points)
            })
            .collect();
        for points in made {
            let points = points?;
            self.positions.extend(points.positions);
            self.colors.extend(points.colors);
            self.normals.extend(points.normals);
        }
        Ok(())
    }
}
