//! Any one model to `.sfb` bytes and files.

use std::fs;
use std::path::Path;

use surfabet_models::alphabet::AlphabetModel;
use surfabet_models::bic_alphabet::BicAlphabetModel;
use surfabet_models::gas::GasModel;
use surfabet_models::hscsm::HscsmModel;
use surfabet_models::patches::PatchModel;
use surfabet_models::planes::PlaneModel;

use crate::error::{Error, Result};

/// A model that can be written as an `.sfb` file.
pub trait Save {
    /// The bytes of an `.sfb` file with this model; the same model gives the same bytes.
    ///
    /// # Errors
    /// When the container cannot hold the model.
    fn to_bytes(&self) -> Result<Vec<u8>>;

    /// Writes an `.sfb` file; an existing one is replaced only when the new one is complete. Returns its size.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file.
    fn save(&self, path: impl AsRef<Path>) -> Result<u64> {
        write(path.as_ref(), &self.to_bytes()?)
    }
}

impl Save for HscsmModel {
    fn to_bytes(&self) -> Result<Vec<u8>> {
        Ok(surfabet_codec::hscsm::write(self)?)
    }
}

impl Save for PatchModel {
    fn to_bytes(&self) -> Result<Vec<u8>> {
        Ok(surfabet_codec::patches::write(self)?)
    }
}

impl Save for BicAlphabetModel {
    fn to_bytes(&self) -> Result<Vec<u8>> {
        Ok(surfabet_codec::bic_alphabet::write(self)?)
    }
}

impl Save for GasModel {
    fn to_bytes(&self) -> Result<Vec<u8>> {
        Ok(surfabet_codec::gas::write(self)?)
    }
}

impl Save for PlaneModel {
    fn to_bytes(&self) -> Result<Vec<u8>> {
        Ok(surfabet_codec::planes::write(self)?)
    }
}

impl Save for AlphabetModel {
    fn to_bytes(&self) -> Result<Vec<u8>> {
        Ok(surfabet_codec::alphabet::write(self)?)
    }
}

/// Writes a whole file or none.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<u64> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let mut partial = path.as_os_str().to_owned();
    partial.push(format!(".{}.part", std::process::id()));
    let written = fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, path));
    if written.is_err() {
        // The first error is the one to tell; a leftover that cannot be removed adds nothing to it.
        let _ = fs::remove_file(&partial);
    }
    written.map_err(io)?;
    Ok(bytes.len() as u64)
}
