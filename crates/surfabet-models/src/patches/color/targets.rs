//! The colour that each cell should have: that of the samples it will be compared with.

use rayon::prelude::*;
use surfabet_geom::morton::{MortonMap, step};

use super::cells::{cell_key, index};
use crate::patches::samples::SidedSamples;

/// Mean colour of the samples in or next to each of the sorted `cells`, which are `size` metres wide.
///
/// A sample counts for its own cell, or for the nearest cell around it; a cell without samples takes the mean of those
/// around, so that what was filled between samples has their colour.
pub(in crate::patches) fn targets(
    samples: &SidedSamples,
    cells: &[u64],
    size: f32,
) -> Vec<[f32; 3]> {
    let places = index(cells);
    let owners: Vec<Option<u32>> =
        samples.all.par_iter().map(|s| owner(&places, s.position, size)).collect();
    // Sums of the channels, and number of samples.
    let mut sums = vec![[0.0_f32; 4]; cells.len()];
    for (owner, sample) in owners.iter().zip(&samples.all) {
        if let Some(i) = owner {
            let sum = &mut sums[*i as usize];
            (0..3).for_each(|c| sum[c] += sample.color[c]);
            sum[3] += 1.0;
        }
    }
    let mut known: Vec<Option<[f32; 3]>> = sums
        .iter()
        .map(|s| (s[3] > 0.0).then(|| [s[0] / s[3], s[1] / s[3], s[2] / s[3]]))
        .collect();
    while spread(&places, cells, &mut known) {}
    let total = sums.iter().map(|s| s[3]).sum::<f32>().max(1.0);
    let mean: [f32; 3] = std::array::from_fn(|c| sums.iter().map(|s| s[c]).sum::<f32>() / total);
    known.into_iter().map(|k| k.unwrap_or(mean)).collect()
}

/// The cell that a position lies in, or of the 26 around it the one whose middle is nearest.
fn owner(places: &MortonMap<u32>, position: [f32; 3], size: f32) -> Option<u32> {
    let scaled = position.map(|c| c / size);
    let own = cell_key(scaled.map(|c| c.floor() as i32));
    if let Some(&i) = places.get(&own) {
        return Some(i);
    }
    let part = scaled.map(|c| c - c.floor() - 0.5);
    let mut best: Option<(f32, u32)> = None;
    for neighbour in 0..27_usize {
        let mut key = own;
        let mut squared = 0.0;
        let along = [neighbour % 3, neighbour / 3 % 3, neighbour / 9];
        for (axis, place) in along.into_iter().enumerate() {
            let offset = place as f32 - 1.0;
            if place != 1 {
                key = step(key, axis, place == 2);
            }
            squared += (offset - part[axis]).powi(2);
        }
        if let Some(&i) = places.get(&key)
            && best.is_none_or(|b| squared < b.0)
        {
            best = Some((squared, i));
        }
    }
    best.map(|b| b.1)
}

/// Gives cells without a colour the mean of the six beside them that have one; false when there were none.
fn spread(places: &MortonMap<u32>, cells: &[u64], known: &mut [Option<[f32; 3]>]) -> bool {
    let mean_beside = |key: u64| {
        let (mut sum, mut n) = ([0.0; 3], 0.0);
        for axis in 0..3 {
            for up in [false, true] {
                let near = places.get(&step(key, axis, up));
                if let Some(color) = near.and_then(|&j| known[j as usize]) {
                    (0..3).for_each(|c| sum[c] += color[c]);
                    n += 1.0;
                }
            }
        }
        (n > 0.0).then(|| sum.map(|s| s / n))
    };
    let found: Vec<(usize, [f32; 3])> = (0..cells.len())
        .into_par_iter()
        .filter(|&i| known[i].is_none())
        .filter_map(|i| Some((i, mean_beside(cells[i])?)))
        .collect();
    for &(i, color) in &found {
        known[i] = Some(color);
    }
    !found.is_empty()
}
