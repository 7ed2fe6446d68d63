//! The order of neurons in a model: along the topology, breadth first.

use surfabet_geom::morton::encode_wide;

use crate::gas::adjacency::Adjacency;
use crate::gas::model::{MAX_COORDINATE, Neuron};

/// The neurons in the order of the file, and the place of each in it.
///
/// Components start at their lowest neuron along a Morton curve; a neuron's neighbours follow by position.
pub(in crate::gas) fn traversal(neurons: &[Neuron], adjacency: &Adjacency) -> (Vec<u32>, Vec<u32>) {
    let mut roots: Vec<u32> = (0..neurons.len() as u32).collect();
    // Coordinates are at least -MAX_COORDINATE.
    let cell = |i: u32| neurons[i as usize].position.map(|c| (c + MAX_COORDINATE) as u32);
    roots.sort_by_cached_key(|&i| (encode_wide(cell(i)), i));
    let mut place = vec![u32::MAX; neurons.len()];
    let mut order: Vec<u32> = Vec::with_capacity(neurons.len());
    for root in roots {
        if place[root as usize] != u32::MAX {
            continue;
        }
        let mut at = order.len();
        place[root as usize] = at as u32;
        order.push(root);
        while at < order.len() {
            let of = adjacency.of(order[at] as usize).iter().copied();
            let mut children: Vec<u32> = of.filter(|&j| place[j as usize] == u32::MAX).collect();
            children.sort_by_key(|&j| (neurons[j as usize].position, j));
            for child in children {
                place[child as usize] = order.len() as u32;
                order.push(child);
            }
            at += 1;
        }
    }
    (order, place)
}
