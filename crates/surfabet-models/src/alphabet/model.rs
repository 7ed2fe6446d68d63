//! The model: an alphabet, and where its words occur.

use surfabet_entropy::{Coder, Price};

use super::channels::Channels;
use super::coding::{CodingParams, code_channels, code_occurrences, code_words};
use super::lattice::{MAX_CELL, MAX_SCALE, SigmaRule, UNITS, sigma};
use super::learn::AlphabetReport;
use super::options::MAX_WORDS;
use super::placement::{Placement, WordPose};
use super::word::Word;
use crate::error::{Error, Result};
use crate::report::Beside;
use crate::scans::Deviation;

/// Largest radius of a word, metres: with it every coordinate that a file can hold is finite in single precision.
const MAX_RADIUS: f64 = 1e12;

/// Words and the radii that they occur in, for any number of scenes.
#[derive(Debug, Clone, PartialEq)]
pub struct Alphabet {
    radius: f64,
    scales: u32,
    words: Vec<Word>,
}

impl Alphabet {
    /// An alphabet of `words`, the first of which is the plane: word 0 of every alphabet.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] for a radius that is not positive or too large, 0 or more than 8 scales, no or too many words, or
    /// another first word than the plane.
    pub fn new(radius: f64, scales: u32, words: Vec<Word>) -> Result<Self> {
        let wrong = |what: String| Err(Error::Inconsistent(what));
        if !(radius > 0.0 && radius <= MAX_RADIUS) {
            return wrong(format!("a radius of {radius} m"));
        }
        if !(1..=MAX_SCALE + 1).contains(&scales) {
            return wrong(format!("{scales} scales"));
        }
        if words.len() > MAX_WORDS as usize || words.first() != Some(&Word::plane()) {
            return wrong(format!(
                "an alphabet of {} words, or one without its plane",
                words.len()
            ));
        }
        Ok(Self { radius, scales, words })
    }

    /// The alphabet of the plane alone.
    ///
    /// # Errors
    /// As [`Alphabet::new`].
    pub fn plane(radius: f64, scales: u32) -> Result<Self> {
        Self::new(radius, scales, vec![Word::plane()])
    }

    /// Reads as many words as the header counts.
    ///
    /// # Errors
    /// Those of the coder, also for sizes or words that no alphabet has.
    pub(super) fn read<C: Coder>(header: &AlphabetHeader, coder: &mut C) -> Result<Self, C::Error> {
        let n = header.n_words as usize;
        let plane =
            Self::plane(header.radius, header.scales).map_err(|e| coder.corrupt(e.to_string()))?;
        let words = plane.code(coder, n)?;
        Self::new(header.radius, header.scales, words).map_err(|e| coder.corrupt(e.to_string()))
    }

    /// Smallest radius of a word, metres.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Number of radii, each twice the one before.
    pub fn scales(&self) -> u32 {
        self.scales
    }

    /// The words; the first is the plane.
    pub fn words(&self) -> &[Word] {
        &self.words
    }

    /// Writes, reads or prices the words; when reading, the words of `self` are ignored.
    ///
    /// # Errors
    /// Whatever the coder finds wrong with what it reads.
    pub fn code<C: Coder>(&self, coder: &mut C, n_words: usize) -> Result<Vec<Word>, C::Error> {
        let mut words = vec![Word::plane()];
        words.extend(code_words(
            coder,
            n_words.saturating_sub(1),
            self.words.get(1..).unwrap_or(&[]),
        )?);
        Ok(words)
    }
}

/// The scene that a model describes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Header {
    /// Points of the cloud that was described.
    pub n_points: u64,
    /// Corner of the lattice in world coordinates, metres.
    pub origin: [f64; 3],
    /// Spacing of decoded points, in sigma.
    pub spacing: f64,
    /// Sigma in metres, as learned; for information.
    pub deviation: Deviation,
    /// Sigma in units.
    pub rule: SigmaRule,
    /// Positions of the sensors, units from the corner of the lattice; ascending.
    pub sensors: Vec<[i64; 3]>,
}

impl Header {
    /// Rounds to what a file holds, so that a model is the same before it is saved and after it is read: spacing and
    /// deviation in single precision, no noise as zero.
    fn round(&mut self) {
        let single = |value: f64| f64::from(value as f32);
        self.spacing = single(self.spacing);
        let deviation = &mut self.deviation;
        deviation.sigma_scale = single(deviation.sigma_scale);
        deviation.angular_resolution = deviation.angular_resolution.map(single);
        deviation.noise = Some(single(deviation.noise.unwrap_or(0.0)));
    }
}

/// What the file holds before its streams.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AlphabetHeader {
    /// Smallest radius of a word, metres.
    pub radius: f64,
    /// Number of radii, each twice the one before.
    pub scales: u32,
    /// Number of words, with the plane.
    pub n_words: u32,
    /// Number of occurrences.
    pub n_occurrences: u64,
    /// Which colours and intensities occurrences have.
    pub channels: Channels,
    /// The scene.
    pub scene: Header,
}

/// Colours and intensities of all occurrences.
#[derive(Debug, Clone, PartialEq)]
pub struct Attributes {
    /// How they are rounded.
    pub channels: Channels,
    /// Per occurrence, the steps of every channel.
    pub values: Vec<Vec<i32>>,
}

/// Where a word occurs, in world coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Occurrence {
    /// Which word.
    pub word: u16,
    /// Its radius, metres.
    pub radius: f64,
    /// Middle of the word, metres.
    pub center: [f64; 3],
    /// Rows: right, up, and the normal towards the sensor.
    pub rows: [[f64; 3]; 3],
    /// Deviation allowed there, metres.
    pub sigma: f64,
}

/// A scene as occurrences of words.
#[derive(Debug, Clone, PartialEq)]
pub struct AlphabetModel {
    header: Header,
    alphabet: Alphabet,
    placements: Vec<Placement>,
    attributes: Option<Attributes>,
    shares_vocabulary: bool,
    report: Beside<AlphabetReport>,
}

/// What the coder of the occurrences has to know.
fn coding_params(header: &Header, alphabet: &Alphabet) -> CodingParams {
    CodingParams {
        scales: alphabet.scales,
        rule: header.rule,
        sensors: header.sensors.clone(),
        n_words: alphabet.words.len() as u32,
    }
}

impl AlphabetModel {
    /// From occurrences in any order, each with its channels; they are brought into the file's order.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] when an occurrence does not fit the alphabet or the lattice.
    pub(super) fn new(
        mut header: Header,
        alphabet: Alphabet,
        mut occurrences: Vec<(Placement, Vec<i32>)>,
        channels: Channels,
        shares_vocabulary: bool,
    ) -> Result<Self> {
        header.round();
        let fits = |p: &Placement| {
            u32::from(p.scale) < alphabet.scales
                && usize::from(p.word) < alphabet.words.len()
                && usize::from(p.view) < header.sensors.len().max(1)
                && p.cell.iter().all(|c| (0..MAX_CELL).contains(c))
        };
        if let Some((p, _)) = occurrences.iter().find(|(p, _)| !fits(p)) {
            return Err(Error::Inconsistent(format!(
                "{p:?} does not fit the alphabet or the lattice"
            )));
        }
        occurrences.sort();
        let given: Vec<Placement> = occurrences.iter().map(|(p, _)| *p).collect();
        let params = coding_params(&header, &alphabet);
        let mut price = Price::default();
        let Ok(placements) =
            code_occurrences(&mut price, &params, &given, given.len(), &mut |_, _| {});
        let attributes = (channels.count() > 0).then(|| Attributes {
            channels,
            values: placements
                .iter()
                .map(|p| {
                    let k = occurrences.partition_point(|(other, _)| other < p);
                    occurrences[k].1.clone()
                })
                .collect(),
        });
        let report = Beside::default();
        Ok(Self { header, alphabet, placements, attributes, shares_vocabulary, report })
    }

    /// Writes or prices the occurrences to one coder and their channels to another.
    ///
    /// # Errors
    /// Those of the coders.
    pub(super) fn write<C: Coder>(
        &self,
        occurrences: &mut C,
        channels: &mut C,
    ) -> Result<(), C::Error> {
        let params = coding_params(&self.header, &self.alphabet);
        let n = self.placements.len();
        code_occurrences(occurrences, &params, &self.placements, n, &mut |_, _| {})?;
        if let Some(a) = &self.attributes {
            let scales = self.alphabet.scales;
            code_channels(channels, &self.placements, scales, a.channels.count(), &a.values)?;
        }
        Ok(())
    }

    /// Reads `n` occurrences from one coder and their channels from another. Header and alphabet are checked already.
    ///
    /// # Errors
    /// Whatever the coders find wrong with what they read.
    pub(super) fn read<C: Coder>(
        header: Header,
        alphabet: Alphabet,
        n: usize,
        kept: Channels,
        shares_vocabulary: bool,
        occurrences: &mut C,
        channels: &mut C,
    ) -> Result<Self, C::Error> {
        let params = coding_params(&header, &alphabet);
        let placements = code_occurrences(occurrences, &params, &[], n, &mut |_, _| {})?;
        if placements.len() != n {
            let found = placements.len();
            return Err(
                occurrences.corrupt(format!("{found} occurrences where the header counts {n}"))
            );
        }
        let count = kept.count();
        let attributes = if count > 0 {
            let scales = alphabet.scales;
            let values = code_channels(channels, &placements, scales, count, &[])?;
            Some(Attributes { channels: kept, values })
        } else {
            None
        };
        let report = Beside::default();
        Ok(Self { header, alphabet, placements, attributes, shares_vocabulary, report })
    }

    /// Number of occurrences.
    pub fn len(&self) -> usize {
        self.placements.len()
    }

    /// True when no word occurs.
    pub fn is_empty(&self) -> bool {
        self.placements.is_empty()
    }

    /// The words that occur.
    pub fn alphabet(&self) -> &Alphabet {
        &self.alphabet
    }

    /// Whether the model's file names its alphabet instead of holding it.
    pub fn shares_vocabulary(&self) -> bool {
        self.shares_vocabulary
    }

    /// The scene that the model describes.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Colours and intensities; `None` without either.
    pub fn attributes(&self) -> Option<&Attributes> {
        self.attributes.as_ref()
    }

    /// Sigma at no range, metres: all of it where no range is known.
    pub fn constant_sigma(&self) -> f64 {
        (self.header.rule.constant as f64).sqrt() * self.unit()
    }

    /// Corner of the lattice in world coordinates, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.header.origin
    }

    /// Whether occurrences have a colour.
    pub fn has_color(&self) -> bool {
        self.attributes.as_ref().is_some_and(|a| a.channels.color_step.is_some())
    }

    /// Whether occurrences have an intensity.
    pub fn has_intensity(&self) -> bool {
        self.attributes.as_ref().is_some_and(|a| a.channels.intensities.is_some())
    }

    /// Red, green and blue of every occurrence; `None` without colour.
    pub fn colors(&self) -> Option<Vec<[u8; 3]>> {
        let kept = self.attributes.as_ref()?;
        kept.values.iter().map(|values| kept.channels.color(values)).collect()
    }

    /// Intensity of every occurrence, in the sensor's own unit; `None` without.
    pub fn intensities(&self) -> Option<Vec<f32>> {
        let kept = self.attributes.as_ref()?;
        kept.values.iter().map(|values| kept.channels.intensity(values)).collect()
    }

    /// Points of the cloud that was described.
    pub fn n_points(&self) -> u64 {
        self.header.n_points
    }

    /// How the model came about; empty for one that was read from a file.
    pub fn report(&self) -> &AlphabetReport {
        &self.report.0
    }

    /// The model with the report of its learning.
    pub(super) fn with_report(self, report: AlphabetReport) -> Self {
        Self { report: Beside(report), ..self }
    }

    pub(super) fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// Metres per unit.
    pub(crate) fn unit(&self) -> f64 {
        self.alphabet.radius / UNITS as f64
    }

    /// Poses of the occurrences in units, with their words.
    pub(crate) fn poses(&self) -> impl ExactSizeIterator<Item = (WordPose, &Word)> + use<'_> {
        let params = coding_params(&self.header, &self.alphabet);
        self.placements.iter().map(move |p| {
            let pose = p.pose(params.level(p), params.sensor(p.view));
            (pose, &self.alphabet.words[usize::from(p.word)])
        })
    }

    /// Where words occur, in the file's order.
    pub fn occurrences(&self) -> impl ExactSizeIterator<Item = Occurrence> + use<'_> {
        let unit = self.unit();
        self.poses().zip(&self.placements).map(move |((pose, _), p)| Occurrence {
            word: p.word,
            radius: pose.radius * unit,
            center: std::array::from_fn(|a| self.header.origin[a] + pose.center[a] * unit),
            rows: pose.rows,
            sigma: sigma(pose.level) * unit,
        })
    }

    /// Lowest and highest corner of a box around all occurrences and what is within sigma of them, world coordinates; not finite
    /// for a model without occurrences.
    pub fn extent(&self) -> [[f64; 3]; 2] {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for o in self.occurrences() {
            let reach: [f64; 3] = std::array::from_fn(|a| {
                o.radius * (o.rows[0][a].abs() + o.rows[1][a].abs()) + o.sigma
            });
            low = std::array::from_fn(|a| low[a].min(o.center[a] - reach[a]));
            high = std::array::from_fn(|a| high[a].max(o.center[a] + reach[a]));
        }
        [low, high]
    }
}
