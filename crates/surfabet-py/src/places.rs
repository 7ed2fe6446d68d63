//! `surfabet.places` and `surfabet.alphabet`: many places in one index, kinds of places, and how alike two places are.

use std::sync::Arc;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use surfabet::recognition::{
    self, LocateOptions, PlaceIndex, PlaceMatch, PlaceOptions, PlaceSignature, label_places, places,
};
use surfabet::{AlphabetModel, Progress};

use crate::alphabet::PyAlphabetModel;
use crate::cloud::cloud_of;
use crate::errors::IntoPyErr;
use crate::locate::{Answer, answer};
use crate::run::{released, run};

/// Many places; documented in `surfabet.places`.
#[pyclass(name = "PlaceIndex", module = "surfabet._core", frozen)]
pub struct PyPlaceIndex {
    index: PlaceIndex,
}

/// Number of the place, similarity, and where in it the scan was taken.
type Match<'py> = (usize, f64, Option<Answer<'py>>);

#[pymethods]
impl PyPlaceIndex {
    #[new]
    fn new(
        py: Python<'_>,
        models: Vec<Py<PyAlphabetModel>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let models: Vec<Arc<AlphabetModel>> =
            models.iter().map(|m| Arc::clone(&m.get().model)).collect();
        let index = run(py, progress, |monitor| {
            let mut index = PlaceIndex::default();
            for model in models {
                index.add(model, monitor)?;
            }
            Ok::<_, surfabet_models::Error>(index)
        })?;
        Ok(Self { index })
    }

    /// The most similar places, the first of them located.
    #[pyo3(signature = (model, scan, *, top, verify, upright, progress))]
    fn query<'py>(
        slf: &Bound<'py, Self>,
        model: &Bound<'_, PyAlphabetModel>,
        scan: Option<&Bound<'_, PyAny>>,
        top: usize,
        verify: usize,
        upright: Option<bool>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Match<'py>>> {
        let py = slf.py();
        let locate = LocateOptions { upright, ..LocateOptions::default() };
        let options = PlaceOptions { top, verify, locate };
        let (index, model) = (&slf.get().index, &model.get().model);
        let scan = scan.map(|s| cloud_of("scan", s)).transpose()?.map(|s| &s.get().cloud);
        let found: Vec<PlaceMatch> =
            run(py, progress, |monitor| index.query(model, scan, &options, monitor))?;
        let matched =
            |m: PlaceMatch| (m.place, m.similarity, m.located.map(|located| answer(py, &located)));
        Ok(found.into_iter().map(matched).collect())
    }

    /// Similarity of every two places, (n, n).
    fn similarities<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let py = slf.py();
        let index = &slf.get().index;
        let rows = released(py, || index.similarities())?;
        let of_pairs = Array2::from_shape_fn((index.len(), index.len()), |(i, j)| rows[i][j]);
        Ok(of_pairs.into_pyarray(py))
    }

    fn __len__(&self) -> usize {
        self.index.len()
    }
}

/// Kinds (n,) and similarities (n, n).
type Kinds<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray2<f64>>);

/// A kind per place; documented in `surfabet.places`.
#[pyfunction]
#[pyo3(name = "label_places", signature = (models, *, n_kinds, min_similarity, progress))]
fn kinds_of_places<'py>(
    py: Python<'py>,
    models: Vec<Py<PyAlphabetModel>>,
    n_kinds: Option<usize>,
    min_similarity: f64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Kinds<'py>> {
    let models: Vec<Arc<AlphabetModel>> =
        models.iter().map(|m| Arc::clone(&m.get().model)).collect();
    let signatures = run(py, progress, |monitor: &dyn Progress| {
        models.iter().map(|m| PlaceSignature::of(m, monitor)).collect::<Result<Vec<_>, _>>()
    })?;
    let all: Vec<&PlaceSignature> = signatures.iter().collect();
    let (labels, rows) =
        label_places(&all, n_kinds, min_similarity).map_err(IntoPyErr::into_py_err)?;
    let labels: Vec<i64> = labels.into_iter().map(i64::from).collect();
    let similar = Array2::from_shape_fn((all.len(), all.len()), |(i, j)| rows[i][j]);
    Ok((labels.into_pyarray(py), similar.into_pyarray(py)))
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
    let all = recognition::word_histogram(&model.get().model);
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
    module.add("KIND_SIMILARITY", places::KIND_SIMILARITY)?;
    module.add_class::<PyPlaceIndex>()?;
    module.add_function(wrap_pyfunction!(kinds_of_places, module)?)?;
    module.add_function(wrap_pyfunction!(place_similarity, module)?)?;
    module.add_function(wrap_pyfunction!(word_histogram, module)?)
}
