//! A scene with what scoring needs of it and never changes.

use surfabet_geom::{KdTree, PointCloud};

use crate::bic_alphabet::constants::OCCURRENCE_RADIUS;
use crate::bic_alphabet::features::{Descriptors, Features, penalty_steps};
use crate::bic_alphabet::likelihood::{Likelihood, ReachableBlocks, Shares};
use crate::bic_alphabet::options::BicAlphabetOptions;
use crate::bic_alphabet::rebuild::{Neighbors, Places, Stamp};
use crate::bic_alphabet::words::BicWord;
use crate::error::Result;
use crate::scans::Scene;
use crate::stages::Stages;

/// The points of a scene, its features with their descriptors, and its likelihood function.
pub(in crate::bic_alphabet) struct PreparedScene<'a> {
    pub options: &'a BicAlphabetOptions,
    pub scene: Scene,
    pub tree: KdTree,
    pub features: Features,
    pub descriptors: Descriptors,
    pub likelihood: Likelihood,
    /// Blocks of the likelihood by feature.
    pub reachable: ReachableBlocks,
    /// Features whose occurrences may come within epsilon of each other.
    neighbors: Neighbors,
}

impl<'a> PreparedScene<'a> {
    /// Merges the points of a cloud (eq. 13), and extracts and describes features (III-C).
    pub fn new(
        cloud: &PointCloud,
        options: &'a BicAlphabetOptions,
        stages: &mut Stages<'_>,
    ) -> Result<Self> {
        let scene = stages.run("preparing the scene", |progress| {
            Scene::new(cloud, options.deviation(), options.min_range, progress)
        })?;
        Self::of_scene(scene, options, stages)
    }

    /// The same from points that are merged already.
    pub fn of_scene(
        scene: Scene,
        options: &'a BicAlphabetOptions,
        stages: &mut Stages<'_>,
    ) -> Result<Self> {
        let tree = KdTree::new(&scene.positions)?;
        let features = stages.run("extracting features", |progress| {
            Features::new(&scene, &tree, options, progress)
        })?;
        let descriptors = stages.run("describing features", |progress| {
            Descriptors::new(&scene, &tree, &features, options, progress)
        })?;
        let (likelihood, reachable, neighbors) = stages.run("preparing the likelihood", |_| {
            let likelihood = Likelihood::new(&scene, options.floor);
            let radius = OCCURRENCE_RADIUS * options.radius() as f32;
            let Features { poses, frames, .. } = &features;
            let reachable = likelihood.reachable(frames, radius);
            let neighbors = Neighbors::new(poses, frames, radius, options.epsilon() as f32)?;
            Ok((likelihood, reachable, neighbors))
        })?;
        Ok(Self { options, scene, tree, features, descriptors, likelihood, reachable, neighbors })
    }

    /// The word at a feature (eq. 1), with the feature's descriptor.
    pub fn word(&self, feature: u32) -> BicWord {
        let f = feature as usize;
        let pixels = self.descriptors.pixels;
        let descriptor = &self.descriptors.values[f * pixels..(f + 1) * pixels];
        let frame = &self.features.frames[f];
        BicWord::take(&self.scene, &self.tree, frame, descriptor, self.options.radius())
    }

    /// A word ready to be placed.
    pub fn stamp(&self, word: &BicWord) -> Stamp {
        Stamp::new(word, self.options.radius(), self.options.epsilon())
    }

    /// Where occurrences may stand.
    pub fn places(&self) -> Places<'_> {
        let (frames, neighbors) = (&self.features.frames, &self.neighbors);
        Places { frames, neighbors, epsilon: self.options.epsilon() as f32 }
    }

    /// The shares of occurrences in the sums of the likelihood, of which none has points.
    pub fn empty_shares(&self) -> Shares {
        Shares::new(&self.likelihood, &self.reachable, self.features.len())
    }

    /// The difference that a pixel empty in one of two descriptors counts as, in height steps.
    pub fn penalty(&self) -> i32 {
        penalty_steps(self.options.empty_penalty)
    }
}
