//! Arguments of functions that Python calls directly: checked here, so that errors name them.

use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use surfabet_geom::{Error, InvalidParameter, Pose};

use crate::errors::{IntoPyErr, wrong_type, wrong_value};

/// True for a truth value, which Python takes for a number and these functions refuse.
fn is_flag(object: &Bound<'_, PyAny>) -> bool {
    object.extract::<bool>().is_ok()
}

/// The number that the argument `name` is.
///
/// # Errors
/// `InvalidTypeError` for anything else.
pub fn number(name: &str, object: &Bound<'_, PyAny>, requirement: &str) -> PyResult<f64> {
    match object.extract() {
        Ok(number) if !is_flag(object) => Ok(number),
        _ => Err(wrong_type(name, object, requirement)),
    }
}

/// The integer that the argument `name` is.
///
/// # Errors
/// `InvalidTypeError` for anything else, and `InvalidInputError` for an integer that `T` cannot hold.
pub fn integer<T: TryFrom<i128>>(
    name: &str,
    object: &Bound<'_, PyAny>,
    requirement: &str,
) -> PyResult<T> {
    let found = match object.extract::<i128>() {
        Ok(number) if !is_flag(object) => T::try_from(number).ok(),
        Err(error) if error.is_instance_of::<PyOverflowError>(object.py()) => None,
        _ => return Err(wrong_type(name, object, requirement)),
    };
    found.ok_or_else(|| wrong_value(name, object, requirement))
}

/// The `N` finite numbers that the argument `name` is a sequence of.
///
/// # Errors
/// `InvalidTypeError` for what are no numbers, and `InvalidInputError` for others.
pub fn numbers<const N: usize>(
    name: &str,
    object: &Bound<'_, PyAny>,
    requirement: &str,
) -> PyResult<[f64; N]> {
    let numbers: Vec<f64> = object.extract().map_err(|_| wrong_type(name, object, requirement))?;
    match <[f64; N]>::try_from(numbers) {
        Ok(numbers) if numbers.iter().all(|number| number.is_finite()) => Ok(numbers),
        _ => Err(wrong_value(name, object, requirement)),
    }
}

/// The pose that the argument `name` is a 4 x 4 matrix of.
///
/// # Errors
/// `InvalidTypeError` for what is no such matrix, and `InvalidInputError` for one that is no pose.
pub fn pose(name: &'static str, object: &Bound<'_, PyAny>) -> PyResult<Pose> {
    let requirement = "a 4 x 4 matrix of a rotation and a translation";
    let rows: Vec<Vec<f64>> =
        object.extract().map_err(|_| wrong_type(name, object, requirement))?;
    let rows: Option<Vec<[f64; 4]>> = rows.into_iter().map(|row| row.try_into().ok()).collect();
    let Some(rows) = rows.and_then(|rows| <[[f64; 4]; 4]>::try_from(rows).ok()) else {
        return Err(wrong_value(name, object, requirement));
    };
    Pose::from_rows(rows).map_err(|error| match error {
        // The matrix is what was given, its parts were not.
        Error::InvalidParameter(InvalidParameter { name: part, value, requirement }) => {
            let requirement = format!("a pose whose {part} is {requirement}");
            InvalidParameter::new(name, format!("a matrix with the {part} {value}"), requirement)
                .into_py_err()
        }
        other => other.into_py_err(),
    })
}
