//! `surfabet.RangeImage`.

use numpy::ndarray::ArrayView2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use surfabet_geom::{Pose, Projection, RangeImage};

use crate::cloud::cloud_of;
use crate::errors::{IntoPyErr, invalid_input};
use crate::run::run;
use crate::view::{FrozenOwner, read_only_view};
use crate::{arguments, arrays};

/// A cloud as a sensor sees it: the nearest point per pixel.
///
/// Make one with `RangeImage.spherical` or `RangeImage.pinhole`. `pose` is the 4 x 4 matrix from the sensor's frame
/// to the world, the identity if not given.
#[pyclass(name = "RangeImage", module = "surfabet", frozen)]
pub struct PyRangeImage {
    image: RangeImage,
}

impl FrozenOwner for PyRangeImage {}

fn make(
    py: Python<'_>,
    cloud: &Bound<'_, PyAny>,
    projection: Projection,
    pose: Option<&Bound<'_, PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyRangeImage> {
    let pose = pose.map(|given| arguments::pose("pose", given)).transpose()?;
    let pose = pose.unwrap_or_else(Pose::identity);
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let image = run(py, progress, |p| RangeImage::new(cloud, projection, pose, p))?;
    Ok(PyRangeImage { image })
}

impl PyRangeImage {
    fn view<'a, T>(&self, values: &'a [T]) -> ArrayView2<'a, T> {
        let shape = self.image.shape();
        // The image holds rows times columns values.
        ArrayView2::from_shape(shape, values).unwrap_or_else(|_| ArrayView2::from(&[[]]))
    }
}

#[pymethods]
impl PyRangeImage {
    /// Columns by azimuth from -pi on, rows by elevation from the highest down, all angles in radians; sensor frame x
    /// forward, y left, z up.
    #[staticmethod]
    #[pyo3(signature = (cloud, *, azimuth_step, elevation_step, elevations, pose=None, progress=None))]
    fn spherical(
        py: Python<'_>,
        cloud: &Bound<'_, PyAny>,
        azimuth_step: &Bound<'_, PyAny>,
        elevation_step: &Bound<'_, PyAny>,
        elevations: &Bound<'_, PyAny>,
        pose: Option<&Bound<'_, PyAny>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let radians = "a positive number of radians";
        let azimuth_step = arguments::number("azimuth_step", azimuth_step, radians)?;
        let elevation_step = arguments::number("elevation_step", elevation_step, radians)?;
        let requirement = "the lowest and the highest elevation, radians";
        let elevations = arguments::numbers("elevations", elevations, requirement)?;
        let projection = Projection::Spherical { azimuth_step, elevation_step, elevations };
        make(py, cloud, projection, pose, progress)
    }

    /// A camera without distortion, focal lengths and principal point in pixels whose centres are whole numbers;
    /// sensor frame x right, y down, z forward.
    #[staticmethod]
    #[pyo3(signature = (cloud, *, fx, fy, cx, cy, width, height, pose=None, progress=None))]
    #[allow(clippy::too_many_arguments)]
    fn pinhole(
        py: Python<'_>,
        cloud: &Bound<'_, PyAny>,
        fx: &Bound<'_, PyAny>,
        fy: &Bound<'_, PyAny>,
        cx: &Bound<'_, PyAny>,
        cy: &Bound<'_, PyAny>,
        width: &Bound<'_, PyAny>,
        height: &Bound<'_, PyAny>,
        pose: Option<&Bound<'_, PyAny>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let pixels = "a number of pixels";
        let [fx, fy] = [
            arguments::number("fx", fx, "a positive number of pixels")?,
            arguments::number("fy", fy, "a positive number of pixels")?,
        ];
        let [cx, cy] = [arguments::number("cx", cx, pixels)?, arguments::number("cy", cy, pixels)?];
        let [width, height] = [
            arguments::integer("width", width, "an integer of at least 1")?,
            arguments::integer("height", height, "an integer of at least 1")?,
        ];
        make(py, cloud, Projection::Pinhole { fx, fy, cx, cy, width, height }, pose, progress)
    }

    /// Rows and columns.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        self.image.shape().into()
    }

    /// (rows, columns) distance from the sensor in metres, zero where no point fell.
    #[getter]
    fn ranges<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        read_only_view(slf, |i| i.view(i.image.ranges()))
    }

    /// (rows, columns) point per pixel, 2^32 - 1 where none fell.
    #[getter]
    fn index<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray2<u32>> {
        read_only_view(slf, |i| i.view(i.image.index()))
    }

    /// (n, 2) row and column and (n,) distance of points in world coordinates; -1, -1 and NaN outside.
    #[allow(clippy::type_complexity)]
    fn project<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray2<i64>>, Bound<'py, PyArray1<f64>>)> {
        let points = arrays::rows3("points", points)?.into_f64();
        let found: Vec<_> = points.iter().map(|&p| self.image.project(p)).collect();
        let pixels: Vec<i64> = found
            .iter()
            .flat_map(|f| f.map_or([-1, -1], |(pixel, _)| pixel.map(|c| c as i64)))
            .collect();
        let ranges: Vec<f64> = found.iter().map(|f| f.map_or(f64::NAN, |(_, r)| r)).collect();
        Ok((pixels.into_pyarray(py).reshape([points.len(), 2])?, ranges.into_pyarray(py)))
    }

    /// (n, 3) world coordinates of points at `ranges` metres through the centres of the pixels (`rows`, `columns`).
    fn unproject<'py>(
        &self,
        py: Python<'py>,
        rows: &Bound<'py, PyAny>,
        columns: &Bound<'py, PyAny>,
        ranges: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = arrays::column_u32("rows", rows)?;
        let columns = arrays::column_u32("columns", columns)?;
        let ranges = arrays::column_f32("ranges", ranges)?;
        if rows.len() != columns.len() || rows.len() != ranges.len() {
            return Err(invalid_input(format!(
                "{} rows, {} columns and {} ranges; give as many of each",
                rows.len(),
                columns.len(),
                ranges.len()
            )));
        }
        let mut points = Vec::with_capacity(3 * rows.len());
        for ((row, column), range) in rows.iter().zip(&columns).zip(&ranges) {
            let pixel = [*row as usize, *column as usize];
            let point = self.image.unproject(pixel, f64::from(*range));
            points.extend(point.map_err(IntoPyErr::into_py_err)?);
        }
        points.into_pyarray(py).reshape([rows.len(), 3])
    }

    fn __repr__(&self) -> String {
        let [rows, columns] = self.image.shape();
        format!("RangeImage({rows} x {columns})")
    }
}

/// Adds this file's classes to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyRangeImage>()
}
