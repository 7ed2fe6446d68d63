//! How the occurrences of a scene lie to each other: a histogram of their pairs.

use surfabet_base::parallel;
use surfabet_geom::{Progress, vector};
use surfabet_models::Result;
use surfabet_models::alphabet::AlphabetModel;

use super::inclination::{INCLINATIONS, inclination};
use super::word_histogram::area;
use crate::constants::{MAX_COMPARED, NEAREST, RISE_LIMITS, TURN_LIMITS};

/// Classes of distance: one per half octave, from a quarter of a metre to 45 m and beyond.
const DISTANCES: usize = 16;

/// Occurrences whose pairs are added up together.
const ROWS: usize = 64;

/// Classes of height of one occurrence over another, from far below to far above.
const RISES: usize = 2 * RISE_LIMITS.len() + 1;

/// Classes of the angle between the horizontal directions of two normals.
const TURNS: usize = TURN_LIMITS.len() + 1;

/// All classes of a pair.
const CLASSES: usize = DISTANCES * RISES * INCLINATIONS * INCLINATIONS * TURNS;

/// Cosine of the roots of two histograms: `sum of sqrt(p q)` over the classes. Roots of shares have unit length, and no
/// class drowns the others.
pub(super) fn pair_cosine(p: &[f64], q: &[f64]) -> f64 {
    p.iter().zip(q).map(|(x, y)| x * y).sum()
}

/// An occurrence as one of a pair.
struct Member {
    center: [f64; 3],
    normal: [f64; 3],
    area: f64,
}

/// The root of the share of all ordered pairs of occurrences, by the product of their areas, in each class.
pub(super) fn pair_roots(model: &AlphabetModel, progress: &dyn Progress) -> Result<Vec<f64>> {
    let words = model.alphabet().words();
    let step = model.len().div_ceil(MAX_COMPARED).max(1);
    let all: Vec<Member> = model
        .occurrences()
        .step_by(step)
        .map(|o| Member {
            center: o.center,
            normal: o.rows[2],
            area: area(&words[usize::from(o.word)], o.radius),
        })
        .collect();
    // Fixed chunks, added in order: the sums do not depend on the number of threads.
    let sums = parallel::try_map_range(all.len().div_ceil(ROWS), |chunk| -> Result<Vec<f64>> {
        progress.check()?;
        let mut sums = vec![0.0; CLASSES];
        for i in chunk * ROWS..all.len().min((chunk + 1) * ROWS) {
            for j in (0..all.len()).filter(|&j| j != i) {
                add(&mut sums, &all[i], &all[j]);
            }
        }
        Ok(sums)
    })?;
    let mut total = vec![0.0; CLASSES];
    for part in sums {
        total.iter_mut().zip(part).for_each(|(t, p)| *t += p);
    }
    let all: f64 = total.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    Ok(total.iter().map(|t| (t / all).sqrt()).collect())
}

/// Adds a pair to its class, divided between the two nearest classes of distance.
fn add(sums: &mut [f64], a: &Member, b: &Member) {
    let d: [f64; 3] = std::array::from_fn(|k| b.center[k] - a.center[k]);
    let half_octaves = 2.0 * (vector::length(d) / NEAREST).log2();
    let distance = half_octaves.clamp(0.0, (DISTANCES - 1) as f64 - 1e-9);
    let over = RISE_LIMITS.iter().filter(|&&limit| d[2].abs() >= limit).count();
    let rise = if d[2] < 0.0 { RISES / 2 - over } else { RISES / 2 + over };
    let [i, j] = [a, b].map(|m| inclination(m.normal[2]));
    let turn = turn(a, b, i, j);
    let first = distance.floor();
    let rest = distance - first;
    for (k, share) in [(first, 1.0 - rest), (first + 1.0, rest)] {
        let class =
            (((k as usize * RISES + rise) * INCLINATIONS + i) * INCLINATIONS + j) * TURNS + turn;
        sums[class] += share * (a.area * b.area);
    }
}

/// Class of the angle between the horizontal directions of two normals; the first where one is level.
fn turn(a: &Member, b: &Member, i: usize, j: usize) -> usize {
    if i == INCLINATIONS - 1 || j == INCLINATIONS - 1 {
        return 0;
    }
    let (n, m) = (&a.normal, &b.normal);
    let [p, q] = [n, m].map(|v| v[0].hypot(v[1]));
    let cosine = ((n[0] * m[0] + n[1] * m[1]) / (p * q)).abs();
    TURN_LIMITS.iter().filter(|&&limit| cosine < limit).count()
}
