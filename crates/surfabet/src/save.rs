//! Models to `.sfb` bytes and files.

use std::fs;
use std::path::Path;

use surfabet_codec::Layout;

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
    fn save(&self, path: impl AsRef<Path>) -> Result<u64>
    where
        Self: Sized,
    {
        write(path.as_ref(), &self.to_bytes()?)
    }
}

impl<M: Layout> Save for M {
    fn to_bytes(&self) -> Result<Vec<u8>> {
        Ok(surfabet_codec::write(self)?)
    }
}

/// Writes a whole file or none; returns its size.
///
/// # Errors
/// [`Error::Io`] naming the file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<u64> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let mut partial = path.as_os_str().to_owned();
    partial.push(format!(".{}.part", std::process::id()));
    let written = fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, path));
    if written.is_err() {
        // The first error is the one to report; a leftover that cannot be removed adds nothing to it.
        let _ = fs::remove_file(&partial);
    }
    written.map_err(io)?;
    Ok(bytes.len() as u64)
}
