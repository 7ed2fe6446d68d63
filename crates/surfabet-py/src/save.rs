//! What every model class does to become a file.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use surfabet::Save;

use crate::errors::IntoPyErr;

/// The bytes of the file with `model`.
pub fn to_bytes<'py>(py: Python<'py>, model: &(impl Save + Sync)) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = py.detach(|| model.to_bytes());
    Ok(PyBytes::new(py, &bytes.map_err(IntoPyErr::into_py_err)?))
}

/// Writes the file with `model` and gives back its size in bytes.
pub fn save(py: Python<'_>, model: &(impl Save + Sync), path: PathBuf) -> PyResult<u64> {
    py.detach(|| model.save(path)).map_err(IntoPyErr::into_py_err)
}
