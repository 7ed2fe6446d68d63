//! Gathers the decoded points of many tasks in their order.

use surfabet_base::parallel;
use surfabet_geom::Progress;

use crate::error::Result;

/// Points of some patches.
#[derive(Default)]
pub(crate) struct Points {
    pub positions: Vec<[f32; 3]>,
    pub colors: Vec<[u8; 3]>,
    pub intensities: Vec<f32>,
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
        let made = parallel::try_map_chunks(patches, block, |patches| -> Result<Self> {
            progress.check()?;
            let mut points = Self::default();
            make(patches, &mut points);
            Ok(points)
        })?;
        for points in made {
            self.positions.extend(points.positions);
            self.colors.extend(points.colors);
            self.intensities.extend(points.intensities);
            self.normals.extend(points.normals);
        }
        Ok(())
    }
}
