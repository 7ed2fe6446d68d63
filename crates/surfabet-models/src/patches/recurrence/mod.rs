//! What recurs in a scene: patches that are left out where others, moved, give the same surface.
//!
//! | file | step |
//! |---|---|
//! | `surface` | the model's surface as pixels, and what it costs to be described by it |
//! | `keypoints` | places that can be told from most others, with their descriptors |
//! | `votes` | motions that keypoints with similar descriptors agree on |
//! | `refine` | these motions, to where surface lies on surface |
//! | `seen` | what the scan shows at each patch |
//! | `fit` | what is won with a motion at each patch |
//! | `assign` | which patches are left out |

mod assign;
mod fit;
mod keypoints;
mod refine;
mod seen;
mod surface;
mod votes;

use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_entropy::Price;
use surfabet_geom::{PointCloud, Progress};

use self::assign::{Assigned, assign};
use self::fit::Prices;
use self::keypoints::keypoints;
use self::refine::refined;
use self::seen::Seen;
use self::surface::SurfacePixels;
use self::votes::candidates;
use super::attributes::chosen::ChosenAttributes;
use super::coding::{Geometry, GeometryModels, code_geometry};
use super::instances::{Instance, Instances, Motion, Place};
use super::model::{Lattice, SheetTree, Square};
use super::options::PatchesOptions;
use super::samples::SidedSamples;
use super::supported::Support;
use super::surface::leaf::Leaf;
use super::whole::Described;
use crate::error::Result;

/// What a model without instances was made of.
pub(super) struct Learned<'a> {
    pub lattice: Lattice,
    pub coded: &'a Described,
    pub samples: &'a SidedSamples<'a>,
    pub chosen: &'a ChosenAttributes<'a>,
    /// Bytes of the geometry.
    pub geometry_bytes: f64,
    /// Samples of a pixel.
    pub density: f64,
    /// Distance from the surface from which on a sample asks for a point beside the patches, metres.
    pub tolerance: f64,
}

/// The patches that are still coded where others are given again, and what is; `None` where nothing is won. With
/// `max_error_forward` only patches are given again that are near the input there.
///
/// # Errors
/// [`crate::Error::Cancelled`]; [`crate::Error::InvalidParameter`] for a bound that single precision does not resolve.
pub(super) fn recurring(
    learned: &Learned<'_>,
    cloud: &PointCloud,
    options: &PatchesOptions,
    progress: &dyn Progress,
) -> Result<Option<(Geometry, Instances)>> {
    let &Learned { lattice, coded: Described { geometry, attributes, .. }, .. } = learned;
    let Some(surface) = SurfacePixels::new(&lattice, &geometry.leaves)? else { return Ok(None) };
    let axis = vertical_axis(&lattice);
    let keypoints = keypoints(&surface, axis);
    progress.check()?;
    let candidates = candidates(&keypoints, axis);
    progress.check()?;
    let refined = parallel::map(&candidates, |of| refined(&surface, &keypoints, of, axis));
    let places =
        different(refined.into_iter().flatten().filter(|&place| place != Place::default()));
    if places.is_empty() {
        return Ok(None);
    }
    let attributes = (attributes, learned.chosen);
    let tolerance = (learned.tolerance / lattice.pixel_size) as f32;
    let options_and_tolerance = (options, tolerance);
    let seen = Seen::new(
        learned.samples,
        &lattice,
        &surface,
        attributes,
        options_and_tolerance,
        progress,
    )?;
    let lambda = (options.rate * learned.density) as f32;
    let bits = bits_of(learned);
    let prices = Prices::new(&surface, &seen, bits, [lambda, learned.density as f32, tolerance]);
    let support = match options.max_error_forward {
        Some(bound) => Some(Support::new(lattice, &geometry.leaves, cloud, bound)?),
        None => None,
    };
    let mut fits = Vec::with_capacity(places.len());
    for (i, &place) in places.iter().enumerate() {
        progress.update("finding what recurs", i as f32 / places.len() as f32);
        let motion = Motion::new(place, axis as u8);
        let allowed = |source: u32| {
            let leaf = &geometry.leaves[source as usize];
            support.as_ref().is_none_or(|support| support.holds(leaf, &motion))
        };
        fits.push(prices.fits(&motion, allowed, progress)?);
    }
    let assigned = assign(&prices, &fits);
    if assigned.gain <= 0.0 {
        return Ok(None);
    }
    Ok(Some(without(lattice, geometry, &assigned, &places, axis as u8)))
}

/// The axis of the lattice that is nearest to the world's third.
fn vertical_axis(lattice: &Lattice) -> usize {
    let rotation = lattice.orientation.rotation();
    let upright = |axis: usize| rotation[2][axis].abs();
    (0..3).max_by(|&a, &b| upright(a).total_cmp(&upright(b)).then(b.cmp(&a))).unwrap_or(2)
}

/// Places of which none is within a pixel of one before it.
fn different(places: impl Iterator<Item = Place>) -> Vec<Place> {
    let mut found: Vec<Place> = Vec::new();
    for place in places {
        let is_same = |other: &Place| {
            let turns = |of: &Place| (of.mirrored, of.quarters);
            let near = |a: usize| (other.shift[a] - place.shift[a]).abs() <= 8;
            turns(other) == turns(&place)
                && (other.angle - place.angle).abs() <= 16
                && (0..3).all(near)
        };
        if !found.iter().any(is_same) {
            found.push(place);
        }
    }
    found
}

/// Bits of each patch with its attributes, by what it has of what takes bits: coefficients, outlines, cells.
fn bits_of(learned: &Learned<'_>) -> Vec<f32> {
    let Learned { lattice, coded, geometry_bytes, .. } = learned;
    let parts = |leaf: &Leaf| {
        let mask = leaf.patch.mask;
        // Pixels that differ from the one before them in their row or column.
        let outline = (mask ^ mask << 1).count_ones() + (mask ^ mask << 8).count_ones();
        let shapes = leaf.patch.coefficients.iter().filter(|&&c| c != 0).count();
        let layers = f64::from(leaf.patch.thickness) / 2.0 + 1.0;
        let cells = f64::from(leaf.area(lattice)) * layers;
        [2.0 + shapes as f64 + 0.25 * f64::from(outline), cells]
    };
    let parts: Vec<[f64; 2]> = coded.geometry.leaves.iter().map(parts).collect();
    let total = |k: usize| parts.iter().map(|p| p[k]).sum::<f64>().max(1.0);
    let per = [8.0 * geometry_bytes / total(0), coded.attribute_bits() / total(1)];
    parts.iter().map(|p| (p[0] * per[0] + p[1] * per[1]) as f32).collect()
}

/// The geometry without the patches that are left out, and the instances that stand for them.
fn without(
    lattice: Lattice,
    geometry: &Geometry,
    assigned: &Assigned,
    places: &[Place],
    axis: u8,
) -> (Geometry, Instances) {
    let mut left_out = assigned.left_out.iter().copied();
    let mut next = || left_out.next().unwrap_or(false);
    let kept = geometry.sheets.iter().filter_map(|sheet| {
        let root = kept(&sheet.root, &mut next);
        (root != Square::Empty).then_some(SheetTree { root, ..*sheet })
    });
    let kept: Vec<SheetTree> = kept.collect();
    let models = &mut GeometryModels::default();
    let Ok(coded) = code_geometry(&mut Price::default(), models, lattice, &kept, usize::MAX);
    // The order of tiles follows from the first of them, which may be another one now.
    let key = |leaf: &Leaf| {
        let Leaf { side, level, corner, patch } = *leaf;
        (side, level, corner, patch.mask, patch.coefficients, patch.thickness)
    };
    let numbers: BTreeMap<_, u32> =
        (0..).zip(&coded.leaves).map(|(i, leaf)| (key(leaf), i)).collect();
    let number = |&source: &u32| numbers.get(&key(&geometry.leaves[source as usize])).copied();
    let of_motion = |(&place, sources): (&Place, &Vec<u32>)| {
        let mut patches: Vec<u32> = sources.iter().filter_map(number).collect();
        patches.sort_unstable();
        patches.dedup();
        (!patches.is_empty()).then_some(Instance { place, patches, points: Vec::new() })
    };
    let all = places.iter().zip(&assigned.sources).filter_map(of_motion).collect();
    (coded, Instances { axis, all })
}

/// What is left of a square without the patches of `is_left_out`, one after another in the order of the file.
fn kept(square: &Square, is_left_out: &mut impl FnMut() -> bool) -> Square {
    match square {
        Square::Empty => Square::Empty,
        Square::Patch(_) if is_left_out() => Square::Empty,
        Square::Patch(patch) => Square::Patch(patch.clone()),
        Square::Split(children) => {
            let left: [Square; 4] = std::array::from_fn(|i| kept(&children[i], is_left_out));
            match left.iter().all(|child| *child == Square::Empty) {
                true => Square::Empty,
                false => Square::Split(Box::new(left)),
            }
        }
    }
}
