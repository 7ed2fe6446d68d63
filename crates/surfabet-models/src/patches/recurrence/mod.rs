//! What recurs in a scene: copies are moved onto the first of them, of all of which the model is learned then.
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
//! | `fold` | the scene with the samples of these moved onto what they are copies of |

mod assign;
mod fit;
mod fold;
mod keypoints;
mod refine;
mod seen;
mod surface;
mod votes;

use surfabet_base::parallel;
use surfabet_geom::{PointCloud, Progress};

use self::assign::assign;
use self::fit::Prices;
pub(super) use self::fold::Fold;
use self::keypoints::keypoints;
use self::refine::refined;
use self::seen::Seen;
use self::surface::SurfacePixels;
use self::votes::candidates;
use super::attributes::chosen::ChosenAttributes;
use super::instances::{Motion, Place};
use super::model::Lattice;
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
    /// How many points there are.
    pub n_points: usize,
    /// Bytes of the geometry.
    pub geometry_bytes: f64,
    /// Samples of a pixel.
    pub density: f64,
    /// Distance from the surface from which on a sample asks for a point beside the patches, metres.
    pub tolerance: f64,
}

/// Which parts of the scene are moved onto which others; `None` where nothing is won. With `max_error_forward` only patches are given
/// again that are near the input there.
///
/// # Errors
/// [`crate::Error::Cancelled`]; [`crate::Error::InvalidParameter`] for a bound that single precision does not resolve.
pub(super) fn recurring(
    learned: &Learned<'_>,
    cloud: &PointCloud,
    options: &PatchesOptions,
    progress: &dyn Progress,
) -> Result<Option<Fold>> {
    let &Learned { lattice, coded: Described { geometry, attributes, .. }, .. } = learned;
    let Some(surface) = SurfacePixels::new(&lattice, &geometry.leaves)? else { return Ok(None) };
    let axis = vertical_axis(&lattice);
    let places = places(&surface, axis, progress)?;
    if places.is_empty() {
        return Ok(None);
    }
    let attributes = (attributes, learned.chosen);
    let tolerance = (learned.tolerance / lattice.pixel_size) as f32;
    let asked = (options, tolerance);
    let seen = Seen::new(learned.samples, &lattice, &surface, attributes, asked, progress)?;
    let lambda = (options.rate * learned.density) as f32;
    let bits = bits_of(learned);
    let prices = Prices::new(&surface, &seen, bits, [lambda, learned.density as f32, tolerance]);
    let support = support(lattice, &geometry.leaves, cloud, options)?;
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
    let mut assigned = assign(&prices, &fits);
    if assigned.gain <= 0.0 {
        return Ok(None);
    }
    prices.spread(&mut assigned.of_leaves);
    Ok(Some(Fold::new(learned, &surface, assigned.of_leaves, &places, axis as u8)))
}

/// Places that parts of a surface may recur at.
fn places(surface: &SurfacePixels<'_>, axis: usize, progress: &dyn Progress) -> Result<Vec<Place>> {
    let keypoints = keypoints(surface, axis);
    progress.check()?;
    let candidates = candidates(&keypoints, axis);
    progress.check()?;
    let refined = parallel::map(&candidates, |of| refined(surface, &keypoints, of, axis));
    Ok(different(refined.into_iter().flatten().filter(|&place| place != Place::default())))
}

/// What patches that are given again must be near to; `None` where any may be.
///
/// # Errors
/// [`crate::Error::InvalidParameter`] for a bound that single precision does not resolve.
pub(super) fn support(
    lattice: Lattice,
    leaves: &[Leaf],
    cloud: &PointCloud,
    options: &PatchesOptions,
) -> Result<Option<Support>> {
    let of_bound = |bound| Support::new(lattice, leaves, cloud, bound);
    options.max_error_forward.map(of_bound).transpose()
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
