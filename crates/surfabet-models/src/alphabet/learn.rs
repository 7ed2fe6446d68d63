//! Learning an alphabet with the scene that it describes, and describing a scene by an alphabet that is given.

use surfabet_geom::{PointCloud, Progress};

use super::candidates::{
    Candidate, CandidatePlane, Descriptor, PlaneSearch, WordPlaces, cluster_words, find_planes,
    sample_grid, sort_within_places,
};
use super::channels::Channels;
use super::choice::{Choice, CoverCounts, Prices, add_best};
use super::coding::CodingParams;
use super::constants::{
    FIRST_OCCURRENCE_BITS, MOST_FINE_POINTS, RADIUS_IN_SIGMAS, RADIUS_IN_SPACINGS,
    REFINEMENT_PASSES, WHOLE_PLANE_OUTLIERS,
};
use super::model::{Alphabet, AlphabetModel, Header};
use super::options::AlphabetOptions;
use super::scene::{Cells, LatticeScene, Thinned};
use super::word::Word;
use crate::error::Result;
use crate::options::Options;
use crate::report::{Report, figures, lost};
use crate::scans::Scene;
use crate::stages::Stages;
use crate::start::{Leave, Start, rounded, significant};

/// The stages and their shares of the progress, in per cent.
const STAGES: &[(&str, f32)] = &[
    ("measuring the cloud", 3.0),
    ("preparing the scene", 10.0),
    ("finding planes", 20.0),
    ("clustering words", 10.0),
    ("placing words", 30.0),
    ("choosing occurrences", 30.0),
];

/// The report of [`learn`] and [`describe`].
pub type AlphabetReport = Report<Option<AlphabetFigures>>;

figures! {
    /// What [`learn`] and [`describe`] count.
    pub struct AlphabetFigures {
        /// Points of the cloud.
        pub points: usize = "points",
        /// Points at different places, but for those that are too near.
        pub distinct_points: usize = "distinct points",
        /// Points that the words are fitted to.
        pub thinned_points: usize = "points as dense as sigma asks",
        /// Points that repeat another.
        pub duplicates: usize = "duplicates",
        /// Points nearer to the sensor than `min_range`.
        pub too_near: usize = "points too near",
        /// Planes and words in their places that were candidates for occurrences, when learning ended.
        pub candidates: usize = "candidates",
    }
}

/// Learns an alphabet from a cloud, and the cloud's description by it.
///
/// The result depends on the points, not on their order, and not on the number of threads.
///
/// # Errors
/// [`crate::Error::InvalidParameter`] for options outside their domain and a radius too small for the scene,
/// [`crate::Error::EmptyCloud`], [`crate::Error::Cancelled`].
pub fn learn(
    cloud: &PointCloud,
    options: &AlphabetOptions,
    progress: &dyn Progress,
) -> Result<AlphabetModel> {
    run(cloud, None, options, progress)
}

/// Describes a cloud by the words of `alphabet` (IV-B). Radii are those of the alphabet; the model's file names the
/// alphabet and does not hold it.
///
/// # Errors
/// As [`learn`].
pub fn describe(
    cloud: &PointCloud,
    alphabet: &Alphabet,
    options: &AlphabetOptions,
    progress: &dyn Progress,
) -> Result<AlphabetModel> {
    let (radius, scales) = (Some(alphabet.radius()), alphabet.scales());
    let options = AlphabetOptions { radius, scales, ..*options };
    run(cloud, Some(alphabet), &options, progress)
}

/// The steps of the guide's page, in its order.
fn run(
    cloud: &PointCloud,
    frozen: Option<&Alphabet>,
    options: &AlphabetOptions,
    progress: &dyn Progress,
) -> Result<AlphabetModel> {
    options.check()?;
    let mut stages = Stages::new(STAGES, progress);
    // Options that are not given follow from the data.
    let (quality, keep) = (options.quality, options.keep_outliers);
    let mut start = Start::of(cloud, quality, Leave::Strays, keep, &mut stages)?;

    // 1. Points denser than half a sigma are thinned out (eq. 13), those of a large scene further.
    let prepared = stages
        .run("preparing the scene", |progress| Prepared::new(&mut start, options, progress))?;
    let scene = &prepared.lattice;

    // 2. Planes at every cell of every scale, rounded, with descriptors of the surface about them (III-C); in a large scene
    // only where no larger plane will do.
    let mut scales =
        stages.run("finding planes", |progress| scales_of(scene, options, progress))?;

    // 3. Words are the centroids of clustered descriptors (III-C), or given (IV-B).
    let words = stages.run("clustering words", |progress| {
        scales.iter_mut().for_each(|s| s.drop_poor_planes(options.inlier_bits() as f32));
        match frozen {
            Some(alphabet) => Ok(alphabet.words().to_vec()),
            None => learned_words(&scales, options.max_words, progress),
        }
    })?;
    let (cells, planes): (Vec<Cells>, Vec<Vec<CandidatePlane>>) =
        scales.into_iter().map(|s| (s.cells, s.planes)).unzip();
    let mut choice = choice(scene, &cells, words, frozen.is_some(), options);

    // 4. The candidates: every plane, and the words that fit best in its place (III-C).
    let mut candidates =
        stages.run("placing words", |progress| candidates(&choice, planes, progress))?;

    let chosen = stages.run("choosing occurrences", |progress| {
        // 5. and 6. Covers of least description length without redundant occurrences (III-D), at the coder's prices;
        // words that do not pay are dropped.
        let (chosen, counts) = choice.cover_rounds(&mut candidates, options.rounds, progress)?;
        // 7. Every occurrence is replaced by the best of its variants.
        choice.refine_rounds(&mut candidates, chosen, counts, progress)
    })?;

    let Choice { words, lengths, .. } = choice;
    let every_round = options.rounds as usize + REFINEMENT_PASSES + 1;
    let alphabet = match frozen {
        Some(alphabet) => alphabet.clone(),
        None => Alphabet::new(scene.radius, options.scales, words)?,
    };
    let model = prepared.model(alphabet, frozen.is_some(), &chosen, options)?;
    let mut report = AlphabetReport {
        stages: stages.finish(),
        figures: Some(prepared.figures(candidates.len())),
        stop_reason: if lengths.len() == every_round {
            "every round was run"
        } else {
            "a round saved less than a hundredth"
        },
        iterations: lengths.len(),
        objectives: vec![("bits, misfit included".into(), lengths)],
        not_kept: prepared.not_kept(cloud),
        ..Report::default()
    };
    start.report(0.0, &mut report);
    Ok(model.with_report(report))
}

/// The scene in the forms that the steps need.
struct Prepared {
    /// Points of the cloud.
    n_points: usize,
    /// All distinct points.
    scene: Scene,
    /// The points that the words are fitted to.
    thinned: Scene,
    /// The same in units of the lattice.
    lattice: LatticeScene,
}

impl Prepared {
    fn new(
        start: &mut Start<'_>,
        options: &AlphabetOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let n_points = start.cloud.len();
        let scene = Scene::new(&start.cloud, options.deviation(), options.min_range, progress)?;
        progress.check()?;
        let thinning = Thinned::of(&scene, MOST_FINE_POINTS);
        progress.check()?;
        let thinned = scene.select(&thinning.kept);
        let radius = start.choose("radius", options.radius, |survey, _| {
            let of_spacing = RADIUS_IN_SPACINGS * survey.spacing;
            let of_sigma = RADIUS_IN_SIGMAS * scene.median_sigma();
            if of_sigma > of_spacing {
                let sigma = significant(scene.median_sigma());
                (
                    rounded(of_sigma),
                    format!("{RADIUS_IN_SIGMAS} times the median sigma of {sigma} m"),
                )
            } else {
                let spacing = significant(survey.spacing);
                (rounded(of_spacing), format!("{RADIUS_IN_SPACINGS} spacings of {spacing} m"))
            }
        });
        AlphabetOptions::check_found("radius", radius)?;
        progress.check()?;
        let lattice = LatticeScene::new(&thinned, thinning, radius)?;
        Ok(Self { n_points, scene, thinned, lattice })
    }

    fn figures(&self, candidates: usize) -> AlphabetFigures {
        AlphabetFigures {
            points: self.n_points,
            distinct_points: self.scene.len(),
            thinned_points: self.lattice.points.len(),
            duplicates: self.scene.duplicates,
            too_near: self.scene.too_near,
            candidates,
        }
    }

    /// What the cloud has and the model does not keep. Ranges follow from the positions of the sensors.
    fn not_kept(&self, cloud: &PointCloud) -> Vec<String> {
        let kept: &[&str] = if self.lattice.sensors.is_empty() {
            &["colors", "intensities"]
        } else {
            &["colors", "intensities", "ranges", "viewpoints"]
        };
        lost(cloud, kept)
    }

    /// The model of the chosen occurrences, with the colours and intensities of what they explain.
    fn model(
        &self,
        alphabet: Alphabet,
        shares_vocabulary: bool,
        chosen: &[Candidate],
        options: &AlphabetOptions,
    ) -> Result<AlphabetModel> {
        let header = Header {
            n_points: self.n_points as u64,
            origin: self.lattice.origin,
            spacing: options.spacing,
            deviation: self.scene.deviation,
            rule: self.lattice.rule,
            sensors: self.lattice.sensors.clone(),
        };
        let channels = Channels::of(&self.thinned, options.color_step);
        let with_means =
            |c: &Candidate| (c.placement, channels.means(&self.thinned, &c.coverage.points));
        let occurrences = chosen.iter().map(with_means).collect();
        AlphabetModel::new(header, alphabet, occurrences, channels, shares_vocabulary)
    }
}

/// One scale of the scene.
struct Scale {
    cells: Cells,
    planes: Vec<CandidatePlane>,
}

impl Scale {
    fn new(
        scene: &LatticeScene,
        scale: u32,
        options: &AlphabetOptions,
        explained: Option<&CoverCounts>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let cells = Cells::new(&scene.points, scale);
        let least = FIRST_OCCURRENCE_BITS / options.inlier_bits() as f32;
        let explained = explained.map(|counts| (counts, least));
        let search =
            PlaneSearch { scene, cells: &cells, scale, spacing: options.spacing, explained };
        let planes = find_planes(&search, progress)?;
        Ok(Self { cells, planes })
    }

    /// The planes that are whole: of whose samples at most [`WHOLE_PLANE_OUTLIERS`] explain nothing.
    fn whole_planes(&self, spacing: f64) -> Vec<&Candidate> {
        let is_whole = |c: &&Candidate| {
            let (n, _) = sample_grid(&c.pose, spacing);
            c.coverage.outliers as f32 <= WHOLE_PLANE_OUTLIERS * (n * n) as f32
        };
        self.planes.iter().map(|p| &p.candidate).filter(is_whole).collect()
    }

    /// Drops the planes that explain too little to pay for an occurrence; no word is tried in their place.
    fn drop_poor_planes(&mut self, inlier_bits: f32) {
        let n_points = |p: &CandidatePlane| p.candidate.coverage.weight as f32;
        self.planes.retain(|p| inlier_bits * n_points(p) > FIRST_OCCURRENCE_BITS);
    }
}

/// All scales of the scene, the smallest first. Of a large scene the largest is searched first, and what its whole planes
/// explain, chosen as for the description, is left out of the search on smaller ones: a smaller plane does not explain it
/// for fewer bits.
fn scales_of(
    scene: &LatticeScene,
    options: &AlphabetOptions,
    progress: &dyn Progress,
) -> Result<Vec<Scale>> {
    let mut counts = scene.is_coarse.then(|| CoverCounts::new(&scene.weights));
    let scales = options.scales;
    let [inlier, outlier] = [options.inlier_bits(), options.outlier_bits()].map(|b| b as f32);
    let prices = Prices::first(inlier, outlier, scales as usize, 1);
    let mut found = Vec::new();
    for scale in (0..scales).rev() {
        let of_scale = Scale::new(scene, scale, options, counts.as_ref(), progress)?;
        if let Some(counts) = counts.as_mut() {
            add_best(&of_scale.whole_planes(options.spacing), &prices, counts, progress)?;
        }
        found.push(of_scale);
    }
    found.reverse();
    Ok(found)
}

/// The plane, and at most `max_words` words of the scene.
fn learned_words(scales: &[Scale], max_words: u32, progress: &dyn Progress) -> Result<Vec<Word>> {
    let descriptors: Vec<&Descriptor> =
        scales.iter().flat_map(|s| s.planes.iter().map(|p| &p.descriptor)).collect();
    cluster_words(&descriptors, max_words as usize, progress)
}

/// The choice among occurrences of `words`, before anything is chosen.
fn choice<'a>(
    scene: &'a LatticeScene,
    cells: &'a [Cells],
    words: Vec<Word>,
    frozen: bool,
    options: &AlphabetOptions,
) -> Choice<'a> {
    Choice {
        scene,
        cells,
        spacing: options.spacing,
        params: CodingParams {
            scales: options.scales,
            rule: scene.rule,
            sensors: scene.sensors.clone(),
            n_words: words.len() as u32,
        },
        prices: Prices::first(
            options.inlier_bits() as f32,
            options.outlier_bits() as f32,
            cells.len(),
            words.len(),
        ),
        words,
        frozen,
        lengths: Vec::new(),
    }
}

/// The planes and the words in their places, as far as they can pay for themselves, sorted.
fn candidates(
    choice: &Choice<'_>,
    planes: Vec<Vec<CandidatePlane>>,
    progress: &dyn Progress,
) -> Result<Vec<Candidate>> {
    let Choice { scene, words, prices, spacing, .. } = choice;
    let mut all: Vec<Candidate> = Vec::new();
    for (cells, planes) in choice.cells.iter().zip(planes) {
        let place = WordPlaces { scene, cells, planes: &planes, words, spacing: *spacing, prices };
        let of_planes = place.words(progress)?;
        for (plane, words) in planes.into_iter().zip(of_planes) {
            all.extend(words);
            all.extend(Some(plane.candidate).filter(|c| prices.gain_alone(c) > 0.0));
        }
    }
    sort_within_places(&mut all);
    Ok(all)
}
