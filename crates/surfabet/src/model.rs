//! A model of any family, to and from `.sfb` bytes and files.

use std::fs;
use std::path::Path;

use surfabet_codec::{Container, Family, Features, Limits};
use surfabet_geom::{PointCloud, Progress};
use surfabet_models::gas::{self, GasModel};
use surfabet_models::patches::lattice::LatticeModel;
use surfabet_models::patches::{DecodeOptions, PatchDictionary, PatchModel};

use crate::error::{Error, Result};

/// A model of any family.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Model {
    /// Sparse-coded surface patches.
    Patches(PatchModel),
    /// Surface patches on a lattice.
    Lattice(LatticeModel),
    /// A growing neural gas.
    Gas(GasModel),
}

impl From<GasModel> for Model {
    fn from(model: GasModel) -> Self {
        Self::Gas(model)
    }
}

impl From<LatticeModel> for Model {
    fn from(model: LatticeModel) -> Self {
        Self::Lattice(model)
    }
}

impl From<PatchModel> for Model {
    fn from(model: PatchModel) -> Self {
        Self::Patches(model)
    }
}

impl Model {
    /// The family that this model belongs to.
    pub fn family(&self) -> Family {
        match self {
            Self::Patches(_) | Self::Lattice(_) => Family::Patches,
            Self::Gas(_) => Family::Gas,
        }
    }

    /// The bytes of an `.sfb` file with this model; the same model gives the same bytes.
    ///
    /// # Errors
    /// When the container cannot hold the model.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        match self {
            Self::Patches(model) => Ok(surfabet_codec::patches::write(model)?),
            Self::Lattice(model) => Ok(surfabet_codec::lattice::write(model)?),
            Self::Gas(model) => Ok(surfabet_codec::gas::write(model)?),
        }
    }

    /// Reads the bytes of an `.sfb` file, which need not be trusted.
    ///
    /// # Errors
    /// [`Error::Codec`] when anything is wrong with them.
    pub fn from_bytes(bytes: &[u8], limits: &Limits) -> Result<Self> {
        Self::from_bytes_with(bytes, limits, None)
    }

    /// As [`Model::from_bytes`], for files that may refer to `dictionary` instead of holding one.
    ///
    /// # Errors
    /// [`Error::Codec`] when anything is wrong with them, or they refer to another dictionary.
    pub fn from_bytes_with(
        bytes: &[u8],
        limits: &Limits,
        dictionary: Option<&PatchDictionary>,
    ) -> Result<Self> {
        let container = Container::parse(bytes, limits)?;
        match container.family() {
            Family::Patches if container.features().contains(Features::LATTICE) => {
                Ok(Self::Lattice(surfabet_codec::lattice::read(&container, limits)?))
            }
            Family::Patches => {
                Ok(Self::Patches(surfabet_codec::patches::read(&container, limits, dictionary)?))
            }
            Family::Gas => Ok(Self::Gas(surfabet_codec::gas::read(&container, limits)?)),
            other => Err(surfabet_codec::Error::UnknownFamily {
                found: other as u8,
                needed: container.needed_version(),
            }
            .into()),
        }
    }

    /// Writes an `.sfb` file; an existing one is replaced only when the new one is complete. Returns its size.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<u64> {
        let path = path.as_ref();
        let bytes = self.to_bytes()?;
        let io = |source| Error::Io { path: path.to_owned(), source };
        let mut partial = path.as_os_str().to_owned();
        partial.push(format!(".{}.part", std::process::id()));
        let written = fs::write(&partial, &bytes).and_then(|()| fs::rename(&partial, path));
        if written.is_err() {
            // The first error is the one to tell; a leftover that cannot be removed adds nothing to it.
            let _ = fs::remove_file(&partial);
        }
        written.map_err(io)?;
        Ok(bytes.len() as u64)
    }

    /// Reads an `.sfb` file, which need not be trusted.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::File`], both naming the file.
    pub fn open(path: impl AsRef<Path>, limits: &Limits) -> Result<Self> {
        Self::open_with(path, limits, None)
    }

    /// As [`Model::open`], for files that may refer to `dictionary` instead of holding one.
    ///
    /// # Errors
    /// As [`Model::open`]; also when the file refers to another dictionary.
    pub fn open_with(
        path: impl AsRef<Path>,
        limits: &Limits,
        dictionary: Option<&PatchDictionary>,
    ) -> Result<Self> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), source };
        let size = fs::metadata(path).map_err(io)?.len();
        let named = |error| match error {
            Error::Codec(source) => Error::File { path: path.to_owned(), source },
            other => other,
        };
        limits.check_size(size).map_err(|e| named(e.into()))?;
        Self::from_bytes_with(&fs::read(path).map_err(io)?, limits, dictionary).map_err(named)
    }

    /// The model as a cloud with points about `resolution` metres apart; `None` leaves the spacing to the model.
    ///
    /// # Errors
    /// [`Error::Model`] for an impossible spacing or when the caller asks to stop.
    pub fn decode(&self, resolution: Option<f64>, progress: &dyn Progress) -> Result<PointCloud> {
        match self {
            Self::Patches(model) => {
                let options = DecodeOptions { resolution, ..DecodeOptions::default() };
                Ok(model.decode(options, progress)?)
            }
            Self::Lattice(model) => {
                let options = DecodeOptions { resolution, ..DecodeOptions::default() };
                Ok(model.decode(options, progress)?)
            }
            Self::Gas(model) => {
                let options = gas::DecodeOptions { resolution, ..gas::DecodeOptions::default() };
                Ok(model.decode(options, progress)?)
            }
        }
    }
}
