//! `surfabet.PatchModel` and how it is learned.

use std::sync::Arc;

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfabet::patches::{Lattice, Leaf};
use surfabet::{PatchModel, patches};

use crate::cloud::cloud_of;
use crate::model::{PyModel, model_class, wrap};
use crate::options::options_of;
use crate::run::run;

/// A cloud as patches on a lattice; immutable.
#[pyclass(name = "PatchModel", module = "surfabet._core", frozen, extends = PyModel)]
pub struct PyPatchModel {
    pub model: Arc<PatchModel>,
}

model_class!(PatchModel, PyPatchModel);

/// Learns patches; documented in `surfabet.patches`.
#[pyfunction]
#[pyo3(signature = (cloud, options, *, progress))]
fn learn_patches(
    py: Python<'_>,
    cloud: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyPatchModel>> {
    let options = options_of(options)?;
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    wrap(py, run(py, progress, |monitor| patches::learn(cloud, &options, monitor))?)
}

/// Linear part, shift and numbers of the patches of an instance.
type PyInstance<'py> = ([[f32; 3]; 3], [f32; 3], Bound<'py, PyArray1<i64>>);

/// Patches as arrays: sides of a pixel by level, places, masks and coefficients.
pub type PySurface<'py> =
    (Vec<f64>, Bound<'py, PyArray2<i64>>, Bound<'py, PyArray3<bool>>, Bound<'py, PyArray2<f64>>);

/// Patches on a lattice as arrays.
pub fn surface<'py>(py: Python<'py>, leaves: &[Leaf], lattice: &Lattice) -> PySurface<'py> {
    let pixels = (0..lattice.levels).map(|level| lattice.pixel_of(level)).collect();
    (pixels, places(py, leaves), masks(py, leaves), coefficients(py, leaves, lattice))
}

/// Side, level and the first column and row of patches.
fn places<'py>(py: Python<'py>, leaves: &[Leaf]) -> Bound<'py, PyArray2<i64>> {
    Array2::from_shape_fn((leaves.len(), 4), |(i, column)| match column {
        0 => i64::from(leaves[i].side),
        1 => i64::from(leaves[i].level),
        c => i64::from(leaves[i].corner[c - 2]),
    })
    .into_pyarray(py)
}

/// Set pixels of patches.
fn masks<'py>(py: Python<'py>, leaves: &[Leaf]) -> Bound<'py, PyArray3<bool>> {
    Array3::from_shape_fn((leaves.len(), 8, 8), |(i, row, column)| {
        leaves[i].patch.mask >> (8 * row + column) & 1 != 0
    })
    .into_pyarray(py)
}

/// Coefficients of the shapes of patches, metres.
fn coefficients<'py>(
    py: Python<'py>,
    leaves: &[Leaf],
    lattice: &Lattice,
) -> Bound<'py, PyArray2<f64>> {
    let step = lattice.pixel_size * f64::from(lattice.depth_step) / 16.0;
    let shapes = leaves.first().map_or(0, |l| l.patch.coefficients.len());
    Array2::from_shape_fn((leaves.len(), shapes), |(i, k)| {
        f64::from(leaves[i].patch.coefficients[k]) * step
    })
    .into_pyarray(py)
}

#[pymethods]
impl PyPatchModel {
    /// Lattice to world, rows of a rotation.
    #[getter]
    fn rotation(&self) -> [[f64; 3]; 3] {
        self.model.lattice().orientation.rotation()
    }

    #[getter]
    fn max_error(&self) -> Option<f64> {
        self.model.max_error()
    }

    #[getter]
    fn max_error_forward(&self) -> Option<f64> {
        self.model.max_error_forward()
    }

    /// Names of the attributes beside colour.
    #[getter]
    fn attribute_names(&self) -> Vec<&str> {
        self.model.attribute_names()
    }

    #[getter]
    fn n_extra_points(&self) -> u64 {
        self.model.header().n_extra
    }

    /// `(pixel_size, pixels, patches, set pixels)` of each level, coarsest first.
    #[getter]
    fn levels(&self) -> Vec<(f64, u32, u64, u64)> {
        let lattice = self.model.lattice();
        let level = |(l, of): (u32, patches::LevelSize)| {
            (lattice.pixel_of(l), patches::PATCH_PIXELS as u32, of.patches, of.set_pixels)
        };
        (0..lattice.levels).zip(self.model.level_sizes()).map(level).collect()
    }

    /// Side, level (0 the coarsest) and the first column and row (finest pixels) of every patch, (m, 4).
    fn places<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        places(py, self.model.leaves())
    }

    /// Set pixels of every patch, (m, 8, 8).
    fn masks<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<bool>> {
        masks(py, self.model.leaves())
    }

    /// Coefficients of the shapes of every patch, (m, 21), metres.
    fn coefficients<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        coefficients(py, self.model.leaves(), &self.model.lattice())
    }

    /// Sides of a pixel by level, and `places`, `masks` and `coefficients`.
    fn surface<'py>(&self, py: Python<'py>) -> PySurface<'py> {
        surface(py, self.model.leaves(), &self.model.lattice())
    }

    /// Standard deviation of the scan about every patch, (m,), metres.
    fn sigma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let pixel = self.model.lattice().pixel_size;
        let sigma = |leaf: &Leaf| leaf.patch.sigma() * pixel;
        self.model.leaves().iter().map(sigma).collect::<Vec<f64>>().into_pyarray(py)
    }

    /// Linear part, shift (finest pixels) and numbers of the patches of each instance.
    fn instances<'py>(&self, py: Python<'py>) -> Vec<PyInstance<'py>> {
        let instances = self.model.instances();
        let of = |instance: &patches::Instance| {
            let motion = patches::Motion::new(instance.place, instances.axis);
            let numbers: Vec<i64> = instance.patches.iter().map(|&i| i64::from(i)).collect();
            (motion.rows, motion.shift, numbers.into_pyarray(py))
        };
        instances.all.iter().map(of).collect()
    }
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyPatchModel>()?;
    module.add_function(wrap_pyfunction!(learn_patches, module)?)
}
