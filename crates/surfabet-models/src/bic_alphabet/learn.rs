//! Learning an alphabet, and describing another scene in its words.
//!
//! | step | computes | paper |
//! |---|---|---|
//! | 1 to 3 | scene, features, descriptors: [`PreparedScene`] | eq. 13, III-C |
//! | 4 to 6 | words, accepted when the BIC falls: [`choose_words`] | eq. 1 to 12, III, III-A |
//! | 7 | occurrences that are not needed: [`reduce`] | III-D |

use surfabet_geom::vector::length;
use surfabet_geom::{PointCloud, Progress, Survey};

use super::choice::{ChosenWords, Matching, PreparedScene, Reconstruction, choose_words, reduce};
use super::constants::{ANY_RADIUS, RADII_PER_SCENE, RADIUS_IN_SPACINGS};
use super::model::{BicAlphabet, BicAlphabetModel, BicHeader};
use super::options::BicAlphabetOptions;
use super::report::{BicAlphabetFigures, BicAlphabetReport};
use crate::error::Result;
use crate::options::Options;
use crate::quality::Quality;
use crate::report::lost;
use crate::stages::Stages;
use crate::start::{Leave, Start, rounded, significant};

/// The stages of learning and their shares of the progress: the time of each in per cent, on a scan of a room.
pub(super) const STAGES: &[(&str, f32)] = &[
    ("measuring the cloud", 1.0),
    ("preparing the scene", 2.0),
    ("extracting features", 2.0),
    ("describing features", 1.0),
    ("preparing the likelihood", 1.0),
    ("choosing words", 90.0),
    ("measuring", 2.0),
    ("removing occurrences", 2.0),
];

/// The stages of describing another scene.
const DESCRIBE_STAGES: &[(&str, f32)] = &[
    ("measuring the cloud", 5.0),
    ("preparing the scene", 15.0),
    ("extracting features", 20.0),
    ("describing features", 10.0),
    ("preparing the likelihood", 5.0),
    ("matching words", 5.0),
    ("placing words", 10.0),
    ("measuring", 20.0),
    ("removing occurrences", 15.0),
];

/// Learns an alphabet from `cloud`, and describes the cloud with it.
///
/// Results depend neither on the number of threads nor on the order of the points.
///
/// # Errors
/// [`Error::InvalidParameter`](crate::Error::InvalidParameter) for options outside their domains and a radius too small
/// for the scene, [`Error::EmptyCloud`](crate::Error::EmptyCloud) when no point is left,
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn learn(
    cloud: &PointCloud,
    options: &BicAlphabetOptions,
    progress: &dyn Progress,
) -> Result<BicAlphabetModel> {
    options.check()?;
    let mut stages = Stages::new(STAGES, progress);
    let mut start = measured(cloud, options, &mut stages)?;
    let radius = start.choose("radius", options.radius, radius);
    BicAlphabetOptions::check_found("radius", radius)?;
    let options = &BicAlphabetOptions { radius: Some(radius), ..options.clone() };
    // Scene, features and their descriptors: eq. 13, III-C.
    let scene = PreparedScene::new(&start.cloud, options, &mut stages)?;
    // Words sampled from the scene (eq. 1), accepted when the BIC falls: III, III-A, III-B.
    let chosen = stages.run("choosing words", |progress| choose_words(&scene, progress))?;
    // Occurrences without which the likelihood does not fall are removed: III-D.
    finish(&start, &scene, chosen, stages)
}

impl BicAlphabet {
    /// Describes another cloud with this alphabet (IV-B). Only features, matching and, where the options ask for it,
    /// the reduction of occurrences take place; nothing is learned. The file names the alphabet and does not hold it.
    ///
    /// # Errors
    /// As [`learn`], and [`Error::Inconsistent`](crate::Error::Inconsistent) when the options contradict those that
    /// the alphabet was learned with, or it has no words.
    pub fn describe(
        &self,
        cloud: &PointCloud,
        options: &BicAlphabetOptions,
        progress: &dyn Progress,
    ) -> Result<BicAlphabetModel> {
        let own = self.options().radius;
        let options = &BicAlphabetOptions { radius: options.radius.or(own), ..options.clone() };
        self.check(options)?;
        options.check()?;
        let mut stages = Stages::new(DESCRIBE_STAGES, progress);
        let start = measured(cloud, options, &mut stages)?;
        let scene = PreparedScene::new(&start.cloud, options, &mut stages)?;
        let words = self.words().to_vec();
        let matching = stages.run("matching words", |_| {
            Ok(Matching::new(&scene.descriptors, &words, scene.penalty()))
        })?;
        let best =
            stages.run("placing words", |_| Ok(Reconstruction::new(&scene, words, matching)))?;
        let chosen = ChosenWords { best, bics: None, stop_reason: "the alphabet was given" };
        finish(&start, &scene, chosen, stages)
    }
}

/// The cloud without strays, and its figures.
fn measured<'a>(
    cloud: &'a PointCloud,
    options: &BicAlphabetOptions,
    stages: &mut Stages<'_>,
) -> Result<Start<'a>> {
    Start::of(cloud, options.quality, Leave::Strays, options.keep_outliers, stages)
}

/// The radius of words by the data, and why: enough points for a descriptor, and no more words than can be tried.
fn radius(survey: &Survey, quality: Quality) -> (f64, String) {
    let diagonal = length(survey.extent());
    let scale = quality.scale();
    let of_spacing = scale * RADIUS_IN_SPACINGS * survey.spacing;
    let of_scene = scale * diagonal / RADII_PER_SCENE;
    if of_scene > of_spacing {
        (rounded(of_scene), format!("a part of the scene of {} m", significant(diagonal)))
    } else if of_spacing > 0.0 {
        let spacings = scale * RADIUS_IN_SPACINGS;
        (rounded(of_spacing), format!("{spacings} spacings of {} m", significant(survey.spacing)))
    } else {
        (ANY_RADIUS, "all points are at one place".to_owned())
    }
}

/// Reduces the occurrences (III-D), measures before and after it (IV), and makes the model.
fn finish(
    start: &Start<'_>,
    scene: &PreparedScene<'_>,
    ChosenWords { mut best, bics, stop_reason }: ChosenWords,
    mut stages: Stages<'_>,
) -> Result<BicAlphabetModel> {
    let cloud: &PointCloud = &start.cloud;
    let is_given = bics.is_none();
    let mut figures = BicAlphabetFigures::new(cloud.len(), scene, &best, &mut stages)?;
    if scene.options.reduce {
        stages
            .run_round("removing occurrences", 1, |progress| reduce(scene, &mut best, progress))?;
        figures.add_reduced(scene, &best, &mut stages)?;
    }
    let mut report = BicAlphabetReport {
        stages: stages.finish(),
        figures: Some(figures),
        levels: Vec::new(),
        iterations: bics.as_ref().map_or(0, Vec::len),
        objectives: bics.into_iter().map(|bics| ("bic".into(), bics)).collect(),
        stop_reason,
        attributes: Vec::new(),
        not_kept: lost(cloud, &[]),
        ..BicAlphabetReport::default()
    };
    start.report(0.0, &mut report);
    let header = BicHeader {
        n_points: cloud.len() as u64,
        origin: scene.scene.origin,
        epsilon: scene.options.epsilon(),
        low: scene.features.low,
    };
    let occurrences = best.occurrences(scene);
    let alphabet = BicAlphabet::learned(best.words, scene.options)?;
    BicAlphabetModel::learned(alphabet, occurrences, header, is_given, report)
}
