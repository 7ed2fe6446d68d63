//! Motions guessed from pairs of occurrences of like words.

use std::f64::consts::{FRAC_PI_8, PI, TAU};

use rayon::prelude::*;
use surfabet_geom::Progress;

use super::occupancy::Occupancy;
use super::scene::{Motion, Place};
use super::template::Template;
use crate::alphabet::model::{AlphabetModel, Occurrence};
use crate::error::Result;
use crate::recognition::surface;

/// Occurrences of the example that motions are guessed from.
const SEEDS: usize = 48;

/// Samples of the example that guesses are tried with.
const TRIED: usize = 96;

/// Guesses that are refined.
const GUESSES: usize = 2000;

/// Pieces larger than the example's largest whole piece by this factor are no place to look for it.
const COMPACT: f64 = 8.0;

/// From this |z| of a normal on, it says little about the direction that something faces.
const LEVEL: f64 = 0.8;

/// Occurrences whose colours are less alike than this are no pair.
const SAME_COLOR: f64 = 0.1;

/// The most promising motions: every pair of an occurrence in the example and one of its radius or the next and of its
/// inclination anywhere gives one, and the opposite one, since thin things look alike from both sides.
pub(super) fn guesses(
    model: &AlphabetModel,
    scene: &Place,
    template: &Template,
    progress: &dyn Progress,
) -> Result<Vec<Motion>> {
    let origin = model.header().origin;
    let all: Vec<Occurrence> = model
        .occurrences()
        .map(|o| Occurrence { center: std::array::from_fn(|a| o.center[a] - origin[a]), ..o })
        .collect();
    let inside: Vec<u32> = (0..scene.surface.len() as u32)
        .filter(|&i| template.region.contains(scene.surface.points[i as usize].map(f64::from)))
        .collect();
    // What an occurrence is worth as a seed: the mean weight of its samples in the region.
    let mut worth = vec![(0.0, 0.0); all.len()];
    for (&i, weight) in inside.iter().zip(scene.shares(&inside)) {
        let (sum, n) = &mut worth[scene.surface.occurrences[i as usize] as usize];
        *sum += weight;
        *n += 1.0;
    }
    let mut seeds: Vec<(f64, usize)> = worth
        .iter()
        .enumerate()
        .filter(|(k, (_, n))| *n > 0.0 && template.region.contains(all[*k].center))
        .map(|(k, (sum, n))| (sum / n, k))
        .collect();
    let any_steep = seeds.iter().any(|&(_, k)| all[k].rows[2][2].abs() < LEVEL);
    seeds.retain(|&(_, k)| !any_steep || all[k].rows[2][2].abs() < LEVEL);
    seeds.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    seeds.truncate(SEEDS);
    let side = (2.0 * template.spacing).max(0.03 * template.diagonal).max(template.tolerance);
    // Whole pieces of the example are not looked for in much larger ones.
    let whole = template.sizes.iter().zip(&template.weights).filter(|(_, w)| **w > 0.7);
    let largest = whole.map(|(size, _)| *size).fold(0.0, f64::max);
    let limit = if largest > 0.0 { COMPACT * largest } else { f64::INFINITY };
    let compact = |i: usize| scene.size(i) <= limit;
    let grid = Occupancy::new(scene.surface, side, compact);
    let mut eligible = vec![false; all.len()];
    for (i, &o) in scene.surface.occurrences.iter().enumerate() {
        eligible[o as usize] |= compact(i);
    }
    let tried = template.points.len().min(4 * TRIED);
    // Of the first samples, those that weigh most.
    let mut trial: Vec<usize> = (0..tried).collect();
    trial.sort_by(|&i, &j| template.weights[j].total_cmp(&template.weights[i]).then(i.cmp(&j)));
    trial.truncate(TRIED);
    let total: f64 = trial.iter().map(|&i| template.weights[i]).sum();
    let share = |motion: &Motion| {
        let mut sum = 0.0;
        for &i in &trial {
            let level = template.normals[i][2].abs() > 0.68;
            if grid.has(template.moved(motion, i), level) {
                sum += template.weights[i];
            }
        }
        sum / total
    };
    let hues = &scene.surface.hues;
    let same_color = |i: usize, j: usize| match (hues, template.color_tolerance) {
        (Some(hues), Some(tolerance)) => surface::alike(hues[i], hues[j], tolerance) > SAME_COLOR,
        _ => true,
    };
    let mut motions: Vec<(f64, Motion)> = seeds
        .par_iter()
        .map(|&(_, k)| {
            progress.check()?;
            let e = &all[k];
            let mut best = Vec::new();
            let there = (0..all.len()).filter(|&j| eligible[j] && same_color(k, j));
            for s in there.map(|j| &all[j]) {
                let ratio = s.radius / e.radius;
                if (s.rows[2][2].abs() - e.rows[2][2].abs()).abs() > 0.3
                    || !(0.4..2.5).contains(&ratio)
                {
                    continue;
                }
                let heading = |o: &Occurrence| o.rows[2][1].atan2(o.rows[2][0]);
                let turns: Vec<f64> = if any_steep {
                    let turn = heading(s) - heading(e);
                    vec![turn, turn + PI]
                } else {
                    (0..16).map(|i| f64::from(i) * FRAC_PI_8).collect()
                };
                for yaw in turns {
                    let arm = std::array::from_fn(|a| (e.center[a] - template.pivot[a]) as f32);
                    let mut motion = Motion { yaw, shift: [0.0; 3] };
                    let turned = motion.turned(arm);
                    motion.shift =
                        std::array::from_fn(|a| s.center[a] - turned[a] - template.pivot[a]);
                    let share = share(&motion);
                    if share > 0.3 {
                        best.push((share, motion));
                    }
                }
            }
            Ok(best)
        })
        .collect::<Result<Vec<_>>>()?
        .concat();
    // One guess per cell and direction.
    let bin = |m: &Motion| {
        let turn = (m.yaw.rem_euclid(TAU) / (0.5 * FRAC_PI_8)).floor() as i64;
        (m.shift.map(|c| (c / side).floor() as i64), turn)
    };
    motions.sort_by(|a, b| {
        let ties = (0..3).map(|k| a.1.shift[k].total_cmp(&b.1.shift[k]));
        let order = bin(&a.1).cmp(&bin(&b.1)).then(b.0.total_cmp(&a.0));
        ties.fold(order, std::cmp::Ordering::then).then(a.1.yaw.total_cmp(&b.1.yaw))
    });
    motions.dedup_by(|a, b| bin(&a.1) == bin(&b.1));
    motions.sort_by(|a, b| b.0.total_cmp(&a.0));
    motions.truncate(GUESSES);
    Ok(motions.into_iter().map(|m| m.1).collect())
}
