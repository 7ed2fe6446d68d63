//! What learning and describing report.

use super::choice::{Fidelity, PreparedScene, Reconstruction, fidelity};
use crate::error::Result;
use crate::report::{Report, figures};
use crate::stages::Stages;

/// The report of learning and of describing.
pub type BicAlphabetReport = Report<Option<BicAlphabetFigures>>;

figures! {
    /// What learning and describing count and measure; those of table (IV) of the paper before occurrences are removed
    /// (III-D), and after that where the options ask for it.
    pub struct BicAlphabetFigures {
        /// Points of the cloud.
        pub points: usize = "points",
        /// Points nearer to the sensor than `min_range`.
        pub too_near: usize = "points too near",
        /// Points that repeat another.
        pub duplicates: usize = "duplicate points",
        /// Points at different places, but for those that are too near.
        pub distinct_points: usize = "distinct points",
        /// Features of the scene.
        pub features: usize = "features",
        /// Features at interest points.
        pub interest_points: usize = "interest points",
        /// Words of the alphabet.
        pub words: usize = "words",
        /// Points of all words.
        pub word_points: usize = "word points",
        /// The BIC (eq. 4).
        pub bic: f64 = "bic",
        /// `ln L` (eq. 6).
        pub log_likelihood: f64 = "log-likelihood",
        /// Occurrences of words.
        pub occurrences: usize = "occurrences",
        /// Bytes as the paper counts them: 12 per point of a word, 28 per occurrence.
        pub paper_bytes: usize = "paper bytes",
        /// Share of the scene's points that are near a decoded one.
        pub inliers: f64 = "inliers",
        /// Share of the decoded points that are near none of the scene.
        pub outliers: f64 = "outliers",
        /// `ln L` after removing.
        pub log_likelihood_reduced: Option<f64> = "log-likelihood reduced",
        /// Occurrences after removing.
        pub occurrences_reduced: Option<usize> = "occurrences reduced",
        /// Bytes as the paper counts them, after removing.
        pub paper_bytes_reduced: Option<usize> = "paper bytes reduced",
        /// Inliers after removing.
        pub inliers_reduced: Option<f64> = "inliers reduced",
        /// Outliers after removing.
        pub outliers_reduced: Option<f64> = "outliers reduced",
    }
}

impl BicAlphabetFigures {
    /// Of a scene of `points` points and what rebuilds it, before occurrences are removed.
    pub(super) fn new(
        points: usize,
        scene: &PreparedScene<'_>,
        best: &Reconstruction,
        stages: &mut Stages<'_>,
    ) -> Result<Self> {
        let measured = Measured::new(scene, best, stages)?;
        Ok(Self {
            points,
            too_near: scene.scene.too_near,
            duplicates: scene.scene.duplicates,
            distinct_points: scene.scene.len(),
            features: scene.features.len(),
            interest_points: scene.features.interest,
            words: best.words.len(),
            word_points: best.n_word_points(),
            bic: best.bic(scene),
            log_likelihood: best.log_likelihood(scene),
            occurrences: measured.occurrences,
            paper_bytes: measured.bytes,
            inliers: measured.fidelity.inliers,
            outliers: measured.fidelity.outliers,
            ..Self::default()
        })
    }

    /// Adds those of the same scene after occurrences are removed.
    pub(super) fn add_reduced(
        &mut self,
        scene: &PreparedScene<'_>,
        best: &Reconstruction,
        stages: &mut Stages<'_>,
    ) -> Result<()> {
        let measured = Measured::new(scene, best, stages)?;
        self.log_likelihood_reduced = Some(best.log_likelihood(scene));
        self.occurrences_reduced = Some(measured.occurrences);
        self.paper_bytes_reduced = Some(measured.bytes);
        self.inliers_reduced = Some(measured.fidelity.inliers);
        self.outliers_reduced = Some(measured.fidelity.outliers);
        Ok(())
    }
}

/// A row of table (IV).
struct Measured {
    occurrences: usize,
    bytes: usize,
    fidelity: Fidelity,
}

impl Measured {
    fn new(
        scene: &PreparedScene<'_>,
        best: &Reconstruction,
        stages: &mut Stages<'_>,
    ) -> Result<Self> {
        let occurrences = best.occurrences(scene).words.len();
        let bytes = 12 * best.n_word_points() + 28 * occurrences;
        let rounds = if scene.options.reduce { 2 } else { 1 };
        let fidelity = stages.run_round("measuring", rounds, |progress| {
            fidelity(scene, &best.sparsified, progress)
        })?;
        Ok(Self { occurrences, bytes, fidelity })
    }
}
