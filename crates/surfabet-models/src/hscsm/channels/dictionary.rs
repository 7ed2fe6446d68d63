//! A dictionary per channel by wK-SVD, and the sparse codes of all patches in it (section III-B, eq. 1).

use surfabet_geom::Progress;
use surfabet_sparse::{Dictionary, KsvdOptions, OmpOptions, Signals, SparseCodes, ksvd, omp};

use crate::error::{Error, Result};
use crate::hscsm::constants::{ENTRY_STEP, WIDE_ENTRY_STEP};
use crate::hscsm::model::{Codes, MAX_ENTRIES};
use crate::hscsm::options::HscsmOptions;

/// Dictionary entries in integers, of 8 or of 16 bits. An entry stands for its integers scaled to unit norm.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct QuantizedDictionary {
    n_features: usize,
    values: Vec<i16>,
}

impl QuantizedDictionary {
    /// A dictionary of entries with `n_features` values each, entry after entry.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] when the values do not divide into entries, there are more than 65 536 entries,
    /// or one is all zero.
    pub fn new(n_features: usize, values: Vec<i16>) -> Result<Self> {
        if n_features == 0 || !values.len().is_multiple_of(n_features) {
            return Err(Error::Inconsistent(format!(
                "{} dictionary values do not divide into entries of {n_features}",
                values.len()
            )));
        }
        if values.len() / n_features > MAX_ENTRIES {
            return Err(Error::Inconsistent(format!(
                "a dictionary of {} entries, more than {MAX_ENTRIES}",
                values.len() / n_features
            )));
        }
        if values.chunks(n_features).any(|entry| entry.iter().all(|&v| v == 0)) {
            return Err(Error::Inconsistent("a dictionary entry is all zero".to_owned()));
        }
        Ok(Self { n_features, values })
    }

    /// Values per entry.
    pub fn n_features(&self) -> usize {
        self.n_features
    }

    /// Number of entries.
    pub fn n_atoms(&self) -> usize {
        self.values.len().checked_div(self.n_features).unwrap_or(0)
    }

    /// All values, entry after entry.
    pub fn values(&self) -> &[i16] {
        &self.values
    }

    /// True when a value has more than 8 bits.
    pub fn is_wide(&self) -> bool {
        self.values.iter().any(|&v| i8::try_from(v).is_err())
    }

    /// The entries that the integers stand for, scaled to unit norm, entry after entry.
    pub fn atoms(&self) -> Vec<f32> {
        let mut atoms = Vec::with_capacity(self.values.len());
        for entry in self.values.chunks(self.n_features.max(1)) {
            let norm = entry.iter().map(|&v| i64::from(v) * i64::from(v)).sum::<i64>() as f64;
            let scale = 1.0 / norm.sqrt();
            atoms.extend(entry.iter().map(|&v| (f64::from(v) * scale) as f32));
        }
        atoms
    }

    /// The nearest storable dictionary; entries that vanish are left out.
    fn quantize(dictionary: &Dictionary, small: bool) -> Self {
        let n_features = dictionary.n_features();
        let mut values = Vec::with_capacity(dictionary.n_atoms() * n_features);
        for k in 0..dictionary.n_atoms() {
            let (step, most) =
                if small { (ENTRY_STEP, 127.0) } else { (WIDE_ENTRY_STEP, 32_767.0) };
            let round = |v: &f32| (v / step).round().clamp(-most, most) as i16;
            let entry: Vec<i16> = dictionary.atom(k).iter().map(round).collect();
            if entry.iter().any(|&v| v != 0) {
                values.extend(entry);
            }
        }
        Self { n_features, values }
    }
}

/// How one channel is learned and coded.
#[derive(Debug, Clone)]
pub(in crate::hscsm) struct ChannelOptions<'a> {
    pub name: &'static str,
    /// The dictionary to code in; `None`: learn one.
    pub frozen: Option<&'a QuantizedDictionary>,
    pub n_atoms: usize,
    pub sparsity: usize,
    pub tolerance: f32,
    pub code_step: f32,
    pub iterations: usize,
    /// Most signals that a dictionary is learned from.
    pub training_signals: usize,
    /// Whether entries are rounded to 8 bits.
    pub small_atoms: bool,
    pub random_state: u64,
}

/// How a dictionary was learned.
#[derive(Debug, Clone)]
pub(in crate::hscsm) struct Learning {
    pub iterations: usize,
    /// What was minimised, after each iteration.
    pub objective: Vec<f64>,
    /// Entries that were asked for and not needed.
    pub cropped: usize,
}

/// A dictionary with the codes of all signals in it.
pub(in crate::hscsm) struct Coded {
    pub dictionary: QuantizedDictionary,
    pub codes: Codes,
    /// `None`: the dictionary was given, or there is nothing to code.
    pub learning: Option<Learning>,
}

/// The dictionaries of one level of a hierarchy.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelDictionary {
    /// Side of a pixel (pr), metres.
    pub pixel_size: f64,
    /// Pixels per side of a patch.
    pub pixels: u32,
    /// Entries for depth.
    pub depth: QuantizedDictionary,
    /// Entries for colour, where the cloud that was learned from had colours or intensities.
    pub color: Option<QuantizedDictionary>,
}

/// The dictionaries D_depth and D_rgb of a model (section III), level by level, for other clouds to be
/// described with.
#[derive(Debug, Clone, PartialEq)]
pub struct HscsmDictionary {
    /// Coarsest level first.
    pub levels: Vec<LevelDictionary>,
}

impl HscsmDictionary {
    /// Default options of the dictionary's hierarchy, to describe a cloud with.
    pub fn options(&self) -> HscsmOptions {
        let default = HscsmOptions::default();
        match self.levels.last() {
            Some(finest) => HscsmOptions {
                resolution: Some(finest.pixel_size),
                patch_pixels: finest.pixels,
                levels: self.levels.len() as u32,
                ..default
            },
            None => default,
        }
    }

    /// Planes of colour images of `area` pixels; `None` without colour.
    pub(in crate::hscsm) fn color_planes(&self, area: usize) -> Option<usize> {
        self.levels.first()?.color.as_ref().map(|c| c.n_features() / area)
    }

    /// True when a value of an entry has more than 8 bits.
    pub fn is_wide(&self) -> bool {
        let of = |l: &LevelDictionary| {
            l.depth.is_wide() || l.color.as_ref().is_some_and(QuantizedDictionary::is_wide)
        };
        self.levels.iter().any(of)
    }

    /// True when there are several levels, and all have the same dictionaries.
    pub(in crate::hscsm) fn is_one(&self) -> bool {
        let same = |w: &[LevelDictionary]| {
            (w[0].pixels, &w[0].depth, &w[0].color) == (w[1].pixels, &w[1].depth, &w[1].color)
        };
        self.levels.len() > 1 && self.levels.windows(2).all(same)
    }

    /// Refuses options of another hierarchy.
    pub(in crate::hscsm) fn check(&self, options: &HscsmOptions) -> Result<()> {
        let mismatch = |what: &str, given: String, own: String| {
            Err(Error::Inconsistent(format!(
                "the dictionary has {own} {what}, the options have {given}; give those of the dictionary"
            )))
        };
        if self.levels.len() != options.levels as usize {
            return mismatch("levels", options.levels.to_string(), self.levels.len().to_string());
        }
        for (j, level) in (0..).zip(&self.levels) {
            if level.pixels != options.patch_pixels {
                let given = options.patch_pixels.to_string();
                return mismatch("pixels per side of a patch", given, level.pixels.to_string());
            }
            let size = options.pixel_size(j);
            if (level.pixel_size - size).abs() > 1e-9 * size {
                return mismatch("m per pixel", size.to_string(), level.pixel_size.to_string());
            }
        }
        Ok(())
    }
}

/// `sqrt(sum of w v^2 / sum of w)`.
fn root_mean_square(values: &[f32], weights: &[f32]) -> f32 {
    let (mut sum, mut count) = (0.0_f64, 0.0_f64);
    for (v, w) in values.iter().zip(weights) {
        sum += f64::from(w * v * v);
        count += f64::from(*w);
    }
    (sum / count.max(1.0)).sqrt() as f32
}

/// The images of one channel, as signals to learn from and to code.
pub(in crate::hscsm) struct ChannelSignals<'a> {
    n_features: usize,
    /// Patch after patch, means removed.
    values: &'a [f32],
    /// 1 where a pixel is set, else 0.
    weights: &'a [f32],
    /// Root mean square of the set pixels of each patch.
    energy: Vec<f32>,
    /// Patches beyond the tolerance of zero: the others need no code, and nothing is learned from them.
    coded: Vec<usize>,
}

impl<'a> ChannelSignals<'a> {
    /// Signals of `n_features` values each.
    pub fn new(n_features: usize, values: &'a [f32], weights: &'a [f32], tolerance: f32) -> Self {
        let energy: Vec<f32> = (values.chunks(n_features).zip(weights.chunks(n_features)))
            .map(|(v, w)| root_mean_square(v, w))
            .collect();
        let coded = (0..energy.len()).filter(|&i| energy[i] > tolerance).collect();
        Self { n_features, values, weights, energy, coded }
    }

    /// Values and weights of the chosen signals.
    fn gather(&self, chosen: &[usize]) -> (Vec<f32>, Vec<f32>) {
        let n = self.n_features;
        let pick = |from: &[f32]| -> Vec<f32> {
            chosen.iter().flat_map(|&i| &from[i * n..(i + 1) * n]).copied().collect()
        };
        (pick(self.values), pick(self.weights))
    }

    /// Those that a dictionary is learned from, at most `most`: those with most energy.
    fn training(&self, most: usize) -> Vec<usize> {
        let mut training = self.coded.clone();
        if training.len() > most {
            let energy = &self.energy;
            training.sort_by(|&a, &b| energy[b].total_cmp(&energy[a]).then(a.cmp(&b)));
            training.truncate(most);
            training.sort_unstable();
        }
        training
    }

    /// Empty codes for all signals.
    fn empty_codes(&self) -> Codes {
        Codes { offsets: vec![0; self.energy.len() + 1], ..Codes::default() }
    }

    /// Sparse codes of all signals in a dictionary, by orthogonal matching pursuit.
    fn code(
        &self,
        dictionary: &QuantizedDictionary,
        options: &ChannelOptions<'_>,
        progress: &dyn Progress,
    ) -> Result<Codes> {
        let (values, weights) = self.gather(&self.coded);
        let signals = Signals::new(self.n_features, &values, Some(&weights))?;
        let entries = Dictionary::new(self.n_features, dictionary.atoms())?;
        let omp_options = OmpOptions {
            max_atoms: options.sparsity,
            tolerance: options.tolerance,
            ..OmpOptions::default()
        };
        let sparse = omp(&entries, &signals, &omp_options, progress)?;
        Ok(quantize_codes(&sparse, &self.coded, self.energy.len(), options.code_step))
    }
}

/// Learns a dictionary from the signals and codes all of them in it (eq. 1); with a frozen one, codes in that.
///
/// The dictionary is quantised before the final coding, so that codes are chosen for the entries that the decoder will
/// use.
pub(in crate::hscsm) fn learn_channel(
    signals: &ChannelSignals<'_>,
    options: &ChannelOptions<'_>,
    progress: &dyn Progress,
) -> Result<Coded> {
    let nothing_to_code = signals.coded.is_empty();
    if let Some(frozen) = options.frozen {
        let codes = if nothing_to_code || frozen.n_atoms() == 0 {
            signals.empty_codes()
        } else {
            signals.code(frozen, options, progress)?
        };
        return Ok(Coded { dictionary: frozen.clone(), codes, learning: None });
    }
    let n_features = signals.n_features;
    if nothing_to_code {
        let dictionary = QuantizedDictionary { n_features, values: Vec::new() };
        return Ok(Coded { dictionary, codes: signals.empty_codes(), learning: None });
    }
    let (values, weights) = signals.gather(&signals.training(options.training_signals));
    let training = Signals::new(n_features, &values, Some(&weights))?;
    let ksvd_options = KsvdOptions {
        n_atoms: options.n_atoms,
        max_atoms: options.sparsity,
        tolerance: options.tolerance,
        iterations: options.iterations,
        random_state: options.random_state,
        ..KsvdOptions::default()
    };
    let learned = ksvd(&training, &ksvd_options, progress, &mut |step| {
        progress.update(options.name, step.iteration as f32 / options.iterations as f32);
    })?;
    let dictionary = QuantizedDictionary::quantize(&learned.dictionary, options.small_atoms);
    let codes = signals.code(&dictionary, options, progress)?;
    let (used, codes) = crop(&dictionary, &codes);
    let cropped = learned.cropped + learned.dictionary.n_atoms() - used.n_atoms();
    let learning =
        Learning { iterations: learned.iterations, objective: learned.objective, cropped };
    Ok(Coded { dictionary: used, codes, learning: Some(learning) })
}

/// Coefficients in steps, entries in growing order, empty codes for the signals that were not coded.
fn quantize_codes(sparse: &SparseCodes, coded: &[usize], n_signals: usize, step: f32) -> Codes {
    let mut codes = Codes { offsets: Vec::with_capacity(n_signals + 1), ..Codes::default() };
    codes.offsets.push(0);
    let mut next = 0;
    for signal in 0..n_signals {
        if coded.get(next) == Some(&signal) {
            let (atoms, coefficients) = sparse.code(next);
            let mut code: Vec<(u16, i32)> = atoms
                .iter()
                .zip(coefficients)
                .map(|(&a, &c)| (a as u16, (c / step).round() as i32))
                .filter(|&(_, c)| c != 0)
                .collect();
            code.sort_unstable_by_key(|&(a, _)| a);
            codes.atoms.extend(code.iter().map(|&(a, _)| a));
            codes.coefficients.extend(code.iter().map(|&(_, c)| c));
            next += 1;
        }
        codes.offsets.push(codes.atoms.len() as u32);
    }
    codes
}

/// Leaves out entries that no code uses.
fn crop(dictionary: &QuantizedDictionary, codes: &Codes) -> (QuantizedDictionary, Codes) {
    let n = dictionary.n_features;
    let mut new_index = vec![None; dictionary.n_atoms()];
    codes.atoms.iter().for_each(|&a| new_index[usize::from(a)] = Some(0));
    let mut values = Vec::new();
    for (old, slot) in new_index.iter_mut().enumerate() {
        if slot.is_some() {
            *slot = Some((values.len() / n) as u16);
            values.extend_from_slice(&dictionary.values[old * n..(old + 1) * n]);
        }
    }
    // Every entry that a code uses was given its new index above.
    let atoms = codes.atoms.iter().filter_map(|&a| new_index[usize::from(a)]).collect();
    let codes = Codes { atoms, ..codes.clone() };
    (QuantizedDictionary { n_features: n, values }, codes)
}
