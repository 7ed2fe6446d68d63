//! Points beside the patches: for the input that is far from what the patches decode to.

use surfabet_base::parallel;
use surfabet_geom::{Aabb, KdTree, Progress};

use super::constants::{EXTRA_CELL, POINT_CELL_IN_GAPS, POINT_TOLERANCE_IN_GAPS, TOLERANCE_SHARE};
use super::model::{PatchModel, extra_key};
use super::samples::cells::LIMIT;
use super::shared_points::with_shared_points;
use super::surface::leaf::Leaf;
use crate::error::{Error, Result};

/// Points by whose distances it is decided whether enough are near: with as many, a share is exact to a tenth of a percent.
const PROBES: usize = 100_000;

/// By how much the share of the probes must be larger than the share that is asked for.
const PROBE_MARGIN: f64 = 0.001;

/// Parts in which a model is decoded, at most: all points of a part and their tree are in memory at once, and every point of
/// the input is held against the box of each part.
const PARTS: usize = 16;

/// Patches of such a part, at least.
const LEAST_PATCHES: usize = 64;

/// Points that one task looks for neighbours of.
const BATCH: usize = 1 << 12;

/// Adds a point for every cell that holds input points further than `bound` from the cloud decoded as measured; each is within
/// `forward` of them, if that is given.
///
/// # Errors
/// [`Error::TooLarge`] for a bound that single precision does not resolve, [`Error::Cancelled`].
pub(super) fn with_points_within(
    model: PatchModel,
    positions: &[[f32; 3]],
    bound: f64,
    forward: Option<f64>,
    progress: &dyn Progress,
) -> Result<PatchModel> {
    let near = limit(positions, bound)?;
    let far = far_points(&model, &[], positions, near, progress)?;
    let forward = forward.map_or(Ok(near), |forward| limit(positions, forward))?;
    let cells = Cells::of(&model, &far, near.min(forward));
    let keys = cells.counted.into_iter().map(|(key, _)| key).collect();
    let model = model.with_extra(keys, cells.size, Some(bound));
    with_shared_points(model, &far, near.min(forward))
}

/// What [`with_share_of_points`] reaches.
#[derive(Debug, Clone, Copy)]
pub(super) struct Completeness {
    /// The share of the input that is to be near.
    pub share: f64,
    /// How far the decoded cloud may be from a point that counts as near, metres.
    pub tolerance: f64,
    /// The distance between surfaces that lie close behind one another, metres.
    pub layer_gap: Option<f64>,
    /// How far an added point may be from the input, metres.
    pub forward: Option<f64>,
}

impl Completeness {
    /// The distance beyond which points stand for the input, metres; none where no point is to be near.
    pub fn bound(&self) -> Option<f64> {
        let bound = TOLERANCE_SHARE * self.tolerance.min(self.in_gaps(POINT_TOLERANCE_IN_GAPS));
        (self.share > 0.0 && bound > 0.0).then_some(bound)
    }

    /// So many gaps between surfaces, metres; infinite without any.
    fn in_gaps(&self, gaps: f64) -> f64 {
        self.layer_gap.map_or(f64::INFINITY, |gap| gaps * gap)
    }
}

/// Adds points until the decoded cloud, as measured, is complete: those first that stand for most input points. Patches
/// `beside` those of the model count as decoded too.
///
/// # Errors
/// As [`with_points_within`].
pub(super) fn with_share_of_points(
    model: PatchModel,
    positions: &[[f32; 3]],
    beside: &[Leaf],
    wanted: Completeness,
    progress: &dyn Progress,
) -> Result<PatchModel> {
    let Some(bound) = wanted.bound() else { return Ok(model) };
    let Completeness { share, forward, .. } = wanted;
    let near = limit(positions, bound)?;
    if positions.len() > PROBES && is_reached(&model, beside, positions, bound, share, progress)? {
        return Ok(model);
    }
    let far = far_points(&model, beside, positions, near, progress)?;
    // The part of a point that exact arithmetic would not have is no reason for one point more.
    let allowed = ((1.0 - share) * positions.len() as f64 + 1e-6).floor() as usize;
    let forward = forward.map_or(Ok(near), |forward| limit(positions, forward))?;
    let of_cells = near.min(wanted.in_gaps(POINT_CELL_IN_GAPS)).min(forward);
    let Cells { mut counted, size } = Cells::of(&model, &far, of_cells);
    counted.sort_unstable_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut missing = far.len();
    let needed = counted.iter().take_while(|(_, n)| {
        let needed = missing > allowed;
        missing -= n;
        needed
    });
    let mut keys: Vec<u64> = needed.map(|cell| cell.0).collect();
    if keys.is_empty() {
        return Ok(model);
    }
    keys.sort_unstable();
    with_shared_points(model.with_extra(keys, size, None), &far, of_cells)
}

/// True when at least the `share` of the positions is within `bound` of what a model and the patches `beside` it decode to as
/// measured. Of many positions some are asked, and have to be a little more.
///
/// # Errors
/// As [`with_points_within`].
pub(super) fn is_reached(
    model: &PatchModel,
    beside: &[Leaf],
    positions: &[[f32; 3]],
    bound: f64,
    share: f64,
    progress: &dyn Progress,
) -> Result<bool> {
    let near = limit(positions, bound)?;
    let step = positions.len().div_ceil(PROBES).max(1);
    let margin = if step > 1 { PROBE_MARGIN } else { 0.0 };
    let probes: Vec<[f32; 3]> = positions.iter().copied().step_by(step).collect();
    let far = far_points(model, beside, &probes, near, progress)?;
    Ok(far.len() as f64 <= (1.0 - share - margin) * probes.len() as f64 + 1e-6)
}

/// The bound less what rounding of coordinates to single precision may add.
pub(super) fn limit(positions: &[[f32; 3]], bound: f64) -> Result<f64> {
    let extent = positions.iter().flat_map(|p| p.map(|c| f64::from(c.abs()))).fold(0.0, f64::max);
    let limit = bound - 4.0 * extent * f64::from(f32::EPSILON);
    let largest = f64::from(LIMIT) * 0.5 * bound;
    if limit < 0.5 * bound || extent > largest {
        return Err(Error::TooLarge { extent, limit: largest, resolution: bound });
    }
    Ok(limit)
}

/// The `positions` that are further than `limit` from all that the patches, those of instances and those `beside` them decode to as measured.
fn far_points(
    model: &PatchModel,
    beside: &[Leaf],
    positions: &[[f32; 3]],
    limit: f64,
    progress: &dyn Progress,
) -> Result<Vec<[f32; 3]>> {
    let mut seen_near = vec![false; positions.len()];
    let patches = model.len().div_ceil(PARTS).max(LEAST_PATCHES);
    let mut look_at = |decoded: Vec<[f32; 3]>| -> Result<()> {
        // Patches decode to at least a point each.
        let Some(bounds) = Aabb::of(decoded.iter().copied()) else { return Ok(()) };
        let tree = KdTree::new(&decoded)?;
        drop(decoded);
        let is_near = |squared: f32| f64::from(squared).sqrt() <= limit;
        let is_near_part = |p: [f32; 3]| {
            let nearest = || tree.nearest(p).is_some_and(|n| is_near(n.squared_distance()));
            is_near(bounds.squared_distance(p)) && nearest()
        };
        let batches = positions.chunks(BATCH).zip(seen_near.chunks_mut(BATCH));
        parallel::try_for_each(batches, |_, (positions, seen_near)| -> Result<()> {
            progress.check()?;
            for (&p, seen) in positions.iter().zip(seen_near) {
                *seen = *seen || is_near_part(p);
            }
            Ok(())
        })
    };
    for part in model.leaves().chunks(patches).chain(beside.chunks(patches)) {
        look_at(model.positions_as_measured(part, progress)?)?;
    }
    for (instance, motion) in model.instances().all.iter().zip(model.instances().motions()) {
        let of_instance: Vec<&Leaf> = model.patches_of(instance).map(|(_, leaf)| leaf).collect();
        for part in of_instance.chunks(patches) {
            look_at(model.positions_of_instance(part, &motion, progress)?)?;
        }
    }
    let far = positions.iter().zip(seen_near).filter(|(_, seen)| !seen);
    Ok(far.map(|(&p, _)| p).collect())
}

/// Cells of the lattice's frame that hold points.
struct Cells {
    /// Key and number of points of each, by growing key.
    counted: Vec<(u64, usize)>,
    /// Side, metres.
    size: f64,
}

impl Cells {
    /// The cells of some points, so small that all of them are within `limit` of their middles.
    fn of(model: &PatchModel, points: &[[f32; 3]], limit: f64) -> Self {
        let size = EXTRA_CELL * limit;
        let rows = model.lattice().orientation.rotation();
        let to_lattice = |p: [f32; 3]| -> [f32; 3] {
            std::array::from_fn(|a| {
                (0..3).map(|k| rows[k][a] * f64::from(p[k])).sum::<f64>() as f32
            })
        };
        let mut keys: Vec<u64> = parallel::map(points, |&p| extra_key(to_lattice(p), size));
        parallel::sort_keys(&mut keys);
        let counted = keys.chunk_by(|a, b| a == b).map(|run| (run[0], run.len())).collect();
        Self { counted, size }
    }
}
