//! Edges by competitive Hebbian learning over all points at once: each point joins its two nearest neurons.
//!
//! While a network grows an edge ages with every win of one of its ends, is refreshed whenever both are the nearest, and goes
//! when it is too old. Of neurons that stay where they are, n_a and n_b points have either end as the nearest neuron and n_ab
//! have both as their two nearest: a win refreshes the edge with the probability `p = n_ab / (n_a + n_b)`, and it is there
//! unless as many wins as the largest age did not, `1 - (1 - p)^max_age` of the time. It is kept where that is half of it
//! at least.

use surfabet_base::parallel;

use super::super::constants::NEURONS_PER_TASK;
use super::super::winners::Nearby;
use super::NeuronCells;

/// An edge of a neuron to one with a larger number, and the weight of the points that join both.
#[derive(Clone, Copy)]
struct Link {
    ends: [u32; 2],
    weight: f64,
}

/// Edges between neurons at `positions`, the smaller number first, sorted. Each neuron keeps the one that most points
/// made; one without points gets one to the neuron nearest to it.
pub(super) fn edges(
    positions: &[[f32; 3]],
    cells: &NeuronCells<'_>,
    nearby: &Nearby,
    max_age: u32,
) -> Vec<[u32; 2]> {
    let tasks = positions.len().div_ceil(NEURONS_PER_TASK);
    let runs: Vec<(Vec<f64>, Vec<Link>)> = parallel::map_range(tasks, |task| {
        let end = ((task + 1) * NEURONS_PER_TASK).min(positions.len());
        let mut links = Vec::new();
        let own = task * NEURONS_PER_TASK..end;
        (own.map(|i| add_links(cells, i, &mut links)).collect(), links)
    });
    let (weights, links): (Vec<Vec<f64>>, Vec<Vec<Link>>) = runs.into_iter().unzip();
    let (weights, mut links) = (weights.concat(), links.concat());
    // Both directions of an edge follow each other; of two weights the order does not matter for the sum.
    links.sort_unstable_by_key(|link| link.ends);
    links.dedup_by(|later, kept| {
        let is_same = later.ends == kept.ends;
        kept.weight += if is_same { later.weight } else { 0.0 };
        is_same
    });
    let mut strongest: Vec<Option<usize>> = vec![None; positions.len()];
    for (k, link) in links.iter().enumerate() {
        for end in link.ends {
            let best = &mut strongest[end as usize];
            if best.is_none_or(|best| links[best].weight < link.weight) {
                *best = Some(k);
            }
        }
    }
    // The least p: 1 - 2^(-1 / max_age).
    let least = -libm::expm1(-std::f64::consts::LN_2 / f64::from(max_age));
    let is_kept = |(k, link): &(usize, Link)| {
        let [a, b] = link.ends.map(|end| end as usize);
        let wins = weights[a] + weights[b];
        link.weight >= least * wins || strongest[a] == Some(*k) || strongest[b] == Some(*k)
    };
    let kept = links.into_iter().enumerate().filter(is_kept);
    let mut edges: Vec<[u32; 2]> = kept.map(|(_, link)| link.ends).collect();
    for i in (0..positions.len()).filter(|&i| strongest[i].is_none()) {
        let [first, second] = nearby.two_nearest(positions[i], i as u32).map(|winner| winner.id());
        let other = if first as usize == i { second } else { first };
        edges.push([other.min(i as u32), other.max(i as u32)]);
    }
    edges.sort_unstable();
    // Two neurons without points may have chosen each other.
    edges.dedup();
    edges
}

/// Adds the edges of neuron `i` to the second nearest of its points; gives the weight of these points.
fn add_links(cells: &NeuronCells<'_>, i: usize, links: &mut Vec<Link>) -> f64 {
    let mut seconds: Vec<(u32, f64)> =
        cells.points(i).map(|(_, weight, winners)| (winners[1].id(), weight)).collect();
    // Stable, so that the weights of each are added in a fixed order.
    seconds.sort_by_key(|second| second.0);
    let sum = |of: &[(u32, f64)]| of.iter().map(|second| second.1).sum::<f64>();
    links.extend(seconds.chunk_by(|a, b| a.0 == b.0).map(|run| {
        let (i, other) = (i as u32, run[0].0);
        Link { ends: [i.min(other), i.max(other)], weight: sum(run) }
    }));
    sum(&seconds)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use surfabet_geom::Silent;

    use super::super::super::ordered::Ordered;
    use super::super::polish;

    /// Neurons on a lattice of 1 m, and points evenly spread over it.
    fn lattice() -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let neurons = (0..64).map(|i| [(i % 8) as f32 + 0.5, (i / 8) as f32 + 0.5, 0.0]).collect();
        let turn = |i: u32, by: f64| 8.0 * (f64::from(i) * by).fract() as f32;
        let points = (0..9000).map(|i| [turn(i, 0.754_877_666), turn(i, 0.569_840_291), 0.0]);
        (neurons, points.collect())
    }

    #[test]
    fn edges_are_those_of_the_definition() {
        let (neurons, points) = lattice();
        let ordered = Ordered::new(&points);
        for max_age in [1, 3, 10, 1000] {
            let graph =
                polish(neurons.clone(), &[(&ordered, 1.0)], 0, max_age, &Silent).unwrap().graph;
            assert_eq!(graph.positions, neurons);
            let mut pairs: BTreeMap<[u32; 2], u32> = BTreeMap::new();
            let mut wins = [0_u32; 64];
            for &p in &points {
                let mut ids: Vec<u32> = (0..64).collect();
                // Rounded as everywhere, so that ties are the same.
                let to = |i: &u32| {
                    let d: [f32; 3] = std::array::from_fn(|a| neurons[*i as usize][a] - p[a]);
                    (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2]
                };
                ids.sort_by(|a, b| to(a).total_cmp(&to(b)));
                wins[ids[0] as usize] += 1;
                *pairs.entry([ids[0].min(ids[1]), ids[0].max(ids[1])]).or_default() += 1;
            }
            let strongest = |i: u32| pairs.iter().filter(|p| p.0.contains(&i)).map(|p| p.1).max();
            for (ends, n) in &pairs {
                let share =
                    f64::from(*n) / f64::from(wins[ends[0] as usize] + wins[ends[1] as usize]);
                let is_young = 1.0 - (1.0 - share).powi(max_age as i32) >= 0.5;
                let is_strongest = ends.iter().any(|&i| strongest(i) == Some(n));
                let found = graph.edges.binary_search(ends).is_ok();
                assert!(!is_young || found, "{ends:?}");
                // Of equally strong edges one is kept.
                assert!(!found || is_young || is_strongest, "{ends:?}");
            }
            assert!(graph.edges.iter().all(|ends| pairs.contains_key(ends)));
            assert!((0..64).all(|i| graph.edges.iter().any(|ends| ends.contains(&i))));
        }
    }

    #[test]
    fn a_neuron_without_points_is_joined_to_the_nearest() {
        let neurons = vec![[0.0; 3], [1.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.5, 0.0, 0.0]];
        let points = Ordered::new(&[[0.4, 0.0, 0.0], [0.6, 0.0, 0.0]]);
        let graph = polish(neurons, &[(&points, 1.0)], 0, 50, &Silent).unwrap().graph;
        assert_eq!(graph.edges, [[0, 1], [2, 3]]);
    }
}
