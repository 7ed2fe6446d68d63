//! The file of an alphabet: header, words or their hash, occurrences, and the colours and intensities there.

use surfabet_models::alphabet::{Alphabet, AlphabetHeader, AlphabetModel, MAX_SCALE, MAX_WORDS};

use crate::bytes::ByteWriter;
use crate::container::{Family, Features};
use crate::entropy::Encoder;
use crate::error::Result;
use crate::hash::ContentHash;
use crate::header::Fields;
use crate::section::{Layout, Promise, StreamSection, Vocabulary};

/// Memory that an occurrence takes at most while it is read.
const BYTES_PER_OCCURRENCE: u64 = 512;

/// Largest coordinate of a sensor, units.
const MAX_SENSOR: u64 = 1 << 41;

/// Least bytes of a sensor's position.
const BYTES_PER_SENSOR: usize = 3;

const WORDS: usize = 0;
const OCCURRENCES: usize = 1;
const CHANNELS: usize = 2;

impl Layout for AlphabetModel {
    const FAMILY: Family = Family::Alphabet;
    const FEATURES: Features = Features::NONE;
    const STREAM_SECTIONS: &'static [StreamSection] = &[
        StreamSection::vocabulary(b"WORD", b"WREF", "words"),
        StreamSection::new(b"OCCR", "occurrences"),
        StreamSection::new(b"CHAN", "colour and intensity"),
    ];

    fn code_header<F: Fields>(fields: &mut F, header: &mut AlphabetHeader) -> Result<()> {
        fields.f64(&mut header.radius)?;
        fields.bounded("number of scales", &mut header.scales, MAX_SCALE + 1)?;
        fields.bounded("number of words", &mut header.n_words, MAX_WORDS)?;
        let scene = &mut header.scene;
        fields.varint(&mut scene.n_points)?;
        fields.count("number of occurrences", &mut header.n_occurrences, BYTES_PER_OCCURRENCE)?;
        fields.vector(&mut scene.origin)?;
        fields.single(&mut scene.spacing)?;
        if !(0.25..=4.0).contains(&scene.spacing) {
            return Err(fields.corrupt(format!("a spacing of {} sigma", scene.spacing)));
        }
        // The deviation is for information only. Zero: no range was known.
        let deviation = &mut scene.deviation;
        fields.single(&mut deviation.sigma_scale)?;
        let mut angle = deviation.angular_resolution.unwrap_or(0.0);
        fields.single(&mut angle)?;
        deviation.angular_resolution = (angle > 0.0).then_some(angle);
        let mut noise = deviation.noise.unwrap_or(0.0);
        fields.single(&mut noise)?;
        deviation.noise = Some(noise);
        fields.varint(&mut scene.rule.per_range)?;
        fields.varint(&mut scene.rule.constant)?;
        fields.list(
            "number of sensors",
            &mut scene.sensors,
            BYTES_PER_SENSOR,
            |fields, sensor| {
                sensor.iter_mut().try_for_each(|c| fields.signed(c))?;
                match sensor.iter().any(|c| c.unsigned_abs() > MAX_SENSOR) {
                    true => Err(fields.corrupt(format!("a sensor at {sensor:?} is out of range"))),
                    false => Ok(()),
                }
            },
        )?;
        if scene.sensors.len() > usize::from(u16::MAX) || !scene.sensors.is_sorted() {
            return Err(fields.corrupt("sensors are too many or not in order".into()));
        }
        let channels = &mut header.channels;
        fields.optional("colour step", &mut channels.color_step, 255)?;
        let mut ranges = u32::from(channels.intensities.is_some());
        fields.bounded("number of ranges of intensity", &mut ranges, 1)?;
        if ranges == 0 {
            channels.intensities = None;
            return Ok(());
        }
        let mut range = channels.intensities.unwrap_or_default();
        range.iter_mut().try_for_each(|v| fields.f32(v))?;
        if range[0] > range[1] {
            return Err(fields.corrupt(format!("intensities from {} to {}", range[0], range[1])));
        }
        channels.intensities = Some(range);
        Ok(())
    }

    fn has_section(header: &AlphabetHeader, stream: usize) -> bool {
        stream != CHANNELS || header.channels.count() > 0
    }

    fn promises(header: &AlphabetHeader) -> Vec<Promise> {
        let occurrences = header.n_occurrences;
        vec![
            Promise { stream: WORDS, what: "number of words", count: header.n_words.into() },
            Promise { stream: OCCURRENCES, what: "number of occurrences", count: occurrences },
        ]
    }
}

impl Vocabulary for Alphabet {
    /// Of radius, scales and number of words as in the header, and of the section of the words.
    fn content_hash(&self) -> ContentHash {
        let mut out = ByteWriter::new();
        out.f64(self.radius());
        out.varint(u64::from(self.scales()));
        out.varint(self.words().len() as u64);
        let mut encoder = Encoder::new();
        let Ok(_) = self.code(&mut encoder, self.words().len());
        out.bytes(&encoder.finish());
        ContentHash::of(&out.finish())
    }
}
