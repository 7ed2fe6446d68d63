//! `surfabet.Localizer`: where in a model a scan was taken.

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray2, PyArray3};
use pyo3::prelude::*;
use surfabet::recognition::{Localizer, LocateOptions, Located, Location, Prior};

use crate::arguments;
use crate::cloud::cloud_of;
use crate::run::run;

/// A model made ready to be asked; documented in `surfabet.locate`.
#[pyclass(name = "Localizer", module = "surfabet._core", frozen)]
pub struct PyLocalizer {
    pub localizer: Localizer,
}

/// Poses (k, 4, 4), covariances (k, 6, 6), and score, probability, shares explained, contradicted and in front (k, 5).
type Columns<'py> =
    (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>);

/// See [`Columns`].
fn columns<'py>(py: Python<'py>, all: &[Location]) -> Columns<'py> {
    let n = all.len();
    let poses = Array3::from_shape_fn((n, 4, 4), |(i, r, c)| match (r, c) {
        (3, 3) => 1.0,
        (3, _) => 0.0,
        (_, 3) => all[i].pose.translation()[r],
        _ => all[i].pose.rotation()[r][c],
    });
    let covariances = Array3::from_shape_fn((n, 6, 6), |(i, r, c)| all[i].covariance[r][c]);
    let figures = Array2::from_shape_fn((n, 5), |(i, k)| {
        let l = &all[i];
        [l.score, l.probability, l.explained, l.contradicted, l.in_front][k]
    });
    (poses.into_pyarray(py), covariances.into_pyarray(py), figures.into_pyarray(py))
}

/// Why no place is accepted: the name of the reason, and a sentence.
type Refused = (&'static str, String);

/// Directions along which the position is free, and axes about which the scan is.
type Free = [Vec<[f64; 3]>; 2];

/// Accepted and rejected places, how many the scan fits, whether it is ambiguous, why none is accepted, and what is free.
pub type Answer<'py> = (Columns<'py>, Columns<'py>, usize, bool, Option<Refused>, Free);

/// See [`Answer`].
pub fn answer<'py>(py: Python<'py>, found: &Located) -> Answer<'py> {
    let refused = found.refusal.map(|refusal| (refusal.kind(), refusal.to_string()));
    let [accepted, rejected] = [&found.locations, &found.rejected].map(|all| columns(py, all));
    let free = [&found.free_along, &found.free_about].map(Clone::clone);
    (accepted, rejected, found.places, found.is_ambiguous(), refused, free)
}

#[pymethods]
impl PyLocalizer {
    /// See [`Answer`].
    #[pyo3(signature = (scan, *, prior, radius, angle, upright, top, progress))]
    fn locate<'py>(
        slf: &Bound<'py, Self>,
        scan: &Bound<'_, PyAny>,
        prior: Option<&Bound<'_, PyAny>>,
        radius: f64,
        angle: f64,
        upright: Option<bool>,
        top: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Answer<'py>> {
        let py = slf.py();
        let prior = match prior {
            Some(given) => {
                let pose = arguments::pose("prior", given)?;
                Some(Prior { pose, radius, angle: angle.to_radians() })
            }
            None => None,
        };
        let options = LocateOptions { prior, upright, top };
        let (map, cloud) = (&slf.get().localizer, &cloud_of("scan", scan)?.get().cloud);
        let found = run(py, progress, |monitor| map.locate(cloud, &options, monitor))?;
        Ok(answer(py, &found))
    }

    /// Number of samples of the surface.
    fn __len__(&self) -> usize {
        self.localizer.len()
    }
}

/// Adds this file's names to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyLocalizer>()
}
