//! Neurons and edges as binary decisions: one function writes, reads and prices.
//!
//! Neurons come breadth first along the topology. For every neuron v these are coded, in this order: its position, if no
//! edge led to it; its normal, sizes, colour and intensity, predicted from its neighbours before it; which of the neurons that are
//! known but come after it are its neighbours; how many of its neighbours are new, and their positions. Those are
//! predicted along the edge that led to v, and across the surface from the normal of v.
//!
//! | file | codes |
//! |---|---|
//! | `order` | nothing: the order of neurons |
//! | `neuron` | normal, sizes, colour and intensity of a neuron |
//! | `edges` | edges between known neurons |
//! | `children` | new neighbours and their positions |

mod children;
mod edges;
mod neuron;
mod order;

pub(super) use order::traversal;

use surfabet_entropy::{Coder, SInt};

use super::adjacency::Adjacency;
use super::model::{GasHeader, MAX_COORDINATE, Neuron};
use children::{ChildModels, code_children};
use edges::{EdgeModels, code_edges};
use neuron::{NeuronModels, code_neuron};

/// Neighbours that predict a neuron, and neighbours of neighbours whose edges are coded one by one, at most: keeps
/// damaged files from taking long.
const MAX_CANDIDATES: usize = 32;

/// No neuron.
const NO_NEURON: u32 = u32::MAX;

/// The streams of a gas.
#[derive(Debug)]
pub(super) struct Streams<'a, C> {
    /// Which neurons are joined.
    pub topology: &'a mut C,
    /// Where they are.
    pub positions: &'a mut C,
    /// Normals.
    pub normals: &'a mut C,
    /// Numbers of points, radii and thicknesses.
    pub sizes: &'a mut C,
    /// Colours.
    pub colors: &'a mut C,
    /// Intensities.
    pub intensities: &'a mut C,
}

/// Neurons and edges of a model.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Parts {
    pub neurons: Vec<Neuron>,
    pub edges: Vec<[u32; 2]>,
}

/// Neurons and edges as far as they are coded.
struct Coded<'a> {
    /// What to write.
    given: Option<(&'a [Neuron], &'a Adjacency)>,
    neurons: Vec<Neuron>,
    /// The neuron whose edge led to each neuron.
    parents: Vec<u32>,
    /// Known neighbours of each neuron.
    known: Vec<Vec<u32>>,
    /// For each neuron, the last one for which [`Coded::mark`] found it among the neighbours.
    marks: Vec<u32>,
    edges: Vec<[u32; 2]>,
}

impl Coded<'_> {
    /// Adds a neuron at a position.
    fn add(&mut self, position: [i32; 3], parent: u32) {
        self.neurons.push(Neuron { position, ..Neuron::default() });
        self.parents.push(parent);
        self.known.push(Vec::new());
        self.marks.push(NO_NEURON);
    }

    /// Marks the neighbours of `v`, for [`Coded::knows`].
    fn mark(&mut self, v: usize) {
        for &u in &self.known[v] {
            self.marks[u as usize] = v as u32;
        }
    }

    /// True when `v`, the neuron marked last, is known to be joined to `u`.
    fn knows(&self, v: usize, u: u32) -> bool {
        self.marks[u as usize] == v as u32
    }

    /// Adds an edge.
    fn join(&mut self, a: usize, b: usize) {
        self.known[a].push(b as u32);
        self.known[b].push(a as u32);
        self.marks[b] = a as u32;
        self.edges.push([a as u32, b as u32]);
    }

    /// The neuron to write.
    fn wanted(&self, i: usize) -> Neuron {
        self.given.map_or_else(Neuron::default, |(neurons, _)| neurons[i])
    }
}

/// Writes, reads or prices a gas. `given` is what to write; in any case all of it is returned.
///
/// # Errors
/// Whatever the coders find wrong with what they read.
pub(super) fn code_gas<C: Coder>(
    streams: &mut Streams<'_, C>,
    header: &GasHeader,
    given: Option<(&[Neuron], &Adjacency)>,
) -> Result<Parts, C::Error> {
    let n = header.n_neurons as usize;
    let mut root_model = SInt::new();
    let (mut neurons, mut edges, mut children) =
        (NeuronModels::new(), EdgeModels::new(), ChildModels::new());
    let mut coded = Coded {
        given,
        neurons: Vec::new(),
        parents: Vec::new(),
        known: Vec::new(),
        marks: Vec::new(),
        edges: Vec::new(),
    };
    let mut root = [0; 3];
    for v in 0..n {
        if v == coded.neurons.len() {
            let wanted = coded.wanted(v).position;
            for (last, to) in root.iter_mut().zip(wanted) {
                let step = streams.positions.sint(&mut root_model, to.wrapping_sub(*last))?;
                *last = bounded(streams.positions, i64::from(*last) + i64::from(step))?;
            }
            coded.add(root, NO_NEURON);
        }
        code_neuron(streams, &mut neurons, &mut coded, header, v)?;
        code_edges(streams.topology, &mut edges, &mut coded, header, v)?;
        code_children(streams, &mut children, &mut coded, header, v)?;
    }
    if coded.edges.len() as u64 != header.n_edges {
        let found = coded.edges.len();
        return Err(streams
            .topology
            .corrupt(format!("{found} edges instead of {}", header.n_edges)));
    }
    Ok(Parts { neurons: coded.neurons, edges: coded.edges })
}

/// A coordinate that positions can have.
fn bounded<C: Coder>(coder: &C, value: i64) -> Result<i32, C::Error> {
    match i32::try_from(value) {
        Ok(value) if value.abs() <= MAX_COORDINATE => Ok(value),
        _ => Err(coder.corrupt(format!("coordinate {value} beyond 2^23 steps"))),
    }
}

/// Refuses more edges than the header has.
fn check_edges<C: Coder>(coder: &C, coded: &Coded<'_>, header: &GasHeader) -> Result<(), C::Error> {
    if coded.edges.len() as u64 > header.n_edges {
        return Err(coder.corrupt(format!("more than {} edges", header.n_edges)));
    }
    Ok(())
}
