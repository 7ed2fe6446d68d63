//! What of a surface another map does not have: `surfabet.diff` builds on it.

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use surfabet_geom::{Change, Fate, Other, changes as find};

use crate::arrays;
use crate::cloud::cloud_of;
use crate::run::run;

/// Box (low, high), number of points, area.
type Row = ([f64; 3], [f64; 3], usize, f64);

/// Fate of each point (0 same, 1 changed, 2 unseen), number of its change, all changes, and the area that was not looked at.
type Found<'py> = (Bound<'py, PyArray1<u8>>, Bound<'py, PyArray1<u32>>, Vec<Row>, f64);

/// What of `surface` the other map does not have though it looked.
#[pyfunction]
#[pyo3(signature = (surface, other, measured, viewpoints, *, tolerance, min_area, progress))]
#[allow(clippy::too_many_arguments)]
fn changes<'py>(
    py: Python<'py>,
    surface: &Bound<'py, PyAny>,
    other: &Bound<'py, PyAny>,
    measured: &Bound<'py, PyAny>,
    viewpoints: Option<&Bound<'py, PyAny>>,
    tolerance: f64,
    min_area: f64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Found<'py>> {
    let rows = |all| arrays::rows3("viewpoints", all).map(arrays::Rows3::into_f64);
    let viewpoints = viewpoints.map(rows).transpose()?;
    let surface = &cloud_of("surface", surface)?.get().cloud;
    let (other, measured) =
        (&cloud_of("other", other)?.get().cloud, &cloud_of("measured", measured)?.get().cloud);
    let other = Other { surface: other, measured, viewpoints: viewpoints.as_deref() };
    let found = run(py, progress, |p| find(surface, &other, tolerance, min_area, p))?;
    let row = |c: &Change| (c.bounds.low, c.bounds.high, c.n_points, c.area);
    let fates: Vec<u8> = found.fates.iter().map(|&fate: &Fate| fate as u8).collect();
    Ok((
        fates.into_pyarray(py),
        found.of_points.into_pyarray(py),
        found.all.iter().map(row).collect(),
        found.unseen_area,
    ))
}

/// Adds this file's function to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(changes, module)?)
}
