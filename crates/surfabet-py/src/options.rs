//! Options of learning: from keywords in Python, and their records for the generator of signatures and tables.

use std::ops::Bound as End;

use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList, PyString};
use surfabet::options::{Kind, OptionSpec, Options, Value};
use surfabet::recognition::{FindOptions, RecurringOptions};
use surfabet::{
    AlphabetModel, BicAlphabetModel, GasModel, HscsmModel, Model, PatchModel, PlaneModel,
    SurfaceModel, for_each_method,
};

use crate::errors::{IntoPyErr, invalid_input};

/// The options in `given`, by name; the others have their defaults.
pub fn options_of<O: Options>(given: &Bound<'_, PyDict>) -> PyResult<O> {
    options_onto(O::default(), given)
}

/// As [`options_of`]; the others are as in `options`.
pub fn options_onto<O: Options>(mut options: O, given: &Bound<'_, PyDict>) -> PyResult<O> {
    for (name, value) in given {
        let name: String = name.extract()?;
        options.set(&name, &value_of(&value)?).map_err(IntoPyErr::into_py_err)?;
    }
    options.check().map_err(IntoPyErr::into_py_err)?;
    Ok(options)
}

/// A Python object as the value of an option. Numbers may be of numpy; a bool is no number.
fn value_of(object: &Bound<'_, PyAny>) -> PyResult<Value> {
    if object.is_none() {
        return Ok(Value::None);
    }
    if let Ok(text) = object.cast::<PyString>() {
        return Ok(Value::Text(text.to_string()));
    }
    if let Ok(flag) = object.extract() {
        return Ok(Value::Bool(flag));
    }
    match object.extract() {
        Ok(number) => return Ok(Value::Int(number)),
        // Beyond every range: the nearest that fits is too.
        Err(error) if error.is_instance_of::<PyOverflowError>(object.py()) => {
            let end = if object.gt(0)? { i128::MAX } else { i128::MIN };
            return Ok(Value::Int(end));
        }
        Err(_) => {}
    }
    // Bytes are no numbers, though a sequence of them.
    if object.is_instance_of::<PyBytes>() {
        return Ok(Value::Other(object.repr()?.to_string()));
    }
    // Before single numbers: an array of one number can be taken for that.
    if let Ok(numbers) = object.extract() {
        return Ok(Value::Floats(numbers));
    }
    if let Ok(names) = object.extract() {
        return Ok(Value::Texts(names));
    }
    match object.extract() {
        Ok(number) => Ok(Value::Float(number)),
        Err(_) => Ok(Value::Other(object.repr()?.to_string())),
    }
}

/// A value as a Python object.
fn object_of<'py>(py: Python<'py>, value: Value) -> PyResult<Bound<'py, PyAny>> {
    match value {
        Value::None => Ok(py.None().into_bound(py)),
        Value::Bool(flag) => Ok(flag.into_pyobject(py)?.to_owned().into_any()),
        Value::Int(number) => Ok(number.into_pyobject(py)?.into_any()),
        Value::Float(number) => Ok(number.into_pyobject(py)?.into_any()),
        Value::Floats(numbers) => numbers.into_pyobject(py),
        Value::Texts(names) => names.into_pyobject(py),
        Value::Text(text) | Value::Other(text) => Ok(text.into_pyobject(py)?.into_any()),
    }
}

/// A method's name, the records of its options, and their check.
type Method = (&'static str, &'static [OptionSpec], fn(&Bound<'_, PyDict>) -> PyResult<()>);

macro_rules! methods {
    ($($(#[$doc:meta])* $variant:ident($type:ty),)+) => {
        &[$((
            <$type as SurfaceModel>::METHOD,
            <<$type as SurfaceModel>::Options as Options>::SPECS,
            |given| options_of::<<$type as SurfaceModel>::Options>(given).map(|_| ()),
        ),)+]
    };
}

/// All methods.
const METHODS: &[Method] = for_each_method!(methods);

/// The records of all options: for each method's name a list of dicts, in the order of the guide.
#[pyfunction]
fn option_specs(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    for (method, specs, _) in METHODS {
        all.set_item(method, records(py, specs)?)?;
    }
    Ok(all)
}

/// The records of the options of `AlphabetModel.find`.
#[pyfunction]
fn find_option_specs(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    records(py, FindOptions::SPECS)
}

/// The records of the options of `recurring`.
#[pyfunction]
fn recurring_option_specs(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    records(py, RecurringOptions::SPECS)
}

/// One dict per option.
fn records<'py>(py: Python<'py>, specs: &[OptionSpec]) -> PyResult<Bound<'py, PyList>> {
    let records: Vec<Bound<'_, PyDict>> =
        specs.iter().map(|spec| record(py, spec)).collect::<PyResult<_>>()?;
    PyList::new(py, records)
}

/// One record.
fn record<'py>(py: Python<'py>, spec: &OptionSpec) -> PyResult<Bound<'py, PyDict>> {
    let (kind, choices): (&str, &[&str]) = match spec.kind {
        Kind::Bool => ("bool", &[]),
        Kind::Int => ("int", &[]),
        Kind::Float => ("float", &[]),
        Kind::Floats => ("floats", &[]),
        Kind::Texts => ("texts", &[]),
        Kind::Choice(names) => ("choice", names),
    };
    // A bound and whether it belongs to the range; no bound: every finite number.
    let end = |end: End<f64>| match end {
        End::Included(value) => Some((value, true)),
        End::Excluded(value) => Some((value, false)),
        End::Unbounded => None,
    };
    let dict = PyDict::new(py);
    dict.set_item("name", spec.name)?;
    dict.set_item("kind", kind)?;
    dict.set_item("choices", choices)?;
    dict.set_item("optional", spec.optional)?;
    dict.set_item("default", object_of(py, (spec.default)())?)?;
    dict.set_item("none", spec.none)?;
    dict.set_item("low", end(spec.range.low))?;
    dict.set_item("high", end(spec.range.high))?;
    dict.set_item("step", spec.range.step)?;
    dict.set_item("unit", spec.unit)?;
    dict.set_item("range", spec.range_in_words())?;
    dict.set_item("requirement", spec.requirement())?;
    dict.set_item("documentation", spec.paragraph())?;
    dict.set_item("another_scene", spec.another_scene)?;
    Ok(dict)
}

/// Refuses what learning with `method` would refuse in these options, without learning.
#[pyfunction]
#[pyo3(signature = (method, options))]
fn check_options(method: &str, options: &Bound<'_, PyDict>) -> PyResult<()> {
    match METHODS.iter().find(|(name, ..)| *name == method) {
        Some((_, _, check)) => check(options),
        None => {
            let names = Model::METHODS.join(", ");
            Err(invalid_input(format!("method is {method:?}, but must be one of {names}")))
        }
    }
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(option_specs, module)?)?;
    module.add_function(wrap_pyfunction!(find_option_specs, module)?)?;
    module.add_function(wrap_pyfunction!(recurring_option_specs, module)?)?;
    module.add_function(wrap_pyfunction!(check_options, module)?)
}
