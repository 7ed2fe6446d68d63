//! A batch polish of a grown network: no step of the published algorithm, but one after it.
//!
//! A growing neural gas moves a neuron with every signal, so that in the end it is the mean of its last few signals and not
//! of all its points, and it keeps what it learned while it was small. The polish is k-means from there. A round
//!
//! 1. finds the two nearest neurons to every point (`winners/nearby`),
//! 2. moves every neuron to the mean of its points (S. Lloyd: *Least Squares Quantization in PCM*, 1982),
//! 3. in the first half of the rounds moves neurons that are hardly needed to where errors are large (`relocate`).
//!
//! Afterwards edges are those of competitive Hebbian learning (T. Martinetz, K. Schulten, 1994) over all points: each point
//! joins its two nearest neurons (`hebbian`).

mod hebbian;
mod relocate;

use std::borrow::Cow;

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::constants::{POLISH_SAMPLE, ROUNDS_OF_ALL};
use super::network::Graph;
use super::ordered::Ordered;
use super::winners::{Groups, Nearby, Winner};
use crate::error::Result;
use relocate::relocate;

/// Points of one weight, and the neurons nearest to them.
struct SampledSet<'a> {
    points: Cow<'a, [[f32; 3]]>,
    weight: f64,
    winners: Vec<[Winner; 2]>,
}

impl<'a> SampledSet<'a> {
    /// Every `step`-th of `points`.
    fn new((points, weight): (&'a Ordered, f64), step: usize) -> Self {
        let points = match step {
            1 => Cow::Borrowed(&points.points[..]),
            _ => Cow::Owned(points.thinned(step)),
        };
        let winners = vec![[Winner::NONE; 2]; points.len()];
        Self { points, weight, winners }
    }
}

/// What a neuron is to the points nearest to it.
#[derive(Debug, Clone, Copy, Default)]
struct NeuronCell {
    /// Sum of the weights of the points.
    weight: f64,
    /// Mean of the points less the neuron's position, metres.
    offset: [f64; 3],
    /// Sum of the distances to the points, with their weights, metres.
    distance: f64,
    /// Sum of the errors of the points (see `relocate`).
    error: f64,
    /// By how much the sum of all errors would grow without this neuron.
    utility: f64,
}

impl NeuronCell {
    /// Adds a point of the neuron at `position`; `offset` is the sum until all are added.
    #[inline(always)]
    fn add(&mut self, p: [f32; 3], distance: f64, weight: f64, position: [f32; 3]) {
        self.weight += weight;
        for a in 0..3 {
            self.offset[a] += weight * (f64::from(p[a]) - f64::from(position[a]));
        }
        self.distance += weight * distance;
    }

    /// Adds the error of a point at this distance, and of the second neuron at that one.
    #[inline(always)]
    fn add_error(&mut self, [d1, d2]: [f64; 2], weight: f64) {
        let error = relocate::error(d1);
        self.error += weight * error;
        self.utility += weight * (relocate::error(d2) - error);
    }
}

/// The points of all samples by the neuron that they are nearest to.
struct NeuronCells<'a> {
    samples: &'a [SampledSet<'a>],
    groups: Vec<Groups>,
}

impl<'a> NeuronCells<'a> {
    fn new(n: usize, samples: &'a [SampledSet<'a>]) -> Self {
        let groups = samples.iter().map(|sample| Groups::new(n, &sample.winners)).collect();
        Self { samples, groups }
    }

    /// Position, weight, winner and second winner of each point of neuron `i`, in a fixed order.
    fn points(&self, i: usize) -> impl Iterator<Item = ([f32; 3], f64, [Winner; 2])> {
        self.samples.iter().zip(&self.groups).flat_map(move |(sample, groups)| {
            groups.of(i).map(|m| (sample.points[m], sample.weight, sample.winners[m]))
        })
    }

    /// The cell of neuron `i` at `position`; error and utility only if `with_errors`.
    fn cell(&self, i: usize, position: [f32; 3], with_errors: bool) -> NeuronCell {
        let mut cell = NeuronCell::default();
        for (sample, groups) in self.samples.iter().zip(&self.groups) {
            let weight = sample.weight;
            for run in groups.runs_of(i) {
                for &m in run {
                    let winners = sample.winners[m as usize];
                    let distance = |k: usize| f64::from(winners[k].squared_distance()).sqrt();
                    cell.add(sample.points[m as usize], distance(0), weight, position);
                    if with_errors {
                        cell.add_error([distance(0), distance(1)], weight);
                    }
                }
            }
        }
        if cell.weight > 0.0 {
            cell.offset = cell.offset.map(|sum| sum / cell.weight);
        }
        cell
    }
}

/// A polished network, and how it came about.
pub(super) struct Polished {
    pub graph: Graph,
    /// Mean distance of the points to their neurons before each round, metres.
    pub trace: Vec<f64>,
    /// The neurons, and the two nearest to each point of each set.
    pub nearby: Nearby,
    pub winners: Vec<Vec<[Winner; 2]>>,
}

/// Polishes the network with neurons at `positions`, at least two, in `rounds` rounds over sets of points, each with the
/// weight of its points; an edge is kept where it would mostly be there with a largest age of `max_age`.
///
/// The result does not depend on the number of threads.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn polish(
    mut positions: Vec<[f32; 3]>,
    sets: &[(&Ordered, f64)],
    rounds: u32,
    max_age: u32,
    progress: &dyn Progress,
) -> Result<Polished> {
    let n_points: usize = sets.iter().map(|(points, _)| points.len()).sum();
    let step = (n_points / (POLISH_SAMPLE * positions.len())).max(1);
    let mut samples: Vec<SampledSet<'_>> =
        sets.iter().map(|&set| SampledSet::new(set, step)).collect();
    let mut is_of_all = step == 1;
    let mut trace = Vec::new();
    let mut nearby = Nearby::new(&positions, progress)?;
    // After the last round once more, for the edges.
    loop {
        let done = trace.len() as u32;
        progress.update("polishing", done as f32 / (rounds + 1) as f32);
        if !is_of_all && done + ROUNDS_OF_ALL >= rounds {
            samples = sets.iter().map(|&set| SampledSet::new(set, 1)).collect();
            is_of_all = true;
        }
        for SampledSet { points, winners, .. } in &mut samples {
            nearby.assign(points, winners, progress)?;
        }
        if done == rounds {
            break;
        }
        trace.push(move_once(&mut positions, &samples, done < rounds / 2));
        nearby.renew(&positions, progress)?;
    }
    let cells = NeuronCells::new(positions.len(), &samples);
    let edges = hebbian::edges(&positions, &cells, &nearby, max_age);
    let winners = samples.into_iter().map(|sample| sample.winners).collect();
    Ok(Polished { graph: Graph { positions, edges }, trace, nearby, winners })
}

/// Moves every neuron to the mean of its points, and with `and_relocate` some to other places. Gives the mean distance
/// before.
fn move_once(positions: &mut [[f32; 3]], samples: &[SampledSet<'_>], and_relocate: bool) -> f64 {
    let points = NeuronCells::new(positions.len(), samples);
    let cells: Vec<NeuronCell> =
        parallel::map_range(positions.len(), |i| points.cell(i, positions[i], and_relocate));
    for (position, cell) in positions.iter_mut().zip(&cells) {
        *position = std::array::from_fn(|a| (f64::from(position[a]) + cell.offset[a]) as f32);
    }
    if and_relocate {
        relocate(positions, &cells, &points);
    }
    let total = |part: fn(&NeuronCell) -> f64| cells.iter().map(part).sum::<f64>();
    total(|cell| cell.distance) / total(|cell| cell.weight)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_geom::{Cancelled, Silent};

    use super::*;
    use crate::error::Error;

    fn on_a_line(x: &[f32]) -> Vec<[f32; 3]> {
        x.iter().map(|&x| [x, 0.0, 0.0]).collect()
    }

    fn polished(neurons: &[[f32; 3]], points: &[[f32; 3]], rounds: u32) -> Graph {
        let ordered = Ordered::new(points);
        polish(neurons.to_vec(), &[(&ordered, 1.0)], rounds, 50, &Silent).unwrap().graph
    }

    fn squared_error(neurons: &[[f32; 3]], points: &[[f32; 3]]) -> f64 {
        let to = |p: &[f32; 3]| {
            let squares = neurons.iter().map(|w| super::super::distance(*p, *w).powi(2));
            squares.fold(f64::INFINITY, f64::min)
        };
        points.iter().map(to).sum()
    }

    #[test]
    fn a_neuron_goes_to_the_mean_of_its_points() {
        let points = on_a_line(&[0.0, 1.0, 2.0, 10.0, 14.0]);
        let graph = polished(&on_a_line(&[3.0, 8.0]), &points, 1);
        assert_eq!(graph.positions, on_a_line(&[1.0, 12.0]));
        assert_eq!(graph.edges, [[0, 1]]);
    }

    #[test]
    fn points_count_by_their_weights() {
        let (light, heavy) = (on_a_line(&[0.0, 100.0]), on_a_line(&[4.0, 104.0]));
        let (light, heavy) = (Ordered::new(&light), Ordered::new(&heavy));
        let neurons = on_a_line(&[1.0, 90.0]);
        let graph = polish(neurons, &[(&light, 1.0), (&heavy, 3.0)], 1, 50, &Silent).unwrap().graph;
        assert_eq!(graph.positions, on_a_line(&[3.0, 103.0]));
    }

    #[test]
    fn a_neuron_without_points_goes_to_where_errors_are_large() {
        // Two clusters of two halves each; one neuron has none of them.
        let points = on_a_line(&[0.0, 0.1, 10.0, 10.1, 20.0, 20.1]);
        let mut graph = polished(&on_a_line(&[0.0, 15.0, 100.0]), &points, 2);
        graph.positions.sort_by(|p, q| p[0].total_cmp(&q[0]));
        for (found, expected) in graph.positions.iter().zip([0.05, 10.05, 20.05]) {
            assert!((found[0] - expected).abs() < 1e-5, "{found:?}");
        }
    }

    proptest! {
        #[test]
        fn no_round_raises_the_squared_error(
            points in prop::collection::vec(prop::array::uniform3(-1_f32..1.0), 20..200),
            n in 2_usize..20,
        ) {
            // Without a first half nothing is relocated.
            let mut neurons = points[..n].to_vec();
            let mut before = squared_error(&neurons, &points);
            for _ in 0..4 {
                neurons = polished(&neurons, &points, 1).positions;
                let after = squared_error(&neurons, &points);
                prop_assert!(after <= before * (1.0 + 1e-6), "{after} {before}");
                before = after;
            }
        }

        #[test]
        fn the_number_of_threads_does_not_matter(
            points in prop::collection::vec(prop::array::uniform3(-1_f32..1.0), 20..3000),
            n in 2_usize..20,
        ) {
            let with = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| polished(&points[..n], &points, 6))
            };
            prop_assert_eq!(with(1), with(3));
        }
    }

    #[test]
    fn stops_when_cancelled() {
        struct Impatient;
        impl Progress for Impatient {
            fn update(&self, _: &'static str, _: f32) {}
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        let points = Ordered::new(&on_a_line(&[0.0, 1.0]));
        let result = polish(on_a_line(&[0.0, 1.0]), &[(&points, 1.0)], 1, 50, &Impatient);
        assert!(matches!(result, Err(Error::Cancelled(Cancelled))));
    }
}
