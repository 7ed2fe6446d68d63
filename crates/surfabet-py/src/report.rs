//! How a model was learned, for Python.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::{Figures, Report};

use crate::survey::PySurvey;

/// A report as nested dicts and lists.
pub fn report_dict<'py>(
    py: Python<'py>,
    report: &Report<dyn Figures>,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let stages = PyDict::new(py);
    for stage in &report.stages {
        stages.set_item(stage.name, stage.seconds)?;
    }
    dict.set_item("stages", stages)?;
    let figures = PyDict::new(py);
    for (name, value) in report.figures.named() {
        figures.set_item(name, value)?;
    }
    dict.set_item("figures", figures)?;
    let levels: Vec<Bound<'py, PyDict>> = report
        .levels
        .iter()
        .map(|figures| {
            let level = PyDict::new(py);
            for (name, value) in figures {
                level.set_item(name, value)?;
            }
            Ok(level)
        })
        .collect::<PyResult<_>>()?;
    dict.set_item("levels", levels)?;
    let objectives = PyDict::new(py);
    for (name, trace) in &report.objectives {
        objectives.set_item(name, trace)?;
    }
    dict.set_item("objectives", objectives)?;
    dict.set_item("iterations", report.iterations)?;
    dict.set_item("stop_reason", report.stop_reason)?;
    let attributes: Vec<_> =
        report.attributes.iter().map(|a| (a.name.as_str(), a.bytes, a.rmse, a.equal)).collect();
    dict.set_item("attributes", attributes)?;
    dict.set_item("not_kept", &report.not_kept)?;
    let chosen = PyDict::new(py);
    for choice in &report.chosen {
        chosen.set_item(choice.option, (choice.value, &choice.reason))?;
    }
    dict.set_item("chosen", chosen)?;
    dict.set_item("left_out", report.left_out)?;
    dict.set_item("survey", PySurvey(report.survey.clone()).into_pyobject(py)?)?;
    dict.set_item("tolerance", report.tolerance)?;
    Ok(dict)
}
