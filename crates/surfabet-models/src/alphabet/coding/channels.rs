//! Encoding of the colours and intensities of occurrences.

use surfabet_entropy::{Coder, SInt};

use super::coarse_cells::CoarseCells;
use crate::alphabet::lattice::cell_center;
use crate::alphabet::placement::Placement;

/// Largest value of a channel, in its steps.
const MAX_VALUE: i32 = 1 << 10;

/// Writes, reads or prices the channels of all occurrences: residuals to the nearest occurrence coded before, the
/// first of equally near ones, or to the last one where none is near. When reading, `given` is empty.
///
/// # Errors
/// Those of the coder; when reading, also for a value out of range.
pub(in crate::alphabet) fn code_channels<C: Coder>(
    coder: &mut C,
    placements: &[Placement],
    scales: u32,
    channels: usize,
    given: &[Vec<i32>],
) -> Result<Vec<Vec<i32>>, C::Error> {
    let mut models = vec![SInt::new(); channels];
    let mut coded_by_cell: CoarseCells<usize> = CoarseCells::new(scales);
    let mut coded: Vec<Vec<i32>> = Vec::with_capacity(placements.len());
    for (k, p) in placements.iter().enumerate() {
        let scale = u32::from(p.scale);
        let candidates = coded_by_cell.around(p.cell, scale).copied();
        let nearest = candidates
            .min_by_key(|&j| (squared_distance(p, &placements[j]), j))
            .or(k.checked_sub(1));
        let mut values = Vec::with_capacity(channels);
        for (c, model) in models.iter_mut().enumerate() {
            let predicted = nearest.map_or(0, |j| coded[j][c]);
            let residual = coder.sint(model, given.get(k).map_or(0, |g| g[c] - predicted))?;
            let value = predicted.saturating_add(residual);
            if value.abs() > MAX_VALUE {
                return Err(coder.corrupt(format!(
                    "a channel of {value} steps is out of range: at most {MAX_VALUE} either way"
                )));
            }
            values.push(value);
        }
        coded.push(values);
        coded_by_cell.insert(p.cell, scale, k);
    }
    Ok(coded)
}

/// Squared distance between the middles of the cells of two occurrences.
fn squared_distance(a: &Placement, b: &Placement) -> u64 {
    let [a, b] = [a, b].map(|p| cell_center(p.cell, u32::from(p.scale)));
    (0..3).map(|c| a[c].abs_diff(b[c]).pow(2)).sum()
}
