//! Model files of all families.

use std::path::PathBuf;

use pyo3::prelude::*;
use surfabet::{Container, Limits, Model, Shared};

use crate::alphabet::{PyAlphabet, PyAlphabetModel};
use crate::bic_alphabet::{PyBicAlphabet, PyBicAlphabetModel};
use crate::errors::{IntoPyErr, invalid_input};
use crate::gas::PyGasModel;
use crate::hscsm::{PyHscsmDictionary, PyHscsmModel};
use crate::patches::PyPatchModel;
use crate::planes::PyPlaneModel;

type Dictionary<'a, 'py> = Option<&'a Bound<'py, PyHscsmDictionary>>;
type Words<'a, 'py> = Option<&'a Bound<'py, PyAlphabet>>;
type BicWords<'a, 'py> = Option<&'a Bound<'py, PyBicAlphabet>>;

fn shared<'a>(
    dictionary: Dictionary<'a, '_>,
    alphabet: Words<'a, '_>,
    bic_alphabet: BicWords<'a, '_>,
) -> Shared<'a> {
    Shared {
        dictionary: dictionary.map(|d| &d.get().dictionary),
        alphabet: alphabet.map(|a| &a.get().alphabet),
        bic_alphabet: bic_alphabet.map(|a| &a.get().alphabet),
    }
}

/// The model in the bytes of an `.sfb` file.
#[pyfunction]
#[pyo3(signature = (data, *, max_items, max_bytes, dictionary, alphabet, bic_alphabet))]
fn from_bytes(
    py: Python<'_>,
    data: &[u8],
    max_items: u64,
    max_bytes: u64,
    dictionary: Dictionary<'_, '_>,
    alphabet: Words<'_, '_>,
    bic_alphabet: BicWords<'_, '_>,
) -> PyResult<Py<PyAny>> {
    let limits = Limits { max_items, max_bytes };
    let shared = shared(dictionary, alphabet, bic_alphabet);
    let model = py.detach(|| Model::from_bytes_with(data, &limits, shared));
    wrap(py, model.map_err(IntoPyErr::into_py_err)?)
}

/// The model in an `.sfb` file.
#[pyfunction]
#[pyo3(signature = (path, *, max_items, max_bytes, dictionary, alphabet, bic_alphabet))]
fn load(
    py: Python<'_>,
    path: PathBuf,
    max_items: u64,
    max_bytes: u64,
    dictionary: Dictionary<'_, '_>,
    alphabet: Words<'_, '_>,
    bic_alphabet: BicWords<'_, '_>,
) -> PyResult<Py<PyAny>> {
    let limits = Limits { max_items, max_bytes };
    let shared = shared(dictionary, alphabet, bic_alphabet);
    let model = py.detach(|| Model::open_with(path, &limits, shared));
    wrap(py, model.map_err(IntoPyErr::into_py_err)?)
}

/// Family, oldest release that reads the file, bytes by section, and the model, of the bytes of an `.sfb` file.
#[pyfunction]
#[pyo3(signature = (data, *, max_items, max_bytes, dictionary, alphabet, bic_alphabet))]
fn inspect(
    py: Python<'_>,
    data: &[u8],
    max_items: u64,
    max_bytes: u64,
    dictionary: Dictionary<'_, '_>,
    alphabet: Words<'_, '_>,
    bic_alphabet: BicWords<'_, '_>,
) -> PyResult<(&'static str, String, Vec<(String, usize)>, Py<PyAny>)> {
    let limits = Limits { max_items, max_bytes };
    let shared = shared(dictionary, alphabet, bic_alphabet);
    let (container, model) = py
        .detach(|| {
            let container = Container::parse(data, &limits)?;
            let model = Model::read(&container, &limits, shared)?;
            Ok::<_, surfabet::Error>((container, model))
        })
        .map_err(IntoPyErr::into_py_err)?;
    let sections =
        container.sections().iter().map(|s| (s.tag.to_string(), s.bytes.len())).collect();
    let version = container.needed_version().to_string();
    Ok((container.family().name(), version, sections, wrap(py, model)?))
}

fn wrap(py: Python<'_>, model: Model) -> PyResult<Py<PyAny>> {
    match model {
        Model::Hscsm(model) => Ok(Py::new(py, PyHscsmModel::from(model))?.into_any()),
        Model::Patches(model) => Ok(Py::new(py, PyPatchModel::from(model))?.into_any()),
        Model::Alphabet(model) => Ok(Py::new(py, PyAlphabetModel::from(model))?.into_any()),
        Model::BicAlphabet(model) => Ok(Py::new(py, PyBicAlphabetModel::from(model))?.into_any()),
        Model::Gas(model) => Ok(Py::new(py, PyGasModel::from(model))?.into_any()),
        Model::Planes(model) => Ok(Py::new(py, PyPlaneModel::from(model))?.into_any()),
        other => {
            Err(invalid_input(format!("models of family {} have no class yet", other.family())))
        }
    }
}

/// Adds this file's functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(from_bytes, module)?)?;
    module.add_function(wrap_pyfunction!(load, module)?)?;
    module.add_function(wrap_pyfunction!(inspect, module)?)
}
