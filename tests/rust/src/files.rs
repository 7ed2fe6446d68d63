//! Files of models: those of earlier releases, and those that are made to be refused.

use std::path::PathBuf;

use surfabet::{Container, Layout, Limits, Model};
use surfabet_codec::{ContainerWriter, Features, Tag};

/// What a reader of untrusted files would allow.
pub const LIMITS: Limits = Limits { max_items: 1_000_000, max_bytes: 64 << 20 };

/// Where files of earlier releases lie.
pub fn golden(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../golden").join(name)
}

/// A file as a model of the method `M`.
///
/// # Errors
/// Those of reading.
///
/// # Panics
/// When the file holds a model of another method.
pub fn read<M: Layout>(file: &[u8]) -> Result<M, surfabet::Error> {
    let model = Model::from_bytes(file, &LIMITS)?;
    match model.as_any_model().as_any().downcast_ref::<M>() {
        Some(model) => Ok(model.clone()),
        None => panic!("a model of {}", model.method()),
    }
}

/// The error of a file that is refused for what its bytes hold.
///
/// # Panics
/// When the file is read, or refused for another reason.
pub fn codec_error<M: Layout>(file: &[u8]) -> surfabet_codec::Error {
    match read::<M>(file) {
        Err(surfabet::Error::Codec(error)) => error,
        other => panic!("{other:?}"),
    }
}

/// The sections of a file, to be changed and put together again.
pub fn sections(file: &[u8]) -> Vec<(Tag, Vec<u8>)> {
    let container = Container::parse(file, &LIMITS).unwrap();
    container.sections().iter().map(|s| (s.tag, s.bytes.to_vec())).collect()
}

/// A file of the method `M` with these sections and valid checksums, so that only the content can be refused. It says that
/// it needs the `optional` features beside those that every file of the method needs.
pub fn put_together<M: Layout>(optional: Features, sections: &[(Tag, Vec<u8>)]) -> Vec<u8> {
    let writer = ContainerWriter::new(M::FAMILY, M::FEATURES.with(optional));
    sections.iter().fold(writer, |w, (tag, bytes)| w.section(*tag, bytes.clone())).finish().unwrap()
}

/// Two listings have the same lines of numbers, each within `tolerance` of its column and its expected value.
pub fn assert_same_numbers(found: &str, expected: &str, tolerance: impl Fn(usize, f64) -> f64) {
    let numbers = |line: &str| -> Vec<f64> {
        let words = line.split([' ', ',', '[', ']']).filter(|word| !word.is_empty());
        words.map(|word| word.parse().unwrap()).collect()
    };
    assert_eq!(found.lines().count(), expected.lines().count());
    for (found, expected) in found.lines().zip(expected.lines()) {
        let [f, e] = [found, expected].map(numbers);
        let near = |i: usize| (f[i] - e[i]).abs() <= tolerance(i, e[i]);
        assert!(
            f.len() == e.len() && (0..f.len()).all(near),
            "{found} where {expected} was written"
        );
    }
}
