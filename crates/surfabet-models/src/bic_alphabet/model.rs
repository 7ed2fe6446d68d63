//! The alphabet and the model, in the integers that a file stores.

use surfabet_entropy::Coder;

use super::coding::{code_occurrences, code_words};
use super::features::{EMPTY, pixel_centers};
use super::options::BicAlphabetOptions;
use super::pose::{BicPose, CELL, Frame, MAX_POSITION, NORMAL_BITS};
use super::report::BicAlphabetReport;
use super::words::{BicWord, MAX_WORD_POINTS, point_step};
use crate::error::{Error, Result};
use crate::report::Beside;
use crate::scans::Upright;

/// Most words of an alphabet.
pub const MAX_WORDS: usize = 1 << 16;

/// Largest coordinate of a cell.
pub const MAX_CELL: i32 = MAX_POSITION / CELL;

/// Most pixels per side of a descriptor.
const MAX_PIXELS: u32 = 32;

/// What words have in common.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BicShape {
    /// Delta, the radius of a word, metres.
    pub radius: f64,
    /// Pixels per side of a descriptor.
    pub descriptor_pixels: u32,
    /// What is up where the normal is vertical.
    pub upright: Upright,
}

impl BicShape {
    /// Number of pixels of a descriptor: those within the circle.
    pub fn pixels(&self) -> usize {
        pixel_centers(self.descriptor_pixels, 1.0).len()
    }

    /// Heights of a descriptor, metres, as a square image: rows from the lowest up, not a number where the surface is
    /// not known and outside of the circle.
    pub fn heights(&self, word: &BicWord) -> Vec<f32> {
        let side = self.descriptor_pixels as usize;
        let mut image = vec![f32::NAN; side * side];
        let column = |c: f32| (0.5 * (c + 1.0) * side as f32) as usize;
        for ([u, v], &h) in pixel_centers(self.descriptor_pixels, 1.0).iter().zip(&word.descriptor)
        {
            if h != EMPTY {
                image[column(*v) * side + column(*u)] = (f64::from(h) * self.point_step()) as f32;
            }
        }
        image
    }

    /// Metres per step of a word's points and of a descriptor's heights.
    pub fn point_step(&self) -> f64 {
        point_step(self.radius)
    }

    fn check(&self) -> Result<()> {
        if !(1e-6..1e6).contains(&self.radius) {
            return Err(Error::Inconsistent(format!("a radius of {} m", self.radius)));
        }
        if !(2..=MAX_PIXELS).contains(&self.descriptor_pixels) {
            let what = format!("{} pixels per side, not 2 to 32", self.descriptor_pixels);
            return Err(Error::Inconsistent(what));
        }
        Ok(())
    }
}

/// Words that recur in a scene; immutable.
#[derive(Debug, Clone, PartialEq)]
pub struct BicAlphabet {
    shape: BicShape,
    words: Vec<BicWord>,
}

impl BicAlphabet {
    /// An alphabet of given words.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] when a number is out of its range.
    pub fn new(shape: BicShape, words: Vec<BicWord>) -> Result<Self> {
        shape.check()?;
        let fail = |what: String| Err(Error::Inconsistent(what));
        if words.len() > MAX_WORDS {
            return fail(format!("{} words, more than {MAX_WORDS}", words.len()));
        }
        let pixels = shape.pixels();
        for word in &words {
            if word.points.is_empty() || word.points.len() > MAX_WORD_POINTS {
                return fail(format!("a word of {} points", word.points.len()));
            }
            if word.points.windows(2).any(|w| w[0] > w[1]) {
                return fail("points of a word that are not ascending".to_owned());
            }
            if word.descriptor.len() != pixels {
                let found = word.descriptor.len();
                return fail(format!("a descriptor of {found} pixels instead of {pixels}"));
            }
        }
        Ok(Self { shape, words })
    }

    /// The alphabet of the `n` words that were accepted first, or of all where there are fewer: what learning had after
    /// some of its iterations.
    #[must_use]
    pub fn first(&self, n: usize) -> Self {
        Self { shape: self.shape, words: self.words.iter().take(n).cloned().collect() }
    }

    pub(super) fn learned(words: Vec<BicWord>, options: &BicAlphabetOptions) -> Result<Self> {
        let BicAlphabetOptions { descriptor_pixels, upright, .. } = *options;
        let radius = options.radius();
        Self::new(BicShape { radius, descriptor_pixels, upright }, words)
    }

    /// Default options for words of this kind, to describe a cloud with.
    pub fn options(&self) -> BicAlphabetOptions {
        let BicShape { radius, descriptor_pixels, upright } = self.shape;
        BicAlphabetOptions {
            radius: Some(radius),
            descriptor_pixels,
            upright,
            ..BicAlphabetOptions::default()
        }
    }

    /// Refuses options of another kind of words.
    pub(super) fn check(&self, options: &BicAlphabetOptions) -> Result<()> {
        let mismatch = |name: &str, own: String, given: String| {
            Err(Error::Inconsistent(format!(
                "the alphabet has {name} {own}, the options have {given}; give those of the alphabet"
            )))
        };
        let BicShape { radius, descriptor_pixels, upright } = self.shape;
        if (radius - options.radius()).abs() > 1e-9 * radius {
            return mismatch("radius", radius.to_string(), options.radius().to_string());
        }
        if descriptor_pixels != options.descriptor_pixels {
            let given = options.descriptor_pixels.to_string();
            return mismatch("descriptor_pixels", descriptor_pixels.to_string(), given);
        }
        if upright != options.upright {
            let [own, given] = [upright, options.upright].map(|u| format!("{u:?}"));
            return mismatch("upright", own, given);
        }
        if self.words.is_empty() {
            return Err(Error::Inconsistent("an alphabet without words describes nothing".into()));
        }
        Ok(())
    }

    /// Writes the words.
    ///
    /// # Errors
    /// Those of the coder.
    pub(super) fn write<C: Coder>(&self, coder: &mut C) -> Result<(), C::Error> {
        let limit = usize::MAX;
        code_words(coder, self.shape.pixels(), &self.words, self.len(), limit).map(|_| ())
    }

    /// Reads `n` words that [`BicAlphabet::write`] wrote, of no more than `max_points` points in all.
    ///
    /// # Errors
    /// Those of the coder, also for words that no alphabet has.
    pub(super) fn read<C: Coder>(
        shape: BicShape,
        n: usize,
        max_points: usize,
        coder: &mut C,
    ) -> Result<Self, C::Error> {
        shape.check().map_err(|e| coder.corrupt(e.to_string()))?;
        let words = code_words(coder, shape.pixels(), &[], n, max_points)?;
        Self::new(shape, words).map_err(|e| coder.corrupt(e.to_string()))
    }

    /// What the words have in common.
    pub fn shape(&self) -> BicShape {
        self.shape
    }

    /// Delta, metres.
    pub fn radius(&self) -> f64 {
        self.shape.radius
    }

    /// What is up where the normal is vertical.
    pub fn upright(&self) -> Upright {
        self.shape.upright
    }

    /// The words, in the order in which they were accepted.
    pub fn words(&self) -> &[BicWord] {
        &self.words
    }

    /// Number of words.
    pub fn len(&self) -> usize {
        self.words.len()
    }

    /// True for a scene without any place that gives a word.
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Points of a word in its own frame (right, up, along the normal), metres; none for a word that does not exist.
    pub fn points(&self, word: usize) -> Vec<[f32; 3]> {
        let step = self.shape.point_step();
        let metres = |p: &[i8; 3]| p.map(|c| (f64::from(c) * step) as f32);
        self.words.get(word).map_or(Vec::new(), |w| w.points.iter().map(metres).collect())
    }
}

/// The words that occur, and their poses.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Occurrences {
    pub poses: Vec<BicPose>,
    pub words: Vec<u32>,
}

/// What the file holds of the scene before its streams.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BicHeader {
    /// Points of the cloud that was described.
    pub n_points: u64,
    /// World position that poses are relative to, metres.
    pub origin: [f64; 3],
    /// Least distance of decoded points, metres.
    pub epsilon: f64,
    /// Lowest cell that a pose may lie in: cells are 32 steps wide.
    pub low: [i32; 3],
}

/// What the file holds before its streams.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BicAlphabetHeader {
    /// What the words have in common.
    pub shape: BicShape,
    /// Number of words.
    pub n_words: u32,
    /// Number of occurrences.
    pub n_occurrences: u64,
    /// The scene.
    pub scene: BicHeader,
}

/// A cloud as occurrences of words (eq. 2); immutable.
#[derive(Debug, Clone, PartialEq)]
pub struct BicAlphabetModel {
    header: BicHeader,
    alphabet: BicAlphabet,
    poses: Vec<BicPose>,
    words: Vec<u32>,
    shares_vocabulary: bool,
    report: Beside<BicAlphabetReport>,
}

impl BicAlphabetModel {
    /// Puts the parts together.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] when a number is out of its range, or poses are not in their order.
    pub fn new(
        header: BicHeader,
        alphabet: BicAlphabet,
        poses: Vec<BicPose>,
        words: Vec<u32>,
        shares_vocabulary: bool,
    ) -> Result<Self> {
        let fail = |what: String| Err(Error::Inconsistent(what));
        if header.origin.iter().any(|c| !c.is_finite()) {
            return fail(format!("origin {:?} is not finite", header.origin));
        }
        if !(1e-9..1e6).contains(&header.epsilon) {
            return fail(format!("an epsilon of {} m", header.epsilon));
        }
        if header.low.iter().any(|c| c.unsigned_abs() > MAX_CELL as u32) {
            return fail(format!("cells from {:?} are out of range", header.low));
        }
        if poses.len() != words.len() {
            return fail(format!("{} poses for {} occurrences", poses.len(), words.len()));
        }
        if let Some(&word) = words.iter().find(|&&w| w as usize >= alphabet.len()) {
            return fail(format!("word {word} of an alphabet of {}", alphabet.len()));
        }
        let half = (1 << (NORMAL_BITS - 1)) - 1;
        let mut previous = None;
        for pose in &poses {
            let cell = pose.cell();
            if (0..3).any(|a| cell[a] < header.low[a]) {
                return fail(format!("{pose:?} lies below cell {:?}", header.low));
            }
            let far = pose.position.iter().any(|c| c.unsigned_abs() > MAX_POSITION as u32);
            let steep = pose.normal.iter().any(|&c| i32::from(c).abs() > half);
            if far || steep {
                return fail(format!("{pose:?} is out of range"));
            }
            if previous.is_some_and(|p| p >= pose.order(header.low)) {
                return fail(format!("{pose:?} does not follow the one before it"));
            }
            previous = Some(pose.order(header.low));
            if pose.roll != 0 && alphabet.upright() != Upright::ViewDirection {
                return fail(format!("{pose:?} has a roll, which its upright rule does not use"));
            }
        }
        let report = Beside::default();
        Ok(Self { header, alphabet, poses, words, shares_vocabulary, report })
    }

    pub(super) fn learned(
        alphabet: BicAlphabet,
        occurrences: Occurrences,
        header: BicHeader,
        shares_vocabulary: bool,
        report: BicAlphabetReport,
    ) -> Result<Self> {
        let Occurrences { poses, words } = occurrences;
        let model = Self::new(header, alphabet, poses, words, shares_vocabulary)?;
        Ok(Self { report: Beside(report), ..model })
    }

    /// Writes the occurrences.
    ///
    /// # Errors
    /// Those of the coder.
    pub(super) fn write<C: Coder>(&self, coder: &mut C) -> Result<(), C::Error> {
        let given = (self.poses.as_slice(), self.words.as_slice());
        code_occurrences(coder, &self.alphabet, self.header.low, given, self.len()).map(|_| ())
    }

    /// Reads `n` occurrences that [`BicAlphabetModel::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder, also for a header or occurrences that no model has.
    pub(super) fn read<C: Coder>(
        header: BicHeader,
        alphabet: BicAlphabet,
        n: usize,
        shares_vocabulary: bool,
        coder: &mut C,
    ) -> Result<Self, C::Error> {
        let (poses, words) = code_occurrences(coder, &alphabet, header.low, (&[], &[]), n)?;
        Self::new(header, alphabet, poses, words, shares_vocabulary)
            .map_err(|e| coder.corrupt(e.to_string()))
    }

    /// What the file holds of the scene before its streams.
    pub fn header(&self) -> BicHeader {
        self.header
    }

    /// Points of the cloud that was described.
    pub fn n_points(&self) -> u64 {
        self.header.n_points
    }

    /// World position that poses are relative to, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.header.origin
    }

    /// Least distance of decoded points, metres.
    pub fn epsilon(&self) -> f64 {
        self.header.epsilon
    }

    /// The words.
    pub fn alphabet(&self) -> &BicAlphabet {
        &self.alphabet
    }

    /// Poses of the occurrences, along a Morton curve.
    pub fn poses(&self) -> &[BicPose] {
        &self.poses
    }

    /// Word of each occurrence.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Word frame to world of an occurrence: rows of a rotation, and a translation in metres.
    pub fn pose(&self, occurrence: usize) -> Option<([[f64; 3]; 3], [f64; 3])> {
        let pose = self.poses.get(occurrence)?;
        let Frame { origin, rows } = pose.frame(self.alphabet.upright(), self.alphabet.radius());
        let rotation = std::array::from_fn(|r| std::array::from_fn(|c| f64::from(rows[c][r])));
        let translation = std::array::from_fn(|a| self.header.origin[a] + f64::from(origin[a]));
        Some((rotation, translation))
    }

    /// Occurrences per word.
    pub fn counts(&self) -> Vec<u64> {
        let mut counts = vec![0; self.alphabet.len()];
        for &word in &self.words {
            counts[word as usize] += 1;
        }
        counts
    }

    /// Number of occurrences.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// True when nothing of the cloud is described.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// True when files of this model name its alphabet by hash instead of holding it.
    pub fn shares_vocabulary(&self) -> bool {
        self.shares_vocabulary
    }

    /// False: the paper's words have no colour.
    pub fn has_color(&self) -> bool {
        false
    }

    /// How the model came about; empty for one read from a file.
    pub fn report(&self) -> &BicAlphabetReport {
        &self.report.0
    }
}
