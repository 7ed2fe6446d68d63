//! From words and poses back to a cloud (eq. 2).

use rayon::prelude::*;
use surfabet_geom::{CloudParts, PointCloud, Progress, Viewpoints};

use super::candidates::coverage::raster;
use super::model::AlphabetModel;
use super::placement::Stand;
use super::word::Word;
use crate::contract::DecodeOptions;
use crate::error::{Result, check_points};

impl AlphabetModel {
    /// The model as a cloud: word by word, row by row, seen from the sensors that saw the scan.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] for a spacing that is not positive, [`crate::Error::TooManyPoints`],
    /// [`crate::Error::Cancelled`].
    pub fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        options.check()?;
        options.expect_thin()?;
        let unit = self.unit();
        let raster_of = |stand: &Stand| match options.resolution {
            Some(resolution) => {
                let n = (2.0 * stand.radius * unit / resolution).round().max(1.0);
                (n, 2.0 * stand.radius / n)
            }
            None => {
                let (n, step) = raster(stand, self.header().spacing);
                (n as f64, step)
            }
        };
        let stands: Vec<(Stand, &Word)> = self.stands().collect();
        let most: f64 = stands.iter().map(|(stand, _)| raster_of(stand).0.powi(2)).sum();
        let first = stands.first().map_or(0.0, |(stand, _)| stand.radius * unit);
        check_points(options.resolution.unwrap_or(first), most, options.max_points)?;
        let blocks: Vec<Vec<[f32; 3]>> = stands
            .par_iter()
            .map(|(stand, word)| {
                progress.check()?;
                let (n, step) = raster_of(stand);
                let at = |i: u64| (i as f64 + 0.5) * step - stand.radius;
                let mut points = Vec::new();
                for i in 0..(n * n) as u64 {
                    let [right, up] = [at(i % n as u64), at(i / n as u64)];
                    let height = word.height(right / stand.radius, up / stand.radius);
                    if let Some(h) = height {
                        let p = stand.global([right, up, h * stand.radius]);
                        points.push(p.map(|c| (c * unit) as f32));
                    }
                }
                Ok(points)
            })
            .collect::<Result<_>>()?;
        fn each<T: Clone>(blocks: &[Vec<[f32; 3]>], of: impl Fn(usize) -> T) -> Vec<T> {
            let block = |(k, points): (usize, &Vec<_>)| vec![of(k); points.len()];
            blocks.iter().enumerate().flat_map(block).collect()
        }
        let colors = self.colors().map(|c| each(&blocks, |k| c[k]));
        let intensities = self.intensities().map(|v| each(&blocks, |k| v[k]));
        let normals =
            options.normals.then(|| each(&blocks, |k| stands[k].0.rows[2].map(|c| c as f32)));
        let origin = self.header().origin;
        let world = |s: &[i64; 3]| std::array::from_fn(|a| origin[a] + s[a] as f64 * unit);
        let viewpoints = self.header().sensors.iter().map(world).collect::<Vec<[f64; 3]>>();
        let viewpoints = (!viewpoints.is_empty()).then(|| Viewpoints {
            origins: viewpoints,
            index: each(&blocks, |k| u32::from(self.placements()[k].view)),
        });
        let parts = CloudParts {
            origin,
            positions: blocks.concat(),
            colors,
            intensities,
            normals,
            viewpoints,
            ..CloudParts::default()
        };
        Ok(PointCloud::from_parts(parts)?.0)
    }
}
