//! Fewer points of a cloud, by number.

use pyo3::prelude::*;
use surfabet_geom::{farthest_points, random_points};

use crate::cloud::{PyPointCloud, cloud_of};
use crate::errors::IntoPyErr;
use crate::run::run;

/// `count` points drawn at random without repetition, in the order of the cloud.
#[pyfunction]
#[pyo3(signature = (cloud, count, random_state))]
fn random_downsample(
    cloud: &Bound<'_, PyAny>,
    count: usize,
    random_state: u64,
) -> PyResult<PyPointCloud> {
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let indices =
        random_points(cloud.len(), count, random_state).map_err(IntoPyErr::into_py_err)?;
    Ok(cloud.select(&indices).map_err(IntoPyErr::into_py_err)?.into())
}

/// `count` points, each the farthest from all before it.
#[pyfunction]
#[pyo3(signature = (cloud, count, start, progress))]
fn farthest_point_downsample(
    py: Python<'_>,
    cloud: &Bound<'_, PyAny>,
    count: usize,
    start: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyPointCloud> {
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let chosen = run(py, progress, |monitor| {
        cloud.select(&farthest_points(cloud.positions(), count, start, monitor)?)
    })?;
    Ok(chosen.into())
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(random_downsample, module)?)?;
    module.add_function(wrap_pyfunction!(farthest_point_downsample, module)?)
}
