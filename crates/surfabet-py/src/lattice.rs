//! `surfabet.LatticeModel` and how it is learned.

use std::path::PathBuf;

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use surfabet::patches::lattice;
use surfabet::{DecodeOptions, LatticeModel, LatticeOptions, Model};

use crate::cloud::PyPointCloud;
use crate::errors::IntoPyErr;
use crate::patches::sensor_of;
use crate::report::report_dict;
use crate::run::run;

/// A cloud as patches on a lattice; immutable.
#[pyclass(name = "LatticeModel", module = "surfabet", frozen)]
pub struct PyLatticeModel {
    model: Model,
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
) -> PyResult<PyLatticeModel> {
    let options = LatticeOptions {
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
    let model = run(py, progress, |monitor| lattice::learn(cloud, &options, monitor))?;
    Ok(PyLatticeModel::new(model))
}

impl PyLatticeModel {
    pub fn new(model: LatticeModel) -> Self {
        Self { model: Model::from(model) }
    }

    fn of(&self) -> &LatticeModel {
        match &self.model {
            Model::Lattice(model) => model,
            // `new` puts nothing else in.
            _ => unreachable!("a lattice model of another kind"),
        }
    }
}

#[pymethods]
impl PyLatticeModel {
    #[pyo3(signature = (*, resolution, as_measured, normals, max_points, progress))]
    fn decode(
        slf: &Bound<'_, Self>,
        resolution: Option<f64>,
        as_measured: bool,
        normals: bool,
        max_points: u64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyPointCloud> {
        let model = slf.get().of();
        let options = DecodeOptions { resolution, as_measured, normals, max_points };
        let cloud = run(slf.py(), progress, |monitor| model.decode(options, monitor))?;
        Ok(cloud.into())
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.model.to_bytes());
        Ok(PyBytes::new(py, &bytes.map_err(IntoPyErr::into_py_err)?))
    }

    /// Writes the file and returns its size in bytes.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<u64> {
        py.detach(|| self.model.save(path)).map_err(IntoPyErr::into_py_err)
    }

    #[getter]
    fn n_points(&self) -> u64 {
        self.of().n_points()
    }

    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.of().origin()
    }

    /// Lattice to world, rows of a rotation.
    #[getter]
    fn rotation(&self) -> [[f64; 3]; 3] {
        self.of().geometry().orientation.rotation()
    }

    #[getter]
    fn has_color(&self) -> bool {
        self.of().has_color()
    }

    #[getter]
    fn max_error(&self) -> Option<f64> {
        self.of().max_error()
    }

    #[getter]
    fn n_extra_points(&self) -> u64 {
        self.of().header().n_extra
    }

    /// `(pixel_size, pixels, patches, set pixels)` of each level, coarsest first.
    #[getter]
    fn levels(&self) -> Vec<(f64, u32, usize, u64)> {
        let geometry = self.of().geometry();
        let level = |l: u32| {
            let of = self.of().leaves().iter().filter(|leaf| leaf.level == l);
            let set = of.clone().map(|leaf| u64::from(leaf.patch.mask.count_ones())).sum();
            let pixel = geometry.pixel_size * f64::from(1 << l);
            (pixel, lattice::PATCH_PIXELS as u32, of.count(), set)
        };
        (0..geometry.levels).rev().map(level).collect()
    }

    /// Side, level and the first column and row (finest pixels) of every patch, (m, 4).
    fn places<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        let leaves = self.of().leaves();
        Array2::from_shape_fn((leaves.len(), 4), |(i, column)| match column {
            0 => i64::from(leaves[i].side),
            1 => i64::from(leaves[i].level),
            c => i64::from(leaves[i].corner[c - 2]),
        })
        .into_pyarray(py)
    }

    /// Set pixels of every patch, (m, 8, 8).
    fn masks<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<bool>> {
        let leaves = self.of().leaves();
        Array3::from_shape_fn((leaves.len(), 8, 8), |(i, row, column)| {
            leaves[i].patch.mask >> (8 * row + column) & 1 != 0
        })
        .into_pyarray(py)
    }

    /// Coefficients of the shapes of every patch, (m, 21), metres.
    fn coefficients<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let (leaves, geometry) = (self.of().leaves(), self.of().geometry());
        let step = geometry.pixel_size * f64::from(geometry.depth_step) / 16.0;
        let shapes = leaves.first().map_or(0, |l| l.patch.coefficients.len());
        Array2::from_shape_fn((leaves.len(), shapes), |(i, k)| {
            f64::from(leaves[i].patch.coefficients[k]) * step
        })
        .into_pyarray(py)
    }

    /// Standard deviation of the scan about every patch, (m,), metres.
    fn sigma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let quarter = 0.25 * self.of().geometry().pixel_size;
        let sigma =
            |leaf: &lattice::Leaf| f64::from(leaf.patch.thickness) * quarter / 3.0_f64.sqrt();
        self.of().leaves().iter().map(sigma).collect::<Vec<f64>>().into_pyarray(py)
    }

    /// How the model was learned, as nested dicts and lists; empty for a model read from a file.
    #[getter]
    fn report_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        report_dict(py, self.of().report())
    }

    fn __len__(&self) -> usize {
        self.of().len()
    }
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyLatticeModel>()?;
    module.add_function(wrap_pyfunction!(learn_lattice, module)?)
}
