//! Rust errors as the Python exceptions of `surfabet.errors`.

use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;

fn raise(class: &str, message: String) -> PyErr {
    Python::attach(|py| {
        let class = match py.import("surfabet.errors").and_then(|m| m.getattr(class)) {
            Ok(class) => class,
            Err(error) => return error,
        };
        match class.call1((message,)) {
            Ok(instance) => PyErr::from_value(instance),
            Err(error) => error,
        }
    })
}

/// `surfabet.errors.InvalidInputError`, a `ValueError`.
pub fn invalid_input(message: impl std::fmt::Display) -> PyErr {
    raise("InvalidInputError", message.to_string())
}

/// A defect of ours, never of the user's input.
pub fn internal(message: impl std::fmt::Display) -> PyErr {
    PyRuntimeError::new_err(format!("internal error in surfabet, please report it: {message}"))
}

/// What the borders of our crates raise in Python.
pub trait IntoPyErr {
    /// The matching Python exception.
    fn into_py_err(self) -> PyErr;
}

impl IntoPyErr for surfabet_geom::Error {
    fn into_py_err(self) -> PyErr {
        match self {
            Self::Cancelled(_) => cancelled(),
            other => invalid_input(other),
        }
    }
}

fn cancelled() -> PyErr {
    pyo3::exceptions::PyKeyboardInterrupt::new_err(())
}

/// `surfabet.errors.FormatError`, an `OSError` and a `ValueError`.
fn format_error(message: impl std::fmt::Display) -> PyErr {
    raise("FormatError", message.to_string())
}

impl IntoPyErr for surfabet_models::Error {
    fn into_py_err(self) -> PyErr {
        match self {
            Self::Geometry(error) => error.into_py_err(),
            Self::Cancelled(_) => cancelled(),
            Self::Sparse(surfabet_sparse::Error::Cancelled) => cancelled(),
            other => invalid_input(other),
        }
    }
}

impl IntoPyErr for surfabet::Error {
    fn into_py_err(self) -> PyErr {
        let message = self.to_string();
        match self {
            // The system's own error keeps its kind: FileNotFoundError, PermissionError, ...
            Self::Io { path, source } => {
                let number = source.raw_os_error();
                match number {
                    Some(number) => PyOSError::new_err((number, source.to_string(), path)),
                    None => PyOSError::new_err(message),
                }
            }
            Self::File { .. } | Self::Codec(_) => format_error(message),
            Self::Model(error) => error.into_py_err(),
            Self::Geometry(error) => error.into_py_err(),
            _ => internal(message),
        }
    }
}
