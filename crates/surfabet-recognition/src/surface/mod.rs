//! The surface that a model describes, as evenly spaced oriented samples.
//!
//! | file | what it does |
//! |---|---|
//! | `sampling` | raw samples of every occurrence |
//! | `mod` | one sample per cube, and how similar their colours are |
//! | `pieces` | the smooth pieces that the samples fall into |

mod pieces;
mod sampling;

use surfabet_base::parallel;
use surfabet_geom::Progress;
use surfabet_geom::vector::{self, minus};
use surfabet_models::alphabet::{AlphabetModel, Occurrence};
use surfabet_models::{Result, to_ycocg};

use self::sampling::{RawSample, most_samples, raw_samples};
use super::constants::LUMA_TOLERANCE;

/// Samples, one per cube whose side is the spacing, and per axis that normals are nearest to.
pub(super) struct SurfaceSamples {
    /// Metres from the corner of the lattice.
    pub points: Vec<[f32; 3]>,
    /// Unit normals, towards the sensor where one is known.
    pub normals: Vec<[f32; 3]>,
    /// The occurrence that each sample is of; of several, the first.
    pub occurrences: Vec<u32>,
    /// Luma, orange and green chroma, 0 to 255, where the model has colours.
    pub colors: Option<Vec<[f32; 3]>>,
    /// The same of all occurrences.
    pub hues: Option<Vec<[f32; 3]>>,
    /// Radius of the words that each colour is the mean of, metres; nothing without colours.
    pub color_radii: Vec<f32>,
    /// Metres.
    pub spacing: f64,
}

impl SurfaceSamples {
    /// # Errors
    /// [`surfabet_models::Error::TooManyPoints`], [`surfabet_models::Error::Cancelled`].
    pub fn of(model: &AlphabetModel, spacing: f64, progress: &dyn Progress) -> Result<Self> {
        let occurrences: Vec<Occurrence> = model.occurrences().collect();
        let unsorted = raw_samples(model, &occurrences, spacing, progress)?;
        progress.check()?;
        // Within a cube the order is that of the occurrences.
        let cube = |i: u32| unsorted[i as usize].cube;
        let mut order: Vec<u32> = (0..unsorted.len() as u32).collect();
        parallel::sort_numbers_by(&mut order, &|i, j| cube(i).cmp(&cube(j)).then(i.cmp(&j)));
        let raw: Vec<RawSample> = order.into_iter().map(|i| unsorted[i as usize]).collect();
        let to_hue = |rgb: &[u8; 3]| to_ycocg(rgb.map(f32::from));
        let hues: Option<Vec<[f32; 3]>> =
            model.colors().map(|colors| colors.iter().map(to_hue).collect());
        let mut surface = Self {
            points: Vec::new(),
            normals: Vec::new(),
            occurrences: Vec::new(),
            colors: hues.as_ref().map(|_| Vec::new()),
            hues,
            color_radii: Vec::new(),
            spacing,
        };
        for same in raw.chunk_by(|a, b| a.cube == b.cube) {
            let (point, normal) = mean_sample(same);
            surface.points.push(point);
            surface.normals.push(normal);
            surface.occurrences.push(same[0].occurrence);
            if let (Some(hues), Some(colors)) = (&surface.hues, &mut surface.colors) {
                let (color, radius) = mean_color(same, hues, &occurrences);
                colors.push(color);
                surface.color_radii.push(radius);
            }
        }
        Ok(surface)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.points.len()
    }
}

/// The closest spacing, at least `spacing`, at which a model has no more than `most` raw samples; infinite where it has more words.
pub(super) fn spacing_for(model: &AlphabetModel, spacing: f64, most: u64) -> f64 {
    let occurrences: Vec<Occurrence> = model.occurrences().collect();
    let most = most as f64;
    if occurrences.len() as f64 > most {
        return f64::INFINITY;
    }
    let mut spacing = spacing;
    loop {
        let n = most_samples(&occurrences, spacing);
        if n <= most {
            return spacing;
        }
        // A little more than their area asks for, since whole samples are counted.
        spacing *= (n / most).sqrt().max(1.01);
    }
}

/// Similarity of two colours (luma, orange, green), 1 to 0: `exp(-((l / LUMA_TOLERANCE)^2 + o^2 + g^2) / (2 t^2))` of their
/// differences l, o and g with the standard deviation `tolerance` of chromas.
pub(super) fn color_similarity(a: [f32; 3], b: [f32; 3], tolerance: f64) -> f64 {
    let [luma, orange, green] = minus(a, b).map(f64::from);
    let squared = (luma / LUMA_TOLERANCE).powi(2) + orange * orange + green * green;
    (-0.5 * squared / (tolerance * tolerance)).exp()
}

/// Mean position and normal of the samples of a cube. Both sides of a thin object can fall into one cube: normals are
/// turned to the side of the first.
fn mean_sample(same: &[RawSample]) -> ([f32; 3], [f32; 3]) {
    let first = &same[0];
    let (mut point, mut normal) = ([0.0; 3], [0.0; 3]);
    for r in same {
        let dot: f64 = (0..3).map(|a| first.normal[a] * r.normal[a]).sum();
        (0..3).for_each(|a| point[a] += r.point[a]);
        (0..3).for_each(|a| normal[a] += dot.signum() * r.normal[a]);
    }
    let length = vector::length(normal);
    (point.map(|c| (c / same.len() as f64) as f32), normal.map(|c| (c / length) as f32))
}

/// Mean colour and radius of the words of a cube, weighted by `1 / radius^2`: the colour of a small word is that of a smaller
/// place.
fn mean_color(
    same: &[RawSample],
    hues: &[[f32; 3]],
    occurrences: &[Occurrence],
) -> ([f32; 3], f32) {
    let (mut sum, mut radii, mut all) = ([0.0; 3], 0.0, 0.0);
    for r in same {
        let k = r.occurrence as usize;
        let weight = occurrences[k].radius.powi(-2) as f32;
        (0..3).for_each(|c| sum[c] += weight * hues[k][c]);
        radii += weight * occurrences[k].radius as f32;
        all += weight;
    }
    (sum.map(|c| c / all), radii / all)
}
