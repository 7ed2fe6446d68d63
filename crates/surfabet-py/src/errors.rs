//! Rust errors as the Python exceptions of `surfabet.errors`.

use pyo3::exceptions::PyRuntimeError;
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
            Self::Cancelled(_) => pyo3::exceptions::PyKeyboardInterrupt::new_err(()),
            other => invalid_input(other),
        }
    }
}
