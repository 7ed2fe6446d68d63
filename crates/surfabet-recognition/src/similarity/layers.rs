//! What stands at which height of a place: the share of area of level, sloped and steep words in layers above the floor.

use surfabet_models::alphabet::AlphabetModel;

use super::inclination::{INCLINATIONS, inclination};
use super::word_histogram::area;
use crate::constants::{FLOOR_SHARE, LAYER, LAYERS};

/// Heights of an occurrence that its area is divided among. No number is better than another by more than chance: of rooms 0 to 7 the
/// adjusted Rand index is 0.93 with 1, 0.76 with 4 and with 16, 1.00 with 8.
const HEIGHTS: usize = 8;

/// The share of area of each layer and class of inclination; without occurrences all are 0. An occurrence is spread over the heights
/// that it reaches, each divided between the two layers nearest to it, and what is higher than the highest is in that.
///
/// Heights are above the floor: where [`FLOOR_SHARE`] of the area of level words, or of all where none is level, is below.
pub(super) fn layers(model: &AlphabetModel) -> Vec<f64> {
    let words = model.alphabet().words();
    let all: Vec<Member> = model
        .occurrences()
        .map(|o| Member {
            height: o.center[2],
            // Half the height of a disc that leans so much.
            half: o.radius * (1.0 - o.rows[2][2].powi(2)).max(0.0).sqrt(),
            inclination: inclination(o.rows[2][2]),
            area: area(&words[usize::from(o.word)], o.radius),
        })
        .collect();
    let mut shares = vec![0.0; LAYERS * INCLINATIONS];
    let Some(floor) = floor(&all) else { return shares };
    let total: f64 = all.iter().map(|m| m.area).sum();
    for m in &all {
        for k in 0..HEIGHTS {
            let height = m.height + m.half * ((2 * k + 1) as f64 / HEIGHTS as f64 - 1.0);
            let at = ((height - floor) / LAYER).clamp(0.0, (LAYERS - 1) as f64);
            let first = (at as usize).min(LAYERS - 2);
            let rest = at - first as f64;
            for (layer, part) in [(first, 1.0 - rest), (first + 1, rest)] {
                shares[layer * INCLINATIONS + m.inclination] +=
                    part * m.area / (total * HEIGHTS as f64);
            }
        }
    }
    shares
}

/// An occurrence in its layer.
struct Member {
    height: f64,
    /// How far it reaches above and below.
    half: f64,
    inclination: usize,
    area: f64,
}

/// Height of the floor; `None` without occurrences.
fn floor(all: &[Member]) -> Option<f64> {
    let level = |m: &&Member| m.inclination == INCLINATIONS - 1;
    let mut below: Vec<&Member> = all.iter().filter(level).collect();
    if below.is_empty() {
        below = all.iter().collect();
    }
    below.sort_by(|a, b| a.height.total_cmp(&b.height));
    let mut left = FLOOR_SHARE * below.iter().map(|m| m.area).sum::<f64>();
    below
        .iter()
        .find(|m| {
            left -= m.area;
            left <= 0.0
        })
        .map(|m| m.height)
}
