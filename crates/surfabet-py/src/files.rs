//! Model files of all methods.

use std::path::PathBuf;

use pyo3::prelude::*;
use surfabet::{
    AlphabetModel, BicAlphabetModel, Container, GasModel, HscsmModel, KnownVocabulary, Limits,
    Model, PatchModel, PlaneModel, for_each_method,
};

use crate::alphabet::PyAlphabet;
use crate::bic_alphabet::PyBicAlphabet;
use crate::errors::{IntoPyErr, internal, invalid_input};
use crate::hscsm::PyHscsmDictionary;
use crate::model::{ModelClass, wrap};
use crate::run::released;

/// The vocabulary in a Python object.
fn known<'a>(vocabulary: Option<&'a Bound<'_, PyAny>>) -> PyResult<KnownVocabulary<'a>> {
    let Some(object) = vocabulary else {
        return Ok(KnownVocabulary::NONE);
    };
    if let Ok(found) = object.cast::<PyHscsmDictionary>() {
        Ok(KnownVocabulary::new(&found.get().dictionary))
    } else if let Ok(found) = object.cast::<PyAlphabet>() {
        Ok(KnownVocabulary::new(&found.get().alphabet))
    } else if let Ok(found) = object.cast::<PyBicAlphabet>() {
        Ok(KnownVocabulary::new(&found.get().alphabet))
    } else {
        let class = object.get_type();
        Err(invalid_input(format!(
            "vocabulary is a {class}, but must be the dictionary or the alphabet of a model"
        )))
    }
}

/// The Python object of a model whose method is known at run time only.
fn wrap_any(py: Python<'_>, model: Model) -> PyResult<Py<PyAny>> {
    fn object<M: ModelClass>(py: Python<'_>, model: M) -> PyResult<Py<PyAny>> {
        Ok(wrap(py, model)?.into_any())
    }
    macro_rules! arms {
        ($($(#[$doc:meta])* $variant:ident($type:ty),)+) => {
            match model {
                $(Model::$variant(model) => object::<$type>(py, model),)+
                other => Err(internal(format!("no class for models of {}", other.method()))),
            }
        };
    }
    for_each_method!(arms)
}

/// The model in the bytes of an `.sfb` file.
#[pyfunction]
#[pyo3(signature = (data, *, max_items, max_bytes, vocabulary))]
fn from_bytes(
    py: Python<'_>,
    data: &[u8],
    max_items: u64,
    max_bytes: u64,
    vocabulary: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<PyAny>> {
    let (limits, known) = (Limits { max_items, max_bytes }, known(vocabulary)?);
    let model = released(py, || Model::from_bytes_with(data, &limits, known))?;
    wrap_any(py, model.map_err(IntoPyErr::into_py_err)?)
}

/// The model in an `.sfb` file.
#[pyfunction]
#[pyo3(signature = (path, *, max_items, max_bytes, vocabulary))]
fn load(
    py: Python<'_>,
    path: PathBuf,
    max_items: u64,
    max_bytes: u64,
    vocabulary: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<PyAny>> {
    let (limits, known) = (Limits { max_items, max_bytes }, known(vocabulary)?);
    let model = released(py, || Model::open_with(path, &limits, known))?;
    wrap_any(py, model.map_err(IntoPyErr::into_py_err)?)
}

/// The header of the bytes of an `.sfb` file: method, oldest release that reads them, hash of the vocabulary that
/// they name, bytes by section, note.
type Inspected = (&'static str, String, Option<String>, Vec<(String, usize)>, Option<String>);

/// The header of the bytes of an `.sfb` file; nothing is decoded.
#[pyfunction]
#[pyo3(signature = (data, *, max_items, max_bytes))]
fn inspect(data: &[u8], max_items: u64, max_bytes: u64) -> PyResult<Inspected> {
    let limits = Limits { max_items, max_bytes };
    let found = Container::parse(data, &limits).map_err(surfabet::Error::from);
    let container = found.map_err(IntoPyErr::into_py_err)?;
    let summary = Model::inspect(&container).map_err(IntoPyErr::into_py_err)?;
    let version = container.needed_version().to_string();
    let vocabulary = summary.vocabulary.map(|hash| hash.to_string());
    let note = surfabet::note(&container);
    Ok((summary.method, version, vocabulary, summary.sections, note))
}

/// Adds this file's functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(from_bytes, module)?)?;
    module.add_function(wrap_pyfunction!(load, module)?)?;
    module.add_function(wrap_pyfunction!(inspect, module)?)
}
