//! `surfabet.Octree`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use surfabet_geom::{Octree, octree_with};

use crate::arguments;
use crate::cloud::{PyPointCloud, cloud_of};
use crate::errors::{IntoPyErr, wrong_value};
use crate::run::run;

/// The occupied cubes of every level over a cloud, from one around it (level 0) down to leaves with edges of
/// `leaf_size` metres (level `depth`). Nodes come in Morton order.
#[pyclass(name = "Octree", module = "surfabet", frozen)]
pub struct PyOctree {
    tree: Octree,
    cloud: Py<PyPointCloud>,
}

impl PyOctree {
    /// The level that was given; the leaves without.
    fn level(&self, level: Option<&Bound<'_, PyAny>>) -> PyResult<u32> {
        let depth = self.tree.depth();
        let Some(level) = level else { return Ok(depth) };
        let requirement = format!("an integer from 0 to {depth}");
        let found: u32 = arguments::integer("level", level, &requirement)?;
        if found > depth {
            return Err(wrong_value("level", level, &requirement));
        }
        Ok(found)
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
        leaf_size: &Bound<'_, PyAny>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let leaf_size = arguments::number("leaf_size", leaf_size, "a positive number of metres")?;
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
        count: &Bound<'_, PyAny>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let count = arguments::integer("count", count, "an integer of at least 1")?;
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
    fn node_size(&self, level: &Bound<'_, PyAny>) -> PyResult<f64> {
        Ok(self.tree.node_size(self.level(Some(level))?))
    }

    /// The deepest level with at most `count` occupied nodes.
    fn level_with_at_most(&self, count: &Bound<'_, PyAny>) -> PyResult<u32> {
        let count = arguments::integer("count", count, "an integer of at least 1")?;
        Ok(self.tree.level_with_at_most(count))
    }

    /// (m,) number of points per occupied node at a level; the leaves if not given.
    #[pyo3(signature = (level=None))]
    fn counts<'py>(
        &self,
        py: Python<'py>,
        level: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<u32>>> {
        let nodes = self.tree.nodes(self.level(level)?).map_err(IntoPyErr::into_py_err)?;
        let counts: Vec<u32> = nodes.iter().map(|n| n.len() as u32).collect();
        Ok(counts.into_pyarray(py))
    }

    /// (m, 3) centres of the occupied nodes at a level in world coordinates; the leaves if not given.
    #[pyo3(signature = (level=None))]
    fn centers<'py>(
        &self,
        py: Python<'py>,
        level: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let centers = self.tree.centers(self.level(level)?).map_err(IntoPyErr::into_py_err)?;
        self.world(py, &centers)
    }

    /// (m, 3) means of the points in each occupied node at a level in world coordinates; the leaves if not given.
    #[pyo3(signature = (level=None))]
    fn centroids<'py>(
        &self,
        py: Python<'py>,
        level: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (cloud, level) = (&self.cloud.get().cloud, self.level(level)?);
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
