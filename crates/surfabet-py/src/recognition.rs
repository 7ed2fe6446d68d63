//! Finding what looks like an example, and comparing places.

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::recognition::{self, FindOptions, Found, Region};

use crate::alphabet::PyAlphabetModel;
use crate::options::options_of;
use crate::run::run;

type FoundArrays<'py> =
    (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// Poses (k, 4, 4), scores (k,) and centres (k, 3); documented in `surfabet.alphabet`.
#[pyfunction]
#[pyo3(signature = (model, *, ball, corners, options, progress))]
fn find_occurrences<'py>(
    py: Python<'py>,
    model: &Bound<'_, PyAlphabetModel>,
    ball: Option<([f64; 3], f64)>,
    corners: ([f64; 3], [f64; 3]),
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<FoundArrays<'py>> {
    let region = match ball {
        Some((center, radius)) => Region::Ball { center, radius },
        None => Region::Box { low: corners.0, high: corners.1 },
    };
    let options: FindOptions = options_of(options)?;
    let model = &model.get().model;
    let found: Vec<Found> = run(py, progress, |monitor| model.find(&region, &options, monitor))?;
    let poses =
        Array3::from_shape_fn((found.len(), 4, 4), |(i, row, column)| match (row, column) {
            (3, 3) => 1.0,
            (3, _) => 0.0,
            (_, 3) => found[i].pose.translation()[row],
            _ => found[i].pose.rotation()[row][column],
        });
    let centers = Array2::from_shape_fn((found.len(), 3), |(i, a)| found[i].center[a]);
    let scores: Vec<f64> = found.iter().map(|f| f.score).collect();
    Ok((poses.into_pyarray(py), scores.into_pyarray(py), centers.into_pyarray(py)))
}

/// How alike two places are, 0 to 1.
#[pyfunction]
fn place_similarity(
    py: Python<'_>,
    a: &Bound<'_, PyAlphabetModel>,
    b: &Bound<'_, PyAlphabetModel>,
) -> PyResult<f64> {
    let [a, b] = [a, b].map(|m| &m.get().model);
    run(py, None, |monitor| recognition::place_similarity(a, b, monitor))
}

type WordShares<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
);

/// Word, radius, class of inclination and share of area, as arrays.
#[pyfunction]
fn word_histogram<'py>(py: Python<'py>, model: &Bound<'_, PyAlphabetModel>) -> WordShares<'py> {
    let all = model.get().model.word_histogram();
    let words: Vec<i64> = all.iter().map(|s| i64::from(s.word)).collect();
    let radii: Vec<f64> = all.iter().map(|s| s.radius).collect();
    let inclinations: Vec<i64> = all.iter().map(|s| i64::from(s.inclination)).collect();
    let shares: Vec<f64> = all.iter().map(|s| s.share).collect();
    (
        words.into_pyarray(py),
        radii.into_pyarray(py),
        inclinations.into_pyarray(py),
        shares.into_pyarray(py),
    )
}

/// Adds this file's names to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(find_occurrences, module)?)?;
    module.add_function(wrap_pyfunction!(place_similarity, module)?)?;
    module.add_function(wrap_pyfunction!(word_histogram, module)?)
}
