//! `surfabet.sparse`: sparse codes, orthogonal matching pursuit and weighted K-SVD.

use numpy::ndarray::ArrayView1;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use surfabet_sparse::{
    Dictionary, Error, Ksvd, KsvdOptions, OmpOptions, Selection, Signals, SparseCodes, StopReason,
};

use crate::errors::{IntoPyErr, cancelled, invalid_input, wrong_value};
use crate::run;
use crate::run::released;
use crate::view::{FrozenOwner, read_only_view};
use crate::{arguments, arrays};

impl IntoPyErr for Error {
    fn into_py_err(self) -> PyErr {
        match self {
            Self::Cancelled(_) => cancelled(),
            Self::InvalidParameter(invalid) => invalid.into_py_err(),
            other => invalid_input(other),
        }
    }
}

/// Which atoms each signal uses, and how much of each; immutable.
#[pyclass(name = "SparseCodes", module = "surfabet.sparse", frozen)]
pub struct PySparseCodes {
    codes: SparseCodes,
    offsets: Vec<u64>,
}

impl FrozenOwner for PySparseCodes {}

impl From<SparseCodes> for PySparseCodes {
    fn from(codes: SparseCodes) -> Self {
        let offsets = codes.offsets().iter().map(|&o| o as u64).collect();
        Self { codes, offsets }
    }
}

#[pymethods]
impl PySparseCodes {
    #[new]
    fn new(
        offsets: &Bound<'_, PyAny>,
        atoms: &Bound<'_, PyAny>,
        coefficients: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let offsets = arrays::column_u32("offsets", offsets)?.into_iter().map(|o| o as usize);
        let codes = SparseCodes::from_parts(
            offsets.collect(),
            arrays::column_u32("atoms", atoms)?,
            arrays::column_f32("coefficients", coefficients)?,
        );
        Ok(codes.map_err(IntoPyErr::into_py_err)?.into())
    }

    #[getter]
    fn offsets<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray1<u64>> {
        read_only_view(slf, |c| ArrayView1::from(&c.offsets[..]))
    }

    #[getter]
    fn atoms<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray1<u32>> {
        read_only_view(slf, |c| ArrayView1::from(c.codes.atoms()))
    }

    #[getter]
    fn coefficients<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray1<f32>> {
        read_only_view(slf, |c| ArrayView1::from(c.codes.coefficients()))
    }

    /// The codes as a dense (n_signals, n_atoms) array.
    fn to_dense<'py>(
        &self,
        py: Python<'py>,
        n_atoms: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let used = self.codes.atoms().iter().map(|&atom| atom as usize + 1).max().unwrap_or(0);
        let requirement = format!("an integer of at least {used}, as many as the codes use");
        let given = n_atoms;
        let n_atoms: usize = arguments::integer("n_atoms", given, &requirement)?;
        if n_atoms < used {
            return Err(wrong_value("n_atoms", given, &requirement));
        }
        let dense = PyArray2::<f32>::zeros(py, [self.codes.len(), n_atoms], false);
        {
            let mut dense = dense.readwrite();
            let values = dense.as_slice_mut().map_err(invalid_input)?;
            for i in 0..self.codes.len() {
                let (atoms, coefficients) = self.codes.code(i);
                for (&atom, &x) in atoms.iter().zip(coefficients) {
                    values[i * n_atoms + atom as usize] = x;
                }
            }
        }
        Ok(dense)
    }

    fn __len__(&self) -> usize {
        self.codes.len()
    }

    fn __getitem__<'py>(
        &self,
        py: Python<'py>,
        index: isize,
    ) -> PyResult<(Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<f32>>)> {
        let len = self.codes.len();
        let from_start =
            if index < 0 { len.checked_sub(index.unsigned_abs()) } else { Some(index as usize) };
        match from_start.filter(|&i| i < len) {
            Some(i) => {
                let (atoms, coefficients) = self.codes.code(i);
                Ok((PyArray1::from_slice(py, atoms), PyArray1::from_slice(py, coefficients)))
            }
            None => Err(PyIndexError::new_err(format!("code {index} of {len}"))),
        }
    }

    fn __repr__(&self) -> String {
        format!("SparseCodes({} codes, {} entries)", self.codes.len(), self.codes.atoms().len())
    }
}

/// A learned dictionary with the codes it was learned with; immutable.
#[pyclass(name = "Ksvd", module = "surfabet.sparse", frozen)]
pub struct PyKsvd {
    learned: Ksvd,
    codes: Py<PySparseCodes>,
}

impl FrozenOwner for PyKsvd {}

#[pymethods]
impl PyKsvd {
    #[getter]
    fn dictionary<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let dictionary = &slf.get().learned.dictionary;
        let shape = [dictionary.n_atoms(), dictionary.n_features()];
        read_only_view(slf, |k| ArrayView1::from(k.learned.dictionary.atoms())).reshape(shape)
    }

    #[getter]
    fn codes(&self, py: Python<'_>) -> Py<PySparseCodes> {
        self.codes.clone_ref(py)
    }

    #[getter]
    fn objective<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray1<f64>> {
        read_only_view(slf, |k| ArrayView1::from(&k.learned.objective[..]))
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.learned.iterations
    }

    #[getter]
    fn replaced(&self) -> usize {
        self.learned.replaced
    }

    #[getter]
    fn cropped(&self) -> usize {
        self.learned.cropped
    }

    #[getter]
    fn stop_reason(&self) -> &'static str {
        match self.learned.stop_reason {
            StopReason::Iterations => "iterations",
            StopReason::Converged => "converged",
        }
    }

    fn __repr__(&self) -> String {
        let learned = &self.learned;
        format!(
            "Ksvd({} atoms of {} features, {} codes, objective {:.6e} after {} iterations, \
             {} replaced, {} cropped)",
            learned.dictionary.n_atoms(),
            learned.dictionary.n_features(),
            learned.codes.len(),
            learned.objective.last().copied().unwrap_or_default(),
            learned.iterations,
            learned.replaced,
            learned.cropped
        )
    }
}

/// Numbers of a table of signals, owned while the interpreter lock is released.
struct Table {
    n_features: usize,
    values: Vec<f32>,
    weights: Option<Vec<f32>>,
}

impl Table {
    fn new(signals: &Bound<'_, PyAny>, weights: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let (values, shape) = arrays::matrix_f32("signals", signals)?;
        let weights = match weights {
            None => None,
            Some(weights) => {
                let (weights, weights_shape) = arrays::matrix_f32("weights", weights)?;
                if weights_shape != shape {
                    return Err(invalid_input(format!(
                        "weights have shape {weights_shape:?} and signals {shape:?}; give one \
                         weight per value"
                    )));
                }
                Some(weights)
            }
        };
        Ok(Self { n_features: shape[1], values, weights })
    }

    fn signals(&self) -> Result<Signals<'_>, Error> {
        Signals::new(self.n_features, &self.values, self.weights.as_deref())
    }
}

fn dictionary_of(dictionary: &Bound<'_, PyAny>) -> PyResult<Dictionary> {
    let (atoms, [_, n_features]) = arrays::matrix_f32("dictionary", dictionary)?;
    Dictionary::new(n_features, atoms).map_err(IntoPyErr::into_py_err)
}

fn selection_of(name: &str) -> PyResult<Selection> {
    match name {
        "least_squares" => Ok(Selection::LeastSquares),
        "correlation" => Ok(Selection::Correlation),
        other => Err(invalid_input(format!(
            "selection is \"{other}\", but must be \"least_squares\" or \"correlation\""
        ))),
    }
}

#[pyfunction]
#[pyo3(signature = (dictionary, signals, weights, max_atoms, tolerance, selection))]
fn omp(
    py: Python<'_>,
    dictionary: &Bound<'_, PyAny>,
    signals: &Bound<'_, PyAny>,
    weights: Option<&Bound<'_, PyAny>>,
    max_atoms: usize,
    tolerance: f32,
    selection: &str,
) -> PyResult<PySparseCodes> {
    let dictionary = dictionary_of(dictionary)?;
    let table = Table::new(signals, weights)?;
    let options = OmpOptions { max_atoms, tolerance, selection: selection_of(selection)? };
    let codes = run::run(py, None, |progress| {
        surfabet_sparse::omp(&dictionary, &table.signals()?, &options, progress)
    })?;
    Ok(codes.into())
}

#[pyfunction]
#[pyo3(signature = (signals, weights, n_atoms, max_atoms, tolerance, selection, iterations, convergence,
                    random_state, max_coherence, update_iterations, update_tolerance, progress))]
#[allow(clippy::too_many_arguments)]
fn ksvd(
    py: Python<'_>,
    signals: &Bound<'_, PyAny>,
    weights: Option<&Bound<'_, PyAny>>,
    n_atoms: usize,
    max_atoms: usize,
    tolerance: f32,
    selection: &str,
    iterations: usize,
    convergence: f64,
    random_state: u64,
    max_coherence: f32,
    update_iterations: usize,
    update_tolerance: f64,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyKsvd> {
    let table = Table::new(signals, weights)?;
    let options = KsvdOptions {
        n_atoms,
        max_atoms,
        tolerance,
        selection: selection_of(selection)?,
        iterations,
        convergence,
        random_state,
        max_coherence,
        update_iterations,
        update_tolerance,
    };
    let learned = run::run(py, progress, |progress| {
        let mut on_iteration = |done: &surfabet_sparse::KsvdIteration| {
            progress.update("dictionary", done.iteration as f32 / iterations as f32);
        };
        surfabet_sparse::ksvd(&table.signals()?, &options, progress, &mut on_iteration)
    })?;
    let codes = Py::new(py, PySparseCodes::from(learned.codes.clone()))?;
    Ok(PyKsvd { learned, codes })
}

#[pyfunction]
fn reconstruct<'py>(
    py: Python<'py>,
    dictionary: &Bound<'py, PyAny>,
    codes: &Bound<'py, PySparseCodes>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let dictionary = dictionary_of(dictionary)?;
    let codes = &codes.get().codes;
    let rows = released(py, || surfabet_sparse::reconstruct(&dictionary, codes))?
        .map_err(IntoPyErr::into_py_err)?;
    rows.into_pyarray(py).reshape([codes.len(), dictionary.n_features()])
}

#[pyfunction]
fn squared_errors<'py>(
    py: Python<'py>,
    dictionary: &Bound<'py, PyAny>,
    signals: &Bound<'py, PyAny>,
    weights: Option<&Bound<'py, PyAny>>,
    codes: &Bound<'py, PySparseCodes>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let dictionary = dictionary_of(dictionary)?;
    let table = Table::new(signals, weights)?;
    let codes = &codes.get().codes;
    let errors =
        released(py, || surfabet_sparse::squared_errors(&dictionary, &table.signals()?, codes))?
            .map_err(IntoPyErr::into_py_err)?;
    Ok(errors.into_pyarray(py))
}

/// Adds this file's classes and functions to the module, under names of their own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PySparseCodes>()?;
    module.add_class::<PyKsvd>()?;
    module.add("sparse_omp", wrap_pyfunction!(omp, module)?)?;
    module.add("sparse_ksvd", wrap_pyfunction!(ksvd, module)?)?;
    module.add("sparse_reconstruct", wrap_pyfunction!(reconstruct, module)?)?;
    module.add("sparse_squared_errors", wrap_pyfunction!(squared_errors, module)?)?;
    Ok(())
}
