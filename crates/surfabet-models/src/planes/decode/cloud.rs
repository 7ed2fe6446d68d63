//! Back to a cloud: the supported tiles, filled at any spacing.

use surfabet_base::parallel;
use surfabet_geom::{CloudParts, PointCloud, Progress};

use crate::contract::DecodeOptions;
use crate::error::{Result, check_points};
use crate::planes::model::PlaneModel;
use crate::spread::across;

/// A decoded point.
#[derive(Debug, Clone, Copy)]
struct Point {
    position: [f32; 3],
    normal: [f32; 3],
    color: [u8; 3],
    intensity: f32,
}

impl PlaneModel {
    /// The model as a cloud about its origin: every supported tile with a lattice of points, patch after patch, tile
    /// after tile.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] for a spacing that is not positive, [`crate::Error::TooManyPoints`],
    /// [`crate::Error::Cancelled`].
    pub fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        let spacing = options.spacing(0.5 * self.grid_size())?;
        let along = |extent: f64| (extent / spacing).ceil().max(1.0);
        // Tile by tile as they are filled: where a side is a multiple of the spacing, rounding makes some of one row more.
        let points_of = |i: usize| -> f64 {
            let tiles = &self.patches()[i].tiles;
            let supported = tiles.supported().iter().enumerate().filter(|(_, s)| **s);
            supported
                .map(|(t, _)| {
                    let (low, high) = tiles.bounds(t % tiles.shape()[0], t / tiles.shape()[0]);
                    along(high[0] - low[0]) * along(high[1] - low[1])
                })
                .sum()
        };
        check_points(spacing, (0..self.len()).map(points_of).sum(), options.max_points)?;
        let patches = parallel::try_map_range(self.len(), |i| -> Result<Vec<Point>> {
            progress.check()?;
            Ok(self.fill(i, along, options.as_measured))
        })?;
        let points: Vec<Point> = patches.into_iter().flatten().collect();
        let parts = CloudParts {
            origin: self.origin(),
            positions: points.iter().map(|p| p.position).collect(),
            colors: self.has_color().then(|| points.iter().map(|p| p.color).collect()),
            intensities: self.has_intensity().then(|| points.iter().map(|p| p.intensity).collect()),
            normals: options.normals.then(|| points.iter().map(|p| p.normal).collect()),
            ..CloudParts::default()
        };
        Ok(PointCloud::from_parts(parts)?.0)
    }

    fn fill(&self, i: usize, along: impl Fn(f64) -> f64, as_measured: bool) -> Vec<Point> {
        let patch = &self.patches()[i];
        let tiles = &patch.tiles;
        let thickness = if as_measured { patch.standard_deviation } else { 0.0 };
        let (colors, intensities) = (self.colors(i), self.intensities(i));
        let nx = tiles.shape()[0];
        let normal = patch.frame.normal.map(|c| c as f32);
        let supported = tiles.supported().iter().enumerate().filter(|(_, s)| **s);
        let mut points: Vec<Point> = Vec::new();
        for (k, (t, _)) in supported.enumerate() {
            let (low, high) = tiles.bounds(t % nx, t / nx);
            let n: [f64; 2] = std::array::from_fn(|a| along(high[a] - low[a]));
            let color = colors.get(k).copied().unwrap_or_default();
            let intensity = intensities.get(k).copied().unwrap_or_default();
            for row in 0..n[1] as usize {
                for column in 0..n[0] as usize {
                    let share = [column as f64 + 0.5, row as f64 + 0.5];
                    let p = patch
                        .frame
                        .at(std::array::from_fn(|a| low[a] + share[a] / n[a] * (high[a] - low[a])));
                    let depth = across(thickness, points.len());
                    points.push(Point {
                        position: std::array::from_fn(|a| {
                            (p[a] + depth * patch.frame.normal[a]) as f32
                        }),
                        normal,
                        color,
                        intensity,
                    });
                }
            }
        }
        points
    }
}
