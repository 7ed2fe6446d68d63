//! New neighbours of a neuron, and their positions: predicted along the edge that led to it, and across the surface from
//! its normal.

use surfabet_entropy::{Coder, SInt, UInt};
use surfabet_geom::octahedral;

use super::{Coded, NO_NEURON, Streams, bounded, check_edges};
use crate::gas::model::{GasHeader, NORMAL_BITS};

/// Classes of length, a power of two each: edges are at most `2 sqrt(3) 2^23` steps long.
const LENGTHS: usize = 26;

/// The adaptive models of new neighbours.
pub(super) struct ChildModels {
    /// Number of new neighbours, by the number of known ones.
    n_children: [UInt; 8],
    /// Differences of coordinates by class of length: along the surface, across it without a normal and with one.
    offset: Vec<SInt>,
}

impl ChildModels {
    pub fn new() -> Self {
        Self { n_children: [const { UInt::new() }; 8], offset: vec![SInt::new(); 3 * LENGTHS] }
    }
}

/// Where new neighbours of a neuron are expected.
struct Prediction {
    /// Position of the neuron.
    at: [i64; 3],
    /// Half of the edge that led here, beyond it: the network grows from a root outwards.
    ahead: [i64; 3],
    /// Class of length of that edge.
    length: usize,
    /// In integers; z where the neuron has no normal.
    normal: [i64; 3],
    has_normal: bool,
    /// The axis that the normal is nearest to: it comes last, and follows from the other two.
    across: usize,
}

impl Prediction {
    fn new(coded: &Coded<'_>, v: usize) -> Self {
        let position = |i: usize| coded.neurons[i].position.map(i64::from);
        let at = position(v);
        let parent = coded.parents[v];
        let from = if parent == NO_NEURON { at } else { position(parent as usize) };
        let squared: i64 = (0..3).map(|a| (at[a] - from[a]).pow(2)).sum();
        let code = coded.neurons[v].normal;
        let normal = code.map_or([0, 0, 1], |code| {
            octahedral::integer_direction(code.map(i32::from), NORMAL_BITS).map(i64::from)
        });
        let length = (i64::BITS - squared.leading_zeros()).div_ceil(2) as usize;
        Self {
            at,
            ahead: std::array::from_fn(|a| at[a] + (at[a] - from[a]).div_euclid(2)),
            length: length.min(LENGTHS - 1),
            normal,
            has_normal: code.is_some(),
            across: (1..3).fold(0, |m, a| if normal[a].abs() > normal[m].abs() { a } else { m }),
        }
    }

    /// The other two axes.
    fn along(&self) -> [usize; 2] {
        [(self.across + 1) % 3, (self.across + 2) % 3]
    }

    /// The coordinate across the surface: that of the plane `n (p - at) = 0` for the coordinates along it.
    fn coordinate_across(&self, position: [i64; 3]) -> i64 {
        if !self.has_normal {
            return self.ahead[self.across];
        }
        let rise: i64 = self
            .along()
            .iter()
            .map(|&a| self.normal[a].saturating_mul(position[a] - self.at[a]))
            .fold(0, i64::saturating_add);
        self.at[self.across].saturating_sub(rise / self.normal[self.across])
    }
}

/// Codes the neighbours of `v` that are not known yet, which become known.
pub(super) fn code_children<C: Coder>(
    streams: &mut Streams<'_, C>,
    models: &mut ChildModels,
    coded: &mut Coded<'_>,
    header: &GasHeader,
    v: usize,
) -> Result<(), C::Error> {
    let next = coded.neurons.len();
    let wanted = coded.given.map_or(0, |(_, adjacency)| {
        adjacency.of(v).iter().filter(|&&u| u as usize >= next).count()
    });
    let context = coded.known[v].len().min(7);
    let n = streams.topology.uint(&mut models.n_children[context], wanted as u32)?;
    if u64::from(n) > header.n_neurons - next as u64 {
        return Err(streams.topology.corrupt(format!("more than {} neurons", header.n_neurons)));
    }
    if coded.known[v].is_empty() && n == 0 {
        return Err(streams.topology.corrupt(format!("neuron {v} has no edge")));
    }
    let prediction = Prediction::new(coded, v);
    for i in 0..n as usize {
        let wanted = coded.wanted(next + i).position;
        let position = code_position(streams.positions, models, &prediction, wanted)?;
        coded.add(position, v as u32);
        coded.join(v, next + i);
    }
    check_edges(streams.topology, coded, header)
}

/// A position: first the two coordinates along the surface, then the one across it.
fn code_position<C: Coder>(
    coder: &mut C,
    models: &mut ChildModels,
    prediction: &Prediction,
    wanted: [i32; 3],
) -> Result<[i32; 3], C::Error> {
    let Prediction { ahead, length, has_normal, across, .. } = *prediction;
    let mut position = [0_i64; 3];
    for axis in prediction.along() {
        let difference = i64::from(wanted[axis]) - ahead[axis];
        let model = &mut models.offset[length];
        position[axis] = ahead[axis] + i64::from(coder.sint(model, difference as i32)?);
    }
    let predicted = prediction.coordinate_across(position);
    let difference = i64::from(wanted[across]).wrapping_sub(predicted);
    // When reading, nothing is wanted and the difference may be anything.
    let difference = i32::try_from(difference).unwrap_or_default();
    let model = &mut models.offset[(1 + usize::from(has_normal)) * LENGTHS + length];
    let difference = coder.sint(model, difference)?;
    position[across] = predicted.saturating_add(i64::from(difference));
    let mut rounded = [0; 3];
    for (to, value) in rounded.iter_mut().zip(position) {
        *to = bounded(coder, value)?;
    }
    Ok(rounded)
}
