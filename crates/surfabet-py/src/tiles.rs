//! Models of patches in tiles: how they are read, learned and put together.

use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use surfabet::geom::{Dtype, Survey};
use surfabet::patches::{
    AttributeContent, AttributeHeader, AttributeRange, Cubes, INTENSITIES, Known, Lattice,
    Orientation, Recipe, TilePlan, TileTask, Views, learn_details, plan,
};
use surfabet::{
    AnyModel, DecodeOptions, Limits, OpenError, Part, ReadAt, ScalarScale, TileEntry, TiledModel,
};

use crate::cloud::{PyPointCloud, cloud_of};
use crate::errors::{IntoPyErr, invalid_input};
use crate::model::{PyModel, region_of};
use crate::options::options_of;
use crate::patches::{PySurface, surface};
use crate::run::{PyStop, released, run, run_until};

/// Patches in tiles, or a part of them; immutable.
#[pyclass(name = "TiledPatchModel", module = "surfabet._core", frozen, extends = PyModel)]
pub struct PyTiledModel {
    model: Arc<TiledModel>,
}

/// Two corners of a box.
type Corners = ([f64; 3], [f64; 3]);

impl PyTiledModel {
    /// The Python object of a model.
    fn wrap(py: Python<'_>, model: TiledModel) -> PyResult<Py<Self>> {
        let model = Arc::new(model);
        let any: Arc<dyn AnyModel> = model.clone();
        Py::new(py, PyClassInitializer::from(PyModel::of(any)).add_subclass(Self { model }))
    }
}

#[pymethods]
impl PyTiledModel {
    #[pyo3(signature = (*, resolution, as_measured, normals, region, level, max_points, progress))]
    #[allow(clippy::too_many_arguments)]
    fn decode_level(
        slf: &Bound<'_, Self>,
        resolution: Option<f64>,
        as_measured: bool,
        normals: bool,
        region: Option<Corners>,
        level: Option<usize>,
        max_points: u64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyPointCloud> {
        let model = &slf.get().model;
        let options = DecodeOptions { resolution, as_measured, normals, max_points };
        let part = Part { region: region_of(region)?, level };
        let decode = |monitor: &dyn surfabet::Progress| model.decode_part(part, options, monitor);
        Ok(run(slf.py(), progress, decode)?.into())
    }

    /// The map with what another scan shows, the number of tiles that were learned, and of points that were left out.
    #[pyo3(signature = (cloud, *, alone, progress))]
    fn update(
        &self,
        py: Python<'_>,
        cloud: &Bound<'_, PyAny>,
        alone: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Py<Self>, usize, usize)> {
        let cloud = &cloud_of("cloud", cloud)?.get().cloud;
        let updated = run(py, progress, |monitor| self.model.update(cloud, alone, monitor))?;
        Ok((Self::wrap(py, updated.model)?, updated.learned, updated.left_out))
    }

    /// A map of one tile, from points of a scan and from what this map holds; None where no point lies in it.
    #[pyo3(signature = (points, cube, *, mean_weight, alone, progress))]
    fn updated_tile(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        cube: [i32; 3],
        mean_weight: f64,
        alone: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Option<Py<Self>>> {
        let points = &cloud_of("points", points)?.get().cloud;
        let tile = run(py, progress, |monitor| {
            self.model.updated_tile(points, cube, mean_weight, alone, monitor)
        })?;
        tile.map(|tile| Self::wrap(py, tile)).transpose()
    }

    /// The map with some tiles in place of its own; with `alone` of these alone.
    #[pyo3(signature = (tiles, *, alone))]
    fn with_tiles(&self, py: Python<'_>, tiles: Vec<Py<Self>>, alone: bool) -> PyResult<Py<Self>> {
        let tiles: Vec<TiledModel> = tiles.iter().map(|t| t.get().model.as_ref().clone()).collect();
        let model = self.model.with_tiles(&tiles, alone).map_err(IntoPyErr::into_py_err)?;
        Self::wrap(py, model)
    }

    /// What tiles are learned by, as a dict of plain values.
    fn tile_plan<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let plan = self.model.tile_plan().map_err(IntoPyErr::into_py_err)?;
        let dict = state(py, &plan)?;
        let margin = self.model.scan_margin().map_err(IntoPyErr::into_py_err)?;
        dict.set_item("scan_margin", margin)?;
        Ok(dict)
    }

    /// Points that the tile in a cube decodes to when it is learned again.
    fn remembered_points(&self, cube: [i32; 3]) -> PyResult<f64> {
        self.model.remembered_points(cube).map_err(IntoPyErr::into_py_err)
    }

    /// Sum of the weights of points of a scan, by their ranges.
    fn scan_weight(&self, points: &Bound<'_, PyAny>) -> PyResult<f64> {
        let points = &cloud_of("points", points)?.get().cloud;
        self.model.scan_weight(points).map_err(IntoPyErr::into_py_err)
    }

    /// Writes the file, with a note if it is not empty, and returns its size in bytes.
    fn save_tiles(&self, py: Python<'_>, path: PathBuf, note: &str) -> PyResult<u64> {
        released(py, || self.model.save(&path, note))?.map_err(IntoPyErr::into_py_err)
    }

    /// Tiles that are here, and that the file has, of all levels of detail.
    #[getter]
    fn tile_counts(&self) -> (usize, usize) {
        self.model.tile_counts()
    }

    /// Whether the file says how its tiles were learned.
    #[getter]
    fn has_plan(&self) -> bool {
        self.model.header().recipe.is_some()
    }

    /// Lattice to world, rows of a rotation.
    #[getter]
    fn rotation(&self) -> [[f64; 3]; 3] {
        self.model.patches().lattice.orientation.rotation()
    }

    #[getter]
    fn max_error(&self) -> Option<f64> {
        self.model.patches().max_error
    }

    #[getter]
    fn max_error_forward(&self) -> Option<f64> {
        self.model.patches().max_error_forward
    }

    /// Names of the attributes beside colour.
    #[getter]
    fn attribute_names(&self) -> Vec<&str> {
        self.model.patches().attributes.iter().map(|header| header.name.as_str()).collect()
    }

    /// The patches of all tiles as arrays, as those of a model in one piece.
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<PySurface<'py>> {
        let leaves = released(py, || self.model.leaves())?.map_err(IntoPyErr::into_py_err)?;
        Ok(surface(py, &leaves, &self.model.patches().lattice))
    }

    /// Sides of the finest pixels of the levels of detail, coarsest first, metres.
    #[getter]
    fn pixel_sizes(&self) -> Vec<f64> {
        self.model.header().details.iter().map(|detail| detail.lattice.pixel_size).collect()
    }

    /// Side of a tile, metres.
    #[getter]
    fn tile_side(&self) -> f64 {
        let header = self.model.header();
        let pixel = header.details.last().map_or(0.0, |detail| detail.lattice.pixel_size);
        f64::from(header.cubes.side) * pixel
    }

    /// Lowest corner of cube (0, 0, 0) along the axes of the lattice, metres from the origin.
    #[getter]
    fn tile_corner(&self) -> [f64; 3] {
        let header = self.model.header();
        let pixel = header.details.last().map_or(0.0, |detail| detail.lattice.pixel_size);
        header.cubes.offset.map(|c| f64::from(c) * pixel)
    }

    /// Place of each tile among the cubes, (n, 3).
    fn tile_cubes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        let tiles: Vec<&TileEntry> = self.model.tiles().collect();
        Array2::from_shape_fn((tiles.len(), 3), |(i, a)| i64::from(tiles[i].cube[a]))
            .into_pyarray(py)
    }

    /// Corners of the box around each tile, world coordinates, (n, 6).
    fn tile_bounds<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let bounds: Vec<_> = self.model.tiles().map(|tile| self.model.tile_bounds(tile)).collect();
        Array2::from_shape_fn((bounds.len(), 6), |(i, a)| bounds[i][a / 3][a % 3]).into_pyarray(py)
    }

    /// Points that each tile was learned from, (n,).
    fn tile_points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.model.tiles().map(|tile| tile.n_points).collect::<Vec<_>>().into_pyarray(py)
    }

    /// Bytes of each tile, (n,).
    fn tile_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.model.tiles().map(|tile| tile.len).collect::<Vec<_>>().into_pyarray(py)
    }
}

/// A Python object that is read in parts: called with an offset and a length it gives bytes.
struct Source<'py> {
    read: Bound<'py, PyAny>,
    size: u64,
}

impl ReadAt for Source<'_> {
    fn size(&mut self) -> io::Result<u64> {
        Ok(self.size)
    }

    fn read_at(&mut self, offset: u64, len: usize) -> io::Result<Vec<u8>> {
        let bytes = self.read.call1((offset, len)).and_then(|bytes| bytes.extract::<Vec<u8>>());
        bytes.map_err(io::Error::other)
    }
}

/// The model in tiles of a file, as far as it meets a box; None for a file without tiles.
#[pyfunction]
#[pyo3(signature = (path, *, region, level, max_items, max_bytes))]
fn open_tiles(
    py: Python<'_>,
    path: PathBuf,
    region: Option<Corners>,
    level: Option<usize>,
    max_items: u64,
    max_bytes: u64,
) -> PyResult<Option<Py<PyTiledModel>>> {
    let part = Part { region: region_of(region)?, level };
    let limits = Limits { max_items, max_bytes };
    let opened = released(py, || {
        let io = |source| surfabet::Error::Io { path: path.clone(), source };
        let mut file = File::open(&path).map_err(io)?;
        TiledModel::open(&mut file, &limits, part).map_err(|error| match error {
            OpenError::Io(source) => io(source),
            OpenError::Codec(source) => surfabet::Error::File { path: path.clone(), source },
            OpenError::Model(error) => error.into(),
        })
    })?;
    let model = opened.map_err(IntoPyErr::into_py_err)?;
    model.map(|model| PyTiledModel::wrap(py, model)).transpose()
}

/// As [`open_tiles`], of `size` bytes that `read(offset, length)` gives.
#[pyfunction]
#[pyo3(signature = (read, size, *, region, level, max_items, max_bytes))]
fn open_tiles_of<'py>(
    py: Python<'py>,
    read: Bound<'py, PyAny>,
    size: u64,
    region: Option<Corners>,
    level: Option<usize>,
    max_items: u64,
    max_bytes: u64,
) -> PyResult<Option<Py<PyTiledModel>>> {
    let part = Part { region: region_of(region)?, level };
    let limits = Limits { max_items, max_bytes };
    let model = TiledModel::open(&mut Source { read, size }, &limits, part);
    let model = model.map_err(IntoPyErr::into_py_err)?;
    model.map(|model| PyTiledModel::wrap(py, model)).transpose()
}

/// True for the first bytes of a file with tiles; of what is no sound file the error comes from the reader.
#[pyfunction]
fn holds_tiles(start: &[u8]) -> bool {
    let limits = Limits { max_items: u64::MAX, max_bytes: u64::MAX };
    surfabet::holds_tiles(start, &limits).unwrap_or(false)
}

/// The model of all tiles of some models.
#[pyfunction]
#[pyo3(signature = (models, *, progress))]
fn merge_tiles(
    py: Python<'_>,
    models: Vec<Py<PyTiledModel>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyTiledModel>> {
    let models: Vec<TiledModel> = models.iter().map(|m| m.get().model.as_ref().clone()).collect();
    let merged = run(py, progress, |monitor| TiledModel::merge(&models, monitor))?;
    PyTiledModel::wrap(py, merged)
}

/// What is known of an attribute over a scene: name, type, labels, least and largest value, standard deviation.
type Range = (String, String, Option<Vec<i64>>, f64, f64, f64);

/// What all tiles of a scene share, as a dict of plain values.
#[pyfunction]
#[pyo3(signature = (sample, bounds, ranges, tile, details, options, *, progress))]
#[allow(clippy::too_many_arguments)]
fn plan_tiles<'py>(
    py: Python<'py>,
    sample: &Bound<'py, PyAny>,
    bounds: Corners,
    ranges: Vec<Range>,
    tile: Option<f64>,
    details: u32,
    options: &Bound<'py, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = options_of(options)?;
    let of_range = |(name, dtype, labels, low, high, deviation): Range| {
        let dtype = dtype_of(&dtype)?;
        Ok(AttributeRange { name, dtype, labels, range: [low, high], deviation })
    };
    let ranges: Vec<AttributeRange> = ranges.into_iter().map(of_range).collect::<PyResult<_>>()?;
    let sample = &cloud_of("sample", sample)?.get().cloud;
    let made = run(py, progress, |monitor| {
        plan(sample, [bounds.0, bounds.1], &ranges, tile, details, &options, monitor)
    })?;
    state(py, &made)
}

/// The plan with tiles of another side, metres.
#[pyfunction]
fn plan_with_side<'py>(
    py: Python<'py>,
    plan: &Bound<'py, PyDict>,
    side: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let chosen = plan.get_item("chosen")?;
    let changed = plan_of(plan)?.with_side(side).map_err(IntoPyErr::into_py_err)?;
    let changed = state(py, &changed)?;
    changed.set_item("chosen", chosen)?;
    Ok(changed)
}

/// The tile in a cube as the bytes of a file of its own; None where no point lies in it.
#[pyfunction]
#[pyo3(signature = (cloud, cube, plan, options, *, progress, stop))]
fn learn_tile<'py>(
    py: Python<'py>,
    cloud: &Bound<'py, PyAny>,
    cube: [i32; 3],
    plan: &Bound<'py, PyDict>,
    options: &Bound<'py, PyDict>,
    progress: Option<Py<PyAny>>,
    stop: Option<Py<PyStop>>,
) -> PyResult<Option<Bound<'py, PyBytes>>> {
    let (plan, options) = (plan_of(plan)?, options_of(options)?);
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let stop = stop.as_ref().map(Py::get);
    let bytes = run_until(py, progress, stop, |monitor| -> surfabet::Result<Option<Vec<u8>>> {
        let known = Known::default();
        let task = TileTask { cloud, known, cube, plan: &plan, options: &options };
        let models = learn_details(&task, monitor)?;
        if models.is_empty() {
            return Ok(None);
        }
        let tile = TiledModel::of_tile(&plan, cube, &models)?;
        tile.with_recipe(Recipe::of(&plan, &options)).to_bytes().map(Some)
    })?;
    Ok(bytes.map(|bytes| PyBytes::new(py, &bytes)))
}

fn dtype_of(name: &str) -> PyResult<Dtype> {
    let found = Dtype::ALL.iter().find(|dtype| dtype.name() == name);
    found.copied().ok_or_else(|| invalid_input(format!("no attribute has the type {name:?}")))
}

/// Kinds of views by number.
const VIEWS: [Views; 3] = [Views::None, Views::Viewpoints, Views::Normals];

fn views_of(number: usize) -> PyResult<Views> {
    let unknown = || invalid_input(format!("no plan of tiles has views of kind {number}"));
    VIEWS.get(number).copied().ok_or_else(unknown)
}

/// An attribute of a plan: name, type, labels, or low end, high end and step of its scale.
type Attribute = (String, String, Option<Vec<i64>>, f64, f64, f64);

/// A plan as a dict of plain values, which [`plan_of`] reads.
fn state<'py>(py: Python<'py>, plan: &TilePlan) -> PyResult<Bound<'py, PyDict>> {
    let TilePlan { lattice, cubes, survey, .. } = plan;
    let attribute = |header: &AttributeHeader| -> Attribute {
        let (name, dtype) = (header.name.clone(), header.dtype.name().to_owned());
        match &header.content {
            AttributeContent::Scalar(s) => (name, dtype, None, s.low, s.high, s.step),
            AttributeContent::Labels(labels) => (name, dtype, Some(labels.clone()), 0.0, 0.0, 1.0),
        }
    };
    let dict = PyDict::new(py);
    dict.set_item("origin", lattice.origin)?;
    dict.set_item("quaternion", lattice.orientation.quaternion)?;
    dict.set_item("pixel_size", lattice.pixel_size)?;
    dict.set_item("levels", lattice.levels)?;
    dict.set_item("depth_step", lattice.depth_step)?;
    dict.set_item("side", cubes.side)?;
    dict.set_item("offset", cubes.offset)?;
    dict.set_item("margin", plan.margin())?;
    dict.set_item("spacing", survey.spacing)?;
    dict.set_item("rounding", survey.rounding)?;
    dict.set_item("noise", survey.noise)?;
    dict.set_item("layer_gap", survey.layer_gap)?;
    dict.set_item("has_facings", survey.has_facings)?;
    dict.set_item("line_spacing", survey.line_spacing)?;
    dict.set_item("bounds", survey.bounds)?;
    dict.set_item("tolerance", plan.tolerance)?;
    dict.set_item("density", plan.density)?;
    dict.set_item("views", VIEWS.iter().position(|views| *views == plan.views))?;
    dict.set_item("attributes", plan.attributes.iter().map(attribute).collect::<Vec<_>>())?;
    dict.set_item("corrected", plan.corrected)?;
    dict.set_item("estimated", plan.estimated)?;
    dict.set_item("details", plan.details)?;
    let chosen = plan.chosen.iter().map(|c| (c.option, c.value, c.reason.clone()));
    dict.set_item("chosen", chosen.collect::<Vec<_>>())?;
    Ok(dict)
}

/// The plan in such a dict; why options were chosen is for people.
fn plan_of(state: &Bound<'_, PyDict>) -> PyResult<TilePlan> {
    let item = |name: &str| {
        let missing = || invalid_input(format!("the plan of the tiles has no {name:?}"));
        state.get_item(name)?.ok_or_else(missing)
    };
    let attribute = |(name, dtype, labels, low, high, step): Attribute| -> PyResult<_> {
        let content = match labels {
            Some(labels) if name != INTENSITIES => AttributeContent::Labels(labels),
            _ => AttributeContent::Scalar(ScalarScale { low, high, step }),
        };
        Ok(AttributeHeader { dtype: dtype_of(&dtype)?, name, content })
    };
    let attributes: Vec<Attribute> = item("attributes")?.extract()?;
    let plan = TilePlan {
        lattice: Lattice {
            origin: item("origin")?.extract()?,
            orientation: Orientation { quaternion: item("quaternion")?.extract()? },
            pixel_size: item("pixel_size")?.extract()?,
            levels: item("levels")?.extract()?,
            depth_step: item("depth_step")?.extract()?,
        },
        cubes: Cubes { side: item("side")?.extract()?, offset: item("offset")?.extract()? },
        survey: Survey {
            spacing: item("spacing")?.extract()?,
            rounding: item("rounding")?.extract()?,
            noise: item("noise")?.extract()?,
            layer_gap: item("layer_gap")?.extract()?,
            has_facings: item("has_facings")?.extract()?,
            line_spacing: item("line_spacing")?.extract()?,
            bounds: item("bounds")?.extract()?,
            ..Survey::default()
        },
        tolerance: item("tolerance")?.extract()?,
        density: item("density")?.extract()?,
        views: views_of(item("views")?.extract()?)?,
        attributes: attributes.into_iter().map(attribute).collect::<PyResult<_>>()?,
        corrected: item("corrected")?.extract()?,
        estimated: item("estimated")?.extract()?,
        details: item("details")?.extract()?,
        chosen: Vec::new(),
    };
    plan.check().map_err(IntoPyErr::into_py_err)?;
    Ok(plan)
}

/// Adds this file's classes and functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyTiledModel>()?;
    module.add_function(wrap_pyfunction!(open_tiles, module)?)?;
    module.add_function(wrap_pyfunction!(open_tiles_of, module)?)?;
    module.add_function(wrap_pyfunction!(holds_tiles, module)?)?;
    module.add_function(wrap_pyfunction!(merge_tiles, module)?)?;
    module.add_function(wrap_pyfunction!(plan_tiles, module)?)?;
    module.add_function(wrap_pyfunction!(plan_with_side, module)?)?;
    module.add_function(wrap_pyfunction!(learn_tile, module)?)
}
