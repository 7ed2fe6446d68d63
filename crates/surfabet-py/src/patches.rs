//! `surfabet.PatchModel` and how it is learned.

use std::path::PathBuf;

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use surfabet::{DecodeOptions, PatchModel, PatchesOptions, patches};

use crate::cloud::PyPointCloud;
use crate::hscsm::sensor_of;
use crate::report::report_dict;
use crate::run::run;
use crate::save;

/// A cloud as patches on a lattice; immutable.
#[pyclass(name = "PatchModel", module = "surfabet", frozen)]
pub struct PyPatchModel {
    model: PatchModel,
}

/// Learns patches on a lattice; documented in `surfabet.patches`.
#[pyfunction]
#[pyo3(signature = (cloud, *, resolution, levels, rate, depth_step, rounds, color_step, chroma_ratio,
                    color_rate, max_error, sensor, progress))]
#[allow(clippy::too_many_arguments)]
fn learn_lattice(
    py: Python<'_>,
    cloud: &Bound<'_, PyPointCloud>,
    resolution: f64,
    levels: u32,
    rate: f64,
    depth_step: u32,
    rounds: u32,
    color_step: u32,
    chroma_ratio: f64,
    color_rate: f64,
    max_error: Option<f64>,
    sensor: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyPatchModel> {
    let options = PatchesOptions {
        resolution,
        levels,
        lambda: rate,
        depth_step,
        rounds,
        color_step,
        chroma_ratio,
        color_lambda: color_rate,
        max_error,
        sensor: sensor_of(sensor)?,
    };
    let cloud = &cloud.get().cloud;
    let model = run(py, progress, |monitor| patches::learn(cloud, &options, monitor))?;
    Ok(model.into())
}

impl From<PatchModel> for PyPatchModel {
    fn from(model: PatchModel) -> Self {
        Self { model }
    }
}

#[pymethods]
impl PyPatchModel {
    #[pyo3(signature = (*, resolution, as_measured, normals, max_points, progress))]
    fn decode(
        slf: &Bound<'_, Self>,
        resolution: Option<f64>,
        as_measured: bool,
        normals: bool,
        max_points: u64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyPointCloud> {
        let model = &slf.get().model;
        let options = DecodeOptions { resolution, as_measured, normals, max_points };
        let cloud = run(slf.py(), progress, |monitor| model.decode(options, monitor))?;
        Ok(cloud.into())
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        save::to_bytes(py, &self.model)
    }

    /// Writes the file and returns its size in bytes.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<u64> {
        save::save(py, &self.model, path)
    }

    #[getter]
    fn n_points(&self) -> u64 {
        self.model.n_points()
    }

    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.model.origin()
    }

    /// Lattice to world, rows of a rotation.
    #[getter]
    fn rotation(&self) -> [[f64; 3]; 3] {
        self.model.lattice().orientation.rotation()
    }

    #[getter]
    fn has_color(&self) -> bool {
        self.model.has_color()
    }

    #[getter]
    fn max_error(&self) -> Option<f64> {
        self.model.max_error()
    }

    #[getter]
    fn n_extra_points(&self) -> u64 {
        self.model.header().n_extra
    }

    /// `(pixel_size, pixels, patches, set pixels)` of each level, coarsest first.
    #[getter]
    fn levels(&self) -> Vec<(f64, u32, u64, u64)> {
        let lattice = self.model.lattice();
        let level = |(l, of): (u32, patches::LevelSize)| {
            (lattice.pixel_of(l), patches::PATCH_PIXELS as u32, of.patches, of.set_pixels)
        };
        (0..lattice.levels).zip(self.model.level_sizes()).rev().map(level).collect()
    }

    /// Side, level and the first column and row (finest pixels) of every patch, (m, 4).
    fn places<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        let leaves = self.model.leaves();
        Array2::from_shape_fn((leaves.len(), 4), |(i, column)| match column {
            0 => i64::from(leaves[i].side),
            1 => i64::from(leaves[i].level),
            c => i64::from(leaves[i].corner[c - 2]),
        })
        .into_pyarray(py)
    }

    /// Set pixels of every patch, (m, 8, 8).
    fn masks<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<bool>> {
        let leaves = self.model.leaves();
        Array3::from_shape_fn((leaves.len(), 8, 8), |(i, row, column)| {
            leaves[i].patch.mask >> (8 * row + column) & 1 != 0
        })
        .into_pyarray(py)
    }

    /// Coefficients of the shapes of every patch, (m, 21), metres.
    fn coefficients<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let (leaves, lattice) = (self.model.leaves(), self.model.lattice());
        let step = lattice.pixel_size * f64::from(lattice.depth_step) / 16.0;
        let shapes = leaves.first().map_or(0, |l| l.patch.coefficients.len());
        Array2::from_shape_fn((leaves.len(), shapes), |(i, k)| {
            f64::from(leaves[i].patch.coefficients[k]) * step
        })
        .into_pyarray(py)
    }

    /// Standard deviation of the scan about every patch, (m,), metres.
    fn sigma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let pixel = self.model.lattice().pixel_size;
        let sigma = |leaf: &patches::Leaf| leaf.patch.sigma() * pixel;
        self.model.leaves().iter().map(sigma).collect::<Vec<f64>>().into_pyarray(py)
    }

    /// How the model was learned, as nested dicts and lists; empty for a model read from a file.
    #[getter]
    fn report_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        report_dict(py, self.model.report())
    }

    fn __len__(&self) -> usize {
        self.model.len()
    }
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyPatchModel>()?;
    module.add_function(wrap_pyfunction!(learn_lattice, module)?)
}
