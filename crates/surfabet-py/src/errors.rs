//! Rust errors as the Python exceptions of `surfabet.errors`.

use std::path::Path;

use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};
use surfabet_geom::InvalidParameter;

fn raise(class: &str, message: String) -> PyErr {
    raise_with(class, message, |_| Ok(None))
}

/// Raises with the keywords that `keywords` gives.
fn raise_with(
    class: &str,
    message: String,
    keywords: impl for<'py> FnOnce(Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>>,
) -> PyErr {
    let made = Python::attach(|py| {
        let class = py.import("surfabet.errors")?.getattr(class)?;
        let instance = class.call((message,), keywords(py)?.as_ref())?;
        Ok(PyErr::from_value(instance))
    });
    made.unwrap_or_else(|error| error)
}

/// `class` for the argument `name`, with `value` as it is shown.
fn invalid_argument(
    class: &str,
    message: String,
    name: &str,
    value: &str,
    requirement: &str,
) -> PyErr {
    raise_with(class, message, |py| {
        let keywords = [("argument", name), ("value", value), ("requirement", requirement)];
        keywords.into_py_dict(py).map(Some)
    })
}

/// `surfabet.errors.InvalidInputError`, a `ValueError`.
pub fn invalid_input(message: impl std::fmt::Display) -> PyErr {
    raise("InvalidInputError", message.to_string())
}

/// `surfabet.errors.InvalidInputError` for the argument `name`, in the words of Python's own `wrong_value`.
pub fn wrong_value(name: &str, object: &Bound<'_, PyAny>, requirement: &str) -> PyErr {
    made_by("wrong_value", name, object, requirement)
}

/// `surfabet.errors.InvalidTypeError` for the argument `name`, in the words of Python's own `wrong_type`.
pub fn wrong_type(name: &str, object: &Bound<'_, PyAny>, requirement: &str) -> PyErr {
    made_by("wrong_type", name, object, requirement)
}

fn made_by(function: &str, name: &str, object: &Bound<'_, PyAny>, requirement: &str) -> PyErr {
    let made = object
        .py()
        .import("surfabet.errors")
        .and_then(|errors| errors.call_method1(function, (name, object, requirement)));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// `surfabet.errors.InvalidInputError` for the argument `name`, with `value` as it is shown.
pub fn wrong_shown(name: &str, value: &str, requirement: &str) -> PyErr {
    let message = format!("{name} is {value}, but must be {requirement}");
    invalid_argument("InvalidInputError", message, name, value, requirement)
}

/// `surfabet.errors.InvalidTypeError` likewise.
pub fn wrong_kind_shown(name: &str, value: &str, requirement: &str) -> PyErr {
    let message = format!("{name} is {value}, but must be {requirement}");
    invalid_argument("InvalidTypeError", message, name, value, requirement)
}

/// The system's own error of a number, in its words, about a path: FileNotFoundError, PermissionError, ...
fn os_error(number: i32, path: Option<&Path>) -> PyErr {
    Python::attach(|py| {
        let words = py.import("os").and_then(|os| os.call_method1("strerror", (number,)));
        match (words.map(Bound::unbind), path) {
            (Ok(words), Some(path)) => {
                PyOSError::new_err((number, words, path.display().to_string()))
            }
            (Ok(words), None) => PyOSError::new_err((number, words)),
            (Err(error), _) => error,
        }
    })
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

impl IntoPyErr for InvalidParameter {
    fn into_py_err(self) -> PyErr {
        let message = self.to_string();
        let Self { name, value, requirement } = self;
        invalid_argument("InvalidInputError", message, name, &value, &requirement)
    }
}

impl IntoPyErr for surfabet_geom::Error {
    fn into_py_err(self) -> PyErr {
        let message = self.to_string();
        match self {
            Self::Cancelled(_) => cancelled(),
            Self::InvalidParameter(invalid) => invalid.into_py_err(),
            _ => invalid_input(message),
        }
    }
}

/// `KeyboardInterrupt`: the caller asked to stop.
pub fn cancelled() -> PyErr {
    pyo3::exceptions::PyKeyboardInterrupt::new_err(())
}

/// `surfabet.errors.FormatError`, an `OSError` and a `ValueError`.
fn format_error(message: impl std::fmt::Display) -> PyErr {
    raise("FormatError", message.to_string())
}

impl IntoPyErr for surfabet_models::Error {
    fn into_py_err(self) -> PyErr {
        let message = self.to_string();
        match self {
            Self::Geometry(error) => error.into_py_err(),
            Self::Sparse(error) => error.into_py_err(),
            Self::Cancelled(_) => cancelled(),
            Self::InvalidParameter(invalid) => invalid.into_py_err(),
            Self::InvalidType { name, value, requirement } => {
                invalid_argument("InvalidTypeError", message, name, &value, &requirement)
            }
            _ => invalid_input(message),
        }
    }
}

impl IntoPyErr for surfabet::OpenError {
    fn into_py_err(self) -> PyErr {
        let message = self.to_string();
        match self {
            // What a Python object raised when it was read stays what it is.
            Self::Io(error) => match error.downcast::<PyErr>() {
                Ok(raised) => raised,
                Err(error) => match error.raw_os_error() {
                    Some(number) => os_error(number, None),
                    None => PyOSError::new_err(message),
                },
            },
            Self::Codec(_) => format_error(message),
            Self::Model(error) => error.into_py_err(),
        }
    }
}

impl IntoPyErr for surfabet::Error {
    fn into_py_err(self) -> PyErr {
        let message = self.to_string();
        match self {
            // The system's own error keeps its kind: FileNotFoundError, PermissionError, ...
            Self::Io { path, source } => match source.raw_os_error() {
                Some(number) => os_error(number, Some(&path)),
                None => PyOSError::new_err(message),
            },
            Self::File { .. } | Self::Codec(_) => format_error(message),
            Self::Model(error) => error.into_py_err(),
            Self::Geometry(error) => error.into_py_err(),
            _ => internal(message),
        }
    }
}
