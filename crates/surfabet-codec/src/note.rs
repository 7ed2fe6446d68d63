//! A note in a file: a line for people, which no model depends on.

use crate::container::{Container, ContainerWriter, Limits, Tag};
use crate::error::{Error, Result};

/// The section of the note, which readers may skip.
pub(crate) const NOTE: Tag = Tag::new(b"note");

/// Longest note, bytes of UTF-8.
pub const MAX_NOTE: usize = 1024;

/// The bytes of a model file with a note in place of the one that it has; an empty one takes it away.
///
/// # Errors
/// [`Error::TooLarge`] for a note of more than [`MAX_NOTE`] bytes; those of [`Container::parse`] for bytes that are no file.
pub fn with_note(file: &[u8], note: &str) -> Result<Vec<u8>> {
    if note.len() > MAX_NOTE {
        return Err(Error::TooLarge {
            what: "bytes of the note",
            value: note.len() as u64,
            limit: MAX_NOTE as u64,
            remedy: "shorten it",
        });
    }
    let container = Container::parse(file, &Limits { max_items: u64::MAX, max_bytes: u64::MAX })?;
    let mut writer = ContainerWriter::new(container.family(), container.features());
    for section in container.sections().iter().filter(|s| s.tag != NOTE) {
        writer = writer.section(section.tag, section.bytes.to_vec());
    }
    if !note.is_empty() {
        writer = writer.section(NOTE, note.as_bytes().to_vec());
    }
    writer.finish()
}

/// The note of a file, if it has one that is no longer than it may be. What is no text, and what would steer a terminal, is
/// replaced.
pub fn note(container: &Container<'_>) -> Option<String> {
    let bytes = container.section(NOTE).filter(|bytes| bytes.len() <= MAX_NOTE)?;
    let visible = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    Some(String::from_utf8_lossy(bytes).chars().map(visible).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::container::{Family, Features};

    fn file() -> Vec<u8> {
        let writer = ContainerWriter::new(Family::Gas, Features::NONE);
        writer.section(Tag::new(b"DATA"), vec![1, 2, 3]).finish().unwrap()
    }

    fn note_of(file: &[u8]) -> Option<String> {
        note(&Container::parse(file, &Limits::default()).unwrap())
    }

    #[test]
    fn a_note_is_read_back_replaced_and_taken_away() {
        let noted = with_note(&file(), "resolution 0.05: 3 spacings of 0.0167 m").unwrap();
        assert_eq!(note_of(&noted).unwrap(), "resolution 0.05: 3 spacings of 0.0167 m");
        // The tag, a length of one byte, the checksum, and the text.
        assert_eq!(noted.len(), file().len() + 9 + 39);
        let container = Container::parse(&noted, &Limits::default()).unwrap();
        assert_eq!(container.require(Tag::new(b"DATA")), Ok(&[1, 2, 3][..]));
        container.expect_only(&[Tag::new(b"DATA")]).unwrap();
        assert_eq!(note_of(&with_note(&noted, "ü").unwrap()).unwrap(), "ü");
        assert_eq!(with_note(&noted, "").unwrap(), file());
        assert_eq!(note_of(&file()), None);
    }

    #[test]
    fn notes_are_bounded_and_steer_no_terminal() {
        assert!(with_note(&file(), &"x".repeat(MAX_NOTE)).is_ok());
        let error = with_note(&file(), &"x".repeat(MAX_NOTE + 1)).unwrap_err();
        assert!(matches!(error, Error::TooLarge { limit: 1024, .. }), "{error}");
        let written = |bytes: Vec<u8>| {
            let writer = ContainerWriter::new(Family::Gas, Features::NONE);
            writer.section(NOTE, bytes).finish().unwrap()
        };
        assert_eq!(note_of(&written(b"a\x1b[2Jb\xff".to_vec())).unwrap(), "a\u{fffd}[2Jb\u{fffd}");
        assert_eq!(note_of(&written(vec![b'x'; MAX_NOTE + 1])), None);
    }
}
