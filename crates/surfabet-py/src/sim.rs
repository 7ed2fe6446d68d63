//! The scan simulator: `surfabet.datasets` builds on these.

use std::sync::Arc;

use numpy::ndarray::{Array2, Array3, ArrayView1, ArrayView2};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use surfabet_base::parallel;
use surfabet_sim::{
    GroundTruth, Intrinsics, LidarOptions, Pose, PoseError, RgbdFrame, RgbdOptions, RoomKind,
    RoomOptions, Scan, Scene, SurfaceKind,
};

use crate::cloud::PyPointCloud;
use crate::errors::{IntoPyErr, internal, invalid_input, wrong_shown, wrong_type};
use crate::run;
use crate::view::{FrozenOwner, read_only_view};
use crate::{arguments, arrays};

/// A simulated room, known exactly.
#[pyclass(name = "Scene", module = "surfabet.datasets", frozen)]
pub struct PyScene {
    scene: Arc<Scene>,
}

/// A thing in a simulated room.
#[pyclass(name = "Instance", module = "surfabet.datasets", frozen, get_all)]
pub struct PyInstance {
    /// Row in `Scene.instances`.
    id: u32,
    /// `chair`, `door`, ...
    class_name: &'static str,
    /// Congruent instances share it.
    model: u32,
    /// From the model's frame to the world.
    pose: Py<PyArray2<f64>>,
    /// Box in the model's frame.
    extent: ([f64; 3], [f64; 3]),
    /// Box in the world.
    bounds: ([f64; 3], [f64; 3]),
}

#[pymethods]
impl PyInstance {
    fn __repr__(&self) -> String {
        let (low, high) = self.bounds;
        let size = std::array::from_fn::<f64, 3, _>(|a| high[a] - low[a]);
        format!(
            "Instance({} {}, {:.2} x {:.2} x {:.2} m)",
            self.class_name, self.id, size[0], size[1], size[2]
        )
    }
}

/// A smooth piece of a scene's surface.
#[pyclass(name = "Surface", module = "surfabet.datasets", frozen, get_all)]
pub struct PySurface {
    /// Row in `Scene.surfaces`.
    id: u32,
    /// `plane`, `cylinder` or `sphere`.
    kind: &'static str,
    /// Row in `Scene.instances`.
    instance: u32,
    /// Normal of a plane, axis of a cylinder.
    direction: [f64; 3],
    /// Of a plane along its normal.
    offset: f64,
}

#[pymethods]
impl PySurface {
    fn __repr__(&self) -> String {
        format!("Surface({} {}, instance {})", self.kind, self.id, self.instance)
    }
}

/// The truth of every point of a cloud.
#[pyclass(name = "GroundTruth", module = "surfabet.datasets", frozen)]
pub struct PyGroundTruth {
    truth: GroundTruth,
}

impl FrozenOwner for PyGroundTruth {}

fn rows<T, const N: usize>(values: &[[T; N]]) -> ArrayView2<'_, T> {
    ArrayView2::from(values)
}

#[pymethods]
impl PyGroundTruth {
    #[getter]
    fn points<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        read_only_view(slf, |t| rows(&t.truth.points))
    }

    #[getter]
    fn normals<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        read_only_view(slf, |t| rows(&t.truth.normals))
    }

    #[getter]
    fn instances<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray1<u32>> {
        read_only_view(slf, |t| ArrayView1::from(&t.truth.instances))
    }

    #[getter]
    fn surfaces<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray1<u32>> {
        read_only_view(slf, |t| ArrayView1::from(&t.truth.surfaces))
    }

    fn __len__(&self) -> usize {
        self.truth.points.len()
    }

    fn __repr__(&self) -> String {
        format!("GroundTruth({} points)", self.truth.points.len())
    }
}

/// One scan: a turn of a laser or a frame of an RGB-D camera.
#[pyclass(name = "Frame", module = "surfabet.datasets", frozen)]
pub struct PyFrame {
    scan: Scan,
    /// `None` for a laser, whose images are empty.
    intrinsics: Option<Intrinsics>,
    depth: Array2<f32>,
    color: Array3<u8>,
}

impl FrozenOwner for PyFrame {}

impl From<Scan> for PyFrame {
    fn from(scan: Scan) -> Self {
        Self {
            scan,
            intrinsics: None,
            depth: Array2::default((0, 0)),
            color: Array3::default((0, 0, 3)),
        }
    }
}

impl PyFrame {
    fn of_camera(frame: RgbdFrame) -> PyResult<Self> {
        let RgbdFrame { scan, intrinsics, depth, color } = frame;
        let (height, width) = (intrinsics.height as usize, intrinsics.width as usize);
        Ok(Self {
            scan,
            intrinsics: Some(intrinsics),
            depth: Array2::from_shape_vec((height, width), depth).map_err(internal)?,
            color: Array3::from_shape_vec((height, width, 3), color.into_flattened())
                .map_err(internal)?,
        })
    }
}

fn matrix<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let values: Vec<f64> = pose.iter().flatten().copied().collect();
    values.into_pyarray(py).reshape([4, 4])
}

#[pymethods]
impl PyFrame {
    #[getter]
    fn cloud(&self) -> PyPointCloud {
        self.scan.cloud.clone().into()
    }

    #[getter]
    fn ground_truth(&self) -> PyGroundTruth {
        PyGroundTruth { truth: self.scan.truth.clone() }
    }

    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.scan.pose)
    }

    #[getter]
    fn true_pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.scan.true_pose)
    }

    #[getter]
    fn depth<'py>(slf: &Bound<'py, Self>) -> Option<Bound<'py, PyArray2<f32>>> {
        slf.get().intrinsics?;
        Some(read_only_view(slf, |f| f.depth.view()))
    }

    #[getter]
    fn color<'py>(slf: &Bound<'py, Self>) -> Option<Bound<'py, PyArray3<u8>>> {
        slf.get().intrinsics?;
        Some(read_only_view(slf, |f| f.color.view()))
    }

    /// The 3 x 3 matrix of the pinhole.
    #[getter]
    fn intrinsics<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let Some(k) = self.intrinsics else { return Ok(None) };
        let values = vec![k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0];
        values.into_pyarray(py).reshape([3, 3]).map(Some)
    }

    fn __repr__(&self) -> String {
        let points = self.scan.cloud.len();
        self.intrinsics.map_or_else(
            || format!("Frame({points} points)"),
            |i| format!("Frame({} x {}, {points} points)", i.width, i.height),
        )
    }
}

/// (n, 4, 4) poses, which are the argument `name`.
fn poses_of(name: &str, poses: &Bound<'_, PyAny>) -> PyResult<Vec<Pose>> {
    let requirement = "an array of poses, (n, 4, 4)";
    let numpy = poses.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (poses, "float64"));
    let array = array.map_err(|_| wrong_type(name, poses, requirement))?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    if shape.len() != 3 || shape[1..] != [4, 4] {
        let given = format!("an array of the shape {}", array.getattr("shape")?.str()?);
        return Err(wrong_shown(name, &given, requirement));
    }
    let flat = array.call_method1("reshape", (-1,))?;
    let flat: Vec<f64> = flat.call_method0("tolist")?.extract()?;
    let poses = flat.as_chunks::<16>().0.iter();
    Ok(poses.map(|p| std::array::from_fn(|r| std::array::from_fn(|c| p[4 * r + c]))).collect())
}

fn stack<'py>(py: Python<'py>, poses: &[Pose]) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let values: Vec<f64> = poses.iter().flatten().flatten().copied().collect();
    values.into_pyarray(py).reshape([poses.len(), 4, 4])
}

#[pymethods]
impl PyScene {
    #[staticmethod]
    #[pyo3(signature = (*, seed, kind, size, n_chairs, n_shelves, n_doors, variation))]
    fn room(
        seed: u64,
        kind: &str,
        size: [f64; 3],
        n_chairs: usize,
        n_shelves: usize,
        n_doors: usize,
        variation: f64,
    ) -> PyResult<Self> {
        let Some(&(_, kind)) = RoomKind::NAMES.iter().find(|(name, _)| *name == kind) else {
            let names = RoomKind::NAMES.map(|(name, _)| name).join(", ");
            return Err(invalid_input(format!("kind is {kind:?}, but must be one of {names}")));
        };
        let options = RoomOptions { seed, kind, size, n_chairs, n_shelves, n_doors, variation };
        let scene = Scene::room(&options).map_err(IntoPyErr::into_py_err)?;
        Ok(Self { scene: Arc::new(scene) })
    }

    #[getter]
    fn instances(&self, py: Python<'_>) -> PyResult<Vec<PyInstance>> {
        let instances = self.scene.instances().iter().enumerate();
        instances
            .map(|(id, i)| {
                Ok(PyInstance {
                    id: id as u32,
                    class_name: i.class,
                    model: i.model,
                    pose: matrix(py, &i.pose)?.unbind(),
                    extent: i.extent,
                    bounds: i.bounds,
                })
            })
            .collect()
    }

    #[getter]
    fn surfaces(&self) -> Vec<PySurface> {
        let kind = |kind| match kind {
            SurfaceKind::Plane => "plane",
            SurfaceKind::Cylinder => "cylinder",
            SurfaceKind::Sphere => "sphere",
        };
        let surfaces = self.scene.surfaces().iter().enumerate();
        surfaces
            .map(|(id, s)| PySurface {
                id: id as u32,
                kind: kind(s.kind),
                instance: s.instance,
                direction: s.direction,
                offset: s.offset,
            })
            .collect()
    }

    #[getter]
    fn interior(&self) -> ([f64; 3], [f64; 3]) {
        self.scene.interior()
    }

    /// The scene with instances in other poses, (4, 4) each, or without them.
    fn rearranged(&self, changes: &Bound<'_, PyAny>) -> PyResult<Self> {
        let requirement = "a dict of poses, (4, 4), or None, by the ids of instances";
        let given = changes.cast::<PyDict>();
        let changes = given.map_err(|_| wrong_type("changes", changes, requirement))?;
        let changes = changes.iter().map(|(row, pose)| {
            let row: u32 = arguments::integer("an id in changes", &row, "the id of an instance")?;
            if pose.is_none() {
                return Ok((row, None));
            }
            let stacked = poses_of("changes", PyList::new(pose.py(), [pose])?.as_any())?;
            Ok((row, stacked.first().copied()))
        });
        let changes = changes.collect::<PyResult<Vec<_>>>()?;
        let scene = self.scene.rearranged(&changes).map_err(IntoPyErr::into_py_err)?;
        Ok(Self { scene: Arc::new(scene) })
    }

    fn default_poses<'py>(
        &self,
        py: Python<'py>,
        n: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let n = arguments::integer("n", n, "an integer of at least 1")?;
        stack(py, &self.scene.default_poses(n).map_err(IntoPyErr::into_py_err)?)
    }

    fn default_lidar_poses<'py>(
        &self,
        py: Python<'py>,
        n: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let n = arguments::integer("n", n, "an integer of at least 1")?;
        stack(py, &self.scene.default_lidar_poses(n).map_err(IntoPyErr::into_py_err)?)
    }

    fn distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points = arrays::rows3("points", points)?.into_f64();
        let scene = self.scene.clone();
        let distances = run::run(py, None, move |progress| {
            parallel::try_map(&points, |p| progress.check().map(|()| scene.distance(*p)))
                .map_err(surfabet_geom::Error::from)
        })?;
        Ok(distances.into_pyarray(py))
    }

    /// Distances (n,), closest points (n, 3), normals (n, 3), instance and surface ids (n,).
    #[allow(clippy::type_complexity)]
    fn closest_points<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<(
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray1<u32>>,
        Bound<'py, PyArray1<u32>>,
    )> {
        let points = arrays::rows3("points", points)?.into_f64();
        let scene = self.scene.clone();
        let found = run::run(py, None, move |progress| {
            let closest = |i: usize| {
                progress.check()?;
                let p = &points[i];
                scene.closest_point(*p).ok_or_else(|| {
                    surfabet_geom::Error::invalid("points", format!("{p:?} in row {i}"), "finite")
                })
            };
            parallel::try_map_range(points.len(), closest)
        })?;
        let three = |f: &dyn Fn(&surfabet_sim::ClosestPoint) -> [f64; 3]| {
            let flat: Vec<f64> = found.iter().flat_map(f).collect();
            flat.into_pyarray(py).reshape([found.len(), 3])
        };
        Ok((
            found.iter().map(|c| c.distance).collect::<Vec<_>>().into_pyarray(py),
            three(&|c| c.point)?,
            three(&|c| c.normal)?,
            found.iter().map(|c| c.instance).collect::<Vec<_>>().into_pyarray(py),
            found.iter().map(|c| c.surface).collect::<Vec<_>>().into_pyarray(py),
        ))
    }

    fn visible<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        normals: &Bound<'py, PyAny>,
        viewpoints: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let points = arrays::rows3("points", points)?.into_f64();
        let normals = arrays::rows3("normals", normals)?.into_f64();
        let viewpoints = arrays::rows3("viewpoints", viewpoints)?.into_f64();
        if points.len() != normals.len() {
            return Err(invalid_input(format!(
                "normals has {} rows for {} points; give one per point",
                normals.len(),
                points.len()
            )));
        }
        let scene = self.scene.clone();
        let seen = run::run(py, None, move |progress| {
            let is_seen = |i: usize| -> surfabet_geom::Result<bool> {
                progress.check()?;
                Ok(viewpoints.iter().any(|v| scene.is_visible(points[i], normals[i], *v)))
            };
            parallel::try_map_range(points.len(), is_seen)
        })?;
        Ok(seen.into_pyarray(py))
    }

    /// Points (n, 3) and their truth.
    fn sample_surface<'py>(
        &self,
        py: Python<'py>,
        spacing: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, PyGroundTruth)> {
        let spacing = arguments::number("spacing", spacing, "a positive number of metres")?;
        let scene = self.scene.clone();
        let samples = run::run(py, None, move |_| scene.sample_surface(spacing))?;
        let truth = GroundTruth {
            points: samples.points.iter().map(|p| p.map(|c| c as f32)).collect(),
            normals: samples.normals,
            instances: samples.instances,
            surfaces: samples.surfaces,
        };
        let n = samples.points.len();
        let points = samples.points.into_flattened().into_pyarray(py).reshape([n, 3])?;
        Ok((points, PyGroundTruth { truth }))
    }

    #[pyo3(signature = (poses, *, width, height, intrinsics, depth_limits, depth_noise,
                        quantize_disparity, max_incidence, dropout, color_noise, translation_std,
                        rotation_std, seed, progress))]
    #[allow(clippy::too_many_arguments)]
    fn scan_rgbd(
        &self,
        py: Python<'_>,
        poses: &Bound<'_, PyAny>,
        width: u32,
        height: u32,
        intrinsics: Option<[f64; 4]>,
        depth_limits: [f64; 2],
        depth_noise: f64,
        quantize_disparity: bool,
        max_incidence: f64,
        dropout: f64,
        color_noise: f64,
        translation_std: f64,
        rotation_std: f64,
        seed: u64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(PyPointCloud, PyGroundTruth, Vec<PyFrame>)> {
        let poses = poses_of("poses", poses)?;
        let intrinsics = intrinsics.map_or_else(
            || Intrinsics::kinect(width, height),
            |[fx, fy, cx, cy]| Intrinsics { width, height, fx, fy, cx, cy },
        );
        let options = RgbdOptions {
            intrinsics,
            depth_limits,
            depth_noise,
            quantize_disparity,
            max_incidence,
            dropout,
            color_noise,
            pose_error: PoseError { translation_std, rotation_std },
            seed,
        };
        let scene = self.scene.clone();
        let (frames, fused) = run::run(py, progress, move |progress| {
            let frames = surfabet_sim::scan_rgbd(&scene, &poses, &options, progress)?;
            let fused = surfabet_sim::fuse(frames.iter().map(|f| &f.scan));
            Ok::<_, surfabet_geom::Error>((frames, fused))
        })?;
        let frames = frames.into_iter().map(PyFrame::of_camera).collect::<PyResult<_>>()?;
        Ok((fused.0.into(), PyGroundTruth { truth: fused.1 }, frames))
    }

    #[pyo3(signature = (poses, *, elevation_limits, elevation_step, azimuth_step, range_limits,
                        range_noise, dropout, color_noise, translation_std, rotation_std, seed,
                        progress))]
    #[allow(clippy::too_many_arguments)]
    fn scan_lidar(
        &self,
        py: Python<'_>,
        poses: &Bound<'_, PyAny>,
        elevation_limits: [f64; 2],
        elevation_step: f64,
        azimuth_step: f64,
        range_limits: [f64; 2],
        range_noise: f64,
        dropout: f64,
        color_noise: f64,
        translation_std: f64,
        rotation_std: f64,
        seed: u64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(PyPointCloud, PyGroundTruth, Vec<PyFrame>)> {
        let poses = poses_of("poses", poses)?;
        let options = LidarOptions {
            elevation_limits,
            elevation_step,
            azimuth_step,
            range_limits,
            range_noise,
            dropout,
            color_noise,
            pose_error: PoseError { translation_std, rotation_std },
            seed,
        };
        let scene = self.scene.clone();
        let (scans, fused) = run::run(py, progress, move |progress| {
            let scans = surfabet_sim::scan_lidar(&scene, &poses, &options, progress)?;
            let fused = surfabet_sim::fuse(&scans);
            Ok::<_, surfabet_geom::Error>((scans, fused))
        })?;
        let frames = scans.into_iter().map(PyFrame::from).collect();
        Ok((fused.0.into(), PyGroundTruth { truth: fused.1 }, frames))
    }

    fn __repr__(&self) -> String {
        let (low, high) = self.scene.interior();
        let size = std::array::from_fn::<f64, 3, _>(|a| high[a] - low[a]);
        let things = self.scene.instances().len();
        format!("Scene({:.1} x {:.1} x {:.1} m, {things} instances)", size[0], size[1], size[2])
    }
}

/// Adds this file's classes to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyScene>()?;
    module.add_class::<PyInstance>()?;
    module.add_class::<PySurface>()?;
    module.add_class::<PyGroundTruth>()?;
    module.add_class::<PyFrame>()
}
