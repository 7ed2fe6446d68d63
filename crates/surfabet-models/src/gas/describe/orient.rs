//! Signs of normals: towards the sensor where that is known, elsewhere the same side along the topology.

use std::collections::BinaryHeap;

use crate::gas::adjacency::Adjacency;
use crate::vector::dot;

/// Steps of how well two normals are parallel, for an order of integers.
const STEPS: f64 = 1e6;

/// Gives every normal a sign. Where `facing` says a side, it is that side; from there signs spread along edges,
/// between the most parallel normals first (Hoppe et al. 1992). A component that knows no side gets one from its
/// highest neuron, whose normal points up.
pub(crate) fn orient(
    normals: &mut [[f64; 3]],
    positions: &[[f32; 3]],
    adjacency: &Adjacency,
    facing: &[[f64; 3]],
) {
    let mut known = vec![false; normals.len()];
    let mut heap = BinaryHeap::new();
    for i in 0..normals.len() {
        let side = dot(normals[i], facing[i]);
        if side != 0.0 {
            known[i] = true;
            turn(&mut normals[i], side);
        }
    }
    for i in (0..normals.len()).filter(|&i| known[i]) {
        push(&mut heap, normals, adjacency, &known, i);
    }
    spread(&mut heap, normals, adjacency, &mut known);
    let mut highest: Vec<usize> = (0..normals.len()).filter(|&i| !known[i]).collect();
    highest.sort_by(|&a, &b| positions[b][2].total_cmp(&positions[a][2]).then(a.cmp(&b)));
    for i in highest {
        if known[i] || normals[i] == [0.0; 3] {
            continue;
        }
        known[i] = true;
        let up = normals[i][2];
        // A vertical one points along the larger of its other components.
        let largest = if normals[i][0].abs() >= normals[i][1].abs() { 0 } else { 1 };
        let side = if up.abs() > 1e-3 { up } else { normals[i][largest] };
        turn(&mut normals[i], side);
        push(&mut heap, normals, adjacency, &known, i);
        spread(&mut heap, normals, adjacency, &mut known);
    }
}

fn push(
    heap: &mut BinaryHeap<(u32, u32, u32)>,
    normals: &[[f64; 3]],
    adjacency: &Adjacency,
    known: &[bool],
    i: usize,
) {
    let unknown = |j: u32| !known[j as usize] && normals[j as usize] != [0.0; 3];
    for &j in adjacency.of(i).iter().filter(|&&j| unknown(j)) {
        let parallel = dot(normals[i], normals[j as usize]).abs();
        heap.push(((parallel * STEPS) as u32, u32::MAX - j, u32::MAX - i as u32));
    }
}

fn spread(
    heap: &mut BinaryHeap<(u32, u32, u32)>,
    normals: &mut [[f64; 3]],
    adjacency: &Adjacency,
    known: &mut [bool],
) {
    while let Some((_, to, from)) = heap.pop() {
        let (to, from) = ((u32::MAX - to) as usize, (u32::MAX - from) as usize);
        if !known[to] {
            known[to] = true;
            let side = dot(normals[to], normals[from]);
            turn(&mut normals[to], side);
            push(heap, normals, adjacency, known, to);
        }
    }
}

fn turn(normal: &mut [f64; 3], side: f64) {
    if side < 0.0 {
        *normal = normal.map(|c| -c);
    }
}
