//! Range image: a cloud as its sensor saw it, one nearest return per pixel.

use std::f64::consts::{PI, TAU};

use crate::cloud::PointCloud;
use crate::error::{Error, Result};
use crate::pose::Pose;
use surfabet_base::Progress;

/// Points between two checks of [`Progress`].
const BATCH: usize = 1 << 16;

/// Largest number of pixels: 16 times those of a 360 degree scan at 0.01 degrees by 64 rings.
const MOST_PIXELS: usize = 1 << 28;

/// How directions map to pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Columns by azimuth, rows by elevation, as a rotating laser sees it. Frame: x forward, y left, z up. The first
    /// column starts at azimuth -pi (backwards), the first row at the highest elevation.
    Spherical {
        /// Angle per column, radians.
        azimuth_step: f64,
        /// Angle per row, radians.
        elevation_step: f64,
        /// Lowest and highest elevation seen, radians.
        elevations: [f64; 2],
    },
    /// A camera without distortion. Frame: x right, y down, z forward. Pixel centres have whole numbers.
    Pinhole {
        /// Focal length in pixels, horizontally.
        fx: f64,
        /// Focal length in pixels, vertically.
        fy: f64,
        /// Column of the principal point.
        cx: f64,
        /// Row of the principal point.
        cy: f64,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
}

impl Projection {
    /// Rows and columns of the image.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for steps, focal lengths or sizes that are not positive, elevations outside of
    /// -pi/2 to pi/2 or in the wrong order, and images of more than 2^28 pixels.
    pub fn shape(&self) -> Result<[usize; 2]> {
        let positive = |name, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(value)
            } else {
                Err(Error::invalid(name, value, "positive and finite"))
            }
        };
        let [rows, columns] = match *self {
            Self::Spherical { azimuth_step, elevation_step, elevations: [low, high] } => {
                if !(-0.5 * PI <= low && low < high && high <= 0.5 * PI) {
                    return Err(Error::invalid(
                        "elevations",
                        format!("{low} to {high}"),
                        "ascending and within -pi/2 to pi/2",
                    ));
                }
                let rows = (high - low) / positive("elevation_step", elevation_step)?;
                let columns = TAU / positive("azimuth_step", azimuth_step)?;
                // A whole number of steps is not rounded up for its last bit.
                [rows, columns].map(|n| (n - 1e-9).ceil().max(1.0) as usize)
            }
            Self::Pinhole { fx, fy, cx, cy, width, height } => {
                positive("fx", fx)?;
                positive("fy", fy)?;
                if let Some((name, value)) =
                    [("cx", cx), ("cy", cy)].into_iter().find(|(_, value)| !value.is_finite())
                {
                    return Err(Error::invalid(name, value, "a finite number of pixels"));
                }
                [height, width]
            }
        };
        if rows == 0 || rows.checked_mul(columns).is_none_or(|n| n == 0 || n > MOST_PIXELS) {
            let shape = format!("{rows} x {columns}");
            return Err(Error::invalid("image size", shape, "1 to 2^28 pixels"));
        }
        Ok([rows, columns])
    }

    /// Row and column of a point in the sensor's frame; `None` outside of the image or at the sensor itself.
    fn pixel(&self, [x, y, z]: [f64; 3], [rows, columns]: [usize; 2]) -> Option<[usize; 2]> {
        let (row, column) = match *self {
            Self::Spherical { azimuth_step, elevation_step, elevations: [low, high] } => {
                let level = x.hypot(y);
                let elevation = z.atan2(level);
                if (level == 0.0 && z == 0.0) || !(low..=high).contains(&elevation) {
                    return None;
                }
                let column = (y.atan2(x) + PI) / azimuth_step;
                // Azimuth pi is the same direction as -pi.
                let column = if column.floor() as usize >= columns { 0.0 } else { column };
                let row = (high - elevation) / elevation_step;
                (row.min((rows - 1) as f64), column)
            }
            Self::Pinhole { fx, fy, cx, cy, .. } => {
                if z <= 0.0 {
                    return None;
                }
                (fy * y / z + cy + 0.5, fx * x / z + cx + 0.5)
            }
        };
        let inside = (0.0..rows as f64).contains(&row) && (0.0..columns as f64).contains(&column);
        inside.then_some([row as usize, column as usize])
    }

    /// Unit direction of a pixel's centre in the sensor's frame.
    fn direction(&self, [row, column]: [usize; 2]) -> [f64; 3] {
        match *self {
            Self::Spherical { azimuth_step, elevation_step, elevations: [_, high] } => {
                let (sin_a, cos_a) = ((column as f64 + 0.5) * azimuth_step - PI).sin_cos();
                let (sin_e, cos_e) = (high - (row as f64 + 0.5) * elevation_step).sin_cos();
                [cos_e * cos_a, cos_e * sin_a, sin_e]
            }
            Self::Pinhole { fx, fy, cx, cy, .. } => {
                let (x, y) = ((column as f64 - cx) / fx, (row as f64 - cy) / fy);
                let length = (x * x + y * y + 1.0).sqrt();
                [x / length, y / length, 1.0 / length]
            }
        }
    }
}

/// Distances from a sensor, row by row, and which point each came from.
#[derive(Debug, Clone, PartialEq)]
pub struct RangeImage {
    projection: Projection,
    pose: Pose,
    shape: [usize; 2],
    ranges: Vec<f32>,
    index: Vec<u32>,
}

impl RangeImage {
    /// What an empty pixel holds as its point.
    pub const NO_POINT: u32 = u32::MAX;

    /// Projects `cloud` into a sensor at `pose` (sensor to world). The nearest point of each pixel wins, the earlier
    /// one of equally distant ones.
    ///
    /// # Errors
    /// Those of [`Projection::shape`], [`Error::InvalidParameter`] from 2^32 - 1 points on, [`Error::Cancelled`].
    pub fn new(
        cloud: &PointCloud,
        projection: Projection,
        pose: Pose,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let shape = projection.shape()?;
        if cloud.len() >= u32::MAX as usize {
            return Err(Error::invalid("number of points", cloud.len(), "below 4294967295"));
        }
        let mut ranges = vec![0.0; shape[0] * shape[1]];
        let mut index = vec![Self::NO_POINT; ranges.len()];
        let to_sensor = pose.inverse();
        for i in 0..cloud.len() {
            if i % BATCH == 0 {
                progress.check()?;
            }
            let p = to_sensor.apply(cloud.world(i));
            if let Some([row, column]) = projection.pixel(p, shape) {
                let range = p.iter().map(|c| c * c).sum::<f64>().sqrt() as f32;
                let pixel = row * shape[1] + column;
                if index[pixel] == Self::NO_POINT || range < ranges[pixel] {
                    ranges[pixel] = range;
                    index[pixel] = i as u32;
                }
            }
        }
        Ok(Self { projection, pose, shape, ranges, index })
    }

    /// Rows and columns.
    pub fn shape(&self) -> [usize; 2] {
        self.shape
    }

    /// Distance from the sensor per pixel in metres, row by row; zero where no point fell. Also for a pinhole this
    /// is the distance, not the depth along its axis.
    pub fn ranges(&self) -> &[f32] {
        &self.ranges
    }

    /// Point per pixel, row by row; [`RangeImage::NO_POINT`] where none fell.
    pub fn index(&self) -> &[u32] {
        &self.index
    }

    /// Row and column of a point in world coordinates, with its distance in metres; `None` outside of the image.
    pub fn project(&self, point: [f64; 3]) -> Option<([usize; 2], f64)> {
        let p = self.pose.inverse().apply(point);
        let pixel = self.projection.pixel(p, self.shape)?;
        Some((pixel, p.iter().map(|c| c * c).sum::<f64>().sqrt()))
    }

    /// World coordinates of the point at `range` metres through the centre of a pixel.
    ///
    /// # Errors
    /// [`Error::IndexOutOfRange`] for a pixel outside of the image.
    pub fn unproject(&self, [row, column]: [usize; 2], range: f64) -> Result<[f64; 3]> {
        for (name, index, len) in [("row", row, self.shape[0]), ("column", column, self.shape[1])] {
            if index >= len {
                return Err(Error::IndexOutOfRange { name, index, len });
            }
        }
        Ok(self.pose.apply(self.projection.direction([row, column]).map(|c| c * range)))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use surfabet_base::Silent;

    const KINECT: Projection =
        Projection::Pinhole { fx: 585.0, fy: 585.0, cx: 320.0, cy: 240.0, width: 640, height: 480 };
    const LASER: Projection = Projection::Spherical {
        azimuth_step: PI / 180.0,
        elevation_step: PI / 180.0,
        elevations: [-PI / 4.0, PI / 4.0],
    };

    fn image(positions: Vec<[f32; 3]>, projection: Projection) -> RangeImage {
        let (cloud, _) = PointCloud::from_positions(positions);
        RangeImage::new(&cloud, projection, Pose::identity(), &Silent).unwrap()
    }

    #[test]
    fn the_nearest_return_wins_and_the_earlier_of_equals() {
        let found = image(
            vec![[0.0, 0.0, 3.0], [0.0, 0.0, 2.0], [0.0, 0.0, 2.0], [0.0, 0.0, -1.0], [0.0; 3]],
            KINECT,
        );
        let center = 240 * 640 + 320;
        assert_eq!((found.ranges()[center], found.index()[center]), (2.0, 1));
        assert_eq!(found.index().iter().filter(|&&i| i != RangeImage::NO_POINT).count(), 1);
    }

    #[test]
    fn a_laser_looks_all_around() {
        let found = image(vec![[-1.0, 0.0, 0.0], [-1.0, -0.0, 0.0], [2.0, 0.001, 0.0]], LASER);
        assert_eq!(found.shape(), [90, 360]);
        assert_eq!(found.project([-1.0, 0.0, 0.01]).unwrap().0, [44, 0]);
        assert_eq!(found.project([-1.0, -0.0, 0.01]).unwrap().0, [44, 0]);
        assert_eq!(found.project([0.0, 1.0, 0.01]).unwrap().0, [44, 270]);
        assert_eq!(found.project([0.0, 0.0, 1.0]), None);
        assert_eq!(found.project([1.0, 0.0, -1.0]).unwrap().0[0], 89);
    }

    #[test]
    fn looks_from_its_pose() {
        let (cloud, _) = PointCloud::from_positions(vec![[10.0, 5.0, 7.0]]);
        let pose = Pose::new([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [10.0, 5.0, 5.0])
            .unwrap();
        let found = RangeImage::new(&cloud, KINECT, pose, &Silent).unwrap();
        assert_eq!(found.ranges()[240 * 640 + 320], 2.0);
    }

    #[test]
    fn refuses_senseless_projections() {
        let bad = [
            Projection::Spherical {
                azimuth_step: 0.0,
                elevation_step: 0.1,
                elevations: [-0.5, 0.5],
            },
            Projection::Spherical {
                azimuth_step: 0.1,
                elevation_step: 0.1,
                elevations: [0.5, -0.5],
            },
            Projection::Spherical {
                azimuth_step: 1e-9,
                elevation_step: 1e-9,
                elevations: [-0.5, 0.5],
            },
            Projection::Pinhole { fx: -1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: 2, height: 2 },
            Projection::Pinhole { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: 0, height: 2 },
        ];
        assert!(bad.iter().all(|p| p.shape().is_err()));
    }

    proptest! {
        #[test]
        fn pixels_come_back(row in 0_usize..90, column in 0_usize..360, range in 0.5_f64..50.0) {
            let pose = Pose::new(
                [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
                [500_000.0, 1.0, 2.0],
            ).unwrap();
            for projection in [LASER, KINECT] {
                let cloud = PointCloud::default();
                let image = RangeImage::new(&cloud, projection, pose, &Silent).unwrap();
                let point = image.unproject([row, column], range).unwrap();
                let (pixel, distance) = image.project(point).unwrap();
                prop_assert_eq!(pixel, [row, column]);
                prop_assert!((distance - range).abs() < 1e-6);
            }
        }
    }
}
