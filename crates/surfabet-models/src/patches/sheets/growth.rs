//! Runs of neighbouring pixels grow into sheets, and small sheets join others.

use std::collections::VecDeque;

use super::runs::{Run, TileRuns};
use crate::patches::constants::{JOIN_REACHES, MAX_STEP, SMALL_SHEET};

/// The eight pixels around one, then the four behind the nearest: a scan line missing does not cut a sheet.
const NEIGHBOURS: [(i32, i32); 12] = [
    (-1, 0),
    (1, 0),
    (0, -1),
    (0, 1),
    (-1, -1),
    (1, -1),
    (-1, 1),
    (1, 1),
    (-2, 0),
    (2, 0),
    (0, -2),
    (0, 2),
];

/// Sheets of a tile as numbers of their runs; the depths of two that touch differ by at most `max_step` pixels.
pub(super) fn grow(tile: &TileRuns, max_step: f32) -> Vec<Vec<usize>> {
    let mut sheets = grow_from_seeds(tile, max_step);
    for reach in JOIN_REACHES {
        join_small(tile, reach, max_step, &mut sheets);
    }
    sheets.retain(|members| !members.is_empty());
    sheets
}

/// True when two runs, `distance` pixels apart, may lie on one surface: their depths differ by no more than a slope of
/// [`MAX_STEP`] makes, and their mean half thickness, and by no more than `max_step`.
fn agree(a: &Run, b: &Run, distance: f32, max_step: f32) -> bool {
    let of_slope = MAX_STEP * distance + 0.5 * (a.half + b.half);
    (b.depth - a.depth).abs() <= of_slope.min(max_step)
}

/// Grows a sheet from every run that no sheet has yet, those with most samples first, breadth first. In each
/// neighbouring pixel the run nearest in depth joins, if it agrees.
fn grow_from_seeds(tile: &TileRuns, max_step: f32) -> Vec<Vec<usize>> {
    let runs = &tile.runs;
    let mut seeds: Vec<usize> = (0..runs.len()).collect();
    seeds.sort_by(|&a, &b| runs[b].n.total_cmp(&runs[a].n).then(a.cmp(&b)));
    let mut taken = vec![false; runs.len()];
    // Seed of the sheet that took a pixel last, so that no sheet takes a pixel twice.
    let mut last_sheet = vec![usize::MAX; tile.n_pixels()];
    let mut sheets: Vec<Vec<usize>> = Vec::new();
    for seed in seeds {
        if taken[seed] {
            continue;
        }
        let mut members = vec![seed];
        let mut queue = VecDeque::from([seed]);
        taken[seed] = true;
        last_sheet[tile.pixel_of(&runs[seed])] = seed;
        while let Some(i) = queue.pop_front() {
            let run = runs[i];
            for (du, dv) in NEIGHBOURS {
                let Some(pixel) = tile.pixel_beside(&run, du, dv) else { continue };
                if last_sheet[pixel] == seed {
                    continue;
                }
                let off = |j: usize| (runs[j].depth - run.depth).abs();
                let free = tile.at(pixel).filter(|&j| !taken[j]);
                let nearest = free.min_by(|&a, &b| off(a).total_cmp(&off(b)));
                let Some(j) = nearest else { continue };
                if agree(&run, &runs[j], du.abs().max(dv.abs()) as f32, max_step) {
                    taken[j] = true;
                    last_sheet[pixel] = seed;
                    members.push(j);
                    queue.push_back(j);
                }
            }
        }
        sheets.push(members);
    }
    sheets
}

/// Joins small sheets to the neighbour that they touch most within `reach` pixels, where no pixel would hold two runs:
/// a surface that is sampled more coarsely than the pixel, or in steps of depth, falls apart into strips otherwise.
fn join_small(tile: &TileRuns, reach: i32, max_step: f32, sheets: &mut [Vec<usize>]) {
    let mut sheet_of = vec![usize::MAX; tile.runs.len()];
    for (s, members) in sheets.iter().enumerate() {
        members.iter().for_each(|&i| sheet_of[i] = s);
    }
    let n_samples = |s: usize| tile.n_samples(&sheets[s]);
    let mut order: Vec<usize> = (0..sheets.len()).filter(|&s| n_samples(s) < SMALL_SHEET).collect();
    order.sort_by(|&a, &b| n_samples(a).total_cmp(&n_samples(b)).then(a.cmp(&b)));
    for small in order {
        let touched = most_touched(tile, reach, max_step, &sheets[small], small, &sheet_of);
        if let Some(other) = touched {
            let members = std::mem::take(&mut sheets[small]);
            members.iter().for_each(|&i| sheet_of[i] = other);
            sheets[other].extend(members);
        }
    }
}

/// The sheet with most runs within `reach` that agree with runs of sheet `small`, among those that share no pixel with
/// it; the first of equal ones.
fn most_touched(
    tile: &TileRuns,
    reach: i32,
    max_step: f32,
    members: &[usize],
    small: usize,
    sheet_of: &[usize],
) -> Option<usize> {
    let mut contacts: Vec<(usize, u32)> = Vec::new();
    let mut overlapping: Vec<usize> = Vec::new();
    for &i in members {
        let run = &tile.runs[i];
        for dv in -reach..=reach {
            for du in -reach..=reach {
                let Some(pixel) = tile.pixel_beside(run, du, dv) else { continue };
                for j in tile.at(pixel) {
                    let other = sheet_of[j];
                    if other == small {
                        continue;
                    }
                    if du == 0 && dv == 0 {
                        overlapping.push(other);
                        continue;
                    }
                    let distance = (du.abs().max(dv.abs()) as f32).max(0.5 * reach as f32);
                    if agree(run, &tile.runs[j], distance, max_step) {
                        match contacts.iter_mut().find(|c| c.0 == other) {
                            Some(contact) => contact.1 += 1,
                            None => contacts.push((other, 1)),
                        }
                    }
                }
            }
        }
    }
    let best = contacts
        .into_iter()
        .filter(|c| !overlapping.contains(&c.0))
        .max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)));
    best.map(|(sheet, _)| sheet)
}
