//! `surfabet.alphabet` and `surfabet.recurring`: what looks like an example, and what recurs.

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::recognition::{
    self, Example, FindOptions, Found, RecurringClass, RecurringOptions, Region,
};

use crate::alphabet::PyAlphabetModel;
use crate::errors::invalid_input;
use crate::options::options_of;
use crate::run::run;

/// Poses (k, 4, 4), scores (k,), centres (k, 3), sizes (k, 2), and which example, (k,).
type FoundArrays<'py> = (
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<i64>>,
);

/// A ball (middle, radius) or a box (corners).
type GivenRegion = (Option<([f64; 3], f64)>, Option<([f64; 3], [f64; 3])>);

fn region_of((ball, corners): GivenRegion) -> Option<Region> {
    match (ball, corners) {
        (Some((center, radius)), _) => Some(Region::Ball { center, radius }),
        (None, Some((low, high))) => Some(Region::Box { low, high }),
        (None, None) => None,
    }
}

fn found_arrays<'py>(py: Python<'py>, found: &[Found]) -> FoundArrays<'py> {
    let poses =
        Array3::from_shape_fn((found.len(), 4, 4), |(i, row, column)| match (row, column) {
            (3, 3) => 1.0,
            (3, _) => 0.0,
            (_, 3) => found[i].pose.translation()[row],
            _ => found[i].pose.rotation()[row][column],
        });
    let centers = Array2::from_shape_fn((found.len(), 3), |(i, a)| found[i].center[a]);
    let sizes = Array2::from_shape_fn((found.len(), 2), |(i, a)| found[i].size[a]);
    let scores: Vec<f64> = found.iter().map(|f| f.score).collect();
    let examples: Vec<i64> = found.iter().map(|f| f.example as i64).collect();
    (
        poses.into_pyarray(py),
        scores.into_pyarray(py),
        centers.into_pyarray(py),
        sizes.into_pyarray(py),
        examples.into_pyarray(py),
    )
}

/// Places like a part of the model itself; documented in `surfabet.alphabet`.
#[pyfunction]
#[pyo3(signature = (model, *, region, options, progress))]
fn find_occurrences<'py>(
    py: Python<'py>,
    model: &Bound<'_, PyAlphabetModel>,
    region: GivenRegion,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<FoundArrays<'py>> {
    let Some(region) = region_of(region) else {
        return Err(invalid_input("region is missing"));
    };
    let options: FindOptions = options_of(options)?;
    let model = &model.get().model;
    let found: Vec<Found> =
        run(py, progress, |monitor| recognition::find(model, &region, &options, monitor))?;
    Ok(found_arrays(py, &found))
}

/// Places like examples of other models, or like a region of each; documented in `surfabet.alphabet`.
#[pyfunction]
#[pyo3(signature = (model, examples, *, region, options, progress))]
fn find_examples<'py>(
    py: Python<'py>,
    model: &Bound<'_, PyAlphabetModel>,
    examples: Vec<Py<PyAlphabetModel>>,
    region: GivenRegion,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<FoundArrays<'py>> {
    let options: FindOptions = options_of(options)?;
    let model = &model.get().model;
    let region = region_of(region);
    let examples: Vec<Example<'_>> =
        examples.iter().map(|e| Example { model: &e.get().model, region }).collect();
    let found: Vec<Found> = run(py, progress, |monitor| {
        recognition::find_examples(model, &examples, &options, monitor)
    })?;
    Ok(found_arrays(py, &found))
}

/// Low and high corner of the example, its places, and the occurrences of words of each place.
type ClassArrays<'py> = ([[f64; 3]; 2], FoundArrays<'py>, Vec<Bound<'py, PyArray1<i64>>>);

/// Classes of things that recur; documented in `surfabet.recurring`.
#[pyfunction]
#[pyo3(signature = (model, options, *, progress))]
fn recurring<'py>(
    py: Python<'py>,
    model: &Bound<'_, PyAlphabetModel>,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<ClassArrays<'py>>> {
    let options: RecurringOptions = options_of(options)?;
    let model = &model.get().model;
    let classes: Vec<RecurringClass> =
        run(py, progress, |monitor| recognition::recurring(model, &options, monitor))?;
    let arrays = |class: &RecurringClass| {
        let numbers = |all: &Vec<u32>| {
            all.iter().map(|&k| i64::from(k)).collect::<Vec<i64>>().into_pyarray(py)
        };
        let occurrences = class.occurrences.iter().map(numbers).collect();
        (class.example.corners(), found_arrays(py, &class.places), occurrences)
    };
    Ok(classes.iter().map(arrays).collect())
}

/// Adds this file's names to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(find_occurrences, module)?)?;
    module.add_function(wrap_pyfunction!(find_examples, module)?)?;
    module.add_function(wrap_pyfunction!(recurring, module)?)
}
