//! `surfabet.PointCloud`.

use numpy::ndarray::{ArrayView1, ArrayView2};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyMapping, PyString, PyTuple};
use surfabet_geom::{CloudParts, Column, DroppedValues, Extra, PointCloud, Viewpoints};

use crate::arguments;
use crate::arrays::{self, Rows3};
use crate::errors::{IntoPyErr, wrong_shown, wrong_type};
use crate::view::{FrozenOwner, read_only_view};

/// Points in metres with what the scanner knew of them; immutable.
///
/// `extra` holds any other attribute: a number per point by name (`uint8` to `int64`, `float32`, `float64`), in the
/// order of the file. `cloud[name]` is any column by its name, built-in or extra, and `attributes` lists the names.
/// `crs` is the coordinate reference system, as WKT or as a code like `EPSG:25832`; nothing here interprets it.
#[pyclass(name = "PointCloud", module = "surfabet", frozen, mapping)]
pub struct PyPointCloud {
    pub(crate) cloud: PointCloud,
    /// World coordinates, once they were asked for.
    world: PyOnceLock<Py<PyArray2<f64>>>,
}

impl FrozenOwner for PyPointCloud {}

impl From<PointCloud> for PyPointCloud {
    fn from(cloud: PointCloud) -> Self {
        Self { cloud, world: PyOnceLock::new() }
    }
}

/// The cloud that the argument `name` is.
///
/// # Errors
/// `InvalidTypeError` for anything else.
pub fn cloud_of<'a, 'py>(
    name: &str,
    object: &'a Bound<'py, PyAny>,
) -> PyResult<&'a Bound<'py, PyPointCloud>> {
    object.cast().map_err(|_| wrong_type(name, object, "a PointCloud"))
}

fn rows<T, const N: usize>(values: &[[T; N]]) -> ArrayView2<'_, T> {
    ArrayView2::from(values)
}

/// The named columns of a mapping, in its order.
fn extra_columns(extra: &Bound<'_, PyAny>) -> PyResult<Extra> {
    let requirement = "a mapping of names to arrays of a number per point";
    let mapping = extra.cast::<PyMapping>();
    let items = mapping.map_err(|_| wrong_type("extra", extra, requirement))?.items()?;
    let column = |item: Bound<'_, PyAny>| {
        let (name, values): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let name: String =
            name.extract().map_err(|_| wrong_type("a name in extra", &name, "a text"))?;
        let column = arrays::column(&format!("extra {name:?}"), &values)?;
        Ok((name, column))
    };
    items.iter().map(column).collect()
}

/// A view of the extra column `i`, which there must be.
fn extra_view<'py>(owner: &Bound<'py, PyPointCloud>, i: usize) -> Bound<'py, PyAny> {
    macro_rules! view {
        ($($Variant:ident)*) => {
            match owner.get().cloud.extra()[i].1 {
                $(Column::$Variant(_) => read_only_view(owner, |c| match &c.cloud.extra()[i].1 {
                    Column::$Variant(values) => ArrayView1::from(values),
                    // The same column as above.
                    _ => ArrayView1::from(&[]),
                })
                .into_any(),)*
            }
        };
    }
    view!(U8 I8 U16 I16 U32 I32 U64 I64 F32 F64)
}

/// What construction left out of `total` points, if anything.
fn in_words(dropped: DroppedValues, total: usize) -> Option<String> {
    let mut parts = Vec::new();
    if dropped.points > 0 {
        parts.push(format!(
            "dropped {} of {total} points with NaN or infinite coordinates",
            dropped.points
        ));
    }
    if dropped.attributes > 0 {
        parts.push(format!(
            "set {} normals, ranges or intensities that were not finite to zero (unknown)",
            dropped.attributes
        ));
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}

#[pymethods]
impl PyPointCloud {
    #[new]
    #[pyo3(signature = (points, *, colors=None, intensities=None, normals=None, ranges=None,
                        viewpoints=None, viewpoint_index=None, extra=None, crs=None,
                        origin=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        colors: Option<&Bound<'_, PyAny>>,
        intensities: Option<&Bound<'_, PyAny>>,
        normals: Option<&Bound<'_, PyAny>>,
        ranges: Option<&Bound<'_, PyAny>>,
        viewpoints: Option<&Bound<'_, PyAny>>,
        viewpoint_index: Option<&Bound<'_, PyAny>>,
        extra: Option<&Bound<'_, PyAny>>,
        crs: Option<&Bound<'_, PyAny>>,
        origin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (cloud, dropped) = Self::checked(
            points,
            colors,
            intensities,
            normals,
            ranges,
            viewpoints,
            viewpoint_index,
            extra,
            crs,
            origin,
        )?;
        if let Some(dropped) = dropped {
            let category = py.import("surfabet.errors")?.getattr("DroppedPointsWarning")?;
            py.import("warnings")?.call_method1("warn", (dropped, category, 2))?;
        }
        Ok(cloud)
    }

    /// The cloud, and what of the columns was not finite and had to go, for callers that warn in their own words.
    #[staticmethod]
    #[pyo3(signature = (points, *, colors=None, intensities=None, normals=None, ranges=None,
                        viewpoints=None, viewpoint_index=None, extra=None, crs=None,
                        origin=None))]
    #[allow(clippy::too_many_arguments)]
    fn checked(
        points: &Bound<'_, PyAny>,
        colors: Option<&Bound<'_, PyAny>>,
        intensities: Option<&Bound<'_, PyAny>>,
        normals: Option<&Bound<'_, PyAny>>,
        ranges: Option<&Bound<'_, PyAny>>,
        viewpoints: Option<&Bound<'_, PyAny>>,
        viewpoint_index: Option<&Bound<'_, PyAny>>,
        extra: Option<&Bound<'_, PyAny>>,
        crs: Option<&Bound<'_, PyAny>>,
        origin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Self, Option<String>)> {
        let of_origin = |given| arguments::numbers("origin", given, "three finite numbers");
        let origin: Option<[f64; 3]> = origin.map(of_origin).transpose()?;
        let of_crs = |given: &Bound<'_, PyAny>| {
            given
                .extract::<String>()
                .map_err(|_| wrong_type("crs", given, "a text: WKT, or EPSG:25832"))
        };
        let crs = crs.map(of_crs).transpose()?;
        let (origin, positions) = match (arrays::rows3("points", points)?, origin) {
            (rows, Some(origin)) => (origin, rows.into_f32()),
            (Rows3::F64(world), None) => PointCloud::split_origin(&world),
            (Rows3::F32(world), None) => PointCloud::split_origin_single(world),
        };
        let total = positions.len();
        let viewpoints = match (viewpoints, viewpoint_index) {
            (None, None) => None,
            (None, Some(_)) => {
                let requirement = "left out without viewpoints, an (m, 3) array";
                return Err(wrong_shown("viewpoint_index", "given", requirement));
            }
            (Some(origins), index) => {
                let origins = arrays::rows3("viewpoints", origins)?.into_f64();
                let index = match index {
                    Some(index) => arrays::column_u32("viewpoint_index", index)?,
                    None if origins.len() == 1 => vec![0; total],
                    None if origins.len() == total => (0..total).map(|i| i as u32).collect(),
                    None => {
                        return Err(wrong_shown(
                            "viewpoints",
                            &format!("an array of {} positions", origins.len()),
                            &format!(
                                "of one or of {total}, as many as points, unless viewpoint_index is given"
                            ),
                        ));
                    }
                };
                Some(Viewpoints { origins, index })
            }
        };
        let parts = CloudParts {
            origin,
            positions,
            colors: colors.map(|c| arrays::colors("colors", c)).transpose()?,
            intensities: intensities.map(|c| arrays::column_f32("intensities", c)).transpose()?,
            normals: normals.map(|c| arrays::rows3("normals", c)).transpose()?.map(Rows3::into_f32),
            ranges: ranges.map(|c| arrays::column_f32("ranges", c)).transpose()?,
            viewpoints,
            extra: extra.map(extra_columns).transpose()?.unwrap_or_default(),
            crs,
        };
        let (cloud, dropped) = PointCloud::from_parts(parts).map_err(IntoPyErr::into_py_err)?;
        Ok((cloud.into(), in_words(dropped, total)))
    }

    /// World coordinates in double precision, metres: a read-only copy that is made when they are first asked for and
    /// kept with the cloud, 24 bytes per point. `local_points` and `origin` are views of what the cloud holds.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let made = || {
            let world: Vec<f64> = (0..self.cloud.len()).flat_map(|i| self.cloud.world(i)).collect();
            let array = world.into_pyarray(py).reshape([self.cloud.len(), 3])?;
            array.readwrite().make_nonwriteable();
            Ok::<_, PyErr>(array.unbind())
        };
        self.world.get_or_try_init(py, made).map(|array| array.bind(py).clone())
    }

    #[getter]
    fn local_points<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        read_only_view(slf, |c| rows(c.cloud.positions()))
    }

    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.cloud.origin()
    }

    #[getter]
    fn colors<'py>(slf: &Bound<'py, Self>) -> Option<Bound<'py, PyArray2<u8>>> {
        slf.get().cloud.colors()?;
        Some(read_only_view(slf, |c| rows(c.cloud.colors().unwrap_or_default())))
    }

    #[getter]
    fn intensities<'py>(slf: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        slf.get().cloud.intensities()?;
        Some(read_only_view(slf, |c| ArrayView1::from(c.cloud.intensities().unwrap_or_default())))
    }

    #[getter]
    fn normals<'py>(slf: &Bound<'py, Self>) -> Option<Bound<'py, PyArray2<f32>>> {
        slf.get().cloud.normals()?;
        Some(read_only_view(slf, |c| rows(c.cloud.normals().unwrap_or_default())))
    }

    #[getter]
    fn ranges<'py>(slf: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        slf.get().cloud.ranges()?;
        Some(read_only_view(slf, |c| ArrayView1::from(c.cloud.ranges().unwrap_or_default())))
    }

    #[getter]
    fn viewpoints<'py>(slf: &Bound<'py, Self>) -> Option<Bound<'py, PyArray2<f64>>> {
        slf.get().cloud.viewpoints()?;
        Some(read_only_view(slf, |c| {
            rows(c.cloud.viewpoints().map(|v| &v.origins[..]).unwrap_or_default())
        }))
    }

    #[getter]
    fn viewpoint_index<'py>(slf: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<u32>>> {
        slf.get().cloud.viewpoints()?;
        Some(read_only_view(slf, |c| {
            ArrayView1::from(c.cloud.viewpoints().map(|v| &v.index[..]).unwrap_or_default())
        }))
    }

    #[getter]
    fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        self.cloud.bounds()
    }

    /// The other attributes by name, in the order of the file.
    #[getter]
    fn extra<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(slf.py());
        for (i, (name, _)) in slf.get().cloud.extra().iter().enumerate() {
            columns.set_item(name, extra_view(slf, i))?;
        }
        Ok(columns)
    }

    #[getter]
    fn crs(&self) -> Option<&str> {
        self.cloud.crs()
    }

    #[getter]
    fn attributes(&self) -> Vec<&str> {
        self.cloud.attributes()
    }

    /// Any column by its name, built-in or extra.
    fn __getitem__<'py>(
        slf: &Bound<'py, Self>,
        name: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let requirement =
            "the name of a column, such as 'points'; for points by number there is select";
        let text = name.cast::<PyString>();
        let name = text.map_err(|_| wrong_type("name", name, requirement))?.to_str()?;
        let cloud = &slf.get().cloud;
        if let Some(i) = cloud.extra().iter().position(|(extra, _)| extra == name) {
            return Ok(extra_view(slf, i));
        }
        let builtin = matches!(name, "points" | "local_points" | "viewpoint_index")
            || cloud.attributes().contains(&name);
        let column = builtin.then(|| slf.getattr(name)).transpose()?;
        column.filter(|column| !column.is_none()).ok_or_else(|| {
            let present = [&["points"][..], &cloud.attributes()].concat().join(", ");
            PyKeyError::new_err(format!("the cloud has no {name:?}; it has {present}"))
        })
    }

    /// Arguments that make the same cloud again, for pickle and copy.
    fn __getnewargs_ex__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let given = PyDict::new(slf.py());
        let columns = ["colors", "intensities", "normals", "ranges", "viewpoints"];
        for name in columns.into_iter().chain(["viewpoint_index", "extra", "crs", "origin"]) {
            given.set_item(name, slf.getattr(name)?)?;
        }
        Ok((PyTuple::new(slf.py(), [slf.getattr("local_points")?])?, given))
    }

    /// The cloud with a viewpoint (x, y, z in world coordinates) where it has none, and the ranges to it where it has
    /// none.
    fn seen_from(&self, viewpoint: &Bound<'_, PyAny>) -> PyResult<Self> {
        let place = arguments::numbers("viewpoint", viewpoint, "three finite coordinates")?;
        self.cloud.clone().seen_from(place).map(Self::from).map_err(IntoPyErr::into_py_err)
    }

    /// Points at integer indices or where a boolean mask is true.
    fn select(&self, py: Python<'_>, which: &Bound<'_, PyAny>) -> PyResult<Self> {
        let numpy = py.import("numpy")?;
        let array = numpy.call_method1("asarray", (which,))?;
        let dtype: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
        let index = if dtype == "b" {
            let n: usize = array.len().map_err(|_| {
                wrong_type("which", which, "integer indices or a truth value per point")
            })?;
            if n != self.cloud.len() {
                let requirement = format!("one of {} values, as many as points", self.cloud.len());
                return Err(wrong_shown("which", &format!("a mask of {n} values"), &requirement));
            }
            numpy.call_method1("flatnonzero", (&array,))?
        } else {
            array
        };
        let index = arrays::column_u32("which", &index)?;
        let index: Vec<usize> = index.into_iter().map(|i| i as usize).collect();
        self.cloud.select(&index).map(Self::from).map_err(IntoPyErr::into_py_err)
    }

    #[staticmethod]
    fn concat(clouds: &Bound<'_, PyAny>) -> PyResult<(Self, Vec<String>)> {
        let items: Vec<Bound<'_, PyAny>> = clouds
            .extract()
            .map_err(|_| wrong_type("clouds", clouds, "a sequence of PointClouds"))?;
        let of = |(i, item): (usize, &Bound<'_, PyAny>)| -> PyResult<PointCloud> {
            Ok(cloud_of(&format!("clouds[{i}]"), item)?.get().cloud.clone())
        };
        let clouds: Vec<PointCloud> = items.iter().enumerate().map(of).collect::<PyResult<_>>()?;
        let (cloud, lost) = PointCloud::concat(&clouds);
        Ok((cloud.into(), lost))
    }

    fn __len__(&self) -> usize {
        self.cloud.len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let unit: String = match self.cloud.crs() {
            Some(crs) => {
                py.import("surfabet.io._crs")?.call_method1("unit_name", (crs,))?.extract()?
            }
            None => "m".to_owned(),
        };
        let extent = self.cloud.bounds().map_or_else(
            || "empty".to_owned(),
            |(low, high)| {
                format!(
                    "{:.2} x {:.2} x {:.2} {unit}",
                    high[0] - low[0],
                    high[1] - low[1],
                    high[2] - low[2]
                )
            },
        );
        let attributes = self.attributes();
        let attributes = if attributes.is_empty() {
            String::new()
        } else {
            format!(", {}", attributes.join(", "))
        };
        Ok(format!("PointCloud({} points, {extent}{attributes})", self.cloud.len()))
    }
}

/// Adds this file's classes to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyPointCloud>()
}
