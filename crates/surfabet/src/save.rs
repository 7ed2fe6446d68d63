//! Models to `.sfb` bytes and files.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, Write};
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
    with_partial(path, |file| file.write_all(bytes))
}

/// As [`write`], with what `fill` writes.
pub(crate) fn with_partial(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<u64> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let mut partial = path.as_os_str().to_owned();
    partial.push(format!(".{}.part", std::process::id()));
    let filled = File::create(&partial).and_then(|file| {
        let mut file = BufWriter::new(file);
        fill(&mut file)?;
        file.stream_position().and_then(|size| file.flush().map(|()| size))
    });
    let written = filled.and_then(|size| fs::rename(&partial, path).map(|()| size));
    if written.is_err() {
        // The first error is the one to report; a leftover that cannot be removed adds nothing to it.
        let _ = fs::remove_file(&partial);
    }
    written.map_err(io)
}
