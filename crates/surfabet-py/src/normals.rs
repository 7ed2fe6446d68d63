//! `surfabet.estimate_normals`.

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use surfabet_geom::{Neighborhood, PointCloud, estimate_normals as estimate};

use crate::cloud::{PyPointCloud, cloud_of};
use crate::errors::invalid_input;
use crate::run::run;

type Estimate<'py> = (PyPointCloud, Bound<'py, PyArray1<f32>>, usize);

/// The cloud with normals, curvatures and the number of unknown normals.
#[pyfunction]
#[pyo3(signature = (cloud, neighbors, radius, progress))]
fn estimate_normals<'py>(
    py: Python<'py>,
    cloud: &Bound<'py, PyAny>,
    neighbors: Option<usize>,
    radius: Option<f32>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Estimate<'py>> {
    let neighborhood = match (neighbors, radius) {
        (Some(k), None) => Neighborhood::Nearest(k),
        (None, Some(radius)) => Neighborhood::Within(radius),
        (Some(k), Some(radius)) => Neighborhood::NearestWithin(k, radius),
        (None, None) => return Err(invalid_input("give neighbors, radius or both")),
    };
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let (cloud, curvatures, unknown) = run(py, progress, |p| {
        let found = estimate(cloud, neighborhood, p)?;
        let mut parts = cloud.clone().into_parts();
        parts.normals = Some(found.normals);
        let (cloud, _) = PointCloud::from_parts(parts)?;
        Ok::<_, surfabet_geom::Error>((cloud, found.curvatures, found.unknown))
    })?;
    Ok((cloud.into(), curvatures.into_pyarray(py), unknown))
}

/// Adds this file's function to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(estimate_normals, module)?)
}
