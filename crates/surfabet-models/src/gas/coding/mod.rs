//! How neurons and edges are said in binary decisions: one function for writing, reading and pricing.
//!
//! Neurons come breadth first along the topology. The turn of neuron v says, in this order: its position, if no
//! edge led to it; its normal, sizes and colour, predicted from its neighbours before it; which of the neurons
//! found but not yet visited it is joined to; how many new ones, and where they are. Positions are predicted along
//! the edge that led to v, and across the surface from the normal of v.

pub(crate) mod order;

use surfabet_entropy::{Bit, Coder, SInt, UInt};
use surfabet_geom::octahedral;

use crate::color::MAX_COLOR_CODE;
use crate::gas::adjacency::Adjacency;
use crate::gas::model::{GasHeader, MAX_COORDINATE, NORMAL_BITS, Neuron};

/// Neighbours of neighbours that are asked about, at most: keeps damaged files from taking long.
const MAX_CANDIDATES: usize = 32;

/// Neighbours of neighbours that are looked at, at most.
const MAX_LOOKS: usize = 512;

/// Classes of length, a power of two each.
const LENGTHS: usize = 26;

/// No neuron.
const NOBODY: u32 = u32::MAX;

/// The streams of a gas.
#[derive(Debug)]
pub(crate) struct Streams<'a, C> {
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
}

/// Neurons and edges of a model.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Parts {
    pub neurons: Vec<Neuron>,
    pub edges: Vec<[u32; 2]>,
}

/// Every adaptive model.
struct Models {
    root: SInt,
    has_normal: [Bit; 3],
    normal: [SInt; 2],
    sizes: [SInt; 6],
    luma: [SInt; 2],
    chroma: [SInt; 6],
    joined: Vec<Bit>,
    n_others: UInt,
    other: UInt,
    n_children: [UInt; 8],
    offset: Vec<SInt>,
}

impl Models {
    fn new() -> Self {
        Self {
            root: SInt::new(),
            has_normal: [Bit::new(); 3],
            normal: [const { SInt::new() }; 2],
            sizes: [const { SInt::new() }; 6],
            luma: [const { SInt::new() }; 2],
            chroma: [const { SInt::new() }; 6],
            joined: vec![Bit::with_memory(Bit::MAX_MEMORY); 8 * 3 * 4 * 4],
            n_others: UInt::new(),
            other: UInt::new(),
            n_children: [const { UInt::new() }; 8],
            offset: vec![SInt::new(); 4 * LENGTHS],
        }
    }
}

/// Neurons and edges as far as they are known.
struct State<'a> {
    given: Option<(&'a [Neuron], &'a Adjacency)>,
    neurons: Vec<Neuron>,
    /// Who led to each neuron.
    parents: Vec<u32>,
    /// Neighbours of each neuron, as far as they are known.
    known: Vec<Vec<u32>>,
    /// For each neuron, the last one whose turn found it among its neighbours.
    marks: Vec<u32>,
    edges: Vec<[u32; 2]>,
}

impl State<'_> {
    fn add(&mut self, position: [i32; 3], parent: u32) {
        self.neurons.push(Neuron { position, ..Neuron::default() });
        self.parents.push(parent);
        self.known.push(Vec::new());
        self.marks.push(NOBODY);
    }

    /// Notes the neighbours of `v`, for [`State::knows`].
    fn mark(&mut self, v: usize) {
        for &u in &self.known[v] {
            self.marks[u as usize] = v as u32;
        }
    }

    /// True when `v`, the neuron marked last, is known to be joined to `u`.
    fn knows(&self, v: usize, u: u32) -> bool {
        self.marks[u as usize] == v as u32
    }

    fn join(&mut self, a: usize, b: usize) {
        self.known[a].push(b as u32);
        self.known[b].push(a as u32);
        self.marks[b] = a as u32;
        self.edges.push([a as u32, b as u32]);
    }

    /// The neuron as it is to be written.
    fn wanted(&self, i: usize) -> Neuron {
        self.given.map_or_else(Neuron::default, |(neurons, _)| neurons[i])
    }
}

/// Writes, reads or prices a gas. `given` is what to write; in any case all of it comes back.
///
/// # Errors
/// Whatever the coders find wrong with what they read.
pub(crate) fn code_gas<C: Coder>(
    streams: &mut Streams<'_, C>,
    header: &GasHeader,
    given: Option<(&[Neuron], &Adjacency)>,
) -> Result<Parts, C::Error> {
    let n = header.n_neurons as usize;
    let mut models = Models::new();
    let mut state = State {
        given,
        neurons: Vec::new(),
        parents: Vec::new(),
        known: Vec::new(),
        marks: Vec::new(),
        edges: Vec::new(),
    };
    let mut root = [0; 3];
    for v in 0..n {
        if v == state.neurons.len() {
            let wanted = state.wanted(v).position;
            for (last, to) in root.iter_mut().zip(wanted) {
                let step = streams.positions.sint(&mut models.root, to.wrapping_sub(*last))?;
                *last = bounded(streams.positions, i64::from(*last) + i64::from(step))?;
            }
            state.add(root, NOBODY);
        }
        code_attributes(streams, &mut models, &mut state, header, v)?;
        code_edges(streams.topology, &mut models, &mut state, header, v)?;
        code_children(streams, &mut models, &mut state, header, v)?;
    }
    if state.edges.len() as u64 != header.n_edges {
        let found = state.edges.len();
        return Err(streams
            .topology
            .corrupt(format!("{found} edges instead of {}", header.n_edges)));
    }
    Ok(Parts { neurons: state.neurons, edges: state.edges })
}

fn bounded<C: Coder>(coder: &C, value: i64) -> Result<i32, C::Error> {
    match i32::try_from(value) {
        Ok(value) if value.abs() <= MAX_COORDINATE => Ok(value),
        _ => Err(coder.corrupt(format!("coordinate {value} beyond 2^23 steps"))),
    }
}

/// Mean rounded to the nearest, of `count` values above zero.
fn mean(sum: i32, count: i32) -> i32 {
    (2 * sum + count).div_euclid(2 * count)
}

fn code_attributes<C: Coder>(
    streams: &mut Streams<'_, C>,
    models: &mut Models,
    state: &mut State<'_>,
    header: &GasHeader,
    v: usize,
) -> Result<(), C::Error> {
    let before: Vec<Neuron> =
        state.known[v].iter().map(|&i| state.neurons[i as usize]).take(MAX_CANDIDATES).collect();
    let n = before.len() as i32;
    let average = |of: &dyn Fn(&Neuron) -> i32| {
        if n == 0 { 0 } else { mean(before.iter().map(of).sum(), n) }
    };
    let wanted = state.wanted(v);
    let mut neuron = Neuron { position: state.neurons[v].position, ..Neuron::default() };

    let with: Vec<[i8; 2]> = before.iter().filter_map(|b| b.normal).collect();
    let context = if n == 0 { 0 } else { 1 + usize::from(!with.is_empty()) };
    let has = &mut models.has_normal[context];
    if streams.normals.bit(has, wanted.normal.is_some())? {
        let code = wanted.normal.unwrap_or_default();
        let mut said = [0; 2];
        for (axis, part) in said.iter_mut().enumerate() {
            let count = with.len() as i32;
            let sum = with.iter().map(|c| i32::from(c[axis])).sum();
            let predicted = if count == 0 { 0 } else { mean(sum, count) };
            let off = i32::from(code[axis]) - predicted;
            let off = streams.normals.sint(&mut models.normal[axis], off)?;
            let half = octahedral::half(NORMAL_BITS);
            let value = i64::from(predicted) + i64::from(off);
            if value.abs() > i64::from(half) {
                return Err(streams.normals.corrupt(format!("a normal of code {value}")));
            }
            *part = value as i8;
        }
        neuron.normal = Some(said);
    }

    let sizes = [wanted.count, wanted.radius, wanted.thickness];
    let predicted = [
        average(&|b| i32::from(b.count)),
        average(&|b| i32::from(b.radius)),
        average(&|b| i32::from(b.thickness)),
    ];
    let mut said = [0; 3];
    for (i, part) in said.iter_mut().enumerate() {
        let model = &mut models.sizes[2 * i + usize::from(n > 0)];
        let off = streams.sizes.sint(model, i32::from(sizes[i]) - predicted[i])?;
        let value = i64::from(predicted[i]) + i64::from(off);
        *part = u8::try_from(value)
            .map_err(|_| streams.sizes.corrupt(format!("a size of code {value}")))?;
    }
    [neuron.count, neuron.radius, neuron.thickness] = said;

    if header.color_step.is_some() {
        let mut active = 0;
        for channel in 0..3 {
            let predicted = average(&|b| i32::from(b.color[channel]));
            let first = usize::from(n > 0);
            let model = match channel {
                0 => &mut models.luma[first],
                _ => &mut models.chroma[3 * (channel - 1) + if n > 0 { 1 + active } else { 0 }],
            };
            let off = streams.colors.sint(model, i32::from(wanted.color[channel]) - predicted)?;
            let value = i64::from(predicted) + i64::from(off);
            if value.abs() > i64::from(MAX_COLOR_CODE) {
                return Err(streams.colors.corrupt(format!("a colour of code {value}")));
            }
            neuron.color[channel] = value as i16;
            active = usize::from(off.unsigned_abs() > 1);
        }
    }
    state.neurons[v] = neuron;
    Ok(())
}

fn squared_distance(a: [i32; 3], b: [i32; 3]) -> i64 {
    (0..3).map(|i| (i64::from(a[i]) - i64::from(b[i])).pow(2)).sum()
}

/// Neurons that v may be joined to: found, not yet visited, with a neighbour in common; the nearest first, each
/// with the number of common neighbours.
fn candidates(state: &State<'_>, v: usize) -> Vec<(i64, u32, usize)> {
    let mut found: Vec<u32> = Vec::new();
    let mut looks = 0;
    'looking: for &w in &state.known[v] {
        for &u in &state.known[w as usize] {
            looks += 1;
            if looks > MAX_LOOKS {
                break 'looking;
            }
            if u as usize > v && !state.knows(v, u) {
                found.push(u);
            }
        }
    }
    found.sort_unstable();
    let at =
        |u: u32| squared_distance(state.neurons[v].position, state.neurons[u as usize].position);
    let mut found: Vec<(i64, u32, usize)> =
        found.chunk_by(|a, b| a == b).map(|run| (at(run[0]), run[0], run.len())).collect();
    found.sort_unstable();
    found.truncate(MAX_CANDIDATES);
    found
}

fn code_edges<C: Coder>(
    coder: &mut C,
    models: &mut Models,
    state: &mut State<'_>,
    header: &GasHeader,
    v: usize,
) -> Result<(), C::Error> {
    state.mark(v);
    let candidates = candidates(state, v);
    let n_before = state.known[v].len() as i64;
    let position = state.neurons[v].position;
    let of = |&i: &u32| squared_distance(position, state.neurons[i as usize].position);
    let scale = state.known[v].iter().take(MAX_CANDIDATES).map(of).sum::<i64>();
    let mut said = 0;
    for (rank, &(squared, u, common)) in candidates.iter().enumerate() {
        // The mean squared length of the known edges, compared without dividing.
        let length = match squared.saturating_mul(n_before.min(MAX_CANDIDATES as i64)) {
            l if 2 * l < scale => 0,
            l if l < scale => 1,
            l if l < 2 * scale => 2,
            _ => 3,
        };
        let context = ((rank.min(7) * 3 + common.min(3) - 1) * 4 + said) * 4 + length;
        let wanted = state.given.is_some_and(|(_, adjacency)| adjacency.joined(v, u as usize));
        if coder.bit(&mut models.joined[context], wanted)? {
            state.join(v, u as usize);
            said = (said + 1).min(3);
        }
    }
    // Those that no neighbour knows, by their distance in the order.
    let found = state.neurons.len();
    let others: Vec<u32> = state.given.map_or_else(Vec::new, |(_, adjacency)| {
        let of = adjacency.of(v).iter().copied();
        of.filter(|&u| (u as usize) > v && (u as usize) < found && !state.knows(v, u)).collect()
    });
    let n_others = coder.uint(&mut models.n_others, others.len() as u32)? as usize;
    let mut last = v;
    for i in 0..n_others {
        let wanted = others.get(i).map_or(0, |&u| u as usize - last - 1);
        let u = last as u64 + 1 + u64::from(coder.uint(&mut models.other, wanted as u32)?);
        let u = usize::try_from(u).unwrap_or(usize::MAX);
        if u >= found || state.knows(v, u as u32) {
            return Err(coder.corrupt(format!("an edge from {v} to {u}, which cannot be")));
        }
        state.join(v, u);
        last = u;
    }
    check_edges(coder, state, header)
}

fn check_edges<C: Coder>(coder: &C, state: &State<'_>, header: &GasHeader) -> Result<(), C::Error> {
    if state.edges.len() as u64 > header.n_edges {
        return Err(coder.corrupt(format!("more than {} edges", header.n_edges)));
    }
    Ok(())
}

fn code_children<C: Coder>(
    streams: &mut Streams<'_, C>,
    models: &mut Models,
    state: &mut State<'_>,
    header: &GasHeader,
    v: usize,
) -> Result<(), C::Error> {
    let next = state.neurons.len();
    let wanted = state.given.map_or(0, |(_, adjacency)| {
        adjacency.of(v).iter().filter(|&&u| u as usize >= next).count()
    });
    let context = state.known[v].len().min(7);
    let n = streams.topology.uint(&mut models.n_children[context], wanted as u32)?;
    if u64::from(n) > header.n_neurons - next as u64 {
        return Err(streams.topology.corrupt(format!("more than {} neurons", header.n_neurons)));
    }
    if state.known[v].is_empty() && n == 0 {
        return Err(streams.topology.corrupt(format!("neuron {v} has no edge")));
    }
    let at = state.neurons[v].position.map(i64::from);
    let parent = state.parents[v];
    let from =
        if parent == NOBODY { at } else { state.neurons[parent as usize].position.map(i64::from) };
    // Growing from a root outwards, half of the edge that led here goes on.
    let ahead: [i64; 3] = std::array::from_fn(|a| at[a] + (at[a] - from[a]).div_euclid(2));
    let squared: i64 = (0..3).map(|a| (at[a] - from[a]).pow(2)).sum();
    let length = (i64::BITS - squared.leading_zeros()).div_ceil(2) as usize;
    let normal = state.neurons[v].normal.map_or([0, 0, 1], |code| {
        octahedral::integer_direction(code.map(i32::from), NORMAL_BITS).map(i64::from)
    });
    // The axis that the surface faces most comes last, and follows from the others.
    let across = (1..3).fold(0, |m, a| if normal[a].abs() > normal[m].abs() { a } else { m });
    let along = [(across + 1) % 3, (across + 2) % 3];
    let known = usize::from(state.neurons[v].normal.is_some());
    for i in 0..n as usize {
        let wanted = state.wanted(next + i).position;
        let mut position = [0_i64; 3];
        for axis in along {
            let model = &mut models.offset[length.min(LENGTHS - 1)];
            let off = i64::from(wanted[axis]) - ahead[axis];
            position[axis] = ahead[axis] + i64::from(streams.positions.sint(model, off as i32)?);
        }
        // Without a normal the last axis is as free as the others.
        let predicted = if known == 1 {
            let rise: i64 = along
                .iter()
                .map(|&a| normal[a].saturating_mul(position[a] - at[a]))
                .fold(0, i64::saturating_add);
            at[across].saturating_sub(rise / normal[across])
        } else {
            ahead[across]
        };
        let class = (1 + known) * LENGTHS + length.min(LENGTHS - 1);
        let off = i64::from(wanted[across]).wrapping_sub(predicted);
        let off = i32::try_from(off).unwrap_or_default();
        let off = streams.positions.sint(&mut models.offset[class], off)?;
        position[across] = predicted.saturating_add(i64::from(off));
        let mut rounded = [0; 3];
        for (to, value) in rounded.iter_mut().zip(position) {
            *to = bounded(streams.positions, value)?;
        }
        state.add(rounded, v as u32);
        state.join(v, next + i);
    }
    check_edges(streams.topology, state, header)
}
