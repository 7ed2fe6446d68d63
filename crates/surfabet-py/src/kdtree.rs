//! `surfabet.KdTree`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use surfabet_geom::{KdTree, Neighbor, PointCloud};

use crate::arguments;
use crate::arrays::{self, Rows3};
use crate::cloud::PyPointCloud;
use crate::run::run;

/// Exact nearest neighbours of points, for many queries at a time and in parallel.
///
/// `points` is a `PointCloud` or an (n, 3) array in metres; it may hold duplicates. Coordinates are kept in single
/// precision about an origin in double precision. Neighbours come nearest first, equal distances by index; results
/// do not depend on the number of threads.
#[pyclass(name = "KdTree", module = "surfabet", frozen)]
pub struct PyKdTree {
    tree: KdTree,
    origin: [f64; 3],
}

/// The argument `k`.
fn number_of_neighbors(k: &Bound<'_, PyAny>) -> PyResult<usize> {
    arguments::integer("k", k, "an integer of at least 1")
}

fn split(rows: Rows3) -> ([f64; 3], Vec<[f32; 3]>) {
    match rows {
        Rows3::F32(rows) => PointCloud::split_origin_single(rows),
        Rows3::F64(rows) => PointCloud::split_origin(&rows),
    }
}

impl PyKdTree {
    /// Query points about the tree's origin.
    fn queries(&self, points: &Bound<'_, PyAny>) -> PyResult<Vec<[f32; 3]>> {
        if let Ok(cloud) = points.cast::<PyPointCloud>() {
            return Ok(cloud.get().cloud.positions_about(self.origin));
        }
        let rows = arrays::rows3("points", points)?;
        if self.origin == [0.0; 3] {
            return Ok(rows.into_f32());
        }
        let local = |p: [f64; 3]| std::array::from_fn(|a| (p[a] - self.origin[a]) as f32);
        Ok(rows.into_f64().into_iter().map(local).collect())
    }
}

fn columns<'py>(
    py: Python<'py>,
    found: &[Neighbor],
) -> (Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<u32>>) {
    let distances: Vec<f32> = found.iter().map(|n| n.squared_distance().sqrt()).collect();
    let index: Vec<u32> = found.iter().map(|n| n.index() as u32).collect();
    (distances.into_pyarray(py), index.into_pyarray(py))
}

type Table<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u32>>);
type Ragged<'py> =
    (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<u32>>);

#[pymethods]
impl PyKdTree {
    #[new]
    fn new(py: Python<'_>, points: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(cloud) = points.cast::<PyPointCloud>() {
            let cloud = &cloud.get().cloud;
            let tree = run(py, None, |_| KdTree::new(cloud.positions()))?;
            return Ok(Self { tree, origin: cloud.origin() });
        }
        let (origin, positions) = split(arrays::rows3("points", points)?);
        let tree = run(py, None, |_| KdTree::new(&positions))?;
        Ok(Self { tree, origin })
    }

    /// Distances in metres and indices of the `k` nearest points to each query, as two (n, min(k, len)) arrays.
    #[pyo3(signature = (points, k=1, *, progress=None))]
    fn query<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = number_of_neighbors)] k: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Table<'py>> {
        let queries = self.queries(points)?;
        let found = run(py, progress, |p| self.tree.k_nearest_batch(&queries, k, p))?;
        let shape = [queries.len(), k.min(self.tree.len())];
        let (distances, index) = columns(py, &found);
        Ok((distances.reshape(shape)?, index.reshape(shape)?))
    }

    /// The points within `radius` metres (included) of each query: (starts, distances, indices), where those of
    /// query i are at `starts[i]:starts[i + 1]`, nearest first.
    #[pyo3(signature = (points, radius, *, progress=None))]
    fn query_radius<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        radius: &Bound<'py, PyAny>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Ragged<'py>> {
        let radius =
            arguments::number("radius", radius, "0 or a positive number of metres")? as f32;
        let queries = self.queries(points)?;
        let found = run(py, progress, |p| self.tree.within_batch(&queries, radius, p))?;
        let starts: Vec<i64> = found.starts().iter().map(|&s| s as i64).collect();
        let (distances, index) = columns(py, found.neighbors());
        Ok((starts.into_pyarray(py), distances, index))
    }

    fn __len__(&self) -> usize {
        self.tree.len()
    }

    fn __repr__(&self) -> String {
        format!("KdTree({} points)", self.tree.len())
    }
}

/// Adds this file's classes to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyKdTree>()
}
