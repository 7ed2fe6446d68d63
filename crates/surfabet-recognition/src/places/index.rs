//! Maps in one index, asked which of them shows a place.

use std::sync::{Arc, OnceLock};

use surfabet_base::parallel;
use surfabet_geom::{PointCloud, Progress};
use surfabet_models::alphabet::AlphabetModel;
use surfabet_models::{Error, Result};

use crate::PlaceSignature;
use crate::locate::{Localizer, LocateOptions, Located};

/// Maps, each with what it is compared by.
#[derive(Debug, Default)]
pub struct PlaceIndex {
    places: Vec<IndexedPlace>,
}

#[derive(Debug)]
struct IndexedPlace {
    model: Arc<AlphabetModel>,
    signature: PlaceSignature,
    /// Made when a scan is first located there.
    localizer: OnceLock<Localizer>,
}

/// How an index is asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceOptions {
    /// Most places that are given.
    pub top: usize,
    /// Of these, how many of the most similar the scan is located in.
    pub verify: usize,
    /// How it is located.
    pub locate: LocateOptions,
}

impl Default for PlaceOptions {
    fn default() -> Self {
        Self { top: 5, verify: 3, locate: LocateOptions::default() }
    }
}

/// A place of the index beside what was asked.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceMatch {
    /// Number of the place, from 0 in the order in which they were added.
    pub place: usize,
    /// Similarity, 0 to 1, as [`place_similarity`](crate::place_similarity).
    pub similarity: f64,
    /// Where in that place the scan was taken; `None` where it was not asked.
    pub located: Option<Located>,
}

impl PlaceIndex {
    /// Adds a place and gives its number.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn add(&mut self, model: Arc<AlphabetModel>, progress: &dyn Progress) -> Result<usize> {
        let signature = PlaceSignature::of(&model, progress)?;
        self.places.push(IndexedPlace { model, signature, localizer: OnceLock::new() });
        Ok(self.places.len() - 1)
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there is no place.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The places most like `model`, the most similar first; in the first `verify` of them `scan` is located, the cloud
    /// that the model was learned from or the decoded model, in the frame of its sensor.
    ///
    /// The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for options outside their domain, [`Error::Cancelled`].
    pub fn query(
        &self,
        model: &AlphabetModel,
        scan: Option<&PointCloud>,
        options: &PlaceOptions,
        progress: &dyn Progress,
    ) -> Result<Vec<PlaceMatch>> {
        if options.top == 0 {
            let error = surfabet_geom::InvalidParameter::new("top", 0, "at least 1");
            return Err(Error::InvalidParameter(error));
        }
        let asked = PlaceSignature::of(model, progress)?;
        let similarities = parallel::map(&self.places, |p| asked.similarity(&p.signature));
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by(|&i, &j| similarities[j].total_cmp(&similarities[i]).then(i.cmp(&j)));
        order.truncate(options.top);
        let located = |(rank, place): (usize, usize)| -> Result<PlaceMatch> {
            let located = match scan.filter(|_| rank < options.verify) {
                Some(scan) => self.places[place].located(scan, &options.locate, progress)?,
                None => None,
            };
            Ok(PlaceMatch { place, similarity: similarities[place], located })
        };
        order.into_iter().enumerate().map(located).collect()
    }

    /// Similarity of every two places, row by row.
    pub fn similarities(&self) -> Vec<Vec<f64>> {
        let row = |p: &IndexedPlace| {
            self.places.iter().map(|q| p.signature.similarity(&q.signature)).collect()
        };
        parallel::map(&self.places, row)
    }

    /// What the places are compared by, in their order.
    pub fn signatures(&self) -> impl Iterator<Item = &PlaceSignature> {
        self.places.iter().map(|p| &p.signature)
    }
}

impl IndexedPlace {
    /// Where in this place a scan was taken; `None` where the place has no surface.
    fn located(
        &self,
        scan: &PointCloud,
        options: &LocateOptions,
        progress: &dyn Progress,
    ) -> Result<Option<Located>> {
        if self.model.is_empty() {
            return Ok(None);
        }
        let localizer = match self.localizer.get() {
            Some(localizer) => localizer,
            None => {
                let made = Localizer::new(&*self.model, progress)?;
                self.localizer.get_or_init(|| made)
            }
        };
        localizer.locate(scan, options, progress).map(Some)
    }
}
