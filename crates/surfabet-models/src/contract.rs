//! What every model can do: the contract between a method's folder, the file and the bindings.

use std::fmt::Debug;

use surfabet_entropy::{Coder, Price};
use surfabet_geom::{PointCloud, Progress};

use crate::error::{Error, Result, positive};
use crate::options::Options;
use crate::region::Region;
use crate::report::{Figures, Report};
use crate::summary::Summary;

/// A cloud as a compact model of its surfaces; immutable.
///
/// Models are equal when their files are: the report does not count.
pub trait SurfaceModel: Debug + Clone + PartialEq + Send + Sync + 'static {
    /// Name of the method, as in `surfabet compress --model NAME`.
    const METHOD: &'static str;

    /// Number of entropy-coded streams.
    const STREAMS: usize;

    /// True when the model keeps how thick the scan was, so that it can be decoded as measured.
    const KEEPS_THICKNESS: bool;

    /// The options of learning.
    type Options: Options;

    /// What the file holds before the streams. The default stands for a header that is not read yet.
    type Header: Debug + Clone + PartialEq + Default;

    /// The counts and measures that learning reports.
    type Figures: Figures + Clone + PartialEq + Default;

    /// What files of several models can share and name by its hash: a dictionary or an alphabet. [`NoVocabulary`]
    /// for methods without one.
    type Vocabulary: Debug + Clone + PartialEq + Send + Sync + 'static;

    /// What the file holds before the streams.
    fn header(&self) -> Self::Header;

    /// Writes, prices or reads the streams, in the order of the file. Gives the model that was read, and nothing when
    /// one was given.
    ///
    /// # Errors
    /// Those of the coders; when reading, also for a header or content that no model has.
    fn code<C: Coder>(
        source: Source<'_, Self>,
        streams: &mut [C],
    ) -> Result<Option<Self>, C::Error>;

    /// The words or dictionaries that the model is made of.
    fn vocabulary(&self) -> Option<Self::Vocabulary> {
        None
    }

    /// True when the file names the vocabulary by its hash instead of holding it.
    fn shares_vocabulary(&self) -> bool {
        false
    }

    /// The model as a cloud.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for options outside their domain, [`Error::TooManyPoints`],
    /// [`Error::Cancelled`].
    fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud>;

    /// What [`SurfaceModel::decode`] gives of the points in `region`, the same points in the same order.
    ///
    /// # Errors
    /// As [`SurfaceModel::decode`].
    fn decode_within(
        &self,
        region: &Region,
        options: DecodeOptions,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        region.crop(&self.decode(options, progress)?)
    }

    /// How the model was learned; empty for a model read from a file.
    fn report(&self) -> &Report<Self::Figures>;

    /// What the model holds, for people.
    fn summary(&self) -> Summary;

    /// Number of patches, words' occurrences, planes or neurons.
    fn n_parts(&self) -> usize;

    /// Points of the cloud that the model was learned from.
    fn n_points(&self) -> u64;

    /// World position that the model computes about, metres.
    fn origin(&self) -> [f64; 3];

    /// True when the model carries colour.
    fn has_color(&self) -> bool;

    /// Bytes that each stream takes, to within a byte or so: its price under the coder's models.
    fn price(&self) -> Vec<f64> {
        let mut streams = vec![Price::default(); Self::STREAMS];
        let Ok(_) = Self::code(Source::Model(self), &mut streams);
        streams.iter().map(|price| price.bits / 8.0).collect()
    }
}

/// The vocabulary of methods that have none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoVocabulary {}

/// The part of [`SurfaceModel`] that a model's own methods of the same names give.
macro_rules! own_methods {
    () => {
        fn decode(
            &self,
            options: crate::contract::DecodeOptions,
            progress: &dyn surfabet_geom::Progress,
        ) -> crate::error::Result<surfabet_geom::PointCloud> {
            self.decode(options, progress)
        }

        fn report(&self) -> &crate::report::Report<Self::Figures> {
            self.report()
        }

        fn n_parts(&self) -> usize {
            self.len()
        }

        fn n_points(&self) -> u64 {
            self.n_points()
        }

        fn origin(&self) -> [f64; 3] {
            self.origin()
        }

        fn has_color(&self) -> bool {
            self.has_color()
        }
    };
}
pub(crate) use own_methods;

/// Where [`SurfaceModel::code`] takes the model from.
#[derive(Debug)]
pub enum Source<'a, M: SurfaceModel> {
    /// A model to write or to price.
    Model(&'a M),
    /// Streams to read.
    Streams {
        /// The header in front of the streams.
        header: &'a M::Header,
        /// The vocabulary that the file names by its hash; `None` when the file holds it.
        vocabulary: Option<&'a M::Vocabulary>,
        /// What reading may cost.
        budget: Budget,
    },
}

/// What reading streams that need not be trusted may cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// Most items of one kind.
    pub items: u64,
    /// Most bytes for the items of one kind.
    pub bytes: u64,
}

impl Budget {
    /// Most items of `bytes_each` bytes of memory.
    pub fn most(self, bytes_each: u64) -> u64 {
        self.items.min(self.bytes / bytes_each.max(1))
    }
}

/// The streams of a model as an array, for [`SurfaceModel::code`].
///
/// # Panics
/// With another number of streams than the method has, which is a fault of the caller's code.
pub(crate) fn exactly<C, const N: usize>(streams: &mut [C]) -> [&mut C; N] {
    let n = streams.len();
    let Ok(array) = <&mut [C; N]>::try_from(streams) else {
        unreachable!("{n} streams where the method has {N}");
    };
    array.each_mut()
}

/// How a model becomes a cloud.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecodeOptions {
    /// Spacing of the points, metres; `None` takes the spacing that the model was made for.
    pub resolution: Option<f64>,
    /// Fill the thickness that the scan had about the surface, where the model keeps it.
    pub as_measured: bool,
    /// Give every point the unit normal of its surface.
    pub normals: bool,
    /// Refuse to make more points than this.
    pub max_points: u64,
}

impl Default for DecodeOptions {
    fn default() -> Self {
        Self { resolution: None, as_measured: false, normals: false, max_points: 500_000_000 }
    }
}

impl DecodeOptions {
    /// The spacing, metres: `own` where the caller left it to the model.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] unless it is positive.
    pub(crate) fn spacing(&self, own: f64) -> Result<f64> {
        self.check()?;
        Ok(self.resolution.unwrap_or(own))
    }

    /// Refuses a spacing that is not positive.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`].
    pub(crate) fn check(&self) -> Result<()> {
        let spacing = self.resolution.unwrap_or(1.0);
        positive("resolution", spacing, "a positive number of metres")
    }

    /// Refuses to decode as measured what keeps no thickness.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`].
    pub(crate) fn expect_thin(&self) -> Result<()> {
        if self.as_measured {
            let requirement = "false: this model does not keep how thick the scan was";
            return Err(Error::invalid("as_measured", true, requirement));
        }
        Ok(())
    }
}
