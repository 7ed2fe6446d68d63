//! numpy arrays of any shape, type and layout into checked Rust columns.

use numpy::{
    PyArrayDescrMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use surfabet_geom::Column;

use crate::errors::{invalid_input, wrong_kind_shown, wrong_shown, wrong_type};

/// Rows of three in the precision they came in.
pub enum Rows3 {
    /// Single precision or less.
    F32(Vec<[f32; 3]>),
    /// Everything else.
    F64(Vec<[f64; 3]>),
}

impl Rows3 {
    /// The rows rounded to single precision.
    pub fn into_f32(self) -> Vec<[f32; 3]> {
        match self {
            Self::F32(rows) => rows,
            Self::F64(rows) => rows.into_iter().map(|r| r.map(|c| c as f32)).collect(),
        }
    }

    /// The rows in double precision.
    pub fn into_f64(self) -> Vec<[f64; 3]> {
        match self {
            Self::F32(rows) => rows.into_iter().map(|r| r.map(f64::from)).collect(),
            Self::F64(rows) => rows,
        }
    }
}

/// What arrays are made of.
const NUMBERS: &str = "an array of floating-point or integer numbers";

/// `obj` as a numpy array of any type.
fn as_array<'py>(name: &str, obj: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = obj.py();
    py.import("numpy")?.call_method1("asarray", (obj,)).map_err(|error| {
        // Rows of several lengths.
        let is_none =
            error.is_instance_of::<PyValueError>(py) || error.is_instance_of::<PyTypeError>(py);
        if is_none { wrong_type(name, obj, NUMBERS) } else { error }
    })
}

/// The error for an array of another shape than `expected`.
fn wrong_shape(name: &str, array: &Bound<'_, PyUntypedArray>, expected: &str) -> PyErr {
    let sides: Vec<String> = array.shape().iter().map(usize::to_string).collect();
    let comma = if sides.len() == 1 { "," } else { "" };
    let given = format!("an array of the shape ({}{comma})", sides.join(", "));
    wrong_shown(name, &given, &format!("one of the shape {expected}"))
}

/// `obj` as a numpy array with its kind ('f', 'u', 'i') and item size, refused when not of real numbers.
fn as_real_array<'py>(
    name: &str,
    obj: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyUntypedArray>, String, usize)> {
    let array = as_array(name, obj)?.cast_into::<PyUntypedArray>()?;
    let kind: String = array.dtype().getattr("kind")?.extract()?;
    if !matches!(kind.as_str(), "f" | "i" | "u") {
        return Err(match array.ndim() {
            0 => wrong_type(name, obj, NUMBERS),
            _ => {
                let given = format!("an array of {}", array.dtype().str()?);
                wrong_kind_shown(name, &given, NUMBERS)
            }
        });
    }
    let size = array.dtype().itemsize();
    Ok((array, kind, size))
}

/// The same numbers as a C-ordered, native-endian, aligned array of `dtype`; no copy where it is one already.
fn contiguous<'py>(array: &Bound<'py, PyUntypedArray>, dtype: &str) -> PyResult<Bound<'py, PyAny>> {
    let numpy = array.py().import("numpy")?;
    numpy.call_method1("require", (array, dtype, ("C", "A")))
}

fn check_rows(name: &str, array: &Bound<'_, PyUntypedArray>, columns: usize) -> PyResult<()> {
    if array.ndim() == 2 && array.shape()[1] == columns {
        return Ok(());
    }
    Err(wrong_shape(name, array, &format!("(n, {columns})")))
}

fn rows_of<T: numpy::Element + Copy>(array: &Bound<'_, PyAny>) -> PyResult<Vec<[T; 3]>> {
    let array: PyReadonlyArray2<'_, T> = array.extract()?;
    Ok(array.as_slice().map_err(invalid_input)?.as_chunks::<3>().0.to_vec())
}

/// An (n, 3) array of real numbers.
pub fn rows3(name: &str, obj: &Bound<'_, PyAny>) -> PyResult<Rows3> {
    let (array, kind, size) = as_real_array(name, obj)?;
    check_rows(name, &array, 3)?;
    if kind == "f" && size <= 4 {
        Ok(Rows3::F32(rows_of::<f32>(&contiguous(&array, "float32")?)?))
    } else {
        Ok(Rows3::F64(rows_of::<f64>(&contiguous(&array, "float64")?)?))
    }
}

/// An (n,) array of real numbers in single precision.
pub fn column_f32(name: &str, obj: &Bound<'_, PyAny>) -> PyResult<Vec<f32>> {
    let (array, _, _) = as_real_array(name, obj)?;
    if array.ndim() != 1 {
        return Err(wrong_shape(name, &array, "(n,)"));
    }
    let array: PyReadonlyArray1<'_, f32> = contiguous(&array, "float32")?.extract()?;
    array.as_slice().map(<[f32]>::to_vec).map_err(invalid_input)
}

/// An (n,) array of numbers in its own type; truth values become 0 and 1, half precision becomes single.
pub fn column(name: &str, obj: &Bound<'_, PyAny>) -> PyResult<Column> {
    let array = as_array(name, obj)?;
    let is_truth = array.getattr("dtype")?.getattr("kind")?.eq("b")?;
    let array = if is_truth { array.call_method1("astype", ("uint8",))? } else { array };
    let (array, kind, size) = as_real_array(name, &array)?;
    if array.ndim() != 1 {
        return Err(wrong_shape(name, &array, "(n,)"));
    }
    fn values<T>(array: &Bound<'_, PyUntypedArray>, dtype: &str) -> PyResult<Column>
    where
        T: numpy::Element + Copy,
        Column: From<Vec<T>>,
    {
        let array: PyReadonlyArray1<'_, T> = contiguous(array, dtype)?.extract()?;
        array.as_slice().map(|values| values.to_vec().into()).map_err(invalid_input)
    }
    match (kind.as_str(), size) {
        ("u", 1) => values::<u8>(&array, "uint8"),
        ("i", 1) => values::<i8>(&array, "int8"),
        ("u", 2) => values::<u16>(&array, "uint16"),
        ("i", 2) => values::<i16>(&array, "int16"),
        ("u", 4) => values::<u32>(&array, "uint32"),
        ("i", 4) => values::<i32>(&array, "int32"),
        ("u", _) => values::<u64>(&array, "uint64"),
        ("i", _) => values::<i64>(&array, "int64"),
        (_, ..=4) => values::<f32>(&array, "float32"),
        _ => values::<f64>(&array, "float64"),
    }
}

/// An (n,) array of non-negative integers below 2^32.
pub fn column_u32(name: &str, obj: &Bound<'_, PyAny>) -> PyResult<Vec<u32>> {
    let (array, kind, _) = as_real_array(name, obj)?;
    if array.ndim() != 1 {
        return Err(wrong_shape(name, &array, "(n,)"));
    }
    if kind == "f" {
        let given = format!("an array of {}", array.dtype().str()?);
        return Err(wrong_kind_shown(name, &given, "an array of integers"));
    }
    // uint64 values past i64 become negative here and are refused with the rest.
    let array: PyReadonlyArray1<'_, i64> = contiguous(&array, "int64")?.extract()?;
    let fits = |&value: &i64| u32::try_from(value).map_err(|_| value);
    let column: Result<Vec<u32>, i64> =
        array.as_slice().map_err(invalid_input)?.iter().map(fits).collect();
    column.map_err(|value| {
        let requirement = format!("integers from 0 to {}", u32::MAX);
        wrong_shown(name, &format!("an array with {value} in it"), &requirement)
    })
}

/// (n, 3) colours: uint8 as they are, uint16 scaled from 0..65535, floats from 0..1.
pub fn colors(name: &str, obj: &Bound<'_, PyAny>) -> PyResult<Vec<[u8; 3]>> {
    let (array, kind, size) = as_real_array(name, obj)?;
    check_rows(name, &array, 3)?;
    match (kind.as_str(), size) {
        ("u", 1) => rows_of::<u8>(&contiguous(&array, "uint8")?),
        ("u", 2) => {
            let rows = rows_of::<u16>(&contiguous(&array, "uint16")?)?;
            Ok(rows.iter().map(|r| r.map(|c| ((u32::from(c) + 128) / 257) as u8)).collect())
        }
        ("f", _) => {
            let rows = rows_of::<f32>(&contiguous(&array, "float32")?)?;
            if let Some(bad) = rows.iter().flatten().find(|c| !(0.0..=1.0).contains(*c)) {
                return Err(wrong_shown(
                    name,
                    &format!("an array of floats with {bad} in it"),
                    "floats from 0 to 1, or uint8 from 0 to 255",
                ));
            }
            Ok(rows.iter().map(|r| r.map(|c| (c * 255.0).round() as u8)).collect())
        }
        _ => Err(wrong_kind_shown(
            name,
            &format!("an array of {}", array.dtype().str()?),
            "uint8 (0 to 255), uint16 (0 to 65535) or floats (0 to 1)",
        )),
    }
}

/// An (n, m) array of real numbers in single precision, row-major, with its shape.
pub fn matrix_f32(name: &str, obj: &Bound<'_, PyAny>) -> PyResult<(Vec<f32>, [usize; 2])> {
    let (array, _, _) = as_real_array(name, obj)?;
    let &[rows, columns] = array.shape() else {
        return Err(wrong_shape(name, &array, "(n, m)"));
    };
    let array: PyReadonlyArray2<'_, f32> = contiguous(&array, "float32")?.extract()?;
    Ok((array.as_slice().map(<[f32]>::to_vec).map_err(invalid_input)?, [rows, columns]))
}
