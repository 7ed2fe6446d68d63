//! `surfabet.GasModel` and how it is learned.

use std::sync::Arc;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::gas::{NavigationGraph, Robot};
use surfabet::{GasModel, gas};

use crate::cloud::cloud_of;
use crate::errors::IntoPyErr;
use crate::model::{PyModel, model_class, wrap};
use crate::options::options_of;
use crate::run::{released, run};

/// A cloud as a gas of neurons with a topology; immutable.
#[pyclass(name = "GasModel", module = "surfabet._core", frozen, extends = PyModel)]
pub struct PyGasModel {
    pub model: Arc<GasModel>,
}

model_class!(GasModel, PyGasModel);

/// Learns a gas; documented in `surfabet.gas`.
#[pyfunction]
#[pyo3(signature = (cloud, options, *, progress))]
fn learn_gas(
    py: Python<'_>,
    cloud: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyGasModel>> {
    let options = options_of(options)?;
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    wrap(py, run(py, progress, |monitor| gas::learn(cloud, &options, monitor))?)
}

impl PyGasModel {
    fn column<'py>(
        &self,
        py: Python<'py>,
        value: impl Fn(usize) -> f64,
    ) -> Bound<'py, PyArray1<f64>> {
        (0..self.model.len()).map(value).collect::<Vec<f64>>().into_pyarray(py)
    }
}

#[pymethods]
impl PyGasModel {
    #[pyo3(signature = (cloud, options, *, n_neurons, progress))]
    fn update(
        slf: &Bound<'_, Self>,
        cloud: &Bound<'_, PyAny>,
        options: &Bound<'_, PyDict>,
        n_neurons: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Py<Self>> {
        let options = options_of(options)?;
        let (model, cloud) = (&slf.get().model, &cloud_of("cloud", cloud)?.get().cloud);
        let updated =
            run(slf.py(), progress, |monitor| model.update(cloud, n_neurons, &options, monitor))?;
        wrap(slf.py(), updated)
    }

    #[getter]
    fn mean_error(&self) -> f64 {
        self.model.mean_error()
    }

    #[getter]
    fn position_step(&self) -> f64 {
        self.model.position_step()
    }

    /// Positions in the world, (n, 3).
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        world_positions(py, &self.model.positions(), self.model.origin())
    }

    /// Unit normals, (n, 3), zero where unknown.
    fn normals<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f32>> {
        let normals: Vec<[f32; 3]> = (0..self.model.len()).map(|i| self.model.normal(i)).collect();
        Array2::from_shape_fn((normals.len(), 3), |(i, a)| normals[i][a]).into_pyarray(py)
    }

    /// Mean intensities, (n,), where there are any.
    fn intensities<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f32>>> {
        Some(self.model.intensities()?.into_pyarray(py))
    }

    /// Colours, (n, 3), where there are any.
    fn colors<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<u8>>> {
        let colors = self.model.colors()?;
        Some(Array2::from_shape_fn((colors.len(), 3), |(i, c)| colors[i][c]).into_pyarray(py))
    }

    /// Numbers of points, (n,).
    fn counts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |i| self.model.count(i))
    }

    /// Radii, (n,), metres.
    fn radii<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |i| self.model.radius(i))
    }

    /// Standard deviations across the surface, (n,), metres.
    fn thicknesses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |i| self.model.thickness(i))
    }

    /// Pairs of neurons, (m, 2).
    fn edges<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u32>> {
        pairs(py, self.model.edges())
    }

    /// Triangles, (t, 3).
    fn mesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let mesh = released(py, || self.model.mesh())?;
        Ok(Array2::from_shape_fn((mesh.len(), 3), |(i, corner)| mesh[i][corner]).into_pyarray(py))
    }

    /// Component of every neuron, (n,).
    fn components<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.model.components().into_pyarray(py)
    }

    /// Shortest ways along edges from one neuron to all, (n,), metres.
    fn geodesic_distances<'py>(
        &self,
        py: Python<'py>,
        source: usize,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let distances = released(py, || self.model.geodesic_distances(source))?;
        Ok(distances.map_err(IntoPyErr::into_py_err)?.into_pyarray(py))
    }

    #[pyo3(signature = (*, radius, height, max_step, max_slope, up, progress))]
    fn navigation(
        &self,
        py: Python<'_>,
        radius: f64,
        height: f64,
        max_step: f64,
        max_slope: f64,
        up: [f64; 3],
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyNavigationGraph> {
        let robot = Robot { radius, height, max_step, max_slope };
        let graph = run(py, progress, |monitor| self.model.navigation(robot, up, monitor))?;
        Ok(PyNavigationGraph(graph))
    }
}

/// Where a robot can stand on a gas; documented in `surfabet.navigation`.
#[pyclass(name = "NavigationGraph", module = "surfabet._core", frozen)]
pub struct PyNavigationGraph(NavigationGraph);

#[pymethods]
impl PyNavigationGraph {
    /// Neuron of every node, (n,).
    fn neurons<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.0.neurons().to_vec().into_pyarray(py)
    }

    /// Ground under the nodes in the world, (n, 3).
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        world_positions(py, self.0.positions(), self.0.origin())
    }

    /// Pairs of nodes, (m, 2).
    fn edges<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u32>> {
        pairs(py, self.0.edges())
    }

    /// Component of every node, (n,).
    fn components<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.0.components().into_pyarray(py)
    }

    /// Nodes along the shortest path, (k,), where there is one.
    fn path<'py>(
        &self,
        py: Python<'py>,
        start: [f64; 3],
        goal: [f64; 3],
    ) -> PyResult<Option<Bound<'py, PyArray1<u32>>>> {
        let path = released(py, || self.0.path(start, goal))?.map_err(IntoPyErr::into_py_err)?;
        Ok(path.map(|nodes| nodes.into_pyarray(py)))
    }
}

fn world_positions<'py>(
    py: Python<'py>,
    positions: &[[f32; 3]],
    origin: [f64; 3],
) -> Bound<'py, PyArray2<f64>> {
    Array2::from_shape_fn((positions.len(), 3), |(i, a)| origin[a] + f64::from(positions[i][a]))
        .into_pyarray(py)
}

fn pairs<'py>(py: Python<'py>, pairs: &[[u32; 2]]) -> Bound<'py, PyArray2<u32>> {
    Array2::from_shape_fn((pairs.len(), 2), |(i, end)| pairs[i][end]).into_pyarray(py)
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyGasModel>()?;
    module.add_class::<PyNavigationGraph>()?;
    module.add_function(wrap_pyfunction!(learn_gas, module)?)
}
