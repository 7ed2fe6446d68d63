//! Edges between neurons that are known: a decision for each of the nearest that have a neighbour in common, then a list
//! of the others.

use surfabet_entropy::{Bit, Coder, UInt};

use super::{Coded, MAX_CANDIDATES, check_edges};
use crate::gas::model::GasHeader;
use crate::vector;

/// Neighbours of neighbours that are visited, at most: keeps damaged files from taking long.
const MAX_VISITS: usize = 512;

/// The adaptive models of edges between known neurons.
pub(super) struct EdgeModels {
    /// By the rank of the candidate, common neighbours, edges coded before it, and class of length.
    joined: Vec<Bit>,
    /// Number of edges to other neurons than candidates.
    n_others: UInt,
    /// Distance in the order to the next such neuron, less one.
    other: UInt,
}

impl EdgeModels {
    pub fn new() -> Self {
        Self {
            joined: vec![Bit::with_memory(Bit::MAX_MEMORY); 8 * 3 * 4 * 4],
            n_others: UInt::new(),
            other: UInt::new(),
        }
    }
}

/// A neuron that v may be joined to. Orders by distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct EdgeCandidate {
    /// Squared distance in position steps.
    squared: i64,
    id: u32,
    /// Number of common neighbours.
    common: usize,
}

/// Codes the edges from `v` to neurons that come after it and are known.
pub(super) fn code_edges<C: Coder>(
    coder: &mut C,
    models: &mut EdgeModels,
    coded: &mut Coded<'_>,
    header: &GasHeader,
    v: usize,
) -> Result<(), C::Error> {
    coded.mark(v);
    code_candidates(coder, models, coded, v)?;
    code_others(coder, models, coded, v)?;
    check_edges(coder, coded, header)
}

/// Squared distance of two neurons, in squared position steps.
fn squared_distance(a: [i32; 3], b: [i32; 3]) -> i64 {
    vector::squared_distance(a.map(i64::from), b.map(i64::from))
}

/// Neurons that v may be joined to: known, after it in the order, with a neighbour in common; the nearest first.
fn candidates(coded: &Coded<'_>, v: usize) -> Vec<EdgeCandidate> {
    let of_neighbors = coded.known[v].iter().flat_map(|&w| &coded.known[w as usize]);
    let mut found: Vec<u32> = of_neighbors
        .copied()
        .take(MAX_VISITS)
        .filter(|&u| u as usize > v && !coded.knows(v, u))
        .collect();
    found.sort_unstable();
    let position = |i: usize| coded.neurons[i].position;
    let mut found: Vec<EdgeCandidate> = found
        .chunk_by(|a, b| a == b)
        .map(|run| EdgeCandidate {
            squared: squared_distance(position(v), position(run[0] as usize)),
            id: run[0],
            common: run.len(),
        })
        .collect();
    found.sort_unstable();
    found.truncate(MAX_CANDIDATES);
    found
}

/// Codes for each candidate whether it is joined to `v`.
fn code_candidates<C: Coder>(
    coder: &mut C,
    models: &mut EdgeModels,
    coded: &mut Coded<'_>,
    v: usize,
) -> Result<(), C::Error> {
    let candidates = candidates(coded, v);
    let n_before = coded.known[v].len().min(MAX_CANDIDATES) as i64;
    let position = coded.neurons[v].position;
    let of = |&i: &u32| squared_distance(position, coded.neurons[i as usize].position);
    let sum = coded.known[v].iter().take(MAX_CANDIDATES).map(of).sum::<i64>();
    let mut n_joined = 0;
    for (rank, &EdgeCandidate { squared, id, common }) in candidates.iter().enumerate() {
        // The squared length against the mean of the known edges', below 1/2, 1 or 2 of it, compared without dividing.
        let length = match squared.saturating_mul(n_before) {
            l if 2 * l < sum => 0,
            l if l < sum => 1,
            l if l < 2 * sum => 2,
            _ => 3,
        };
        let context = ((rank.min(7) * 3 + common.min(3) - 1) * 4 + n_joined) * 4 + length;
        let wanted = coded.given.is_some_and(|(_, adjacency)| adjacency.joined(v, id as usize));
        if coder.bit(&mut models.joined[context], wanted)? {
            coded.join(v, id as usize);
            n_joined = (n_joined + 1).min(3);
        }
    }
    Ok(())
}

/// Codes the known neurons joined to `v` that are no candidates, by their distance in the order.
fn code_others<C: Coder>(
    coder: &mut C,
    models: &mut EdgeModels,
    coded: &mut Coded<'_>,
    v: usize,
) -> Result<(), C::Error> {
    let found = coded.neurons.len();
    let others: Vec<u32> = coded.given.map_or_else(Vec::new, |(_, adjacency)| {
        let of = adjacency.of(v).iter().copied();
        of.filter(|&u| (u as usize) > v && (u as usize) < found && !coded.knows(v, u)).collect()
    });
    let n_others = coder.uint(&mut models.n_others, others.len() as u32)? as usize;
    let mut last = v;
    for i in 0..n_others {
        let wanted = others.get(i).map_or(0, |&u| u as usize - last - 1);
        let u = last as u64 + 1 + u64::from(coder.uint(&mut models.other, wanted as u32)?);
        let u = usize::try_from(u).unwrap_or(usize::MAX);
        if u >= found || coded.knows(v, u as u32) {
            return Err(coder.corrupt(format!("an edge from {v} to {u}, which cannot be")));
        }
        coded.join(v, u);
        last = u;
    }
    Ok(())
}
