//! `surfabet.Model`: what every model class has.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::pyclass::PyClass;
use pyo3::types::{PyBytes, PyDict};
use surfabet::{AnyModel, DecodeOptions, Fact, Layout, Region};

use crate::cloud::PyPointCloud;
use crate::errors::IntoPyErr;
use crate::locate::PyLocalizer;
use crate::report::report_dict;
use crate::run::{released, run};

/// A model of any method; immutable. The classes of the methods derive from it.
#[pyclass(name = "Model", module = "surfabet._core", frozen, subclass)]
pub struct PyModel {
    model: Arc<dyn AnyModel>,
}

/// A model that has a class of its own in Python.
pub trait ModelClass: Layout {
    /// The class.
    type Class: PyClass<BaseType = PyModel, Frozen = pyo3::pyclass::boolean_struct::True>;

    /// The object of the class.
    fn object(model: Arc<Self>) -> Self::Class;
}

/// Declares that `$model` has the class `$class`, whose only field is `model`.
macro_rules! model_class {
    ($model:ty, $class:ident) => {
        impl $crate::model::ModelClass for $model {
            type Class = $class;

            fn object(model: std::sync::Arc<Self>) -> $class {
                $class { model }
            }
        }
    };
}
pub(crate) use model_class;

/// The Python object of a model. Warns of points that learning left out.
pub fn wrap<M: ModelClass>(py: Python<'_>, model: M) -> PyResult<Py<M::Class>> {
    let left_out = model.report().left_out;
    if left_out > 0 {
        let points = if left_out == 1 { "point is" } else { "points are" };
        let message = format!(
            "{left_out} {points} far from all others and no part of the model; keep_outliers=True keeps them"
        );
        let category = py.import("surfabet.errors")?.getattr("DroppedPointsWarning")?;
        py.import("warnings")?.call_method1("warn", (message, category, 3))?;
    }
    let model = Arc::new(model);
    let base = PyClassInitializer::from(PyModel { model: model.clone() });
    Py::new(py, base.add_subclass(M::object(model)))
}

/// The region with these corners.
pub fn region_of(corners: Option<([f64; 3], [f64; 3])>) -> PyResult<Option<Region>> {
    let region = corners.map(|(low, high)| Region::new(low, high)).transpose();
    region.map_err(IntoPyErr::into_py_err)
}

impl PyModel {
    /// The object of a model.
    pub fn of(model: Arc<dyn AnyModel>) -> Self {
        Self { model }
    }

    /// The bytes of the file, with a note if it is not empty.
    fn noted(&self, note: &str) -> surfabet::Result<Vec<u8>> {
        let bytes = self.model.to_bytes()?;
        if note.is_empty() { Ok(bytes) } else { Ok(surfabet::with_note(&bytes, note)?) }
    }
}

#[pymethods]
impl PyModel {
    #[pyo3(signature = (*, resolution, as_measured, normals, region, max_points, progress))]
    #[allow(clippy::too_many_arguments)]
    fn decode(
        slf: &Bound<'_, Self>,
        resolution: Option<f64>,
        as_measured: bool,
        normals: bool,
        region: Option<([f64; 3], [f64; 3])>,
        max_points: u64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyPointCloud> {
        let model = &slf.get().model;
        let options = DecodeOptions { resolution, as_measured, normals, max_points };
        let region = region_of(region)?;
        let cloud = run(slf.py(), progress, |monitor| match &region {
            Some(region) => model.decode_within(region, options, monitor),
            None => model.decode(options, monitor),
        })?;
        Ok(cloud.into())
    }

    /// The model made ready to be asked where scans were taken.
    fn localizer(slf: &Bound<'_, Self>, progress: Option<Py<PyAny>>) -> PyResult<PyLocalizer> {
        let model = &slf.get().model;
        let localizer = run(slf.py(), progress, |monitor| model.localizer(monitor))?;
        Ok(PyLocalizer { localizer })
    }

    /// The bytes of the file, with a note if it is not empty.
    #[pyo3(signature = (note=""))]
    fn to_bytes<'py>(&self, py: Python<'py>, note: &str) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = released(py, || self.noted(note))?;
        Ok(PyBytes::new(py, &bytes.map_err(IntoPyErr::into_py_err)?))
    }

    /// Writes the file, with a note if it is not empty, and returns its size in bytes.
    fn save(&self, py: Python<'_>, path: PathBuf, note: &str) -> PyResult<u64> {
        let written = released(py, || surfabet::write(&path, &self.noted(note)?))?;
        written.map_err(IntoPyErr::into_py_err)
    }

    #[getter]
    fn method(&self) -> &'static str {
        self.model.method()
    }

    #[getter]
    fn n_points(&self) -> u64 {
        self.model.n_points()
    }

    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.model.origin()
    }

    #[getter]
    fn has_color(&self) -> bool {
        self.model.has_color()
    }

    #[getter]
    fn keeps_thickness(&self) -> bool {
        self.model.keeps_thickness()
    }

    #[getter]
    fn shares_vocabulary(&self) -> bool {
        self.model.shares_vocabulary()
    }

    /// How the model was learned, as nested dicts and lists; empty for a model read from a file.
    #[getter]
    fn report_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        report_dict(py, self.model.report())
    }

    /// What the model holds, by name.
    #[getter]
    fn summary_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, fact) in self.model.summary().facts {
            match fact {
                Fact::Count(count) => dict.set_item(name, count)?,
                Fact::Number(number) => dict.set_item(name, number)?,
                Fact::Flag(flag) => dict.set_item(name, flag)?,
                Fact::Text(text) => dict.set_item(name, text)?,
            }
        }
        Ok(dict)
    }

    fn __len__(&self) -> usize {
        self.model.n_parts()
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.model.equals(other.get().model.as_ref()))
    }
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyModel>()
}
