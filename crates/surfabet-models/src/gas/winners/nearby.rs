//! The two nearest of neurons that stay where they are, for points of which one lies near the next.
//!
//! Every neuron has a list of those around it, in two rings, and for each ring the distance beyond which all others are. A
//! search goes from neuron to neuron, each time to the nearest to the point in the list, until that is the neuron whose list
//! it is. With distances d1 and d2 of the point to the two nearest in this list, a neuron that is not in it is at least
//! `reach - d1` from the point: where `d1 + d2` is below the reach, these two are the nearest of all. Mostly the inner ring
//! shows this, else both rings do, and elsewhere a k-d tree is asked. So the result is exact, ties included, wherever the
//! search starts.

use crate::gas::constants::MOST_LISTS;
use pulp::{Arch, Simd, WithSimd};
use surfabet_base::parallel;
use surfabet_geom::{KdTree, Neighbor, Progress};

use super::{Best, Winner};
use crate::error::Result;
use crate::gas::constants::NEURONS_PER_TASK;

/// Neurons of a ring: on a surface the first one around the neuron, which is of the inner ring itself.
const LANES: usize = 8;

/// Neurons of a list.
const LISTED: usize = 2 * LANES;

/// Share of the reach that is relied upon: the rest is far more than the rounding of three distances.
const SAFE: f32 = 1.0 - 1e-5;

/// Points per unit of parallel work, some milliseconds; results do not depend on it.
const POINTS_PER_TASK: usize = 4096;

/// Points that are sorted by their neurons at a time; results do not depend on it.
const POINTS_PER_PART: usize = 1 << 14;

/// Some neurons around one, nearest first.
#[derive(Debug, Clone)]
struct Ring {
    /// Columns; unused lanes are at infinity.
    position: [[f32; LANES]; 3],
    id: [u32; LANES],
}

impl Ring {
    const EMPTY: Self = Self { position: [[f32::INFINITY; LANES]; 3], id: [u32::MAX; LANES] };

    /// Takes the neurons in that are nearer to the query than the best so far.
    #[inline(always)]
    fn offer(&self, query: [f32; 3], best: &mut Best) {
        let distances: [f32; LANES] = std::array::from_fn(|lane| {
            let d: [f32; 3] = std::array::from_fn(|axis| self.position[axis][lane] - query[axis]);
            (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2]
        });
        // Those that are nearest to the middle are in first, so that few of the others are near.
        best.offer(Winner::new(distances[0], self.id[0]));
        best.offer(Winner::new(distances[1], self.id[1]));
        let limit = best.limit();
        let mut near = 0_u32;
        for (lane, &distance) in distances.iter().enumerate() {
            near |= u32::from(distance <= limit) << lane;
        }
        near &= !3;
        while near != 0 {
            let lane = near.trailing_zeros() as usize;
            near &= near - 1;
            best.offer(Winner::new(distances[lane], self.id[lane]));
        }
    }
}

/// A neuron, in the first lane of the inner ring, and those around it.
#[derive(Debug, Clone)]
#[repr(align(32))]
struct List {
    rings: [Ring; 2],
    /// No neuron outside of the inner ring, and of both, is nearer to the first than this, metres.
    reaches: [f32; 2],
}

impl List {
    const EMPTY: Self = Self { rings: [Ring::EMPTY; 2], reaches: [f32::INFINITY; 2] };

    /// Its own neuron, as seen from `query`.
    fn own(&self, query: [f32; 3]) -> Winner {
        let Ring { position, id } = &self.rings[0];
        let d: [f32; 3] = std::array::from_fn(|axis| position[axis][0] - query[axis]);
        Winner::new((d[0] * d[0] + d[1] * d[1]) + d[2] * d[2], id[0])
    }

    /// The list of neuron `own` at `positions`, with memory for its neighbours.
    fn new(own: usize, positions: &[[f32; 3]], tree: &KdTree, near: &mut Vec<Neighbor>) -> Self {
        let mut list = Self::EMPTY;
        tree.k_nearest(positions[own], LISTED, near);
        // Where more neurons than a list holds are at its place, a neuron may be missing in its own row.
        let others = near.iter().map(|n| n.index()).filter(|&i| i != own);
        for (k, i) in std::iter::once(own).chain(others).take(LISTED).enumerate() {
            let (ring, lane) = (&mut list.rings[k / LANES], k % LANES);
            (0..3).for_each(|a| ring.position[a][lane] = positions[i][a]);
            ring.id[lane] = i as u32;
        }
        for (reach, count) in list.reaches.iter_mut().zip([LANES, LISTED]) {
            if count < positions.len() {
                *reach = near[count - 1].squared_distance().sqrt();
            }
        }
        list
    }
}

/// Neurons that stay where they are, at least two.
pub(in crate::gas) struct Nearby {
    lists: Vec<List>,
    tree: KdTree,
}

impl Nearby {
    /// Of neurons at finite `positions`.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn new(positions: &[[f32; 3]], progress: &dyn Progress) -> Result<Self> {
        let tree = KdTree::new(positions)?;
        let lists = vec![List::EMPTY; positions.len()];
        let mut nearby = Self { lists, tree };
        nearby.fill(positions, progress)?;
        Ok(nearby)
    }

    /// Follows as many neurons to other positions, in the same memory.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn renew(&mut self, positions: &[[f32; 3]], progress: &dyn Progress) -> Result<()> {
        self.tree = KdTree::new(positions)?;
        self.fill(positions, progress)
    }

    /// Follows as many neurons to other positions, each at most `by` away, metres, with the same lists: what is around a neuron may now
    /// be nearer by twice as much.
    ///
    /// # Errors
    /// As the tree has them.
    pub fn shift(&mut self, positions: &[[f32; 3]], by: f32) -> Result<()> {
        self.tree = KdTree::new(positions)?;
        parallel::for_each_mut(&mut self.lists, |_, list| {
            for ring in &mut list.rings {
                for (lane, &id) in ring.id.iter().enumerate() {
                    if let Some(position) = positions.get(id as usize) {
                        (0..3).for_each(|a| ring.position[a][lane] = position[a]);
                    }
                }
            }
            list.reaches = list.reaches.map(|reach| SAFE * reach - 2.0 * by);
        });
        Ok(())
    }

    /// Lists the neurons around each.
    fn fill(&mut self, positions: &[[f32; 3]], progress: &dyn Progress) -> Result<()> {
        let Self { lists, tree } = self;
        parallel::try_for_each(lists.chunks_mut(NEURONS_PER_TASK), |task, lists| {
            let mut near = Vec::new();
            for (i, list) in lists.iter_mut().enumerate() {
                *list = List::new(task * NEURONS_PER_TASK + i, positions, tree, &mut near);
            }
            Ok(progress.check()?)
        })
    }

    /// The two nearest neurons to a finite `query`, of equally near ones those with the smaller numbers; `near` is a
    /// neuron to start from.
    #[inline(always)]
    pub fn two_nearest(&self, query: [f32; 3], near: u32) -> [Winner; 2] {
        let mut at = near;
        'lists: for _ in 0..MOST_LISTS {
            let list = &self.lists[at as usize];
            let mut best = Best([Winner::NONE; 2]);
            for (ring, reach) in list.rings.iter().zip(list.reaches) {
                ring.offer(query, &mut best);
                if best.0[0].id() != at {
                    at = best.0[0].id();
                    continue 'lists;
                }
                let [d1, d2] = best.0.map(|winner| winner.squared_distance().sqrt());
                if d1 + d2 < SAFE * reach {
                    return best.0;
                }
            }
            break;
        }
        self.two_in_tree(query)
    }

    /// The same by the tree.
    #[inline(never)]
    fn two_in_tree(&self, query: [f32; 3]) -> [Winner; 2] {
        let mut found = Vec::with_capacity(2);
        self.tree.k_nearest(query, 2, &mut found);
        std::array::from_fn(|k| Winner::new(found[k].squared_distance(), found[k].index() as u32))
    }

    /// The two nearest neurons to each of `points`, which lie near each other as they follow; `winners` has the neurons to
    /// start from, and gets those that are found.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn assign(
        &self,
        points: &[[f32; 3]],
        winners: &mut [[Winner; 2]],
        progress: &dyn Progress,
    ) -> Result<()> {
        let chunks = points.chunks(POINTS_PER_TASK).zip(winners.chunks_mut(POINTS_PER_TASK));
        parallel::try_for_each(chunks, |_, (points, winners)| {
            // Compiled a second time for AVX2: the same operations on each lane.
            Arch::new().dispatch(Assign { nearby: self, points, winners });
            Ok(progress.check()?)
        })
    }

    /// The nearest neuron to each of `points`, whose two nearest were `winners` before every neuron moved by at most `by`, metres;
    /// the second is left as it was where the first follows without it.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn follow(
        &self,
        points: &[[f32; 3]],
        winners: &mut [[Winner; 2]],
        by: f32,
        progress: &dyn Progress,
    ) -> Result<()> {
        let chunks = points.chunks(POINTS_PER_TASK).zip(winners.chunks_mut(POINTS_PER_TASK));
        parallel::try_for_each(chunks, |_, (points, winners)| {
            for (&point, winners) in points.iter().zip(winners) {
                let [d1, d2] = winners.map(|winner| winner.squared_distance().sqrt());
                let id = winners[0].id();
                if d1 + 2.0 * by < SAFE * d2 {
                    winners[0] = self.lists[id as usize].own(point);
                } else {
                    *winners = self.two_nearest(point, id);
                }
            }
            Ok(progress.check()?)
        })
    }

    /// As [`assign`](Self::assign), where nothing is known of the points yet.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn assigned(
        &self,
        points: &[[f32; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<[Winner; 2]>> {
        let mut winners = vec![[Winner::NONE; 2]; points.len()];
        self.assign(points, &mut winners, progress)?;
        Ok(winners)
    }
}

/// The arguments of a task of [`Nearby::assign`].
struct Assign<'a> {
    nearby: &'a Nearby,
    points: &'a [[f32; 3]],
    winners: &'a mut [[Winner; 2]],
}

impl WithSimd for Assign<'_> {
    type Output = ();

    // Inlined, so that it is compiled for what the processor has.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let mut last = 0;
        for (&point, winners) in self.points.iter().zip(self.winners) {
            let near = if winners[0] == Winner::NONE { last } else { winners[0].id() };
            *winners = self.nearby.two_nearest(point, near);
            last = winners[0].id();
        }
    }
}

/// Points by the neuron that they are nearest to.
pub(in crate::gas) struct Groups {
    /// Where the runs of each neuron start, and the end.
    starts: Vec<u32>,
    runs: Vec<PointRange>,
    /// The points of each part of all points, by neuron.
    parts: Vec<Vec<u32>>,
}

/// Points of a neuron in one part.
#[derive(Debug, Clone, Copy, Default)]
struct PointRange {
    part: u32,
    start: u32,
    end: u32,
}

impl Groups {
    /// Of `n` neurons.
    pub fn new(n: usize, winners: &[[Winner; 2]]) -> Self {
        let n_parts = winners.len().div_ceil(POINTS_PER_PART);
        // Neighbours in the list are near each other, so that a part has points of few neurons.
        let sorted = parallel::map_range_with(
            n_parts,
            || vec![0; n],
            |places, part| {
                let first = part * POINTS_PER_PART;
                sorted(&winners[first..(first + POINTS_PER_PART).min(winners.len())], first, places)
            },
        );
        let mut starts = vec![0_u32; n + 1];
        let ids = || sorted.iter().flat_map(|(_, ends)| ends).map(|of| of.0 as usize);
        ids().for_each(|id| starts[id + 1] += 1);
        for i in 0..n {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut runs = vec![PointRange::default(); starts[n] as usize];
        for (part, (_, ends)) in (0..).zip(&sorted) {
            let mut start = 0;
            for &(id, end) in ends {
                let place = &mut next[id as usize];
                runs[*place as usize] = PointRange { part, start, end };
                *place += 1;
                start = end;
            }
        }
        Self { starts, runs, parts: sorted.into_iter().map(|part| part.0).collect() }
    }

    /// Points of neuron `i`, ascending, in runs.
    pub fn runs_of(&self, i: usize) -> impl Iterator<Item = &[u32]> + '_ {
        let runs = &self.runs[self.starts[i] as usize..self.starts[i + 1] as usize];
        runs.iter().map(|run| &self.parts[run.part as usize][run.start as usize..run.end as usize])
    }

    /// Points of neuron `i`, ascending.
    pub fn of(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        self.runs_of(i).flatten().map(|&p| p as usize)
    }
}

/// Counting sort of the points from `first` on by their winners: their numbers, and of every neuron that has some, ascending,
/// where they end. `places` is zero for all neurons, before and after.
fn sorted(
    winners: &[[Winner; 2]],
    first: usize,
    places: &mut [u32],
) -> (Vec<u32>, Vec<(u32, u32)>) {
    let mut ids = Vec::new();
    for of in winners {
        let place = &mut places[of[0].id() as usize];
        if *place == 0 {
            ids.push(of[0].id());
        }
        *place += 1;
    }
    ids.sort_unstable();
    let mut end = 0;
    for &id in &ids {
        let place = &mut places[id as usize];
        end += std::mem::replace(place, end);
    }
    let mut order = vec![0; winners.len()];
    for (point, of) in (first as u32..).zip(winners) {
        let place = &mut places[of[0].id() as usize];
        order[*place as usize] = point;
        *place += 1;
    }
    let ends = ids.into_iter().map(|id| (id, std::mem::take(&mut places[id as usize]))).collect();
    (order, ends)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_geom::Silent;

    use super::super::{BruteForce, Winners};
    use super::*;

    /// Coordinates on a coarse grid tie often; others hardly ever.
    fn position() -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(prop_oneof![(-2_i8..2).prop_map(f32::from), -3.0_f32..3.0])
    }

    proptest! {
        #[test]
        fn finds_what_brute_force_finds_from_anywhere(
            neurons in prop::collection::vec(position(), 2..200),
            queries in prop::collection::vec((position(), any::<u32>()), 1..40),
        ) {
            let nearby = Nearby::new(&neurons, &Silent).unwrap();
            let mut brute = BruteForce::default();
            for (id, &p) in (0..).zip(&neurons) {
                brute.insert(id, p);
            }
            for &(query, near) in &queries {
                let found = nearby.two_nearest(query, near % neurons.len() as u32);
                prop_assert_eq!(found, brute.two_nearest(query));
            }
            let points: Vec<[f32; 3]> = queries.iter().map(|q| q.0).collect();
            let winners = nearby.assigned(&points, &Silent).unwrap();
            // Neurons that moved by less than a hundredth along each axis.
            let moved: Vec<[f32; 3]> = neurons
                .iter()
                .map(|p| std::array::from_fn(|a| p[a] + 0.01 * (91.7 * p[(a + 1) % 3]).sin()))
                .collect();
            let mut shifted = Nearby::new(&neurons, &Silent).unwrap();
            shifted.shift(&moved, 0.018).unwrap();
            let found = Nearby::new(&moved, &Silent).unwrap().assigned(&points, &Silent).unwrap();
            prop_assert_eq!(&shifted.assigned(&points, &Silent).unwrap(), &found);
            let mut followed = winners.clone();
            shifted.follow(&points, &mut followed, 0.018, &Silent).unwrap();
            prop_assert!(followed.iter().zip(&found).all(|(a, b)| a[0] == b[0]));
            let groups = Groups::new(neurons.len(), &winners);
            let mut seen = 0;
            for id in 0..neurons.len() {
                for i in groups.of(id) {
                    prop_assert_eq!(brute.two_nearest(points[i])[0].id() as usize, id);
                    seen += 1;
                }
            }
            prop_assert_eq!(seen, points.len());
        }
    }

    #[test]
    fn more_neurons_at_one_place_than_a_list_holds() {
        let mut neurons = vec![[1.0; 3]; 40];
        neurons.push([0.0; 3]);
        let nearby = Nearby::new(&neurons, &Silent).unwrap();
        for near in [0, 39, 40] {
            assert_eq!(nearby.two_nearest([0.9; 3], near).map(Winner::id), [0, 1]);
            assert_eq!(nearby.two_nearest([0.1; 3], near).map(Winner::id), [40, 0]);
        }
    }
}
