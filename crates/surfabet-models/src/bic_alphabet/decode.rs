//! Back to a cloud: every word at its places (eq. 2), sparsified (eq. 3).

use surfabet_geom::{CloudParts, PointCloud, Progress};

use super::model::BicAlphabetModel;
use super::pose::Frame;
use super::rebuild::{Stamp, rebuild};
use crate::contract::DecodeOptions;
use crate::error::{Result, check_points};

impl BicAlphabetModel {
    /// The scene as points that keep a distance of `resolution`, by default epsilon; occurrences have at most
    /// `max_points` points before they are thinned. Words hold no more points than they were learned with, so that a
    /// spacing below epsilon adds few.
    ///
    /// The result is the same before a model is saved and after it is read. The normal of a point is that of its
    /// occurrence.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] for a spacing that is not positive, [`crate::Error::TooManyPoints`],
    /// [`crate::Error::Cancelled`].
    pub fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        progress.check()?;
        options.expect_thin()?;
        let alphabet = self.alphabet();
        let (radius, epsilon) = (alphabet.radius(), options.spacing(self.epsilon())?);
        let stamps: Vec<Stamp> =
            alphabet.words().iter().map(|w| Stamp::new(w, radius, epsilon)).collect();
        let of = |word: u32| stamps.get(word as usize).map_or(0, Stamp::len) as u64;
        let points: u64 = self.words().iter().map(|&w| of(w)).sum();
        check_points(epsilon, points as f64, options.max_points)?;
        let frames: Vec<Frame> =
            self.poses().iter().map(|p| p.frame(alphabet.upright(), radius)).collect();
        progress.check()?;
        // Occurrence after occurrence, the middle of each first.
        let kept = rebuild(self.poses(), &frames, self.words(), &stamps, epsilon as f32, progress)?;
        let parts = CloudParts {
            origin: self.origin(),
            normals: options
                .normals
                .then(|| kept.iter().map(|&(o, _)| frames[o as usize].rows[2]).collect()),
            positions: kept.into_iter().map(|(_, position)| position).collect(),
            ..CloudParts::default()
        };
        Ok(PointCloud::from_parts(parts)?.0)
    }
}
