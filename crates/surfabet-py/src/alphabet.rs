//! `surfabet.AlphabetModel`, its alphabet, and how both are learned.

use std::sync::Arc;

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::alphabet;
use surfabet::{Alphabet, AlphabetModel, Occurrence, Vocabulary};

use crate::cloud::cloud_of;
use crate::model::{PyModel, model_class, wrap};
use crate::options::options_of;
use crate::run::run;

/// Words for any number of scenes; immutable.
#[pyclass(name = "Alphabet", module = "surfabet", frozen)]
pub struct PyAlphabet {
    pub alphabet: Alphabet,
}

/// A cloud as occurrences of words; immutable.
#[pyclass(name = "AlphabetModel", module = "surfabet._core", frozen, extends = PyModel)]
pub struct PyAlphabetModel {
    pub model: Arc<AlphabetModel>,
}

model_class!(AlphabetModel, PyAlphabetModel);

/// Learns an alphabet; documented in `surfabet.alphabet`.
#[pyfunction]
#[pyo3(signature = (cloud, options, *, progress))]
fn learn_alphabet(
    py: Python<'_>,
    cloud: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAlphabetModel>> {
    let options = options_of(options)?;
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    wrap(py, run(py, progress, |monitor| alphabet::learn(cloud, &options, monitor))?)
}

#[pymethods]
impl PyAlphabet {
    /// Describes a cloud by these words; documented in `surfabet.alphabet`.
    #[pyo3(signature = (cloud, options, *, progress))]
    fn describe(
        slf: &Bound<'_, Self>,
        cloud: &Bound<'_, PyAny>,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Py<PyAlphabetModel>> {
        let options = options_of(options)?;
        let (words, cloud) = (&slf.get().alphabet, &cloud_of("cloud", cloud)?.get().cloud);
        let describe =
            |monitor: &dyn surfabet::Progress| alphabet::describe(cloud, words, &options, monitor);
        wrap(slf.py(), run(slf.py(), progress, describe)?)
    }

    #[getter]
    fn radius(&self) -> f64 {
        self.alphabet.radius()
    }

    #[getter]
    fn scales(&self) -> u32 {
        self.alphabet.scales()
    }

    #[getter]
    fn hash(&self) -> String {
        self.alphabet.content_hash().to_string()
    }

    /// Heights of the pixels of every word over its radius, NaN where it has a hole, (n, 8, 8).
    fn heights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f32>> {
        let words = self.alphabet.words();
        let shape = (words.len(), alphabet::PIXELS, alphabet::PIXELS);
        Array3::from_shape_fn(shape, |(k, row, column)| {
            let pixel = alphabet::PIXELS * row + column;
            let is_set = words[k].mask >> pixel & 1 != 0;
            let height = f32::from(words[k].heights[pixel]) / alphabet::HEIGHT_STEPS as f32;
            if is_set { height } else { f32::NAN }
        })
        .into_pyarray(py)
    }

    fn __len__(&self) -> usize {
        self.alphabet.words().len()
    }
}

#[pymethods]
impl PyAlphabetModel {
    #[getter]
    fn has_intensity(&self) -> bool {
        self.model.has_intensity()
    }

    #[getter]
    fn alphabet(&self) -> PyAlphabet {
        PyAlphabet { alphabet: self.model.alphabet().clone() }
    }

    /// Factor, angular resolution (degrees) and noise (metres) of sigma.
    #[getter]
    fn deviation(&self) -> (f64, Option<f64>, f64) {
        let of = self.model.header().deviation;
        (of.sigma_scale, of.angular_resolution.map(f64::to_degrees), of.noise.unwrap_or(0.0))
    }

    /// Sigma at no range, metres.
    #[getter]
    fn constant_sigma(&self) -> f64 {
        self.model.constant_sigma()
    }

    /// Lowest and highest corner of a box around all occurrences.
    fn extent(&self) -> [[f64; 3]; 2] {
        self.model.extent()
    }

    /// Word of every occurrence, (m,).
    fn words<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.each(py, |o| i64::from(o.word))
    }

    /// Radius of every occurrence, (m,), metres.
    fn radii<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.each(py, |o| o.radius)
    }

    /// Deviation allowed at every occurrence, (m,), metres.
    fn sigma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.each(py, |o| o.sigma)
    }

    /// Word to world, (m, 4, 4): what is right, what is up, the normal, the middle.
    fn poses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let all: Vec<Occurrence> = self.model.occurrences().collect();
        Array3::from_shape_fn((all.len(), 4, 4), |(i, row, column)| match (row, column) {
            (3, 3) => 1.0,
            (3, _) => 0.0,
            (_, 3) => all[i].center[row],
            _ => all[i].rows[column][row],
        })
        .into_pyarray(py)
    }

    /// Colour of every occurrence, (m, 3).
    fn colors<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<u8>>> {
        let colors = self.model.colors()?;
        let array = Array2::from_shape_fn((colors.len(), 3), |(i, c)| colors[i][c]);
        Some(array.into_pyarray(py))
    }

    /// Intensity of every occurrence, (m,).
    fn intensities<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f32>>> {
        Some(self.model.intensities()?.into_pyarray(py))
    }
}

impl PyAlphabetModel {
    fn each<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        of: impl Fn(Occurrence) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        self.model.occurrences().map(of).collect::<Vec<T>>().into_pyarray(py)
    }
}

/// Adds this file's names to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyAlphabet>()?;
    module.add_class::<PyAlphabetModel>()?;
    module.add_function(wrap_pyfunction!(learn_alphabet, module)?)
}
