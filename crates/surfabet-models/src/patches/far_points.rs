//! Points beside the patches: for the input that is far from what the patches decode to.

use surfabet_base::parallel;
use surfabet_geom::Progress;
use surfabet_geom::morton::MortonMap;

use super::axes::to_axes;
use super::constants::{
    POINT_CELL_IN_GAPS, POINT_CELL_IN_PIXELS, POINT_TOLERANCE_IN_GAPS, TOLERANCE_SHARE,
};
use super::cover::Cover;
use super::decode::{LastFound, MeasuredReach, PlacedPatch};
use super::instances::Motion;
use super::model::{Lattice, PatchModel, extra_key};
use super::samples::cells::LIMIT;
use super::surface::leaf::Leaf;
use crate::error::Result;
use crate::extent::too_small;

/// Points by whose distances it is decided whether enough are near: the share that they give has a standard deviation of 0.00016 where
/// it is to be 0.99.
const PROBES: usize = 400_000;

/// By how much the share of the probes must be larger than the share that is asked for: three such deviations.
const PROBE_MARGIN: f64 = 0.0005;

/// Roundings to single precision on the way from a patch to a decoded position, each of less than `f32::EPSILON` of its distance from the
/// origin: up to four where it is moved, and where it is turned.
const DECODE_ROUNDINGS: f64 = 8.0;

/// Points that one task decides about.
const BATCH: usize = 1 << 12;

/// Adds points so that all input further than `bound` from the cloud decoded as measured is near to one; each is within `forward` of such
/// input, if that is given.
///
/// # Errors
/// [`Error::InvalidParameter`] for a bound that single precision does not resolve, [`Error::Cancelled`].
pub(super) fn with_points_within(
    model: PatchModel,
    input: FoldedInput<'_>,
    bound: f64,
    forward: Option<f64>,
    progress: &dyn Progress,
) -> Result<PatchModel> {
    let positions = input.positions;
    let near = limit(positions, bound)?;
    let motions = model.instances().motions();
    let patches = patches_of(&model, &motions, &[]);
    let far = far_points(model.lattice(), patches, positions, near, progress)?;
    let of_forward = forward.map_or(Ok(near), |forward| limit(positions, forward))?;
    let (cover, of_points) = input.cover(&model, &far, near.min(of_forward), forward);
    let keys = cover.of_all();
    let shared = shared(&cover, &keys, &of_points, motions.len());
    Ok(model.with_extra(keys.clone(), cover.size(), Some(bound)).with_shared_extra(keys, shared))
}

/// Input with the instance that stands for each point, and one more; 0 where none does. All stay where no numbers are given.
#[derive(Clone, Copy)]
pub(super) struct FoldedInput<'a> {
    pub positions: &'a [[f32; 3]],
    pub fold: &'a [u16],
}

impl FoldedInput<'_> {
    /// Points to be covered, those of instances where their sources are if others are in the same cell there, and the instance of each, as
    /// of the input.
    fn cover(
        &self,
        model: &PatchModel,
        far: &[u32],
        limit: f64,
        forward: Option<f64>,
    ) -> (Cover, Vec<u16>) {
        let lattice = model.lattice();
        let rows = lattice.orientation.rotation();
        let motions = model.instances().motions();
        let pixel = lattice.pixel_size;
        let size = Cover::size_of(limit);
        let in_axes: Vec<[f32; 3]> =
            parallel::map(far, |&i| to_axes(&rows, self.positions[i as usize]).map(|c| c as f32));
        let of = |i: u32| self.fold.get(i as usize).copied().unwrap_or(0);
        let staying = far.iter().zip(&in_axes).filter(|(i, _)| of(**i) == 0);
        let staying: MortonMap<()> = staying.map(|(_, &p)| (extra_key(p, size), ())).collect();
        let placed: Vec<([f32; 3], u16)> = parallel::map_range(far.len(), |k| {
            let (p, m) = (in_axes[k], of(far[k]));
            if m == 0 {
                return (p, 0);
            }
            let pixels = p.map(|c| f64::from(c) / pixel);
            let source = motions[usize::from(m) - 1].exact_source_of(pixels);
            let source = source.map(|c| (c * pixel) as f32);
            match forward.is_none() || staying.contains_key(&extra_key(source, size)) {
                true => (source, m),
                false => (p, 0),
            }
        });
        let (points, of): (Vec<[f32; 3]>, Vec<u16>) = placed.into_iter().unzip();
        (Cover::new(&points, limit), of)
    }
}

/// The numbers of the points of each of `n` instances: those that cover input which it stands for.
fn shared(cover: &Cover, keys: &[u64], of_points: &[u16], n: usize) -> Vec<Vec<u32>> {
    let mut of_instances = vec![Vec::new(); n];
    for (number, &key) in (0..).zip(keys) {
        for input in cover.input_of(key) {
            let m = usize::from(of_points[input as usize]);
            if m > 0 && of_instances[m - 1].last() != Some(&number) {
                of_instances[m - 1].push(number);
            }
        }
    }
    of_instances
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
    input: FoldedInput<'_>,
    beside: &[Leaf],
    wanted: Completeness,
    progress: &dyn Progress,
) -> Result<PatchModel> {
    let Some(bound) = wanted.bound() else { return Ok(model) };
    let Completeness { share, forward, .. } = wanted;
    let positions = input.positions;
    let near = limit(positions, bound)?;
    let motions = model.instances().motions();
    let patches = || patches_of(&model, &motions, beside);
    let lattice = model.lattice();
    if positions.len() > PROBES
        && is_reached(lattice, patches(), positions, bound, share, progress)?
    {
        return Ok(model);
    }
    let far = far_points(lattice, patches(), positions, near, progress)?;
    // The part of a point that exact arithmetic would not have is no reason for one point more.
    let allowed = ((1.0 - share) * positions.len() as f64 + 1e-6).floor() as usize;
    let of_forward = forward.map_or(Ok(near), |forward| limit(positions, forward))?;
    let of_pixels = POINT_CELL_IN_PIXELS * lattice.pixel_size;
    let of_cells = near.min(wanted.in_gaps(POINT_CELL_IN_GAPS)).min(of_pixels).min(of_forward);
    let (cover, of_points) = input.cover(&model, &far, of_cells, forward);
    let keys = cover.of_most(allowed);
    if keys.is_empty() {
        return Ok(model);
    }
    let shared = shared(&cover, &keys, &of_points, motions.len());
    Ok(model.with_extra(keys.clone(), cover.size(), None).with_shared_extra(keys, shared))
}

/// True when at least the `share` of the positions is within `bound` of what patches decode to as measured. Of many positions some
/// are asked, and have to be a little more.
///
/// # Errors
/// As [`with_points_within`].
pub(super) fn is_reached<'a>(
    lattice: Lattice,
    patches: impl Iterator<Item = PlacedPatch<'a>>,
    positions: &[[f32; 3]],
    bound: f64,
    share: f64,
    progress: &dyn Progress,
) -> Result<bool> {
    let near = limit(positions, bound)?;
    let step = positions.len().div_ceil(PROBES).max(1);
    let margin = if step > 1 { PROBE_MARGIN } else { 0.0 };
    let probes: Vec<[f32; 3]> = positions.iter().copied().step_by(step).collect();
    let far = far_points(lattice, patches, &probes, near, progress)?;
    Ok(far.len() as f64 <= (1.0 - share - margin) * probes.len() as f64 + 1e-6)
}

/// The least bound that points reach whose coordinates are up to `extent`, metres; see [`limit`].
pub(super) fn least_bound(extent: f64) -> f64 {
    // A little more, for the rounding of the product.
    1.000_001 * 2.0 * extent / f64::from(LIMIT)
}

/// The bound less what rounding of coordinates to single precision may add.
pub(super) fn limit(positions: &[[f32; 3]], bound: f64) -> Result<f64> {
    let extent = largest_coordinate(positions);
    let limit = bound - 4.0 * extent * f64::from(f32::EPSILON);
    let largest = f64::from(LIMIT) * 0.5 * bound;
    if limit < 0.5 * bound || extent > largest {
        let of_rounding = 8.0 * extent * f64::from(f32::EPSILON);
        let least = of_rounding.max(2.0 * extent / f64::from(LIMIT));
        return Err(too_small("max_error", bound, least, extent));
    }
    Ok(limit)
}

/// The patches of a model, those of its instances, and those `beside` them.
fn patches_of<'a>(
    model: &'a PatchModel,
    motions: &'a [Motion],
    beside: &'a [Leaf],
) -> impl Iterator<Item = PlacedPatch<'a>> {
    let coded = model.leaves().iter().chain(beside).map(|leaf| (leaf, None));
    let of_instances = model.instances().all.iter().zip(motions).flat_map(|(instance, motion)| {
        model.patches_of(instance).map(move |(_, leaf)| (leaf, Some(motion)))
    });
    coded.chain(of_instances)
}

/// Numbers of the `positions` that are further than `limit` from all that patches decode to as measured.
fn far_points<'a>(
    lattice: Lattice,
    patches: impl Iterator<Item = PlacedPatch<'a>>,
    positions: &[[f32; 3]],
    limit: f64,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let rounding = DECODE_ROUNDINGS * largest_coordinate(positions) * f64::from(f32::EPSILON);
    let near = (limit - rounding).max(0.0);
    let reach = MeasuredReach::new(lattice, patches, near)?;
    let far = parallel::try_map_range(positions.len().div_ceil(BATCH), |b| -> Result<Vec<u32>> {
        let start = b * BATCH;
        progress.check()?;
        let mut last = LastFound::default();
        let all = start..positions.len().min(start + BATCH);
        Ok(all.filter(|&i| !reach.is_near(positions[i], &mut last)).map(|i| i as u32).collect())
    })?;
    Ok(far.concat())
}

/// Largest coordinate of some positions, either sign, metres about the origin.
fn largest_coordinate(positions: &[[f32; 3]]) -> f64 {
    positions.iter().flat_map(|p| p.map(|c| f64::from(c.abs()))).fold(0.0, f64::max)
}
