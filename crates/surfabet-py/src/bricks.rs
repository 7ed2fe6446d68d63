//! Points by the bricks of the world, for clouds on disk.

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use surfabet_geom::{
    BRICK_HALF, BrickRun, Bricks, CloudParts, InBricks, PointCloud, Result, positions_of_records,
};

use crate::arrays;
use crate::cloud::{PyPointCloud, cloud_of};
use crate::errors::invalid_input;
use crate::run::run;

/// Keys and counts of bricks, numbers of the points, and their positions from the corners.
type Sorted<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray2<f32>>,
);

/// The points of a cloud brick by brick.
#[pyfunction]
fn sort_by_bricks<'py>(
    py: Python<'py>,
    cloud: &Bound<'py, PyAny>,
    side: f64,
    base: [i64; 3],
) -> PyResult<Sorted<'py>> {
    let cloud = &cloud_of("cloud", cloud)?.get().cloud;
    let found = run(py, None, |_| -> Result<InBricks> { Ok(Bricks { side, base }.sort(cloud)) })?;
    // Keys take 63 bits.
    let keys: Vec<i64> = found.keys.into_iter().map(|key| key as i64).collect();
    let counts: Vec<i64> = found.counts.into_iter().map(|count| count as i64).collect();
    let n = found.positions.len();
    let positions = Array2::from_shape_vec([n, 3], found.positions.into_flattened());
    let positions = positions.map_err(invalid_input)?.into_pyarray(py);
    Ok((keys.into_pyarray(py), counts.into_pyarray(py), found.order.into_pyarray(py), positions))
}

/// The points of records, each `size` bytes that begin with a position from the corner of its brick: `counts` of each brick, with
/// its corner from `origin`.
#[pyfunction]
fn cloud_of_records(
    py: Python<'_>,
    records: PyReadonlyArray1<'_, u8>,
    size: usize,
    counts: Vec<usize>,
    corners: &Bound<'_, PyAny>,
    origin: [f64; 3],
) -> PyResult<PyPointCloud> {
    let records = records.as_slice().map_err(invalid_input)?;
    let corners = arrays::rows3("corners", corners)?.into_f64();
    let n: Option<usize> = counts.iter().try_fold(0_usize, |n, &count| n.checked_add(count));
    let n_bytes = n.and_then(|n| n.checked_mul(size));
    if size < 12 || n_bytes != Some(records.len()) || counts.len() != corners.len() {
        return Err(invalid_input("records, counts and corners do not fit one another"));
    }
    let run_of = |(count, corner)| BrickRun { count, corner };
    let runs: Vec<BrickRun> = counts.into_iter().zip(corners).map(run_of).collect();
    let (cloud, _) = run(py, None, |_| {
        let positions = positions_of_records(records, size, &runs);
        PointCloud::from_parts(CloudParts { origin, positions, ..CloudParts::default() })
    })?;
    Ok(cloud.into())
}

/// Adds this file's names to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("BRICK_HALF", BRICK_HALF)?;
    module.add_function(wrap_pyfunction!(sort_by_bricks, module)?)?;
    module.add_function(wrap_pyfunction!(cloud_of_records, module)?)
}
