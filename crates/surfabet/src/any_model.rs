//! A model whatever its method, as an object.

use std::any::Any;
use std::fmt::Debug;

use surfabet_codec::{ContentHash, Layout, Vocabulary};
use surfabet_geom::{PointCloud, Progress};
use surfabet_models::{DecodeOptions, Figures, Region, Report, Summary};
use surfabet_recognition::Localizer;

use crate::error::Result;

/// What every model can do, for programs that do not care for its method. Every [`Layout`] has it.
pub trait AnyModel: Debug + Send + Sync {
    /// Name of the method.
    fn method(&self) -> &'static str;

    /// The bytes of an `.sfb` file with this model; the same model gives the same bytes.
    ///
    /// # Errors
    /// When the container cannot hold the model.
    fn to_bytes(&self) -> Result<Vec<u8>>;

    /// The model as a cloud.
    ///
    /// # Errors
    /// [`crate::Error::Model`] for options outside their domain, too many points, or when the caller asks to stop.
    fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud>;

    /// What [`AnyModel::decode`] gives of the points in `region`, the same points in the same order.
    ///
    /// # Errors
    /// As [`AnyModel::decode`].
    fn decode_within(
        &self,
        region: &Region,
        options: DecodeOptions,
        progress: &dyn Progress,
    ) -> Result<PointCloud>;

    /// The model made ready to be asked where scans were taken.
    ///
    /// # Errors
    /// [`crate::Error::Model`] for a model without surface or one that is too large, or when the caller asks to stop.
    fn localizer(&self, progress: &dyn Progress) -> Result<Localizer>;

    /// How the model was learned; empty for a model read from a file.
    fn report(&self) -> &Report<dyn Figures>;

    /// What the model holds, for people; with the hash of its vocabulary, if it has one.
    fn summary(&self) -> Summary;

    /// The hash of its vocabulary, if it has one.
    fn vocabulary_hash(&self) -> Option<ContentHash>;

    /// True when the file names the vocabulary by its hash instead of holding it.
    fn shares_vocabulary(&self) -> bool;

    /// True when the model can be decoded as measured.
    fn keeps_thickness(&self) -> bool;

    /// Number of patches, occurrences, planes or neurons.
    fn n_parts(&self) -> usize;

    /// Points of the cloud that the model was learned from.
    fn n_points(&self) -> u64;

    /// World position that the model computes about, metres.
    fn origin(&self) -> [f64; 3];

    /// True when the model carries colour.
    fn has_color(&self) -> bool;

    /// True for a model of the same method whose file is the same.
    fn equals(&self, other: &dyn AnyModel) -> bool;

    /// The model itself, to be cast to its type.
    fn as_any(&self) -> &dyn Any;
}

impl<M: Layout> AnyModel for M {
    fn method(&self) -> &'static str {
        M::METHOD
    }

    fn to_bytes(&self) -> Result<Vec<u8>> {
        Ok(surfabet_codec::write(self)?)
    }

    fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        Ok(M::decode(self, options, progress)?)
    }

    fn decode_within(
        &self,
        region: &Region,
        options: DecodeOptions,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        Ok(M::decode_within(self, region, options, progress)?)
    }

    fn localizer(&self, progress: &dyn Progress) -> Result<Localizer> {
        Ok(Localizer::new(self, progress)?)
    }

    fn report(&self) -> &Report<dyn Figures> {
        M::report(self)
    }

    fn summary(&self) -> Summary {
        let summary = M::summary(self);
        match AnyModel::vocabulary_hash(self) {
            Some(hash) => summary
                .with("vocabulary", hash.to_string())
                .with("shared vocabulary", M::shares_vocabulary(self)),
            None => summary,
        }
    }

    fn vocabulary_hash(&self) -> Option<ContentHash> {
        self.vocabulary().map(|vocabulary| vocabulary.content_hash())
    }

    fn shares_vocabulary(&self) -> bool {
        M::shares_vocabulary(self)
    }

    fn keeps_thickness(&self) -> bool {
        M::KEEPS_THICKNESS
    }

    fn n_parts(&self) -> usize {
        M::n_parts(self)
    }

    fn n_points(&self) -> u64 {
        M::n_points(self)
    }

    fn origin(&self) -> [f64; 3] {
        M::origin(self)
    }

    fn has_color(&self) -> bool {
        M::has_color(self)
    }

    fn equals(&self, other: &dyn AnyModel) -> bool {
        other.as_any().downcast_ref::<M>().is_some_and(|other| self == other)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
