//! `surfabet.places`: many places in one index, and kinds of places.

use std::sync::Arc;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use surfabet::recognition::PlaceSignature;
use surfabet::{
    AlphabetModel, LocateOptions, PlaceIndex, PlaceMatch, PlaceOptions, Progress, label_places,
    places,
};

use crate::alphabet::PyAlphabetModel;
use crate::cloud::PyPointCloud;
use crate::errors::IntoPyErr;
use crate::locate::{Columns, columns};
use crate::run::run;

/// Many places; documented in `surfabet.places`.
#[pyclass(name = "PlaceIndex", module = "surfabet._core", frozen)]
pub struct PyPlaceIndex {
    index: PlaceIndex,
}

/// Accepted and rejected places, and why none is accepted.
type Located<'py> = (Columns<'py>, Columns<'py>, Option<String>);

/// Number of the place, similarity, and where in it the scan was taken.
type Match<'py> = (usize, f64, Option<Located<'py>>);

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
        scan: Option<&Bound<'_, PyPointCloud>>,
        top: usize,
        verify: usize,
        upright: Option<bool>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Match<'py>>> {
        let py = slf.py();
        let locate = LocateOptions { upright, ..LocateOptions::default() };
        let options = PlaceOptions { top, verify, locate };
        let (index, model) = (&slf.get().index, &model.get().model);
        let scan = scan.map(|s| &s.get().cloud);
        let found: Vec<PlaceMatch> =
            run(py, progress, |monitor| index.query(model, scan, &options, monitor))?;
        let matched = |m: PlaceMatch| {
            let located = m.located.map(|l| {
                let reason = l.refusal.map(|refusal| refusal.to_string());
                (columns(py, &l.locations), columns(py, &l.rejected), reason)
            });
            (m.place, m.similarity, located)
        };
        Ok(found.into_iter().map(matched).collect())
    }

    /// Similarity of every two places, (n, n).
    fn similarities<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray2<f64>> {
        let py = slf.py();
        let index = &slf.get().index;
        let rows = py.detach(|| index.similarities());
        Array2::from_shape_fn((index.len(), index.len()), |(i, j)| rows[i][j]).into_pyarray(py)
    }

    fn __len__(&self) -> usize {
        self.index.len()
    }
}

/// Kinds (n,) and similarities of words (n, n).
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
    let labels = label_places(&all, n_kinds, min_similarity).map_err(IntoPyErr::into_py_err)?;
    let labels: Vec<i64> = labels.into_iter().map(i64::from).collect();
    let similar =
        Array2::from_shape_fn((all.len(), all.len()), |(i, j)| all[i].word_similarity(all[j]));
    Ok((labels.into_pyarray(py), similar.into_pyarray(py)))
}

/// Adds this file's names to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("KIND_SIMILARITY", places::KIND_SIMILARITY)?;
    module.add_class::<PyPlaceIndex>()?;
    module.add_function(wrap_pyfunction!(kinds_of_places, module)?)
}
