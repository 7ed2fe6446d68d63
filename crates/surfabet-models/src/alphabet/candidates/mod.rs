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
pub(super) use self::planes::{CandidatePlane, find_planes};
use super::constants::{PLANE_DISTANCE, WORDS_PER_PLACE};
use super::placement::{Placement, WordPose};
use super::scene::{Cells, LatticeScene, LocalPoint, local_points};
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

/// The words whose descriptors are nearest to those of `planes`, in their places; all of one scale. The plane itself is
/// not among them, and none is tried where the surface is a plane.
pub(super) fn place_words(
    scene: &LatticeScene,
    cells: &Cells,
    planes: &[CandidatePlane],
    words: &[Word],
    spacing: f64,
    progress: &dyn Progress,
) -> Result<Vec<Candidate>> {
    let descriptors: Vec<Descriptor> = words.iter().map(Descriptor::of_word).collect();
    let placed = parallel::try_map_range_with(
        planes.len(),
        || (Vec::new(), Vec::<LocalPoint>::new(), WordSamples::new(words)),
        |(around, points, samples), k| -> Result<Vec<Candidate>> {
            progress.check()?;
            let plane = &planes[k];
            if plane.descriptor.distance(&descriptors[0]) < PLANE_DISTANCE {
                return Ok(Vec::new());
            }
            let mut fitting = nearest_words(&plane.descriptor, &descriptors, WORDS_PER_PLACE);
            fitting.retain(|&word| word != 0);
            if fitting.is_empty() {
                return Ok(Vec::new());
            }
            let Candidate { placement, pose, .. } = plane.candidate;
            cells.touched(placement.cell, &pose, around);
            local_points(scene, &pose, around, points);
            let with_word = |word: usize| Candidate {
                placement: Placement { word: word as u16, ..placement },
                pose,
                coverage: samples.coverage(word, &pose, spacing, points),
            };
            Ok(fitting.into_iter().map(with_word).collect())
        },
    )?;
    Ok(placed.into_iter().flatten().collect())
}
