//! Dictionaries, and means and sparse codes of a channel, depth or colour.

use surfabet_entropy::{Coder, SInt, Symbols, UInt};

use crate::hscsm::channels::dictionary::QuantizedDictionary;
use crate::hscsm::model::{Channel, Codes, MAX_SPARSITY};

/// Values of dictionary entries, by the sum of the values to the left and above.
struct EntryModels {
    models: Vec<SInt>,
    /// Bits of a value beyond 8, which sums do not count.
    shift: u32,
}

impl EntryModels {
    /// Sums beyond this share a model.
    const REACH: i32 = 12;

    fn new(wide: bool) -> Self {
        let models = vec![SInt::new(); 2 * Self::REACH as usize + 1];
        Self { models, shift: if wide { 8 } else { 0 } }
    }

    /// The model of the value after those in `before`, in an entry of planes of `side` x `side` values.
    fn at(&mut self, before: &[i16], side: usize) -> &mut SInt {
        let at = before.len();
        let left = if at.is_multiple_of(side) { 0 } else { i32::from(before[at - 1]) };
        let in_plane = at % (side * side);
        let above = if in_plane >= side { i32::from(before[at - side]) } else { 0 };
        let context = ((left + above) >> self.shift).clamp(-Self::REACH, Self::REACH) + Self::REACH;
        &mut self.models[context as usize]
    }
}

/// Side of the square planes that an entry of `n_features` values consists of: one for depth, three for colour.
fn plane_side(n_features: usize) -> usize {
    let one = n_features.isqrt();
    if one * one == n_features { one } else { (n_features / 3).isqrt() }
}

/// Writes, reads or prices a dictionary of `n_atoms` entries of `n_features` values; `given` are the values to
/// write, entry after entry.
///
/// # Errors
/// Those of the coder; values beyond 8 bits, or 16 where `wide`, entries that are all zero.
pub(super) fn code_dictionary<C: Coder>(
    coder: &mut C,
    n_features: usize,
    n_atoms: usize,
    wide: bool,
    given: Option<&[i16]>,
) -> Result<QuantizedDictionary, C::Error> {
    let side = plane_side(n_features);
    let mut models = EntryModels::new(wide);
    let mut values = Vec::new();
    for _ in 0..n_atoms {
        let from = values.len();
        for _ in 0..n_features {
            let value = given.map_or(0, |given| i32::from(given[values.len()]));
            let value = coder.sint(models.at(&values[from..], side), value)?;
            let fits = wide || i8::try_from(value).is_ok();
            let value = i16::try_from(value)
                .ok()
                .filter(|_| fits)
                .ok_or_else(|| coder.corrupt(format!("a dictionary value of {value}")))?;
            values.push(value);
        }
    }
    QuantizedDictionary::new(n_features, values).map_err(|e| coder.corrupt(e.to_string()))
}

/// Models of a channel's means and codes.
struct ChannelModels {
    /// Difference of a plane's mean to the previous patch's.
    mean: Vec<SInt>,
    /// Entries per code, by those of the previous patch.
    count: [UInt; 4],
    atom: Symbols,
    /// Magnitude and sign of a coefficient, by the size of the code.
    coefficient: [SInt; 4],
}

/// Writes, reads or prices the means and codes of `n_patches` patches of `planes` planes in `dictionary`; `given`
/// is what to write.
///
/// # Errors
/// Those of the coder; codes longer than dictionary or format allow.
pub(super) fn code_channel<C: Coder>(
    coder: &mut C,
    dictionary: QuantizedDictionary,
    n_patches: usize,
    planes: usize,
    given: Option<&Channel>,
) -> Result<Channel, C::Error> {
    let n_atoms = dictionary.n_atoms();
    let mut models = ChannelModels {
        mean: vec![SInt::new(); planes],
        count: std::array::from_fn(|_| UInt::new()),
        atom: Symbols::new(n_atoms.max(1) as u32).map_err(|e| coder.corrupt(e.to_string()))?,
        coefficient: std::array::from_fn(|_| SInt::new()),
    };
    let mut means = Vec::new();
    let mut previous_mean = vec![0_i32; planes];
    let mut previous_count = 0;
    let mut codes = Codes { offsets: vec![0], ..Codes::default() };
    for i in 0..n_patches {
        for (plane, previous) in previous_mean.iter_mut().enumerate() {
            let mean = given.map_or(0, |channel| channel.means[i * planes + plane]);
            // Differences may wrap around; sums then do as well.
            let difference = coder.sint(&mut models.mean[plane], mean.wrapping_sub(*previous))?;
            *previous = previous.wrapping_add(difference);
            means.push(*previous);
        }
        let (atoms, coefficients) = given.map_or((&[][..], &[][..]), |c| c.codes.of(i));
        let count = &mut models.count[previous_count.min(3)];
        let count = coder.uint(count, atoms.len() as u32)? as usize;
        if count > n_atoms.min(MAX_SPARSITY) {
            return Err(coder.corrupt(format!("a code of {count} in {n_atoms} entries")));
        }
        previous_count = count;
        for at in 0..count {
            let atom = atoms.get(at).map_or(0, |&a| u32::from(a));
            codes.atoms.push(coder.symbol(&mut models.atom, atom)? as u16);
            let coefficient = coefficients.get(at).copied().unwrap_or_default();
            let model = &mut models.coefficient[(count - 1).min(3)];
            codes.coefficients.push(coder.sint(model, coefficient)?);
        }
        let end = u32::try_from(codes.atoms.len())
            .map_err(|_| coder.corrupt("more than 2^32 coefficients".to_owned()))?;
        codes.offsets.push(end);
    }
    Ok(Channel { dictionary, means, codes })
}
