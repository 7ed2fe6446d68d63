//! Candidates: words that may occur somewhere, with what each would explain.
//!
//! | file | step |
//! |---|---|
//! | `planes` | planes at every cell, rounded to integers, with what the surface about them looks like |
//! | `descriptor` | the surface about a pose as an image of heights |
//! | `clusters` | words from the descriptors, and the words nearest to a descriptor |
//! | `mod` | those words in place of the planes |
//! | `coverage` | the points that an occurrence explains, and its outliers |

mod clusters;
mod coverage;
mod descriptor;
mod planes;

use surfabet_base::parallel;
use surfabet_geom::Progress;

pub(super) use self::clusters::{cluster_words, nearest_words};
pub(super) use self::coverage::{Coverage, WordSamples, sample_grid};
pub(super) use self::descriptor::Descriptor;
pub(super) use self::planes::{CandidatePlane, PlaneSearch, find_planes};
use super::choice::Prices;
use super::constants::{PLANE_DISTANCE, WORDS_PER_PLACE};
use super::placement::{Placement, WordPose};
use super::scene::{Cells, LatticeScene, LocalPoint, Rows, local_points};
use super::word::Word;
use crate::error::Result;

/// An occurrence that may be chosen.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    pub placement: Placement,
    /// The pose that the placement stands for.
    pub pose: WordPose,
    pub coverage: Coverage,
}

/// Sorts candidates by placement that are sorted by all of it but the word and what follows it.
pub(super) fn sort_within_places(candidates: &mut [Candidate]) {
    let place = |c: &Candidate| Placement { word: 0, view: 0, ..c.placement };
    let places = candidates.chunk_by_mut(|a, b| place(a) == place(b));
    places.for_each(|same| same.sort_by_key(|c| c.placement));
}

/// Words in the places of planes, all of one scale.
pub(super) struct WordPlaces<'a> {
    pub scene: &'a LatticeScene,
    pub cells: &'a Cells,
    pub planes: &'a [CandidatePlane],
    pub words: &'a [Word],
    /// Distance of samples, in sigma.
    pub spacing: f64,
    pub prices: &'a Prices,
}

/// Buffers for the points about a place.
struct Buffers<'a> {
    rows: Rows,
    around: Vec<u32>,
    points: Vec<LocalPoint>,
    samples: WordSamples<'a>,
}

impl WordPlaces<'_> {
    /// Per plane those that pay for themselves of the words whose descriptors are nearest to that of the plane.
    pub fn words(&self, progress: &dyn Progress) -> Result<Vec<Vec<Candidate>>> {
        let descriptors: Vec<Descriptor> = self.words.iter().map(Descriptor::of_word).collect();
        let buffers = || Buffers {
            rows: Rows::default(),
            around: Vec::new(),
            points: Vec::new(),
            samples: WordSamples::new(self.words),
        };
        parallel::try_map_range_with(self.planes.len(), buffers, |buffers, k| {
            progress.check()?;
            Ok(self.words_at(&self.planes[k], &descriptors, buffers))
        })
    }

    /// The plane itself is not among them, and none is tried where the surface is a plane. In a large scene a word saves
    /// more than the plane in its place, or it is left out.
    fn words_at(
        &self,
        plane: &CandidatePlane,
        descriptors: &[Descriptor],
        buffers: &mut Buffers<'_>,
    ) -> Vec<Candidate> {
        let Buffers { rows, around, points, samples } = buffers;
        if plane.descriptor.distance(&descriptors[0]) < PLANE_DISTANCE {
            return Vec::new();
        }
        let mut fitting = nearest_words(&plane.descriptor, descriptors, WORDS_PER_PLACE);
        fitting.retain(|&word| word != 0);
        if fitting.is_empty() {
            return Vec::new();
        }
        let Candidate { placement, pose, .. } = plane.candidate;
        self.cells.around(placement.cell, rows);
        self.cells.touched(rows, &pose, around);
        local_points(self.scene, &pose, around, points);
        let of_plane = self.prices.gain_alone(&plane.candidate).max(0.0);
        let least = if self.scene.is_coarse { of_plane } else { 0.0 };
        let paying = |word: usize| {
            let placement = Placement { word: word as u16, ..placement };
            let [weight, outliers] = samples.cover(word, &pose, self.spacing, points);
            let pays = self.prices.gain(&placement, weight, outliers) > least;
            pays.then(|| Candidate { placement, pose, coverage: samples.coverage() })
        };
        fitting.into_iter().filter_map(paying).collect()
    }
}
