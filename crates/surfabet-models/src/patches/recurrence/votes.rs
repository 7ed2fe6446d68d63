//! Which motions take much of the surface to where the surface looks the same: keypoints with similar descriptors vote for them.

use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_geom::cells::{cell_of, key, of_key};

use super::keypoints::{DESCRIPTOR, Keypoint, N_TURNS, exchanges};
use crate::patches::constants::{
    ALIKE, BEST_MATCHES, COMPARED_KEYPOINTS, FIRST_MATCHES, LEAST_VOTES, MOST_MOTIONS, SHIFT_CELL,
    SYMMETRY_MARGIN,
};
use crate::patches::instances::order::place_in_order;

/// A motion that some keypoints agree on.
pub(super) struct MotionCandidate {
    /// Mirrored (bit 2) and quarter turns (the lower bits).
    pub turn: usize,
    /// Mean shift of the keypoints, pixels.
    pub shift: [f32; 3],
    /// Numbers of the keypoints that are moved.
    pub sources: Vec<u32>,
}

/// A keypoint whose descriptor is like that of an earlier one.
#[derive(Clone, Copy)]
struct DescriptorMatch {
    source: u32,
    target: u32,
    turn: usize,
    shift: [f32; 3],
}

/// The motions that most keypoints vote for, from sources to places after them in the order of sources.
pub(super) fn candidates(keypoints: &[Keypoint], axis: usize) -> Vec<MotionCandidate> {
    let exchanges = exchanges(axis);
    let matches: Vec<DescriptorMatch> = parallel::gather(keypoints.len(), |target, matches| {
        matches.extend(matches_of(keypoints, target, &exchanges, axis));
    });
    let mut cells: BTreeMap<(usize, u64), Vec<usize>> = BTreeMap::new();
    for (i, of) in matches.iter().enumerate() {
        cells.entry((of.turn, key(cell_of(of.shift, SHIFT_CELL)))).or_default().push(i);
    }
    // Votes of a cell and those around it.
    let votes: BTreeMap<(usize, u64), Vec<usize>> = cells
        .keys()
        .map(|&(turn, cell)| {
            let around = surfabet_geom::cells::around(of_key(cell));
            let near = around.filter_map(|near| cells.get(&(turn, key(near))));
            ((turn, cell), near.flatten().copied().collect())
        })
        .collect();
    let mut found: Vec<(usize, MotionCandidate)> = Vec::new();
    for (&(turn, cell), of_cell) in &votes {
        let is_most = surfabet_geom::cells::around(of_key(cell)).all(|near| {
            let near = (turn, key(near));
            votes.get(&near).is_none_or(|other| {
                other.len() < of_cell.len() || other.len() == of_cell.len() && near >= (turn, cell)
            })
        });
        if is_most {
            found.extend(agreed(turn, of_cell.iter().map(|&i| matches[i])));
        }
    }
    found.sort_by_key(|&(votes, _)| std::cmp::Reverse(votes));
    found.truncate(MOST_MOTIONS);
    found.into_iter().map(|(_, candidate)| candidate).collect()
}

/// What some matches agree on, with the number of different keypoints among them.
fn agreed(
    turn: usize,
    matches: impl Iterator<Item = DescriptorMatch>,
) -> Option<(usize, MotionCandidate)> {
    let all: Vec<DescriptorMatch> = matches.collect();
    let different = |mut numbers: Vec<u32>| {
        numbers.sort_unstable();
        numbers.dedup();
        numbers
    };
    let sources = different(all.iter().map(|of| of.source).collect());
    let targets = different(all.iter().map(|of| of.target).collect());
    let votes = sources.len().min(targets.len());
    let n = all.len().max(1) as f32;
    let shift = std::array::from_fn(|a| all.iter().map(|of| of.shift[a]).sum::<f32>() / n);
    (votes >= LEAST_VOTES).then_some((votes, MotionCandidate { turn, shift, sources }))
}

/// The earlier keypoints with descriptors like that of `target`.
fn matches_of(
    keypoints: &[Keypoint],
    target: usize,
    exchanges: &[[u16; DESCRIPTOR]; N_TURNS],
    axis: usize,
) -> Vec<DescriptorMatch> {
    let own = &keypoints[target];
    let at = place_in_order(own.position);
    let mut near: Vec<(f32, u32)> = Vec::new();
    for (j, other) in (0..).zip(keypoints) {
        if place_in_order(other.position) < at {
            let squares = own.invariant.iter().zip(&other.invariant).map(|(a, b)| (a - b).powi(2));
            near.push((squares.sum(), j));
        }
    }
    let by_distance = |a: &(f32, u32), b: &(f32, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    if near.len() > COMPARED_KEYPOINTS {
        near.select_nth_unstable_by(COMPARED_KEYPOINTS, by_distance);
        near.truncate(COMPARED_KEYPOINTS);
    }
    // The descriptor that the source would have, for each turn that takes it to this.
    let turned_back: [[f32; DESCRIPTOR]; N_TURNS] = std::array::from_fn(|turn| {
        let mut descriptor = [0.0; DESCRIPTOR];
        for (&i, c) in exchanges[turn].iter().zip(own.descriptor) {
            descriptor[usize::from(i)] = c;
        }
        descriptor
    });
    let mut alike: Vec<(f32, u32, [f32; N_TURNS])> = Vec::new();
    for (_, j) in near {
        let descriptor = &keypoints[j as usize].descriptor;
        let product = |turn: usize| product(&turned_back[turn], descriptor);
        let products: [f32; N_TURNS] = std::array::from_fn(product);
        let best = products.iter().copied().fold(0.0, f32::max);
        if best >= ALIKE {
            alike.push((best, j, products));
        }
    }
    alike.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut kept: Vec<(f32, u32, [f32; N_TURNS])> =
        alike.iter().take(BEST_MATCHES).copied().collect();
    let order = |j: u32| place_in_order(keypoints[j as usize].position);
    alike.drain(..kept.len());
    alike.sort_by(|a, b| order(a.1).total_cmp(&order(b.1)).then(a.1.cmp(&b.1)));
    kept.extend(alike.into_iter().take(FIRST_MATCHES));
    let mut matches = Vec::new();
    for (best, source, products) in kept {
        for turn in (0..N_TURNS).filter(|&turn| products[turn] >= best - SYMMETRY_MARGIN) {
            let moved = turned(keypoints[source as usize].position, turn, axis);
            let shift = std::array::from_fn(|a| own.position[a] - moved[a]);
            matches.push(DescriptorMatch { source, target: target as u32, turn, shift });
        }
    }
    matches
}

/// Product of two descriptors, in eight sums that do not wait for one another.
fn product(a: &[f32; DESCRIPTOR], b: &[f32; DESCRIPTOR]) -> f32 {
    let mut sums = [0.0; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        (0..8).for_each(|k| sums[k] += a[k] * b[k]);
    }
    sums.iter().sum()
}

/// A position mirrored and turned.
fn turned(mut p: [f32; 3], turn: usize, axis: usize) -> [f32; 3] {
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    if turn & 4 != 0 {
        p[u] = -p[u];
    }
    for _ in 0..turn & 3 {
        (p[u], p[v]) = (-p[v], p[u]);
    }
    p
}
