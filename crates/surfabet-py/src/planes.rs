//! `surfabet.PlaneModel`, how it is learned, and classical EM to compare with.

use std::sync::Arc;

use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::PlaneModel;
use surfabet::planes::{self, Frame, Patch, Points};

use crate::arrays::{column_f32, rows3};
use crate::cloud::{PyPointCloud, cloud_of};
use crate::errors::invalid_input;
use crate::model::{PyModel, model_class, wrap};
use crate::options::options_of;
use crate::run::{released, run};

/// A cloud as planar patches with tiles; immutable.
#[pyclass(name = "PlaneModel", module = "surfabet._core", frozen, extends = PyModel)]
pub struct PyPlaneModel {
    pub model: Arc<PlaneModel>,
}

model_class!(PlaneModel, PyPlaneModel);

fn weights_of(weights: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<f32>>> {
    weights.map(|w| column_f32("weights", w)).transpose()
}

/// Learns planes; documented in `surfabet.planes`.
#[pyfunction]
#[pyo3(signature = (cloud, options, *, weights, progress))]
fn learn_planes(
    py: Python<'_>,
    cloud: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    weights: Option<&Bound<'_, PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyPlaneModel>> {
    let options = options_of(options)?;
    let weights = weights_of(weights)?;
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let learn = |monitor: &dyn surfabet::Progress| {
        planes::learn(cloud, weights.as_deref(), &options, monitor)
    };
    wrap(py, run(py, progress, learn)?)
}

/// The patch of each point before any is judged, -1 where there is none, and what the judge gets of each patch, (k, f).
#[pyfunction]
#[pyo3(signature = (cloud, options))]
fn plane_candidates<'py>(
    py: Python<'py>,
    cloud: &Bound<'py, PyAny>,
    options: &Bound<'py, PyDict>,
) -> PyResult<(Bound<'py, PyArray1<i32>>, Bound<'py, PyArray2<f64>>)> {
    let options = options_of(options)?;
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let found = run(py, None, |monitor| planes::candidates(cloud, &options, monitor))?;
    let patches = &found.patches;
    let inputs =
        Array2::from_shape_fn((patches.len(), planes::FIGURES), |(j, k)| patches[j].inputs[k]);
    // No patch is -1.
    let labels = found.labels.iter().map(|&label| label as i32).collect::<Array1<i32>>();
    Ok((labels.into_pyarray(py), inputs.into_pyarray(py)))
}

/// Centres, normals, labels, standard deviation and log-likelihoods.
type Fitted<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<i32>>,
    f64,
    Bound<'py, PyArray1<f64>>,
);

/// Centres and normals of the patches that a fit starts from; documented in `surfabet.planes`.
#[pyfunction]
#[pyo3(signature = (cloud, *, n_planes, random_state))]
fn random_planes<'py>(
    py: Python<'py>,
    cloud: &Bound<'py, PyAny>,
    n_planes: usize,
    random_state: u64,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let (origin, frames) = run(py, None, |_| {
        let points = Points::new(cloud, None)?;
        let frames = planes::random_planes(&points, n_planes, random_state)?;
        Ok::<_, surfabet_models::Error>((points.origin(), frames))
    })?;
    let (centers, normals) = planes_of(origin, &frames);
    Ok((centers.into_pyarray(py), normals.into_pyarray(py)))
}

/// Points on planes and their normals, (n, 3).
fn planes_of(origin: [f64; 3], frames: &[Frame]) -> (Array2<f64>, Array2<f64>) {
    let centers =
        Array2::from_shape_fn((frames.len(), 3), |(i, a)| origin[a] + frames[i].center[a]);
    let normals = Array2::from_shape_fn((frames.len(), 3), |(i, a)| frames[i].normal[a]);
    (centers, normals)
}

/// Classical EM with infinite planes; documented in `surfabet.planes`.
#[pyfunction]
#[pyo3(signature = (cloud, *, centers, normals, weights, max_iterations, tolerance, progress))]
#[allow(clippy::too_many_arguments)]
fn fit_planes_em<'py>(
    py: Python<'py>,
    cloud: &Bound<'py, PyAny>,
    centers: &Bound<'py, PyAny>,
    normals: &Bound<'py, PyAny>,
    weights: Option<&Bound<'py, PyAny>>,
    max_iterations: usize,
    tolerance: f64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Fitted<'py>> {
    let centers = rows3("centers", centers)?.into_f64();
    let normals = rows3("normals", normals)?.into_f64();
    if centers.len() != normals.len() {
        let (c, n) = (centers.len(), normals.len());
        return Err(invalid_input(format!("centers has {c} rows, but normals {n}")));
    }
    let weights = weights_of(weights)?;
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let (origin, fit) = run(py, progress, |monitor| {
        let points = Points::new(cloud, weights.as_deref())?;
        let origin = points.origin();
        let start: Vec<([f64; 3], [f64; 3])> = centers
            .iter()
            .zip(&normals)
            .map(|(c, n)| (std::array::from_fn(|a| c[a] - origin[a]), *n))
            .collect();
        let fit = planes::fit_planes(&points, &start, max_iterations, tolerance, monitor)?;
        Ok::<_, surfabet_models::Error>((origin, fit))
    })?;
    let (centers, normals) = planes_of(origin, &fit.planes);
    Ok((
        centers.into_pyarray(py),
        normals.into_pyarray(py),
        signed(&fit.labels).into_pyarray(py),
        fit.standard_deviation,
        fit.log_likelihood.into_pyarray(py),
    ))
}

/// Labels with -1 for outliers, which are `u32::MAX`; there are at most 2^20 patches.
fn signed(labels: &[u32]) -> Vec<i32> {
    labels.iter().map(|l| l.cast_signed()).collect()
}

impl PyPlaneModel {
    fn column<'py>(
        &self,
        py: Python<'py>,
        value: impl Fn(&Patch) -> f64,
    ) -> Bound<'py, PyArray1<f64>> {
        self.model.patches().iter().map(value).collect::<Vec<f64>>().into_pyarray(py)
    }
}

#[pymethods]
impl PyPlaneModel {
    /// The patch that each point supports, (n,), -1 for none.
    #[pyo3(signature = (cloud, *, progress))]
    fn segment<'py>(
        slf: &Bound<'py, Self>,
        cloud: &Bound<'py, PyAny>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<i32>>> {
        let (model, cloud) = (&slf.get().model, &cloud_of("cloud", cloud)?.get().cloud);
        let labels = run(slf.py(), progress, |monitor| model.segment(cloud, monitor))?;
        Ok(signed(&labels).into_pyarray(slf.py()))
    }

    /// The points that support a patch, on it.
    #[pyo3(signature = (cloud, *, progress))]
    fn project(
        slf: &Bound<'_, Self>,
        cloud: &Bound<'_, PyAny>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyPointCloud> {
        let (model, cloud) = (&slf.get().model, &cloud_of("cloud", cloud)?.get().cloud);
        Ok(run(slf.py(), progress, |monitor| model.project(cloud, monitor))?.into())
    }

    #[getter]
    fn n_outliers(&self) -> u64 {
        self.model.header().n_outliers
    }

    #[getter]
    fn grid_size(&self) -> f64 {
        self.model.grid_size()
    }

    /// The patch that each input point supports, (n,), -1 for none; None for a model read from a file.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<i32>>> {
        self.model.labels().map(|labels| signed(labels).into_pyarray(py))
    }

    /// Middles of the rectangles in the world, (n, 3).
    fn centers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let (patches, origin) = (self.model.patches(), self.model.origin());
        Array2::from_shape_fn((patches.len(), 3), |(i, a)| origin[a] + patches[i].frame.center[a])
            .into_pyarray(py)
    }

    /// First axis, second axis and normal of each patch, (n, 3, 3).
    fn axes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let patches = self.model.patches();
        Array3::from_shape_fn((patches.len(), 3, 3), |(i, axis, a)| {
            let frame = &patches[i].frame;
            [frame.u, frame.v, frame.normal][axis][a]
        })
        .into_pyarray(py)
    }

    /// Sides of the rectangles along their axes, (n, 2), metres.
    fn extents<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let patches = self.model.patches();
        Array2::from_shape_fn((patches.len(), 2), |(i, a)| patches[i].tiles.size()[a])
            .into_pyarray(py)
    }

    /// Standard deviations of the supports about their planes, (n,), metres.
    fn standard_deviations<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |patch| patch.standard_deviation)
    }

    /// Numbers of supporting points, (n,).
    fn counts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        Array1::from_shape_fn(self.model.len(), |i| self.model.count(i)).into_pyarray(py)
    }

    /// Areas of the supported tiles, (n,), square metres.
    fn areas<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |patch| patch.tiles.area())
    }

    /// Sides of the tiles, (n,), metres.
    fn tile_edges<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |patch| patch.tiles.edge())
    }

    /// Which tiles are supported, for each patch an array of rows along the first axis.
    fn supported<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray2<bool>>> {
        let of = |patch: &Patch| {
            let ([nx, ny], tiles) = (patch.tiles.shape(), patch.tiles.supported());
            Array2::from_shape_fn((ny, nx), |(y, x)| tiles[y * nx + x]).into_pyarray(py)
        };
        self.model.patches().iter().map(of).collect()
    }

    /// Mean intensities of the supported tiles of each patch, (k,), row by row; None without intensities.
    fn intensities<'py>(&self, py: Python<'py>) -> Option<Vec<Bound<'py, PyArray1<f32>>>> {
        let of = |i: usize| self.model.intensities(i).into_pyarray(py);
        self.model.has_intensity().then(|| (0..self.model.len()).map(of).collect())
    }

    /// Colours of the supported tiles of each patch, (k, 3), row by row; None without colours.
    fn colors<'py>(&self, py: Python<'py>) -> Option<Vec<Bound<'py, PyArray2<u8>>>> {
        let of = |i: usize| {
            let colors = self.model.colors(i);
            Array2::from_shape_fn((colors.len(), 3), |(k, c)| colors[k][c]).into_pyarray(py)
        };
        self.model.has_color().then(|| (0..self.model.len()).map(of).collect())
    }

    /// Rings around the supported area of a patch, each (k, 3), in the world.
    fn polygons<'py>(
        &self,
        py: Python<'py>,
        patch: usize,
    ) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let n = self.model.len();
        if patch >= n {
            return Err(invalid_input(format!("patch is {patch}, but there are {n} patches")));
        }
        let of = |ring: Vec<[f64; 3]>| {
            Array2::from_shape_fn((ring.len(), 3), |(i, a)| ring[i][a]).into_pyarray(py)
        };
        Ok(released(py, || self.model.polygons(patch))?.into_iter().map(of).collect())
    }

    /// Corners (m, 3), triangles (t, 3) and the patch of each, (t,).
    fn mesh<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>, Bound<'py, PyArray1<u32>>)>
    {
        let mesh = released(py, || self.model.mesh())?;
        let (vertices, triangles) = (&mesh.vertices, &mesh.triangles);
        Ok((
            Array2::from_shape_fn((vertices.len(), 3), |(i, a)| vertices[i][a]).into_pyarray(py),
            Array2::from_shape_fn((triangles.len(), 3), |(i, a)| triangles[i][a]).into_pyarray(py),
            mesh.patches.into_pyarray(py),
        ))
    }
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyPlaneModel>()?;
    module.add_function(wrap_pyfunction!(learn_planes, module)?)?;
    module.add_function(wrap_pyfunction!(plane_candidates, module)?)?;
    module.add_function(wrap_pyfunction!(random_planes, module)?)?;
    module.add_function(wrap_pyfunction!(fit_planes_em, module)?)
}
