//! A model of any method, to and from `.sfb` bytes and files.

use std::any::Any;
use std::fs;
use std::path::Path;

use surfabet_codec::{Container, FileSummary, Limits, Tag, holds};
use surfabet_geom::{PointCloud, Progress};
use surfabet_models::alphabet::AlphabetModel;
use surfabet_models::bic_alphabet::BicAlphabetModel;
use surfabet_models::gas::GasModel;
use surfabet_models::hscsm::HscsmModel;
use surfabet_models::patches::PatchModel;
use surfabet_models::planes::PlaneModel;
use surfabet_models::{DecodeOptions, SurfaceModel};

use crate::any_model::AnyModel;
use crate::error::{Error, Result};
use crate::for_each_method;
use crate::save::write;

/// A dictionary or alphabet that a file may name by its hash instead of holding it: of any method.
#[derive(Debug, Clone, Copy, Default)]
pub struct KnownVocabulary<'a>(Option<&'a (dyn Any + Send + Sync)>);

impl<'a> KnownVocabulary<'a> {
    /// None: files must hold theirs.
    pub const NONE: Self = Self(None);

    /// A vocabulary, such as an [`Alphabet`](crate::Alphabet).
    pub fn new<V: Any + Send + Sync>(vocabulary: &'a V) -> Self {
        Self(Some(vocabulary))
    }

    fn of<M: SurfaceModel>(self) -> Option<&'a M::Vocabulary> {
        self.0?.downcast_ref()
    }
}

macro_rules! define_model {
    ($($(#[$doc:meta])* $variant:ident($type:ty),)+) => {
        /// A model of any method.
        #[derive(Debug, Clone, PartialEq)]
        #[non_exhaustive]
        pub enum Model {
            $($(#[$doc])* $variant($type),)+
        }

        $(impl From<$type> for Model {
            fn from(model: $type) -> Self {
                Self::$variant(model)
            }
        })+

        impl Model {
            /// Names of all methods.
            pub const METHODS: &'static [&'static str] = &[$(<$type as SurfaceModel>::METHOD,)+];

            /// What the model can do whatever its method.
            pub fn as_any_model(&self) -> &dyn AnyModel {
                match self {
                    $(Self::$variant(model) => model,)+
                }
            }

            /// As [`Model::from_bytes_with`], from a file that is parsed already.
            ///
            /// # Errors
            /// As [`Model::from_bytes_with`].
            pub fn read(
                container: &Container<'_>,
                limits: &Limits,
                vocabulary: KnownVocabulary<'_>,
            ) -> Result<Self> {
                $(if holds::<$type>(container) {
                    let known = vocabulary.of::<$type>();
                    return Ok(Self::$variant(surfabet_codec::read(container, limits, known)?));
                })+
                if container.features().contains(surfabet_codec::Features::TILES) {
                    let what = "the model is in tiles: open it with TiledModel::open";
                    return Err(surfabet_codec::Error::corrupt(Tag::HEADER, 0, what).into());
                }
                let names: Vec<&str> = container.features().names().collect();
                let what = format!(
                    "no method of family {} has the features {names:?}", container.family());
                Err(surfabet_codec::Error::corrupt(Tag::HEADER, 0, what).into())
            }

            /// Name of the method of the model in a parsed file, the hash of the vocabulary that it names instead of
            /// holding it, and what each of its sections holds.
            ///
            /// # Errors
            /// [`Error::Codec`] for a combination of features that no method has, or a header that no model has.
            pub fn inspect(container: &Container<'_>) -> Result<FileSummary> {
                if let Some(summary) = surfabet_codec::inspect_tiles(container)? {
                    return Ok(summary);
                }
                $(if holds::<$type>(container) {
                    return Ok(surfabet_codec::inspect::<$type>(container)?);
                })+
                Err(surfabet_codec::Error::corrupt(Tag::HEADER, 0, "features of no method").into())
            }
        }
    };
}

for_each_method!(define_model);

impl Model {
    /// Name of the method.
    pub fn method(&self) -> &'static str {
        self.as_any_model().method()
    }

    /// The bytes of an `.sfb` file with this model; the same model gives the same bytes.
    ///
    /// # Errors
    /// When the container cannot hold the model.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        self.as_any_model().to_bytes()
    }

    /// Writes an `.sfb` file; an existing one is replaced only when the new one is complete. Returns its size.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<u64> {
        write(path.as_ref(), &self.to_bytes()?)
    }

    /// Reads the bytes of an `.sfb` file, which need not be trusted.
    ///
    /// # Errors
    /// [`Error::Codec`] when anything is wrong with them.
    pub fn from_bytes(bytes: &[u8], limits: &Limits) -> Result<Self> {
        Self::from_bytes_with(bytes, limits, KnownVocabulary::NONE)
    }

    /// As [`Model::from_bytes`], for files that may name a vocabulary instead of holding it.
    ///
    /// # Errors
    /// [`Error::Codec`] when anything is wrong with them, or they name another vocabulary.
    pub fn from_bytes_with(
        bytes: &[u8],
        limits: &Limits,
        vocabulary: KnownVocabulary<'_>,
    ) -> Result<Self> {
        Self::read(&Container::parse(bytes, limits)?, limits, vocabulary)
    }

    /// Reads an `.sfb` file, which need not be trusted.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::File`], both naming the file.
    pub fn open(path: impl AsRef<Path>, limits: &Limits) -> Result<Self> {
        Self::open_with(path, limits, KnownVocabulary::NONE)
    }

    /// As [`Model::open`], for files that may name a vocabulary instead of holding it.
    ///
    /// # Errors
    /// As [`Model::open`]; also when the file names another vocabulary.
    pub fn open_with(
        path: impl AsRef<Path>,
        limits: &Limits,
        vocabulary: KnownVocabulary<'_>,
    ) -> Result<Self> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), source };
        let size = fs::metadata(path).map_err(io)?.len();
        let named = |error| match error {
            Error::Codec(source) => Error::File { path: path.to_owned(), source },
            other => other,
        };
        limits.check_size(size).map_err(|e| named(e.into()))?;
        Self::from_bytes_with(&fs::read(path).map_err(io)?, limits, vocabulary).map_err(named)
    }

    /// The model as a cloud.
    ///
    /// # Errors
    /// [`Error::Model`] for options outside their domain, too many points, or when the caller asks to stop.
    pub fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        self.as_any_model().decode(options, progress)
    }
}
