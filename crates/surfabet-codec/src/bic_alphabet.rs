//! The file of a BIC alphabet: header, words or their hash, and where they occur.

use surfabet_models::bic_alphabet::{
    BicAlphabet, BicAlphabetHeader, BicAlphabetModel, BicShape, MAX_CELL, MAX_WORDS,
};
use surfabet_models::scans::Upright;

use crate::bytes::ByteWriter;
use crate::container::{Family, Features};
use crate::error::Result;
use crate::hash::ContentHash;
use crate::header::Fields;
use crate::section::{Layout, Promise, StreamSection, Vocabulary};

/// Memory that an occurrence takes while it is read.
const BYTES_PER_OCCURRENCE: u64 = 64;

/// Memory that a word takes at most beside its points.
const BYTES_PER_WORD: u64 = 2048;

/// The rules of what is up, by the number that stands for each in the file.
const UPRIGHT: [Upright; 3] = [Upright::WorldX, Upright::WorldZ, Upright::ViewDirection];

const WORDS: usize = 0;
const POSES: usize = 1;

impl Layout for BicAlphabetModel {
    const FAMILY: Family = Family::Alphabet;
    const FEATURES: Features = Features::BIC_ALPHABET;
    const STREAM_SECTIONS: &'static [StreamSection] = &[
        StreamSection::vocabulary(b"WORD", b"WREF", "words"),
        StreamSection::new(b"POSE", "poses"),
    ];

    fn code_header<F: Fields>(fields: &mut F, header: &mut BicAlphabetHeader) -> Result<()> {
        let (shape, scene) = (&mut header.shape, &mut header.scene);
        fields.varint(&mut scene.n_points)?;
        fields.vector(&mut scene.origin)?;
        fields.f64(&mut shape.radius)?;
        fields.bounded("pixels per side of a descriptor", &mut shape.descriptor_pixels, 32)?;
        let mut upright = upright_number(shape.upright);
        fields.bounded("upright rule", &mut upright, UPRIGHT.len() as u32 - 1)?;
        shape.upright = UPRIGHT[upright as usize];
        let mut n_words = u64::from(header.n_words);
        fields.count("number of words", &mut n_words, BYTES_PER_WORD)?;
        header.n_words = u32::try_from(n_words)
            .ok()
            .filter(|&n| n as usize <= MAX_WORDS)
            .ok_or_else(|| fields.corrupt(format!("{n_words} words, more than {MAX_WORDS}")))?;
        fields.f64(&mut scene.epsilon)?;
        for c in &mut scene.low {
            fields.signed_32("a lowest cell", c)?;
            if c.unsigned_abs() > MAX_CELL as u32 {
                return Err(fields.corrupt(format!("a lowest cell of {c}")));
            }
        }
        fields.count("number of occurrences", &mut header.n_occurrences, BYTES_PER_OCCURRENCE)
    }

    fn promises(header: &BicAlphabetHeader) -> Vec<Promise> {
        let occurrences = header.n_occurrences;
        vec![
            Promise { stream: WORDS, what: "number of words", count: header.n_words.into() },
            Promise { stream: POSES, what: "number of occurrences", count: occurrences },
        ]
    }
}

impl Vocabulary for BicAlphabet {
    /// Its content is written out in `docs/format.md`.
    fn content_hash(&self) -> ContentHash {
        let BicShape { radius, descriptor_pixels, upright } = self.shape();
        let mut out = ByteWriter::new();
        out.f64(radius);
        out.varint(u64::from(descriptor_pixels));
        out.varint(u64::from(upright_number(upright)));
        out.varint(self.len() as u64);
        let byte = |v: &i8| v.to_le_bytes()[0];
        for word in self.words() {
            out.varint(word.points.len() as u64);
            out.bytes(&word.points.as_flattened().iter().map(byte).collect::<Vec<u8>>());
            out.bytes(&word.descriptor.iter().map(byte).collect::<Vec<u8>>());
        }
        ContentHash::of(&out.finish())
    }
}

/// The number that stands for a rule in the file.
fn upright_number(upright: Upright) -> u32 {
    // Every rule is in the list.
    UPRIGHT.iter().position(|u| *u == upright).unwrap_or(0) as u32
}
