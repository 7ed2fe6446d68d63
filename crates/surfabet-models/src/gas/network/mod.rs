//! The network while it learns: Fritzke's ten steps.
//!
//! B. Fritzke: *A Growing Neural Gas Network Learns Topologies*, NIPS 1995. Neurons c have a reference vector w_c (here:
//! position) and an accumulated error E_c; edges have an age.
//!
//! | step | computes | where |
//! |---|---|---|
//! | 1 | neurons at two random signals | [`Network::new`] |
//! | 2 | a signal xi | `signals` |
//! | 3 | the winner s1 and the second s2: the nearest neurons to xi | [`Winners`] |
//! | 4 | ages of the edges of s1, plus one | [`Network::present`], `edges` |
//! | 5 | `E_s1 += |w_s1 - xi|^2` | [`Network::present`], `accumulated` |
//! | 6 | `w_s1 += epsilon_w (xi - w_s1)`, `w_n += epsilon_n (xi - w_n)` for its neighbours n | [`Network::present`] |
//! | 7 | an edge of age zero between s1 and s2 | [`Network::present`], `edges` |
//! | 8 | no edges older than a_max, no neurons without edges | [`Network::present`], `edges` |
//! | 9 | every lambda signals a neuron r between q, of the largest E, and f, its neighbour of the largest E: `w_r = (w_q + w_f) / 2`, `E_q *= alpha`, `E_f *= alpha`, `E_r = E_q` | [`Network::insert`] |
//! | 10 | `E_c *= 1 - beta` for all | [`Network::decay`], `accumulated` |
//!
//! `growth` repeats them until there is enough.

mod accumulated;
mod edges;
mod growth;
mod signals;

pub(super) use growth::{Grown, Stop, grow};
pub(super) use signals::Signals;

use super::winners::Winners;
use accumulated::AccumulatedErrors;
use edges::Edges;

/// A neuron: its position, and how often it has won (wraps); a quarter of a cache line.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(16))]
struct Unit {
    position: [f32; 3],
    wins: u32,
}

/// The parameters of the ten steps, rounded to the precision of positions.
#[derive(Debug, Clone, Copy)]
pub struct Rates {
    /// Share of the way to a signal that the winner moves.
    pub epsilon_w: f32,
    /// Share of the way to a signal that its neighbours move.
    pub epsilon_n: f32,
    /// Factor of errors next to a new neuron.
    pub alpha: f64,
    /// Share of errors forgotten with each signal.
    pub beta: f64,
    /// Age above which edges go.
    pub max_age: u32,
}

/// Neurons, edges and accumulated errors.
#[derive(Debug, Clone)]
pub struct Network<W> {
    units: Vec<Unit>,
    winners: W,
    edges: Edges,
    errors: AccumulatedErrors,
    rates: Rates,
    /// Ids of removed neurons, to be used again.
    free: Vec<u32>,
    /// Ends of edges that have become too old.
    old: Vec<u32>,
    alive: usize,
}

/// Neurons and edges by the order of their ids, without gaps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Graph {
    /// Positions, metres.
    pub positions: Vec<[f32; 3]>,
    /// Pairs of neurons, the smaller first, sorted.
    pub edges: Vec<[u32; 2]>,
}

impl<W: Winners> Network<W> {
    /// Step 1: neurons, at first without edges or errors; at least two.
    pub fn new(winners: W, rates: Rates, positions: &[[f32; 3]]) -> Self {
        let mut network = Self {
            units: Vec::new(),
            winners,
            edges: Edges::default(),
            errors: AccumulatedErrors::new(rates.beta),
            rates,
            free: Vec::new(),
            old: Vec::new(),
            alive: 0,
        };
        for &position in positions {
            network.add(position, 0.0);
        }
        network
    }

    /// Joins neurons of a new network that were joined before.
    pub fn join(&mut self, edges: &[[u32; 2]]) {
        for &[a, b] in edges {
            self.edges.connect(a, b, self.wins_of_both(a, b));
        }
    }

    /// Number of neurons.
    pub fn len(&self) -> usize {
        self.alive
    }

    /// Never true: a network has two neurons at least.
    pub fn is_empty(&self) -> bool {
        self.alive == 0
    }

    /// Adds a neuron, with the id of one removed where there is any.
    fn add(&mut self, position: [f32; 3], error: f64) -> u32 {
        let id = self.free.pop().unwrap_or(self.units.len() as u32);
        if id as usize == self.units.len() {
            self.units.push(Unit::default());
        }
        self.units[id as usize].position = position;
        self.winners.insert(id, position);
        self.errors.set(id, error);
        self.alive += 1;
        id
    }

    /// Wins of two neurons together: the base of the age of the edge between them.
    fn wins_of_both(&self, a: u32, b: u32) -> u32 {
        self.units[a as usize].wins.wrapping_add(self.units[b as usize].wins)
    }

    /// Steps 3 to 8: adapts the network to a signal. Gives the squared distance of the winner before it moves.
    pub fn present(&mut self, signal: [f32; 3]) -> f32 {
        // 3: the winner and the second winner.
        let [first, second] = self.winners.two_nearest(signal);
        let distance = first.squared_distance();
        let (winner, second) = (first.id(), second.id());
        // 4: the ages of all edges of the winner grow with its wins.
        let unit = &mut self.units[winner as usize];
        unit.wins = unit.wins.wrapping_add(1);
        let wins = unit.wins;
        // 5: its error grows.
        self.errors.add(winner, f64::from(distance));
        // 6: it moves, and its neighbours do.
        unit.position = towards(unit.position, signal, self.rates.epsilon_w);
        self.winners.shift(winner, unit.position);
        self.old.clear();
        for link in self.edges.of(winner) {
            let unit = &mut self.units[link.to as usize];
            unit.position = towards(unit.position, signal, self.rates.epsilon_n);
            self.winners.shift(link.to, unit.position);
            let age = wins.wrapping_add(unit.wins).wrapping_sub(link.base);
            if age > self.rates.max_age && link.to != second {
                self.old.push(link.to);
            }
        }
        // 7: both winners are joined by an edge of age zero.
        self.edges.connect(winner, second, self.wins_of_both(winner, second));
        // 8: old edges are removed, and neurons without edges. The winner has the one just made.
        for i in 0..self.old.len() {
            let other = self.old[i];
            self.edges.disconnect(winner, other);
            if self.edges.of(other).is_empty() {
                self.winners.remove(other);
                self.errors.remove(other);
                self.free.push(other);
                self.alive -= 1;
            }
        }
        distance
    }

    /// Step 9: inserts a neuron r half way between the neuron q with the largest error and its neighbour f with the
    /// largest.
    pub fn insert(&mut self) {
        // There are two neurons at least, joined since the first signal.
        let Some(q) = self.errors.largest() else { return };
        let neighbours = self.edges.of(q).iter().map(|link| link.to);
        // The larger error, of equal ones the smaller id.
        let worse = |a: u32, b: u32| {
            self.errors.get(b).total_cmp(&self.errors.get(a)).then(a.cmp(&b)).is_lt()
        };
        let Some(f) = neighbours.reduce(|a, b| if worse(a, b) { a } else { b }) else { return };
        let (wq, wf) = (self.units[q as usize].position, self.units[f as usize].position);
        for id in [q, f] {
            self.errors.set(id, self.rates.alpha * self.errors.get(id));
        }
        let r = self.add(std::array::from_fn(|a| 0.5 * (wq[a] + wf[a])), self.errors.get(q));
        self.edges.disconnect(q, f);
        self.edges.connect(q, r, self.wins_of_both(q, r));
        self.edges.connect(f, r, self.wins_of_both(f, r));
    }

    /// Step 10: all errors decay.
    #[inline]
    pub fn decay(&mut self) {
        self.errors.decay();
    }

    /// The neurons that have edges: all of them once a signal was presented.
    pub fn graph(&self) -> Graph {
        let mut place = vec![u32::MAX; self.units.len()];
        let mut graph = Graph::default();
        for (id, unit) in self.units.iter().enumerate() {
            if !self.edges.of(id as u32).is_empty() {
                place[id] = graph.positions.len() as u32;
                graph.positions.push(unit.position);
            }
        }
        for id in 0..self.units.len() {
            for link in self.edges.of(id as u32).iter().filter(|link| link.to as usize > id) {
                graph.edges.push([place[id], place[link.to as usize]]);
            }
        }
        graph.edges.sort_unstable();
        graph
    }
}

/// `from + share (to - from)`.
#[inline(always)]
fn towards(from: [f32; 3], to: [f32; 3], share: f32) -> [f32; 3] {
    std::array::from_fn(|a| from[a] + share * (to[a] - from[a]))
}

#[cfg(test)]
mod tests {
    use super::super::winners::{BruteForce, Index};
    use super::*;

    const RATES: Rates =
        Rates { epsilon_w: 0.5, epsilon_n: 0.25, alpha: 0.5, beta: 0.5, max_age: 1 };

    #[test]
    fn the_ten_steps_by_hand() {
        let mut net = Network::new(BruteForce::default(), RATES, &[[0.0; 3], [4.0, 0.0, 0.0]]);
        // Nearest to 0; 1 is no neighbour yet and stays.
        assert_eq!(net.present([1.0, 0.0, 0.0]), 1.0);
        assert_eq!(net.units[0].position, [0.5, 0.0, 0.0]);
        assert_eq!(net.units[1].position, [4.0, 0.0, 0.0]);
        assert_eq!(net.graph().edges, [[0, 1]]);
        assert_eq!(net.errors.get(0), 1.0);
        net.decay();
        assert_eq!(net.errors.get(0), 0.5);
        // Now the neighbour moves by a quarter of its way: 4 -> 3; 0 -> 1.
        assert_eq!(net.present([1.5, 0.0, 0.0]), 1.0);
        assert_eq!(net.units[0].position, [1.0, 0.0, 0.0]);
        assert_eq!(net.units[1].position, [3.375, 0.0, 0.0]);
        // Errors 1.5 and 0. The new neuron is half way, with the halved error of the worst.
        net.insert();
        assert_eq!(net.units[2].position, [2.1875, 0.0, 0.0]);
        assert_eq!(net.graph().edges, [[0, 2], [1, 2]]);
        for id in [0, 2] {
            assert_eq!(net.errors.get(id), 0.75);
        }
        assert_eq!(net.errors.get(1), 0.0);
        assert_eq!(net.len(), 3);
    }

    #[test]
    fn old_edges_go_and_so_do_neurons_without_any() {
        let rates = Rates { epsilon_w: 0.01, epsilon_n: 0.0, ..RATES };
        let at = |x: f32| [x, 0.0, 0.0];
        let mut net = Network::new(Index::new(), rates, &[at(0.0), at(1.0), at(3.0)]);
        // 1 and 2 get an edge; then 1 wins with 0 as the second, so that the edge to 2 ages.
        net.present(at(1.9));
        assert_eq!(net.graph().edges, [[0, 1]]);
        assert_eq!(net.len(), 3);
        net.present(at(0.9));
        assert_eq!(net.len(), 3, "age 1 is not above the largest");
        net.present(at(0.9));
        assert_eq!(net.len(), 2, "age 2 is, and neuron 2 had no other edge");
        assert_eq!(net.graph().positions.len(), 2);
    }
}
