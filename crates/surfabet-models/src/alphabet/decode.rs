//! From words and poses back to a cloud (eq. 2).

use surfabet_base::parallel;
use surfabet_geom::{CloudParts, PointCloud, Progress, Viewpoints};

use super::candidates::sample_grid;
use super::model::AlphabetModel;
use super::placement::WordPose;
use super::word::Word;
use crate::contract::DecodeOptions;
use crate::error::{Result, check_points};

/// The points of each occurrence.
type PointsPerOccurrence = Vec<Vec<[f32; 3]>>;

impl AlphabetModel {
    /// The model as a cloud: word by word, row by row, seen from the sensors that saw the scan. Without a resolution,
    /// points are as far apart as the deviation allowed at each word.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] for a spacing that is not positive, [`crate::Error::TooManyPoints`],
    /// [`crate::Error::Cancelled`].
    pub fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        options.check()?;
        options.expect_thin()?;
        let poses: Vec<(WordPose, &Word)> = self.poses().collect();
        let grid_of = |pose: &WordPose| self.grid(pose, options.resolution);
        let most: f64 = poses.iter().map(|(pose, _)| grid_of(pose).0.powi(2)).sum();
        let first = poses.first().map_or(0.0, |(pose, _)| grid_of(pose).1 * self.unit());
        check_points(options.resolution.unwrap_or(first), most, options.max_points)?;
        let points: PointsPerOccurrence = parallel::try_map(&poses, |(pose, word)| -> Result<_> {
            progress.check()?;
            Ok(self.word_points(pose, word, grid_of(pose)))
        })?;
        let normals =
            options.normals.then(|| per_point(&points, |k| poses[k].0.rows[2].map(|c| c as f32)));
        let parts = CloudParts {
            origin: self.header().origin,
            colors: self.colors().map(|colors| per_point(&points, |k| colors[k])),
            intensities: self.intensities().map(|values| per_point(&points, |k| values[k])),
            normals,
            viewpoints: self.viewpoints(&points),
            positions: points.concat(),
            ..CloudParts::default()
        };
        Ok(PointCloud::from_parts(parts)?.0)
    }

    /// Points per side of a word and their distance in units, at `resolution` metres or at the model's own spacing.
    fn grid(&self, pose: &WordPose, resolution: Option<f64>) -> (f64, f64) {
        let Some(resolution) = resolution else {
            let (n, step) = sample_grid(pose, self.header().spacing);
            return (n as f64, step);
        };
        let n = (2.0 * pose.radius * self.unit() / resolution).round().max(1.0);
        (n, 2.0 * pose.radius / n)
    }

    /// The points of a word, metres from the model's origin; none where it has holes.
    fn word_points(&self, pose: &WordPose, word: &Word, (n, step): (f64, f64)) -> Vec<[f32; 3]> {
        let unit = self.unit();
        let at = |i: u64| (i as f64 + 0.5) * step - pose.radius;
        let mut points = Vec::new();
        for i in 0..(n * n) as u64 {
            let [right, up] = [at(i % n as u64), at(i / n as u64)];
            if let Some(height) = word.height(right / pose.radius, up / pose.radius) {
                let p = pose.to_scene([right, up, height * pose.radius]);
                points.push(p.map(|c| (c * unit) as f32));
            }
        }
        points
    }

    /// The sensors, and which of them saw each point; `None` where no sensor is known.
    fn viewpoints(&self, points: &PointsPerOccurrence) -> Option<Viewpoints> {
        let (origin, unit) = (self.header().origin, self.unit());
        let to_world = |s: &[i64; 3]| std::array::from_fn(|a| origin[a] + s[a] as f64 * unit);
        let origins: Vec<[f64; 3]> = self.header().sensors.iter().map(to_world).collect();
        (!origins.is_empty()).then(|| Viewpoints {
            origins,
            index: per_point(points, |k| u32::from(self.placements()[k].view)),
        })
    }
}

/// What each point has from its occurrence.
fn per_point<T: Clone>(points: &PointsPerOccurrence, of: impl Fn(usize) -> T) -> Vec<T> {
    let block = |(k, points): (usize, &Vec<_>)| vec![of(k); points.len()];
    points.iter().enumerate().flat_map(block).collect()
}
