//! A model of any family, to and from `.sfb` bytes and files.

use std::fs;
use std::path::Path;

use surfabet_codec::{Container, Family, Features, Limits};
use surfabet_geom::{PointCloud, Progress};
use surfabet_models::DecodeOptions;
use surfabet_models::alphabet::{Alphabet, AlphabetModel, MdlDecodeOptions};
use surfabet_models::bic_alphabet::{BicAlphabet, BicAlphabetModel};
use surfabet_models::gas::{self, GasModel};
use surfabet_models::hscsm::{HscsmDictionary, HscsmModel};
use surfabet_models::patches::PatchModel;
use surfabet_models::planes::{self, PlaneModel};

use crate::error::{Error, Result};
use crate::save::{Save, write};

/// A model of any family.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Model {
    /// Sparse-coded surface patches.
    Hscsm(HscsmModel),
    /// Surface patches on a lattice.
    Patches(PatchModel),
    /// Words and where they occur.
    Alphabet(AlphabetModel),
    /// Words chosen by the Bayesian information criterion, and where they occur.
    BicAlphabet(BicAlphabetModel),
    /// A growing neural gas.
    Gas(GasModel),
    /// Planar patches with tiles.
    Planes(PlaneModel),
}

/// What files may name instead of holding it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shared<'a> {
    /// Dictionaries of patches.
    pub dictionary: Option<&'a HscsmDictionary>,
    /// The words of an alphabet.
    pub alphabet: Option<&'a Alphabet>,
    /// The words of an alphabet by BIC.
    pub bic_alphabet: Option<&'a BicAlphabet>,
}

impl From<PlaneModel> for Model {
    fn from(model: PlaneModel) -> Self {
        Self::Planes(model)
    }
}

impl From<GasModel> for Model {
    fn from(model: GasModel) -> Self {
        Self::Gas(model)
    }
}

impl From<BicAlphabetModel> for Model {
    fn from(model: BicAlphabetModel) -> Self {
        Self::BicAlphabet(model)
    }
}

impl From<AlphabetModel> for Model {
    fn from(model: AlphabetModel) -> Self {
        Self::Alphabet(model)
    }
}

impl From<PatchModel> for Model {
    fn from(model: PatchModel) -> Self {
        Self::Patches(model)
    }
}

impl From<HscsmModel> for Model {
    fn from(model: HscsmModel) -> Self {
        Self::Hscsm(model)
    }
}

impl Model {
    /// The family that this model belongs to.
    pub fn family(&self) -> Family {
        match self {
            Self::Hscsm(_) | Self::Patches(_) => Family::Patches,
            Self::Alphabet(_) | Self::BicAlphabet(_) => Family::Alphabet,
            Self::Gas(_) => Family::Gas,
            Self::Planes(_) => Family::Planes,
        }
    }

    /// The bytes of an `.sfb` file with this model; the same model gives the same bytes.
    ///
    /// # Errors
    /// When the container cannot hold the model.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        match self {
            Self::Hscsm(model) => model.to_bytes(),
            Self::Patches(model) => model.to_bytes(),
            Self::Alphabet(model) => model.to_bytes(),
            Self::BicAlphabet(model) => model.to_bytes(),
            Self::Gas(model) => model.to_bytes(),
            Self::Planes(model) => model.to_bytes(),
        }
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
        Self::from_bytes_with(bytes, limits, Shared::default())
    }

    /// As [`Model::from_bytes`], for files that may name what is `shared` instead of holding it.
    ///
    /// # Errors
    /// [`Error::Codec`] when anything is wrong with them, or they name something else.
    pub fn from_bytes_with(bytes: &[u8], limits: &Limits, shared: Shared<'_>) -> Result<Self> {
        Self::read(&Container::parse(bytes, limits)?, limits, shared)
    }

    /// As [`Model::from_bytes_with`], from a file that is parsed already.
    ///
    /// # Errors
    /// As [`Model::from_bytes_with`].
    pub fn read(container: &Container<'_>, limits: &Limits, shared: Shared<'_>) -> Result<Self> {
        match container.family() {
            Family::Patches if container.features().contains(Features::LATTICE) => {
                Ok(Self::Patches(surfabet_codec::patches::read(container, limits)?))
            }
            Family::Patches => {
                Ok(Self::Hscsm(surfabet_codec::hscsm::read(container, limits, shared.dictionary)?))
            }
            Family::Alphabet if container.features().contains(Features::BIC_ALPHABET) => {
                let known = shared.bic_alphabet;
                let model = surfabet_codec::bic_alphabet::read(container, limits, known)?;
                Ok(Self::BicAlphabet(model))
            }
            Family::Alphabet => Ok(Self::Alphabet(surfabet_codec::alphabet::read(
                container,
                limits,
                shared.alphabet,
            )?)),
            Family::Gas => Ok(Self::Gas(surfabet_codec::gas::read(container, limits)?)),
            Family::Planes => Ok(Self::Planes(surfabet_codec::planes::read(container, limits)?)),
        }
    }

    /// Reads an `.sfb` file, which need not be trusted.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::File`], both naming the file.
    pub fn open(path: impl AsRef<Path>, limits: &Limits) -> Result<Self> {
        Self::open_with(path, limits, Shared::default())
    }

    /// As [`Model::open`], for files that may name what is `shared` instead of holding it.
    ///
    /// # Errors
    /// As [`Model::open`]; also when the file names something else.
    pub fn open_with(path: impl AsRef<Path>, limits: &Limits, shared: Shared<'_>) -> Result<Self> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), source };
        let size = fs::metadata(path).map_err(io)?.len();
        let named = |error| match error {
            Error::Codec(source) => Error::File { path: path.to_owned(), source },
            other => other,
        };
        limits.check_size(size).map_err(|e| named(e.into()))?;
        Self::from_bytes_with(&fs::read(path).map_err(io)?, limits, shared).map_err(named)
    }

    /// The model as a cloud with points about `resolution` metres apart; `None` leaves the spacing to the model.
    ///
    /// # Errors
    /// [`Error::Model`] for an impossible spacing or when the caller asks to stop.
    pub fn decode(&self, resolution: Option<f64>, progress: &dyn Progress) -> Result<PointCloud> {
        let options = DecodeOptions { resolution, ..DecodeOptions::default() };
        match self {
            Self::Hscsm(model) => Ok(model.decode(options, progress)?),
            Self::Patches(model) => Ok(model.decode(options, progress)?),
            // Its spacing was chosen when it was learned.
            Self::BicAlphabet(model) => Ok(model.decode(options.max_points, progress)?),
            Self::Gas(model) => {
                let options = gas::DecodeOptions { resolution, ..gas::DecodeOptions::default() };
                Ok(model.decode(options, progress)?)
            }
            Self::Planes(model) => {
                let options =
                    planes::DecodeOptions { resolution, ..planes::DecodeOptions::default() };
                Ok(model.decode(options, progress)?)
            }
            Self::Alphabet(model) => {
                let options = MdlDecodeOptions { resolution, ..MdlDecodeOptions::default() };
                Ok(model.decode(options, progress)?)
            }
        }
    }
}
