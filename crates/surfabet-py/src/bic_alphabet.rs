//! `BicAlphabetModel`, its alphabet, and how both are learned.

use std::sync::Arc;

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::{
    BicAlphabet, BicAlphabetModel, BicAlphabetOptions, Deviation, Layout, Upright, bic_alphabet,
};

use crate::cloud::PyPointCloud;
use crate::errors::invalid_input;
use crate::model::{PyModel, model_class, wrap};
use crate::run::run;

/// The names of the upright rules.
const UPRIGHT: [(&str, Upright); 3] =
    [("x", Upright::WorldX), ("z", Upright::WorldZ), ("view", Upright::ViewDirection)];

fn upright_of(name: &str) -> PyResult<Upright> {
    UPRIGHT.iter().find(|(n, _)| *n == name).map(|(_, rule)| *rule).ok_or_else(|| {
        invalid_input(format!("upright is {name:?}, but must be \"x\", \"z\" or \"view\""))
    })
}

fn upright_name(rule: Upright) -> &'static str {
    // Every rule is in the list.
    UPRIGHT.iter().find(|(_, r)| *r == rule).map_or("x", |(name, _)| name)
}

/// Words in their own frames; immutable.
#[pyclass(name = "BicAlphabet", module = "surfabet", frozen)]
pub struct PyBicAlphabet {
    pub alphabet: BicAlphabet,
}

#[pymethods]
impl PyBicAlphabet {
    #[getter]
    fn radius(&self) -> f64 {
        self.alphabet.radius()
    }

    #[getter]
    fn descriptor_pixels(&self) -> u32 {
        self.alphabet.shape().descriptor_pixels
    }

    #[getter]
    fn upright(&self) -> &'static str {
        upright_name(self.alphabet.upright())
    }

    #[getter]
    fn hash(&self) -> String {
        BicAlphabetModel::vocabulary_hash(&self.alphabet).to_string()
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

/// Learns an alphabet by BIC, or describes a cloud with a given one.
#[pyfunction]
#[pyo3(signature = (cloud, *, radius, scale, angular_resolution, noise, min_range, epsilon, feature_spacing,
                    interest_scales, interest_threshold, normal_neighbors, upright, descriptor_pixels,
                    empty_penalty, floor, min_points, iterations, max_rejections, reduce, random_state,
                    alphabet, progress))]
#[allow(clippy::too_many_arguments)]
fn learn_bic(
    py: Python<'_>,
    cloud: &Bound<'_, PyPointCloud>,
    radius: f64,
    scale: f64,
    angular_resolution: Option<f64>,
    noise: Option<f64>,
    min_range: f64,
    epsilon: Option<f64>,
    feature_spacing: Option<f64>,
    interest_scales: Vec<f64>,
    interest_threshold: f64,
    normal_neighbors: u32,
    upright: &str,
    descriptor_pixels: u32,
    empty_penalty: f64,
    floor: f64,
    min_points: u32,
    iterations: u32,
    max_rejections: u32,
    reduce: bool,
    random_state: u64,
    alphabet: Option<&Bound<'_, PyBicAlphabet>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyBicAlphabetModel>> {
    let options = BicAlphabetOptions {
        radius,
        deviation: Deviation { scale, angular_resolution, noise },
        min_range,
        epsilon,
        feature_spacing,
        interest_scales,
        interest_threshold,
        normal_neighbors,
        upright: upright_of(upright)?,
        descriptor_pixels,
        empty_penalty,
        floor,
        min_points,
        iterations,
        max_rejections,
        reduce,
        random_state,
    };
    let cloud = &cloud.get().cloud;
    let alphabet = alphabet.map(|a| &a.get().alphabet);
    let model = run(py, progress, |monitor| match alphabet {
        Some(alphabet) => alphabet.describe(cloud, &options, monitor),
        None => bic_alphabet::learn(cloud, &options, monitor),
    })?;
    wrap(py, model)
}

/// The defaults of [`learn_bic`], by name.
#[pyfunction]
fn bic_defaults(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let BicAlphabetOptions {
        radius,
        deviation: Deviation { scale, angular_resolution, noise },
        min_range,
        epsilon,
        feature_spacing,
        interest_scales,
        interest_threshold,
        normal_neighbors,
        upright,
        descriptor_pixels,
        empty_penalty,
        floor,
        min_points,
        iterations,
        max_rejections,
        reduce,
        random_state,
    } = BicAlphabetOptions::default();
    let dict = PyDict::new(py);
    dict.set_item("radius", radius)?;
    dict.set_item("scale", scale)?;
    dict.set_item("angular_resolution", angular_resolution)?;
    dict.set_item("noise", noise)?;
    dict.set_item("min_range", min_range)?;
    dict.set_item("epsilon", epsilon)?;
    dict.set_item("feature_spacing", feature_spacing)?;
    dict.set_item("interest_scales", interest_scales)?;
    dict.set_item("interest_threshold", interest_threshold)?;
    dict.set_item("normal_neighbors", normal_neighbors)?;
    dict.set_item("upright", upright_name(upright))?;
    dict.set_item("descriptor_pixels", descriptor_pixels)?;
    dict.set_item("empty_penalty", empty_penalty)?;
    dict.set_item("floor", floor)?;
    dict.set_item("min_points", min_points)?;
    dict.set_item("iterations", iterations)?;
    dict.set_item("max_rejections", max_rejections)?;
    dict.set_item("reduce", reduce)?;
    dict.set_item("random_state", random_state)?;
    Ok(dict)
}

#[pymethods]
impl PyBicAlphabetModel {
    /// This model with its alphabet left out of files (true) or in them (false).
    fn sharing_alphabet(&self, py: Python<'_>, shares: bool) -> PyResult<Py<Self>> {
        wrap(py, BicAlphabetModel::clone(&self.model).sharing_alphabet(shares))
    }

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
    module.add_function(wrap_pyfunction!(learn_bic, module)?)?;
    module.add_function(wrap_pyfunction!(bic_defaults, module)?)
}
