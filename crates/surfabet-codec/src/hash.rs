//! Content hash by which a file names the shared dictionary or alphabet it was made with.

use std::fmt;

use crate::container::{Container, Features, Tag};
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

    /// The hash in section `tag` of a file that names shared content; `None` for one that holds its own.
    pub(crate) fn named_by(container: &Container<'_>, tag: Tag) -> Result<Option<Self>> {
        if !container.features().contains(Features::SHARED_DICTIONARY) {
            return Ok(None);
        }
        let bytes = container.require(tag)?;
        let wrong = |_| Error::corrupt(tag, 0, format!("a hash of {} bytes, not 16", bytes.len()));
        Ok(Some(Self(bytes.try_into().map_err(wrong)?)))
    }

    /// `given`, when it has this hash; [`Error::MissingDictionary`] without it, [`Error::DictionaryMismatch`] for
    /// another.
    pub(crate) fn of_given<T>(self, given: Option<&T>, hash: impl Fn(&T) -> Self) -> Result<&T> {
        let given = given.ok_or(Error::MissingDictionary { expected: self })?;
        let found = hash(given);
        if found != self {
            return Err(Error::DictionaryMismatch { expected: self, found });
        }
        Ok(given)
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
    fn a_refusal_names_the_hashes() {
        let of = |content: &&[u8]| ContentHash::of(content);
        let [chairs, doors]: [&[u8]; 2] = [b"chairs", b"doors"];
        let hash = of(&chairs);
        assert_eq!(hash.of_given(Some(&chairs), of), Ok(&chairs));
        let message = hash.of_given(Some(&doors), of).unwrap_err().to_string();
        assert!(message.contains(&hash.to_string()), "{message}");
        assert!(message.contains(&of(&doors).to_string()), "{message}");
        let message = hash.of_given(None, of).unwrap_err().to_string();
        assert!(message.contains(&hash.to_string()), "{message}");
    }
}
