//! `surfabet.survey`.

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use surfabet_geom::Survey;

use crate::cloud::cloud_of;
use crate::run::run;

/// Corners of the box, (low, high).
type Bounds = Option<([f64; 3], [f64; 3])>;

/// The figures of a cloud.
#[pyclass(name = "Survey", module = "surfabet._core", frozen)]
pub struct PySurvey(pub Survey);

#[pymethods]
impl PySurvey {
    #[getter]
    fn spacing(&self) -> f64 {
        self.0.spacing
    }

    #[getter]
    fn rounding(&self) -> f64 {
        self.0.rounding
    }

    #[getter]
    fn noise(&self) -> f64 {
        self.0.noise
    }

    #[getter]
    fn layer_gap(&self) -> Option<f64> {
        self.0.layer_gap
    }

    #[getter]
    fn has_facings(&self) -> bool {
        self.0.has_facings
    }

    #[getter]
    fn line_spacing(&self) -> Option<f64> {
        self.0.line_spacing
    }

    #[getter]
    fn tolerance(&self) -> f64 {
        self.0.tolerance()
    }

    #[getter]
    fn bounds(&self) -> Bounds {
        self.0.bounds
    }

    #[getter]
    fn outliers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.0.outliers.clone().into_pyarray(py)
    }

    fn __repr__(&self) -> String {
        let survey = &self.0;
        let or_none =
            |length: Option<f64>| length.map_or("None".to_owned(), |l| format!("{l:.3e}"));
        format!(
            "Survey(spacing={:.3e}, noise={:.3e}, layer_gap={}, line_spacing={}, outliers={})",
            survey.spacing,
            survey.noise,
            or_none(survey.layer_gap),
            or_none(survey.line_spacing),
            survey.outliers.len()
        )
    }

    #[getter]
    fn strays<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.0.strays.clone().into_pyarray(py)
    }
}

/// Measures a cloud; documented in `surfabet.geometry`.
#[pyfunction]
#[pyo3(signature = (cloud, *, progress))]
fn survey(
    py: Python<'_>,
    cloud: &Bound<'_, PyAny>,
    progress: Option<Py<PyAny>>,
) -> PyResult<PySurvey> {
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    Ok(PySurvey(run(py, progress, |monitor| Survey::of(cloud, monitor))?))
}

/// Adds this file's names to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PySurvey>()?;
    module.add_function(wrap_pyfunction!(survey, module)?)
}
