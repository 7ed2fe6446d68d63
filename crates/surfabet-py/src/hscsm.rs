//! `surfabet.HscsmModel` and how it is learned.

use std::sync::Arc;

use numpy::ndarray::{Array2, Array3, ArrayView2};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::{HscsmDictionary, HscsmModel, Vocabulary, hscsm};

use crate::cloud::cloud_of;
use crate::errors::invalid_input;
use crate::model::{PyModel, model_class, wrap};
use crate::options::{options_of, options_onto};
use crate::run::run;

/// A cloud as sparse-coded surface patches; immutable.
#[pyclass(name = "HscsmModel", module = "surfabet._core", frozen, extends = PyModel)]
pub struct PyHscsmModel {
    pub model: Arc<HscsmModel>,
}

model_class!(HscsmModel, PyHscsmModel);

/// The dictionaries of a model; immutable.
#[pyclass(name = "HscsmDictionary", module = "surfabet", frozen)]
pub struct PyHscsmDictionary {
    pub dictionary: HscsmDictionary,
}

#[pymethods]
impl PyHscsmDictionary {
    /// Describes a cloud in these dictionaries; documented in `surfabet.hscsm`.
    #[pyo3(signature = (cloud, options, *, progress))]
    fn describe(
        slf: &Bound<'_, Self>,
        cloud: &Bound<'_, PyAny>,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Py<PyHscsmModel>> {
        let dictionary = &slf.get().dictionary;
        let options = options_onto(dictionary.options(), options)?;
        let cloud = &cloud_of("cloud", cloud)?.get().cloud;
        let describe = |monitor: &dyn surfabet::Progress| {
            hscsm::describe(cloud, &options, dictionary, monitor)
        };
        wrap(slf.py(), run(slf.py(), progress, describe)?)
    }

    /// `(pixel_size, pixels)` of each level, coarsest first.
    #[getter]
    fn levels(&self) -> Vec<(f64, u32)> {
        self.dictionary.levels.iter().map(|l| (l.pixel_size, l.pixels)).collect()
    }

    #[getter]
    fn hash(&self) -> String {
        self.dictionary.content_hash().to_string()
    }

    /// Entries of one channel of each level, unit norm, (k, n * n) or (k, 3 * n * n); `None` without colour.
    fn entries<'py>(
        &self,
        py: Python<'py>,
        channel: &str,
    ) -> PyResult<Option<Vec<Bound<'py, PyArray2<f32>>>>> {
        let levels = self.dictionary.levels.iter();
        let of: Option<Vec<&hscsm::QuantizedDictionary>> = match channel {
            "depth" => levels.map(|l| Some(&l.depth)).collect(),
            "color" => levels.map(|l| l.color.as_ref()).collect(),
            other => return Err(unknown_channel(other)),
        };
        of.map(|all| all.into_iter().map(|d| atoms(py, d)).collect()).transpose()
    }
}

fn atoms<'py>(
    py: Python<'py>,
    dictionary: &hscsm::QuantizedDictionary,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let shape = (dictionary.n_atoms(), dictionary.n_features());
    let atoms = Array2::from_shape_vec(shape, dictionary.atoms()).map_err(invalid_input)?;
    Ok(atoms.into_pyarray(py))
}

fn unknown_channel(other: &str) -> PyErr {
    invalid_input(format!("channel is {other:?}, but must be \"depth\" or \"color\""))
}

/// Learns sparse-coded surface patches; documented in `surfabet.hscsm`.
#[pyfunction]
#[pyo3(signature = (cloud, options, *, progress))]
fn learn_hscsm(
    py: Python<'_>,
    cloud: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyHscsmModel>> {
    let options = options_of(options)?;
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    wrap(py, run(py, progress, |monitor| hscsm::learn(cloud, &options, monitor))?)
}

#[pymethods]
impl PyHscsmModel {
    /// `(pixel_size, pixels, patches, depth entries, colour entries, set pixels, area)` of each level,
    /// coarsest first.
    #[getter]
    fn levels(&self) -> Vec<(f64, u32, usize, usize, usize, usize, f64)> {
        let atoms = |c: &hscsm::Channel| c.dictionary.n_atoms();
        let color = |l: &hscsm::Level| l.color.as_ref().map_or(0, atoms);
        let levels = self.model.levels().iter();
        levels
            .map(|l| {
                let (depth, color) = (atoms(&l.depth), color(l));
                let (pixels, area) = (l.set_pixels(), l.covered_area());
                (l.pixel_size, l.pixels, l.len(), depth, color, pixels, area)
            })
            .collect()
    }

    /// Intensities of grey levels 0 and 255; `None` without intensities.
    #[getter]
    fn intensity_limits(&self) -> Option<(f64, f64)> {
        self.model.intensity().map(|limits| (limits.low, limits.high))
    }

    /// Means of one channel of the patches of one level: (m, 1) metres, or (m, 3) luma, orange, green chroma,
    /// or (m, 1) grey.
    fn means<'py>(
        &self,
        py: Python<'py>,
        level: usize,
        channel: &str,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let of = self.level(level)?;
        let (data, _) = self.channel(level, channel)?;
        let step = if channel == "depth" { of.steps.depth_mean } else { of.steps.color_mean };
        let means: Vec<f64> = data.means.iter().map(|&m| f64::from(m) * step).collect();
        let planes = if channel == "depth" { 1 } else { of.color_planes() };
        means.into_pyarray(py).reshape([of.len(), planes])
    }

    #[getter]
    fn centers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let origin = self.model.origin();
        let centers: Vec<[f64; 3]> = self
            .model
            .levels()
            .iter()
            .flat_map(|l| {
                l.poses.iter().map(move |p| {
                    std::array::from_fn(|a| origin[a] + f64::from(p.position[a]) * l.steps.position)
                })
            })
            .collect();
        ArrayView2::from(&centers[..]).to_owned().into_pyarray(py)
    }

    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let axes: Vec<f32> = self
            .model
            .levels()
            .iter()
            .flat_map(|l| {
                l.poses.iter().map(|p| {
                    let frame = p.frame(l.steps.position as f32);
                    [frame.x, frame.y, frame.z].into_iter().flatten()
                })
            })
            .flatten()
            .collect();
        axes.into_pyarray(py).reshape([self.model.len(), 3, 3])
    }

    /// Bitmasks of the patches of one level, (m, n, n), with n mask pixels per side of a patch.
    fn masks<'py>(&self, py: Python<'py>, level: usize) -> PyResult<Bound<'py, PyArray3<bool>>> {
        let level = self.level(level)?;
        let n = (level.pixels * level.mask_scale) as usize;
        let masks = Array3::from_shape_fn((level.len(), n, n), |(i, row, column)| {
            level.mask(i)[row * n + column] != 0
        });
        Ok(masks.into_pyarray(py))
    }

    /// Dictionary entries of one channel of one level, unit norm, (k, n * n) or (k, 3 * n * n).
    fn dictionary<'py>(
        &self,
        py: Python<'py>,
        level: usize,
        channel: &str,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        atoms(py, &self.channel(level, channel)?.0.dictionary)
    }

    /// The dictionaries of all levels.
    fn dictionaries(&self) -> PyHscsmDictionary {
        PyHscsmDictionary { dictionary: self.model.dictionary() }
    }

    /// Sparse codes of one channel of one level as CSR columns `(offsets, entries, coefficients)`.
    fn codes<'py>(
        &self,
        py: Python<'py>,
        level: usize,
        channel: &str,
    ) -> PyResult<(Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u16>>, Bound<'py, PyArray1<f64>>)>
    {
        let (channel, step) = self.channel(level, channel)?;
        let codes = &channel.codes;
        let coefficients: Vec<f64> =
            codes.coefficients.iter().map(|&c| f64::from(c) * step).collect();
        Ok((
            codes.offsets.clone().into_pyarray(py),
            codes.atoms.clone().into_pyarray(py),
            coefficients.into_pyarray(py),
        ))
    }
}

impl PyHscsmModel {
    fn level(&self, level: usize) -> PyResult<&hscsm::Level> {
        let levels = self.model.levels();
        levels.get(level).ok_or_else(|| {
            invalid_input(format!("level is {level}, but the model has {}", levels.len()))
        })
    }

    fn channel(&self, level: usize, channel: &str) -> PyResult<(&hscsm::Channel, f64)> {
        let level = self.level(level)?;
        match channel {
            "depth" => Ok((&level.depth, level.steps.depth_code)),
            "color" => match &level.color {
                Some(color) => Ok((color, level.steps.color_code)),
                None => Err(invalid_input("this model has neither colour nor intensity")),
            },
            other => Err(unknown_channel(other)),
        }
    }
}

/// Adds this file's names to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyHscsmModel>()?;
    module.add_class::<PyHscsmDictionary>()?;
    module.add_function(wrap_pyfunction!(learn_hscsm, module)?)
}
