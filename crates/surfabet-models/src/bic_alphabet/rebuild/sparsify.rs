//! The kept points of all occurrences (eq. 3).

use surfabet_geom::Progress;

use super::NO_WORD;
use super::change::Change;
use super::grid::KeptGrid;
use super::neighbors::{Neighbors, order};
use super::stamp::Stamp;
use super::thin::{KeptPoint, Thinner};
use crate::bic_alphabet::constants::OCCURRENCES_PER_CHECK;
use crate::bic_alphabet::pose::{BicPose, Frame};
use crate::error::Result;

/// Where occurrences may stand.
#[derive(Debug, Clone, Copy)]
pub(in crate::bic_alphabet) struct Places<'a> {
    pub frames: &'a [Frame],
    pub neighbors: &'a Neighbors,
    /// Least distance of decoded points, metres.
    pub epsilon: f32,
}

/// The words at all places, and which of their points are kept.
#[derive(Debug, Clone)]
pub(in crate::bic_alphabet) struct Sparsified {
    pub(super) stamps: Vec<Stamp>,
    /// By place; [`NO_WORD`] where there is none.
    pub(super) words: Vec<u32>,
    /// By place.
    pub(super) kept: Vec<Vec<KeptPoint>>,
    count: usize,
}

impl Sparsified {
    /// Nothing at any of so many places.
    pub fn empty(places: usize) -> Self {
        let kept = vec![Vec::new(); places];
        Self { stamps: Vec::new(), words: vec![NO_WORD; places], kept, count: 0 }
    }

    /// `stamps[words[p]]` at every place p.
    pub fn new(places: Places<'_>, words: &[u32], stamps: Vec<Stamp>) -> Self {
        let mut sparsified = Self { stamps, words: words.to_vec(), ..Self::empty(words.len()) };
        let mut thinner = Thinner::default();
        for &place in &places.neighbors.order {
            let mut kept = Vec::new();
            let word = sparsified.words[place as usize];
            let of = |n: u32| sparsified.kept[n as usize].as_slice();
            if let Some(stamp) = sparsified.stamps.get(word as usize) {
                thin_place(places, place, stamp, of, &mut thinner, &mut kept);
            }
            sparsified.count += kept.len();
            sparsified.kept[place as usize] = kept;
        }
        sparsified
    }

    /// The kept points, R^ of eq. 3, place after place.
    pub fn kept(&self) -> impl Iterator<Item = [f32; 3]> {
        self.kept.iter().flatten().map(|p| p.position)
    }

    /// The kept points by place.
    pub fn by_place(&self) -> impl Iterator<Item = (u32, &[KeptPoint])> {
        (0..).zip(self.kept.iter().map(Vec::as_slice))
    }

    /// Number of kept points, M.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Applies a change. A new word's stamp becomes the last.
    pub fn apply(&mut self, change: &mut Change) {
        let word = match change.stamp.take() {
            Some(stamp) => {
                self.stamps.push(stamp);
                self.stamps.len() as u32 - 1
            }
            None => NO_WORD,
        };
        for &place in &change.places {
            self.words[place as usize] = word;
        }
        for (place, kept) in change.decided() {
            let of = &mut self.kept[place as usize];
            self.count = self.count + kept.len() - of.len();
            of.clear();
            of.extend_from_slice(kept);
        }
    }
}

/// Appends the points of a word at `place` that are kept, given those of the neighbours before it.
pub(super) fn thin_place<'a>(
    places: Places<'_>,
    place: u32,
    stamp: &Stamp,
    kept: impl Fn(u32) -> &'a [KeptPoint],
    thinner: &mut Thinner,
    out: &mut Vec<KeptPoint>,
) {
    let frame = &places.frames[place as usize];
    // A thousandth more, so that rounding leaves out none that counts.
    let reach = 1.001 * (stamp.reach + places.epsilon);
    thinner.clear();
    for &neighbor in places.neighbors.before(place) {
        thinner.push_near(kept(neighbor), frame.origin, reach);
    }
    thinner.keep(stamp, frame, places.epsilon, out);
}

/// Eq. 2 and 3 at once: the kept points of occurrences, given the pose, frame and word of each, with the occurrence that
/// each belongs to, occurrence after occurrence.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(in crate::bic_alphabet) fn rebuild(
    poses: &[BicPose],
    frames: &[Frame],
    words: &[u32],
    stamps: &[Stamp],
    epsilon: f32,
    progress: &dyn Progress,
) -> Result<Vec<(u32, [f32; 3])>> {
    let largest = stamps.iter().map(|stamp| stamp.reach).fold(0.0, f32::max);
    // A thousandth more, so that rounding leaves out none that counts.
    let mut grid = KeptGrid::new(1.001 * (largest + epsilon));
    let mut kept: Vec<(u32, Vec<KeptPoint>)> = Vec::with_capacity(poses.len());
    let mut thinner = Thinner::default();
    for (k, place) in order(poses).into_iter().enumerate() {
        if k % OCCURRENCES_PER_CHECK == 0 {
            progress.check()?;
        }
        let mut points = Vec::new();
        let frame = &frames[place as usize];
        if let Some(stamp) = stamps.get(words[place as usize] as usize) {
            thinner.clear();
            grid.visit_near(frame.origin, |p| thinner.push(p));
            thinner.keep(stamp, frame, epsilon, &mut points);
            points.iter().for_each(|p| grid.insert(p.position));
        }
        kept.push((place, points));
    }
    kept.sort_unstable_by_key(|(place, _)| *place);
    let of_place = |(place, points): (u32, Vec<KeptPoint>)| {
        points.into_iter().map(move |p| (place, p.position))
    };
    Ok(kept.into_iter().flat_map(of_place).collect())
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;
    use surfabet_geom::Silent;

    use super::*;
    use crate::bic_alphabet::words::BicWord;
    use crate::scans::Upright;

    pub const RADIUS: f64 = 0.2;
    pub const EPSILON: f32 = 0.07;

    /// Poses in a cube of one metre with their frames, in ascending order.
    pub fn poses() -> impl Strategy<Value = (Vec<BicPose>, Vec<Frame>)> {
        let one = (prop::array::uniform3(0.0_f32..1.0), prop::array::uniform3(-1.0_f32..1.0));
        prop::collection::vec(one, 1..60).prop_map(|all| {
            let quantize = |(at, normal): &([f32; 3], [f32; 3])| {
                BicPose::quantize(*at, *normal, [0.0; 3], Upright::WorldX, RADIUS).unwrap()
            };
            let mut poses: Vec<BicPose> = all.iter().map(quantize).collect();
            poses.sort_unstable();
            poses.dedup();
            let frames = poses.iter().map(|p| p.frame(Upright::WorldX, RADIUS)).collect();
            (poses, frames)
        })
    }

    /// A few words of up to 60 points within the radius.
    pub fn words() -> impl Strategy<Value = Vec<BicWord>> {
        let points = prop::collection::vec(prop::array::uniform3(-36_i8..37), 1..60);
        let word = points.prop_map(|mut points| {
            points.sort_unstable();
            BicWord { points, descriptor: Vec::new() }
        });
        prop::collection::vec(word, 1..4)
    }

    pub fn stamp(word: &BicWord) -> Stamp {
        Stamp::new(word, RADIUS, f64::from(EPSILON))
    }

    pub fn neighbors(poses: &[BicPose], frames: &[Frame]) -> Neighbors {
        Neighbors::new(poses, frames, RADIUS as f32, EPSILON).unwrap()
    }

    fn squared(a: [f32; 3], b: [f32; 3]) -> f32 {
        let d: [f32; 3] = std::array::from_fn(|i| a[i] - b[i]);
        d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    }

    proptest! {
        #[test]
        fn kept_points_are_apart_and_each_other_point_is_near_one_before_it(
            (poses, frames) in poses(),
            words in words(),
            chosen in prop::collection::vec(any::<prop::sample::Index>(), 60),
        ) {
            let stamps: Vec<Stamp> = words.iter().map(stamp).collect();
            let ids: Vec<u32> =
                (0..poses.len()).map(|p| chosen[p].index(words.len() + 1) as u32).collect();
            let neighbors = neighbors(&poses, &frames);
            let places = Places { frames: &frames, neighbors: &neighbors, epsilon: EPSILON };
            let sparsified = Sparsified::new(places, &ids, stamps.clone());
            // Eq. 3 by a plain loop over all points.
            let mut kept: Vec<[f32; 3]> = Vec::new();
            for place in order(&poses) {
                let Some(stamp) = stamps.get(ids[place as usize] as usize) else { continue };
                for &point in &stamp.points {
                    let p = frames[place as usize].place(point);
                    if kept.iter().all(|&q| squared(p, q) >= EPSILON * EPSILON) {
                        kept.push(p);
                    }
                }
            }
            let by_turn = neighbors.order.iter().flat_map(|&p| &sparsified.kept[p as usize]);
            let found: Vec<[f32; 3]> = by_turn.map(|p| p.position).collect();
            prop_assert_eq!(&found, &kept);
            prop_assert_eq!(sparsified.count(), kept.len());
            // At once, as a decoder does it.
            let decoded = rebuild(&poses, &frames, &ids, &stamps, EPSILON, &Silent).unwrap();
            let in_order: Vec<(u32, [f32; 3])> = sparsified
                .by_place()
                .flat_map(|(place, kept)| kept.iter().map(move |p| (place, p.position)))
                .collect();
            prop_assert_eq!(decoded, in_order);
        }
    }
}
