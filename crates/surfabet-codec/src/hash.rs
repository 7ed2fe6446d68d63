//! Content hash by which a file names the shared dictionary it was made with.

use std::fmt;

use crate::error::{Error, Result};

/// The first 16 bytes of the BLAKE3 hash of some content.
///
/// 128 bits: two different dictionaries with one hash are not met by accident (2^64 dictionaries for an even
/// chance).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct ContentHash(pub [u8; 16]);

impl ContentHash {
    /// Hash of `content`.
    pub fn of(content: &[u8]) -> Self {
        let full: [u8; 32] = blake3::hash(content).into();
        let mut first = [0; 16];
        first.copy_from_slice(&full[..16]);
        Self(first)
    }

    /// [`Error::DictionaryMismatch`] unless `content` has this hash.
    pub fn verify(&self, content: &[u8]) -> Result<()> {
        let found = Self::of(content);
        if found == *self {
            Ok(())
        } else {
            Err(Error::DictionaryMismatch { expected: *self, found })
        }
    }
}

impl fmt::Display for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ContentHash({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_content_has_the_published_hash() {
        // First half of the test vector for input length 0 in the BLAKE3 specification.
        assert_eq!(ContentHash::of(b"").to_string(), "af1349b9f5f9a1a6a0404dea36dcc949");
    }

    #[test]
    fn verify_names_both_hashes() {
        let hash = ContentHash::of(b"chairs");
        assert_eq!(hash.verify(b"chairs"), Ok(()));
        let message = hash.verify(b"doors").unwrap_err().to_string();
        assert!(message.contains(&hash.to_string()), "{message}");
        assert!(message.contains(&ContentHash::of(b"doors").to_string()), "{message}");
    }
}
