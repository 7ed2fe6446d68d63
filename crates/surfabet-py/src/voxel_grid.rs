//! `surfabet.VoxelGrid`.

use numpy::ndarray::ArrayView2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use surfabet_geom::{VoxelGrid, voxel_grid_with};

use crate::cloud::{PyPointCloud, cloud_of};
use crate::run::run;
use crate::view::{FrozenOwner, read_only_view};
use crate::{arguments, arrays};

/// Points of a cloud sorted into cubes with edges of `size` metres, aligned to the world's axes and origin.
///
/// Voxels come in the order of their cells (x, then y, then z), whatever the order of the points.
#[pyclass(name = "VoxelGrid", module = "surfabet", frozen)]
pub struct PyVoxelGrid {
    grid: VoxelGrid,
    cloud: Py<PyPointCloud>,
}

impl FrozenOwner for PyVoxelGrid {}

#[pymethods]
impl PyVoxelGrid {
    #[new]
    #[pyo3(signature = (cloud, size, *, progress=None))]
    fn new(
        py: Python<'_>,
        cloud: &Bound<'_, PyAny>,
        size: &Bound<'_, PyAny>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let size = arguments::number("size", size, "a positive number of metres")?;
        let cloud = cloud_of("cloud", cloud)?;
        let points = &cloud.get().cloud;
        let grid = run(py, progress, |p| VoxelGrid::new(points, size, p))?;
        Ok(Self { grid, cloud: cloud.clone().unbind() })
    }

    /// The grid with the smallest size found that has at most `count` voxels.
    #[staticmethod]
    #[pyo3(signature = (cloud, count, *, progress=None))]
    fn with_at_most(
        py: Python<'_>,
        cloud: &Bound<'_, PyAny>,
        count: &Bound<'_, PyAny>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let count = arguments::integer("count", count, "an integer of at least 1")?;
        let cloud = cloud_of("cloud", cloud)?;
        let points = &cloud.get().cloud;
        let grid = run(py, progress, |p| voxel_grid_with(points, count, p))?;
        Ok(Self { grid, cloud: cloud.clone().unbind() })
    }

    /// Edge length in metres.
    #[getter]
    fn size(&self) -> f64 {
        self.grid.size()
    }

    /// (m, 3) cell numbers per voxel; a voxel reaches from `cell * size` up to `(cell + 1) * size`.
    #[getter]
    fn cells<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray2<i64>> {
        read_only_view(slf, |g| ArrayView2::from(g.grid.cells()))
    }

    /// (m,) number of points per voxel.
    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.grid.counts().into_pyarray(py)
    }

    /// (n,) voxel of each point of the cloud.
    #[getter]
    fn voxel_of_points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.grid.voxel_of_points().into_pyarray(py)
    }

    /// One point per voxel: the mean of its points in every attribute.
    ///
    /// Normals are averaged as directions, unknown ranges are left out and the viewpoint is the one with the most
    /// weight. `weights` is an (n,) array of positive numbers; without it all points count the same.
    #[pyo3(signature = (weights=None, *, progress=None))]
    fn means(
        &self,
        py: Python<'_>,
        weights: Option<&Bound<'_, PyAny>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyPointCloud> {
        let weights = weights.map(|w| arrays::column_f32("weights", w)).transpose()?;
        let cloud = &self.cloud.get().cloud;
        run(py, progress, |p| self.grid.means(cloud, weights.as_deref(), p)).map(Into::into)
    }

    fn __len__(&self) -> usize {
        self.grid.len()
    }

    fn __repr__(&self) -> String {
        format!("VoxelGrid({} voxels of {} m)", self.grid.len(), self.grid.size())
    }
}

/// Adds this file's classes to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyVoxelGrid>()
}
