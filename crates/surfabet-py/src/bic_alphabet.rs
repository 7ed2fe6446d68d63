//! `BicAlphabetModel`, its alphabet, and how both are learned.

use std::sync::Arc;

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::{BicAlphabet, BicAlphabetModel, Vocabulary, bic_alphabet};

use crate::cloud::cloud_of;
use crate::errors::invalid_input;
use crate::model::{PyModel, model_class, wrap};
use crate::options::{options_of, options_onto};
use crate::run::run;

/// Words in their own frames; immutable.
#[pyclass(name = "BicAlphabet", module = "surfabet", frozen)]
pub struct PyBicAlphabet {
    pub alphabet: BicAlphabet,
}

#[pymethods]
impl PyBicAlphabet {
    /// Describes a cloud in these words; documented in `surfabet.bic_alphabet`.
    #[pyo3(signature = (cloud, options, *, progress))]
    fn describe(
        slf: &Bound<'_, Self>,
        cloud: &Bound<'_, PyAny>,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Py<PyBicAlphabetModel>> {
        let words = &slf.get().alphabet;
        let options = options_onto(words.options(), options)?;
        let cloud = &cloud_of("cloud", cloud)?.get().cloud;
        let model = run(slf.py(), progress, |monitor| words.describe(cloud, &options, monitor))?;
        wrap(slf.py(), model)
    }

    /// The words that were accepted first.
    fn first(&self, n: usize) -> Self {
        Self { alphabet: self.alphabet.first(n) }
    }

    #[getter]
    fn radius(&self) -> f64 {
        self.alphabet.radius()
    }

    #[getter]
    fn hash(&self) -> String {
        self.alphabet.content_hash().to_string()
    }

    /// Points of each word (right, up, along the normal), (n, 3), metres.
    fn points<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray2<f32>>> {
        (0..self.alphabet.len())
            .map(|w| {
                let points = self.alphabet.points(w);
                Array2::from_shape_fn((points.len(), 3), |(i, a)| points[i][a]).into_pyarray(py)
            })
            .collect()
    }

    /// Descriptors as height images, (k, n, n), metres; NaN where unknown.
    fn descriptors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let shape = self.alphabet.shape();
        let side = shape.descriptor_pixels as usize;
        let heights = self.alphabet.words().iter().flat_map(|w| shape.heights(w)).collect();
        let images = Array3::from_shape_vec((self.alphabet.len(), side, side), heights);
        Ok(images.map_err(invalid_input)?.into_pyarray(py))
    }

    fn __len__(&self) -> usize {
        self.alphabet.len()
    }
}

/// A cloud as occurrences of words that were chosen by BIC; immutable.
#[pyclass(name = "BicAlphabetModel", module = "surfabet._core", frozen, extends = PyModel)]
pub struct PyBicAlphabetModel {
    pub model: Arc<BicAlphabetModel>,
}

model_class!(BicAlphabetModel, PyBicAlphabetModel);

/// Learns an alphabet by BIC; documented in `surfabet.bic_alphabet`.
#[pyfunction]
#[pyo3(signature = (cloud, options, *, progress))]
fn learn_bic_alphabet(
    py: Python<'_>,
    cloud: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyBicAlphabetModel>> {
    let options = options_of(options)?;
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    wrap(py, run(py, progress, |monitor| bic_alphabet::learn(cloud, &options, monitor))?)
}

#[pymethods]
impl PyBicAlphabetModel {
    #[getter]
    fn epsilon(&self) -> f64 {
        self.model.epsilon()
    }

    #[getter]
    fn alphabet(&self) -> PyBicAlphabet {
        PyBicAlphabet { alphabet: self.model.alphabet().clone() }
    }

    /// Word of each occurrence, (m,).
    #[getter]
    fn word_ids<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.model.words().to_vec().into_pyarray(py)
    }

    /// Occurrences of each word, (k,).
    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.model.counts().into_pyarray(py)
    }

    /// Word frame to world of each occurrence, (m, 4, 4).
    fn poses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let poses: Vec<_> = (0..self.model.len()).filter_map(|i| self.model.pose(i)).collect();
        Array3::from_shape_fn((poses.len(), 4, 4), |(i, r, c)| {
            let (rotation, translation) = &poses[i];
            match (r, c) {
                (3, _) => f64::from(u8::from(c == 3)),
                (_, 3) => translation[r],
                _ => rotation[r][c],
            }
        })
        .into_pyarray(py)
    }
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyBicAlphabetModel>()?;
    module.add_class::<PyBicAlphabet>()?;
    module.add_function(wrap_pyfunction!(learn_bic_alphabet, module)?)
}
