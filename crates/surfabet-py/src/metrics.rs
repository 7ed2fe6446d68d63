//! The measures behind `surfabet.evaluate`.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet_geom::{EvaluateOptions, Tolerance, evaluate as measure};

use crate::cloud::cloud_of;
use crate::run::run;

/// Measures by name; `None` where they do not apply. `attributes` are (name, labels, forward, backward, pooled). `sigma_by_range` is (factor, angular resolution in degrees).
#[pyfunction]
#[pyo3(signature = (reference, decoded, sigma, sigma_by_range, peak, normal_neighbors, progress))]
#[allow(clippy::too_many_arguments)]
fn evaluate<'py>(
    py: Python<'py>,
    reference: &Bound<'py, PyAny>,
    decoded: &Bound<'py, PyAny>,
    sigma: Option<f64>,
    sigma_by_range: Option<(f64, f64)>,
    peak: Option<f64>,
    normal_neighbors: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let tolerance = sigma.map(Tolerance::Distance).or_else(|| {
        sigma_by_range.map(|(scale, degrees)| Tolerance::Range {
            scale,
            angular_resolution: degrees.to_radians(),
        })
    });
    let options = EvaluateOptions { tolerance, peak, normal_neighbors };
    let (reference, decoded) = (
        &cloud_of("reference", reference)?.get().cloud,
        &cloud_of("decoded", decoded)?.get().cloud,
    );
    let q = run(py, progress, |p| measure(reference, decoded, &options, p))?;
    let found = PyDict::new(py);
    found.set_item("reference_points", q.reference_points)?;
    found.set_item("decoded_points", q.decoded_points)?;
    found.set_item("rmse", q.rmse)?;
    found.set_item("rmse_forward", q.forward.rmse)?;
    found.set_item("rmse_backward", q.backward.rmse)?;
    found.set_item("rmse_pooled", q.rmse_pooled)?;
    for (direction, errors) in [("forward", q.forward), ("backward", q.backward)] {
        found.set_item(format!("mean_{direction}"), errors.mean)?;
        found.set_item(format!("p95_{direction}"), errors.p95)?;
        found.set_item(format!("p99_{direction}"), errors.p99)?;
        found.set_item(format!("max_{direction}"), errors.max)?;
        found.set_item(format!("plane_rmse_{direction}"), errors.plane_rmse)?;
        found.set_item(format!("color_rmse_{direction}"), errors.color_rmse)?;
    }
    found.set_item("plane_rmse_pooled", q.plane_rmse_pooled)?;
    found.set_item("color_rmse_pooled", q.color_rmse_pooled)?;
    found.set_item("psnr_peak", q.psnr_peak)?;
    found.set_item("d1_psnr", q.d1_psnr)?;
    found.set_item("d2_psnr", q.d2_psnr)?;
    found.set_item("inliers", q.inliers)?;
    found.set_item("outliers", q.outliers)?;
    let attributes: Vec<_> = q
        .attributes
        .into_iter()
        .map(|a| (a.name, a.labels, a.forward, a.backward, a.pooled))
        .collect();
    found.set_item("attributes", attributes)?;
    Ok(found)
}

/// Adds this file's function to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(evaluate, module)?)
}
