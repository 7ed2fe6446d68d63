//! `surfabet.Octree`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use surfabet_geom::{Octree, octree_with};

use crate::cloud::{PyPointCloud, cloud_of};
use crate::errors::IntoPyErr;
use crate::run::run;

/// The occupied cubes of every level over a cloud, from one around it (level 0) down to leaves with edges of
/// `leaf_size` metres (level `depth`). Nodes come in Morton order.
#[pyclass(name = "Octree", module = "surfabet", frozen)]
pub struct PyOctree {
    tree: Octree,
    cloud: Py<PyPointCloud>,
}

impl PyOctree {
    fn level(&self, level: Option<u32>) -> u32 {
        level.unwrap_or_else(|| self.tree.depth())
    }

    fn world<'py>(
        &self,
        py: Python<'py>,
        local: &[[f32; 3]],
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let origin = self.cloud.get().cloud.origin();
        let world: Vec<f64> =
            local.iter().flat_map(|p| (0..3).map(move |a| origin[a] + f64::from(p[a]))).collect();
        world.into_pyarray(py).reshape([local.len(), 3])
    }
}

#[pymethods]
impl PyOctree {
    #[new]
    #[pyo3(signature = (cloud, leaf_size, *, progress=None))]
    fn new(
        py: Python<'_>,
        cloud: &Bound<'_, PyAny>,
        leaf_size: f64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let cloud = cloud_of("cloud", cloud)?;
        let points = &cloud.get().cloud;
        let tree = run(py, progress, |p| Octree::new(points, leaf_size, p))?;
        Ok(Self { tree, cloud: cloud.clone().unbind() })
    }

    /// The tree with the smallest leaf size found that has at most `count` leaves.
    #[staticmethod]
    #[pyo3(signature = (cloud, count, *, progress=None))]
    fn with_at_most(
        py: Python<'_>,
        cloud: &Bound<'_, PyAny>,
        count: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let cloud = cloud_of("cloud", cloud)?;
        let points = &cloud.get().cloud;
        let tree = run(py, progress, |p| octree_with(points, count, p))?;
        Ok(Self { tree, cloud: cloud.clone().unbind() })
    }

    /// Level of the leaves.
    #[getter]
    fn depth(&self) -> u32 {
        self.tree.depth()
    }

    /// Edge length of the nodes at a level, metres.
    fn node_size(&self, level: u32) -> f64 {
        self.tree.node_size(level)
    }

    /// The deepest level with at most `count` occupied nodes.
    fn level_with_at_most(&self, count: usize) -> u32 {
        self.tree.level_with_at_most(count)
    }

    /// (m,) number of points per occupied node at a level; the leaves if not given.
    #[pyo3(signature = (level=None))]
    fn counts<'py>(
        &self,
        py: Python<'py>,
        level: Option<u32>,
    ) -> PyResult<Bound<'py, PyArray1<u32>>> {
        let nodes = self.tree.nodes(self.level(level)).map_err(IntoPyErr::into_py_err)?;
        let counts: Vec<u32> = nodes.iter().map(|n| n.len() as u32).collect();
        Ok(counts.into_pyarray(py))
    }

    /// (m, 3) centres of the occupied nodes at a level in world coordinates; the leaves if not given.
    #[pyo3(signature = (level=None))]
    fn centers<'py>(
        &self,
        py: Python<'py>,
        level: Option<u32>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let centers = self.tree.centers(self.level(level)).map_err(IntoPyErr::into_py_err)?;
        self.world(py, &centers)
    }

    /// (m, 3) means of the points in each occupied node at a level in world coordinates; the leaves if not given.
    #[pyo3(signature = (level=None))]
    fn centroids<'py>(
        &self,
        py: Python<'py>,
        level: Option<u32>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (cloud, level) = (&self.cloud.get().cloud, self.level(level));
        let centroids = self.tree.centroids(cloud, level).map_err(IntoPyErr::into_py_err)?;
        self.world(py, &centroids)
    }

    fn __repr__(&self) -> String {
        let (depth, leaf) = (self.tree.depth(), self.tree.node_size(self.tree.depth()));
        format!("Octree({depth} levels down to {leaf} m)")
    }
}

/// Adds this file's classes to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyOctree>()
}
