//! The scene that is searched.

use surfabet_geom::{KdTree, Progress};
use surfabet_models::Result;
use surfabet_models::alphabet::AlphabetModel;

use crate::surface::SurfaceSamples;

/// The samples of a scene, and the smooth pieces that they fall into.
pub(crate) struct SearchScene {
    pub surface: SurfaceSamples,
    pub tree: KdTree,
    /// Standard deviation of equal chromas, grey levels; `None` where shape alone counts.
    pub color_tolerance: Option<f64>,
    /// The piece of each sample, by the number of its first sample.
    pieces: Vec<u32>,
    /// Samples of the piece that starts with each sample.
    sizes: Vec<u32>,
}

impl SearchScene {
    /// Samples the surface of `model`. Where colours count, every sample is a piece of its own: what lies flush with a
    /// wall is one smooth piece with it, and colours distinguish it.
    pub fn new(
        model: &AlphabetModel,
        spacing: f64,
        color_tolerance: Option<f64>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let surface = SurfaceSamples::of(model, spacing, progress)?;
        let tree = KdTree::new(&surface.points)?;
        let color_tolerance = color_tolerance.filter(|_| surface.colors.is_some());
        let (pieces, sizes) = match color_tolerance {
            Some(_) => ((0..surface.len() as u32).collect(), vec![1; surface.len()]),
            None => surface.pieces(&tree, progress)?,
        };
        progress.check()?;
        Ok(Self { surface, tree, color_tolerance, pieces, sizes })
    }

    /// Samples of the i-th sample's piece.
    pub fn piece_size(&self, i: usize) -> f64 {
        f64::from(self.sizes[self.pieces[i] as usize])
    }

    /// The weight of each of `samples`: the root of the share of its piece that lies among them. Surfaces that go on
    /// beyond the samples, such as the floor, count little.
    pub fn weights(&self, samples: &[u32]) -> Vec<f64> {
        let mut pieces: Vec<u32> = samples.iter().map(|&i| self.pieces[i as usize]).collect();
        pieces.sort_unstable();
        let weight = |&i: &u32| {
            let piece = self.pieces[i as usize];
            let n =
                pieces.partition_point(|&p| p <= piece) - pieces.partition_point(|&p| p < piece);
            (n as f64 / f64::from(self.sizes[piece as usize])).sqrt()
        };
        samples.iter().map(weight).collect()
    }
}
