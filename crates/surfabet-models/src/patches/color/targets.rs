//! The colour that each node should have: that of the samples it will be compared with.

use rayon::prelude::*;
use surfabet_geom::morton::step;

use crate::patches::color::cells::{cell_key, index};
use crate::patches::samples::Samples;

/// Mean colour of the samples in or next to each node's cell.
///
/// A sample counts for the node of its own cell, or for the nearest node around it; a node without samples takes
/// the mean of those around, so that what was filled between samples has their colour.
pub(in crate::patches) fn targets(samples: &Samples, nodes: &[u64], cell: f32) -> Vec<[f32; 3]> {
    let places = index(nodes);
    let owner = |p: [f32; 3]| -> Option<u32> {
        let scaled = p.map(|c| c / cell);
        let own = cell_key(scaled.map(|c| c.floor() as i32));
        if let Some(&i) = places.get(&own) {
            return Some(i);
        }
        let part = scaled.map(|c| c - c.floor() - 0.5);
        let mut best: Option<(f32, u32)> = None;
        for neighbour in 0..27_usize {
            let mut key = own;
            let mut squared = 0.0;
            for (axis, place) in
                [neighbour % 3, neighbour / 3 % 3, neighbour / 9].into_iter().enumerate()
            {
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
    };
    let owners: Vec<Option<u32>> = samples.samples.par_iter().map(|s| owner(s.position)).collect();
    let mut sums = vec![[0.0_f32; 4]; nodes.len()];
    for (owner, sample) in owners.iter().zip(&samples.samples) {
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
    // Colours spread into what no sample reached, ring by ring.
    loop {
        let spread: Vec<(usize, [f32; 3])> = (0..nodes.len())
            .into_par_iter()
            .filter(|&i| known[i].is_none())
            .filter_map(|i| {
                let (mut sum, mut n) = ([0.0; 3], 0.0);
                for axis in 0..3 {
                    for up in [false, true] {
                        let near = places.get(&step(nodes[i], axis, up));
                        if let Some(color) = near.and_then(|&j| known[j as usize]) {
                            (0..3).for_each(|c| sum[c] += color[c]);
                            n += 1.0;
                        }
                    }
                }
                (n > 0.0).then(|| (i, sum.map(|s| s / n)))
            })
            .collect();
        if spread.is_empty() {
            break;
        }
        for (i, color) in spread {
            known[i] = Some(color);
        }
    }
    let total = sums.iter().map(|s| s[3]).sum::<f32>().max(1.0);
    let mean: [f32; 3] = std::array::from_fn(|c| sums.iter().map(|s| s[c]).sum::<f32>() / total);
    known.into_iter().map(|k| k.unwrap_or(mean)).collect()
}
