//! Colours and intensities of supported tiles, each predicted by those to the left and above.

use surfabet_entropy::{Coder, SInt};

use super::stored::StoredPatch;
use super::syntax::code_residual;

/// Adaptive models of N channels, and the last values.
pub(super) struct TileModels<const N: usize> {
    /// Of the first channel, by the number of neighbours.
    first: [SInt; 3],
    /// Of each further channel two, by whether the one before had a residual of more than one step. Those of the first are
    /// not used.
    further: [[SInt; 2]; N],
    last: [i32; N],
    /// Largest value, either way.
    limit: i32,
    /// Name of a value in errors.
    what: &'static str,
}

impl<const N: usize> TileModels<N> {
    pub fn new(limit: i32, what: &'static str) -> Self {
        let further = [const { [const { SInt::new() }; 2] }; N];
        Self { first: [const { SInt::new() }; 3], further, last: [0; N], limit, what }
    }
}

/// Codes the values of the supported tiles of a patch; `wanted` gives those of a supported tile to write.
pub(super) fn code_tiles<C: Coder, const N: usize>(
    coder: &mut C,
    models: &mut TileModels<N>,
    wanted: impl Fn(usize) -> Option<[i32; N]>,
    patch: &StoredPatch,
) -> Result<Vec<[i32; N]>, C::Error> {
    let nx = patch.shape[0] as usize;
    let mut coded: Vec<[i32; N]> = Vec::new();
    let mut above: Vec<Option<[i32; N]>> = vec![None; nx];
    for row in patch.supported.chunks(nx) {
        let mut left = None;
        for (x, _) in row.iter().enumerate() {
            if !row[x] {
                (above[x], left) = (None, None);
                continue;
            }
            let (predicted, n) = match (left, above[x]) {
                (Some(a), Some(b)) => {
                    (std::array::from_fn(|c| (a[c] + b[c] + 1_i32).div_euclid(2)), 2)
                }
                (Some(one), None) | (None, Some(one)) => (one, 1),
                (None, None) => (models.last, 0),
            };
            let to = wanted(coded.len()).unwrap_or([0; N]);
            let mut values = [0; N];
            let mut active = 0;
            for channel in 0..N {
                let model = match channel {
                    0 => &mut models.first[n],
                    _ => &mut models.further[channel][active],
                };
                let domain = -models.limit..=models.limit;
                let (from, to) = (predicted[channel], to[channel]);
                values[channel] = code_residual(coder, model, from, to, domain, models.what)?;
                active = usize::from((values[channel] - from).abs() > 1);
            }
            coded.push(values);
            (above[x], left, models.last) = (Some(values), Some(values), values);
        }
    }
    Ok(coded)
}
