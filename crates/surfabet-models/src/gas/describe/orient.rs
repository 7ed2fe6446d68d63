//! Signs of normals: towards the sensor where that is known, elsewhere the same side along the topology.

use std::collections::BinaryHeap;

use crate::gas::adjacency::Adjacency;
use crate::gas::constants::{COSINE_STEPS, LEAST_UP};
use crate::vector::dot;

/// Edges from neurons with a sign to neurons without, as a heap: the cosine between both normals in steps, then, of equal
/// ones the smallest first, the neuron without and the neuron with a sign, each subtracted from the largest integer.
type Front = BinaryHeap<(u32, u32, u32)>;

/// Gives every normal a sign. Where `facing` has a side, it is that side; from there signs spread along edges, between
/// the most parallel normals first (H. Hoppe et al.: *Surface Reconstruction from Unorganized Points*, SIGGRAPH 1992). A
/// component where no side is known gets one from its highest neuron, whose normal points up.
pub(super) fn orient(
    normals: &mut [[f64; 3]],
    positions: &[[f32; 3]],
    adjacency: &Adjacency,
    facing: &[[f64; 3]],
) {
    let mut known = vec![false; normals.len()];
    let mut front = Front::new();
    for i in 0..normals.len() {
        let side = dot(normals[i], facing[i]);
        if side != 0.0 {
            known[i] = true;
            turn(&mut normals[i], side);
        }
    }
    for i in (0..normals.len()).filter(|&i| known[i]) {
        push(&mut front, normals, adjacency, &known, i);
    }
    spread(&mut front, normals, adjacency, &mut known);
    let mut highest: Vec<usize> = (0..normals.len()).filter(|&i| !known[i]).collect();
    highest.sort_by(|&a, &b| positions[b][2].total_cmp(&positions[a][2]).then(a.cmp(&b)));
    for i in highest {
        if known[i] || normals[i] == [0.0; 3] {
            continue;
        }
        known[i] = true;
        let up = normals[i][2];
        // The normal of a vertical wall points along the larger of its other components.
        let largest = if normals[i][0].abs() >= normals[i][1].abs() { 0 } else { 1 };
        let side = if up.abs() > LEAST_UP { up } else { normals[i][largest] };
        turn(&mut normals[i], side);
        push(&mut front, normals, adjacency, &known, i);
        spread(&mut front, normals, adjacency, &mut known);
    }
}

/// Adds the edges from neuron `i` to neighbours with a normal but without a sign.
fn push(front: &mut Front, normals: &[[f64; 3]], adjacency: &Adjacency, known: &[bool], i: usize) {
    let unknown = |j: u32| !known[j as usize] && normals[j as usize] != [0.0; 3];
    for &j in adjacency.of(i).iter().filter(|&&j| unknown(j)) {
        let cosine = dot(normals[i], normals[j as usize]).abs();
        front.push(((cosine * COSINE_STEPS) as u32, u32::MAX - j, u32::MAX - i as u32));
    }
}

/// Gives signs along the edges of the front until none is left.
fn spread(front: &mut Front, normals: &mut [[f64; 3]], adjacency: &Adjacency, known: &mut [bool]) {
    while let Some((_, to, from)) = front.pop() {
        let (to, from) = ((u32::MAX - to) as usize, (u32::MAX - from) as usize);
        if !known[to] {
            known[to] = true;
            let side = dot(normals[to], normals[from]);
            turn(&mut normals[to], side);
            push(front, normals, adjacency, known, to);
        }
    }
}

/// Turns a normal to the other side where `side` is negative.
fn turn(normal: &mut [f64; 3], side: f64) {
    if side < 0.0 {
        *normal = normal.map(|c| -c);
    }
}
