//! How alike two places are, by the words that occur there.

use rayon::prelude::*;
use surfabet_geom::Progress;

use crate::alphabet::model::AlphabetModel;
use crate::alphabet::word::{HEIGHT_STEPS, PIXELS, Word};
use crate::error::Result;
use crate::vector;

/// Classes of inclination of a normal, from level to steep.
const INCLINATIONS: usize = 4;

/// Classes of distance between two occurrences: a class per half octave, from a quarter of a metre to 64 m.
const DISTANCES: usize = 16;

/// Shortest distance that is told, metres.
const NEAREST: f64 = 0.25;

/// Classes of height of one occurrence over another, from far below to far above.
const RISES: usize = 7;

/// Height from which on the next class begins, metres.
const RISE_LIMITS: [f64; 3] = [0.25, 1.0, 2.5];

/// Classes of the angle between the normals of two steep occurrences.
const TURNS: usize = 3;

/// Most occurrences that are compared with one another, evenly taken.
const COMPARED: usize = 1500;

/// Weight of the words against the pairs, chosen on few scans: words alone vary more between scans of one place.
const WORDS: f64 = 0.25;

/// Squared difference of looks, per pixel and in squared radii, that makes words half as alike.
const LOOK: f64 = 0.03;

/// Share of the surface that one word takes in one radius and inclination.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WordShare {
    /// Which word.
    pub word: u16,
    /// Its radius, metres.
    pub radius: f64,
    /// Class of its normal, of its elevation in quarters of a right angle: 0 steep (a wall) to 3 level (a floor).
    pub inclination: u8,
    /// Share of the area of all occurrences, 0 to 1.
    pub share: f64,
}

impl AlphabetModel {
    /// The share of area per word, radius and inclination of its normal: ascending by these, without what does not
    /// occur. Shares add up to 1; a model without occurrences has none.
    pub fn word_histogram(&self) -> Vec<WordShare> {
        let words = self.alphabet().words();
        let mut all: Vec<WordShare> = self
            .occurrences()
            .map(|o| WordShare {
                word: o.word,
                radius: o.radius,
                inclination: inclination(o.rows[2][2]),
                share: area(&words[usize::from(o.word)], o.radius),
            })
            .collect();
        let total: f64 = all.iter().map(|s| s.share).sum();
        all.sort_by(|a, b| {
            let radii = a.radius.total_cmp(&b.radius);
            a.word.cmp(&b.word).then(radii).then(a.inclination.cmp(&b.inclination))
        });
        let same = |a: &WordShare, b: &WordShare| {
            (a.word, a.inclination) == (b.word, b.inclination) && a.radius == b.radius
        };
        let merged = |group: &[WordShare]| WordShare {
            share: group.iter().map(|s| s.share).sum::<f64>() / total,
            ..group[0]
        };
        all.chunk_by(same).map(merged).collect()
    }
}

/// How alike two places are, 0 to 1: 1 for a model and itself, the same either way, and whatever the heading and the
/// position of the scans.
///
/// A geometric mean of two cosines: of the words that occur, by their looks, radii and inclinations, so that the
/// alphabets may differ; and of how occurrences lie to each other: distance, height and angle of every pair. Pairs tell
/// places apart, words what they are made of. A model without occurrences is like none but another one without.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn place_similarity(
    a: &AlphabetModel,
    b: &AlphabetModel,
    progress: &dyn Progress,
) -> Result<f64> {
    if a.is_empty() || b.is_empty() {
        return Ok(f64::from(u8::from(a.is_empty() && b.is_empty())));
    }
    let of_words = {
        let [p, q] = [a, b].map(used_words);
        let kernel = |p: &[Used], q: &[Used]| -> f64 {
            p.iter().map(|x| q.iter().map(|y| x.share * y.share * x.like(y)).sum::<f64>()).sum()
        };
        // Summed both ways, so that rounding is the same for (a, b) and (b, a).
        let across = 0.5 * (kernel(&p, &q) + kernel(&q, &p));
        across / (kernel(&p, &p) * kernel(&q, &q)).sqrt()
    };
    let of_pairs = {
        let [p, q] = [pairs(a, progress)?, pairs(b, progress)?];
        // Roots of shares have unit length: no class drowns the others.
        p.iter().zip(&q).map(|(x, y)| (x * y).sqrt()).sum::<f64>()
    };
    Ok((of_words.powf(WORDS) * of_pairs.powf(1.0 - WORDS)).clamp(0.0, 1.0))
}

/// A word that occurs, by its looks.
struct Used {
    look: Word,
    radius: f64,
    inclination: u8,
    share: f64,
}

fn used_words(model: &AlphabetModel) -> Vec<Used> {
    let words = model.alphabet().words();
    let used = |s: WordShare| Used {
        look: words[usize::from(s.word)].clone(),
        radius: s.radius,
        inclination: s.inclination,
        share: s.share,
    };
    model.word_histogram().into_iter().map(used).collect()
}

impl Used {
    /// How alike two words are, where they stand: 1 to 0.
    fn like(&self, other: &Self) -> f64 {
        let turn = f64::from(self.inclination.abs_diff(other.inclination));
        let octaves = (self.radius / other.radius).log2();
        let look = look_distance(&self.look, &other.look) / LOOK;
        (-turn * turn - 0.25 * octaves * octaves - look * std::f64::consts::LN_2).exp()
    }
}

/// Mean squared difference of heights over the radius; a hole is a quarter of the radius off.
fn look_distance(a: &Word, b: &Word) -> f64 {
    let n = PIXELS * PIXELS;
    let of = |k: usize| match (a.mask >> k & 1, b.mask >> k & 1) {
        (1, 1) => {
            (f64::from(i16::from(a.heights[k]) - i16::from(b.heights[k])) / HEIGHT_STEPS).powi(2)
        }
        (0, 0) => 0.0,
        _ => 1.0 / 16.0,
    };
    (0..n).map(of).sum::<f64>() / n as f64
}

fn area(word: &Word, radius: f64) -> f64 {
    f64::from(word.mask.count_ones()) / (PIXELS * PIXELS) as f64 * (2.0 * radius).powi(2)
}

fn inclination(z: f64) -> u8 {
    let quarter = z.abs().min(1.0).asin() / std::f64::consts::FRAC_PI_2 * INCLINATIONS as f64;
    (quarter as u8).min(INCLINATIONS as u8 - 1)
}

/// The share of all pairs of occurrences, by area, per class of distance, height, inclinations and angle.
fn pairs(model: &AlphabetModel, progress: &dyn Progress) -> Result<Vec<f64>> {
    let words = model.alphabet().words();
    let step = model.len().div_ceil(COMPARED).max(1);
    let all: Vec<([f64; 3], [f64; 3], f64)> = model
        .occurrences()
        .step_by(step)
        .map(|o| (o.center, o.rows[2], area(&words[usize::from(o.word)], o.radius)))
        .collect();
    // Fixed chunks, added in order.
    let sums: Vec<Vec<f64>> = (0..all.len())
        .collect::<Vec<_>>()
        .par_chunks(64)
        .map(|rows| {
            progress.check()?;
            let mut sums = vec![0.0; CLASSES];
            for &i in rows {
                for j in (0..all.len()).filter(|&j| j != i) {
                    let ((p, n, a), (q, m, b)) = (&all[i], &all[j]);
                    add(&mut sums, p, n, q, m, a * b);
                }
            }
            Ok(sums)
        })
        .collect::<Result<_>>()?;
    let mut total = vec![0.0; CLASSES];
    for part in sums {
        total.iter_mut().zip(part).for_each(|(t, p)| *t += p);
    }
    let all: f64 = total.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    Ok(total.iter().map(|t| t / all).collect())
}

const CLASSES: usize = DISTANCES * RISES * 3 * 3 * TURNS;

fn add(sums: &mut [f64], p: &[f64; 3], n: &[f64; 3], q: &[f64; 3], m: &[f64; 3], weight: f64) {
    let d: [f64; 3] = std::array::from_fn(|a| q[a] - p[a]);
    let far = vector::length(d);
    let place = (2.0 * (far / NEAREST).log2()).clamp(0.0, (DISTANCES - 1) as f64 - 1e-9);
    let over = RISE_LIMITS.iter().filter(|&&limit| d[2].abs() >= limit).count();
    let rise = if d[2] < 0.0 { RISES / 2 - over } else { RISES / 2 + over };
    let lie = |z: f64| usize::from(z.abs() > 0.38) + usize::from(z.abs() > 0.92);
    let [i, j] = [lie(n[2]), lie(m[2])];
    let turn = if i == 2 || j == 2 {
        0
    } else {
        let [a, b] = [n, m].map(|v| v[0].hypot(v[1]));
        let cosine = ((n[0] * m[0] + n[1] * m[1]) / (a * b)).abs();
        usize::from(cosine < 0.9) + usize::from(cosine < 0.45)
    };
    // Between two classes of distance, in shares.
    let first = place.floor();
    for (k, part) in [(first, 1.0 - (place - first)), (first + 1.0, place - first)] {
        let class = (((k as usize * RISES + rise) * 3 + i) * 3 + j) * TURNS + turn;
        sums[class] += part * weight;
    }
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::alphabet::{AlphabetOptions, learn};

    /// A room without a ceiling, turned and moved.
    fn room(size: [f64; 3], yaw: f64, shift: [f64; 3]) -> AlphabetModel {
        let [x, y, z] = size;
        let walls = [
            [[x, 0.0, 0.0], [0.0, y, 0.0]],
            [[x, 0.0, 0.0], [0.0, 0.0, z]],
            [[0.0, y, 0.0], [0.0, 0.0, z]],
        ];
        let (s, c) = yaw.sin_cos();
        let mut points = Vec::new();
        for [right, up] in walls {
            for i in 0..3600 {
                let [a, b] = [f64::from(i % 60) / 60.0, f64::from(i / 60) / 60.0];
                let p: [f64; 3] = std::array::from_fn(|k| a * right[k] + b * up[k]);
                let turned = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
                points.push(std::array::from_fn(|k| (turned[k] + shift[k]) as f32));
            }
        }
        let (cloud, _) = PointCloud::from_positions(points);
        learn(&cloud, &AlphabetOptions::default(), &Silent).unwrap()
    }

    #[test]
    fn shares_add_up_to_one() {
        let histogram = room([4.0, 3.0, 2.5], 0.3, [0.0; 3]).word_histogram();
        assert!((histogram.iter().map(|s| s.share).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(histogram.iter().all(|s| s.share > 0.0));
        // Floors are level, walls steep; nothing lies between.
        let level: f64 = histogram.iter().filter(|s| s.inclination == 3).map(|s| s.share).sum();
        let steep: f64 = histogram.iter().filter(|s| s.inclination == 0).map(|s| s.share).sum();
        assert!(level > 0.2 && steep > 0.4 && level + steep > 0.9, "{level} {steep}");
    }

    #[test]
    fn a_place_is_like_itself_whatever_the_heading() {
        let place = room([4.0, 3.0, 2.5], 0.0, [0.0; 3]);
        let again = room([4.0, 3.0, 2.5], 0.9, [30.0, -7.0, 1.0]);
        let other = room([9.0, 2.0, 2.5], 0.4, [1.0, 1.0, 0.0]);
        let like = |a, b| place_similarity(a, b, &Silent).unwrap();
        assert!((like(&place, &place) - 1.0).abs() < 1e-9);
        for (a, b) in [(&place, &again), (&place, &other), (&again, &other)] {
            assert_eq!(like(a, b), like(b, a));
            assert!((0.0..=1.0).contains(&like(a, b)));
        }
        assert!(like(&place, &again) > 0.9, "{}", like(&place, &again));
        assert!(like(&place, &again) > like(&place, &other) + 0.05, "{}", like(&place, &other));
    }
}
