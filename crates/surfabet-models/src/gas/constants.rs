//! Tuned constants of the method. What a user may set is in [`GasOptions`](super::GasOptions); what the file format fixes
//! is beside the code that writes it. What half and double of a value change is in `docs/benchmarks/constants.md`.

/// Position steps per mean edge e, by default: rounding adds `3 (e / 16)^2 / 12`, a thousandth of e^2, to the squared
/// error.
pub(super) const STEPS_PER_EDGE: f64 = 16.0;

/// Multiple of the planned signals after which a network that does not reach its size is taken as it is: its neurons are
/// removed as fast as they are inserted. Networks that reach their size within the plan do not depend on it: half and
/// double gave the same files.
pub(super) const PATIENCE: u64 = 2;

/// Side of the cells that hold points, one neuron for each, in tolerances: for small, balanced and fine models. With 2 from
/// 99.7 to 100 percent of the real scans of `docs/benchmarks/defaults.md` are within the tolerance. 1 makes
/// 1.6 to 2.1 times as many neurons of two laser scans; 4 makes 0.4 to 0.5 times as many of three scans, with 97.3 to 98.6 percent within
/// (`docs/benchmarks/constants.md`).
pub(super) const CELL_TOLERANCES: [f64; 3] = [3.0, 2.0, 1.2];

/// Neurons that are chosen where none are given, at most: what takes longer is for the user to ask for. Of a depth frame
/// 50,000 take 3 CPU seconds and hold 99.98 percent within the tolerance, 100,000 take 8, and 200,000 take 19.
pub(super) const MOST_CHOSEN: usize = 100_000;

/// Spacing of the points of discs by default, in mean edges.
pub(super) const POINTS_PER_EDGE: f64 = 1.0 / 3.0;

/// Signals between two checks whether the caller wants to stop, some milliseconds.
pub(super) const SIGNALS_PER_BATCH: usize = 4096;

/// Signals per neuron over which the mean distance is compared with `target_error`: so few that the network has hardly
/// grown meanwhile, yet so many that most neurons have won.
pub(super) const SIGNALS_PER_NEURON_OF_MEAN: u64 = 2;

/// Points of the trace of mean distances in the report: enough for a curve.
pub(super) const TRACE_LENGTH: u64 = 64;

/// Neurons per leaf of a tree built anew: the rest of the eight is room to grow. Results do not depend on it. 20,000
/// neurons took 3.5 s with 6, 3.8 s with 4, 4.3 s with 3 and with 8 (medians of three runs on a busy machine).
pub(super) const FILL: usize = 6;

/// Most points that represent the old scans in an update. It bounds memory and time: with 30,000 in place of 120,000 an
/// updated room had 3 percent more neurons, with 10,000 13 percent, since gaps between the points count as new space.
pub(super) const MOST_RECALLED: f64 = 2e6;

/// Signals per neuron of an update beyond those of the inserted neurons, so that old neurons move to where the new scan
/// is. Half and double changed the mean error of an updated room by 0.3 percent.
pub(super) const SETTLING: u64 = 30;

/// Points per neuron that the rounds of the polish use, but for the last ones: every so many along a curve through all
/// points, so that each neuron has about its share. Half and double change mean errors by at most 0.3 percent.
pub(super) const POLISH_SAMPLE: usize = 32;

/// Rounds at the end of the polish that use all points: the second moves neurons little more. One and four change mean errors by
/// at most 0.2 percent.
pub(super) const ROUNDS_OF_ALL: u32 = 2;

/// Neurons per unit of parallel work, some milliseconds; results do not depend on it.
pub(super) const NEURONS_PER_TASK: usize = 256;

/// Neurons that are decoded between two checks of the caller's wish to stop.
pub(super) const DISCS_PER_CHECK: usize = 64;

/// Radius of a decoded disc in radii of a round disc of the same spread: a neuron's points fill the cell of those nearest
/// to it. The corners of a hexagon are `sqrt(6 / 5)` = 1.10 such radii from its middle, those of a square
/// `sqrt(3 / 2)` = 1.22; this is between. 1.0 leaves points 5 to 10 percent farther from the discs and the discs 3 to 6
/// percent nearer to the points; 1.3 gains 2 percent of the one and loses 4 to 10 of the other.
pub(super) const DISC_REACH: f64 = 1.15;

/// Least cosine between the normals of two neurons for their planes to blend: surfaces that turn by more than 45 degrees
/// are on two sides of an edge. 0.35 and 0.9 change the errors by at most 0.4 percent.
pub(super) const LEAST_BLEND_COSINE: f64 = 0.7;

/// Weights of blended planes and colours fall as `exp(-BLEND_WIDTH d^2 / r^2)` at distance d from a neuron of radius r:
/// to 14 percent at the rim. Half and double change the errors by at most 0.4 percent, that of colour by at most 1.7.
pub(super) const BLEND_WIDTH: f64 = 2.0;

/// Least cosine between a triangle and the mean normal of its corners: steeper triangles lie across the surface. With
/// 0.15 and 0.6 the mesh has as many triangles to 0.8 percent.
pub(super) const LEAST_TRIANGLE_COSINE: f64 = 0.3;

/// Most edges of a hole of the mesh that is closed. Half leaves 8 to 13 percent more open edges, double 10 percent
/// less, with 4 to 6 percent more triangles.
pub(super) const LARGEST_HOLE: usize = 12;

/// Steps of the cosine between two normals when edges are ordered by it, so that they order as integers.
pub(super) const COSINE_STEPS: f64 = 1e6;

/// Least vertical component of a normal that points up or down; a normal below it is horizontal but for rounding.
pub(super) const LEAST_UP: f64 = 1e-3;

/// Memory of errors by default, in signals per neuron: the published decay of 0.005 is for networks of 100 neurons.
pub(super) const BETA_PER_NEURON: f64 = 0.5;

/// The published decay (Fritzke 1995).
pub(super) const PUBLISHED_BETA: f64 = 0.005;

/// Signals per inserted neuron by default where nothing follows growth: within the paper's 250 to 500.
pub(super) const PATTERNS: u32 = 300;

/// The same where the polish follows, which moves neurons to their places anyhow.
pub(super) const PATTERNS_BEFORE_POLISH: u32 = 20;

/// Share of its error that a neuron on a surface loses to a second one: cells of half the area have distances smaller by
/// `sqrt(2)`, that is `1 - 2^(-1.5 / 2)` = 0.41. Of this three quarters, so that what is expected comes true. Half
/// raises mean errors by 0.5 to 1.1 percent; double lowers them by 0.6 to 1.2, over points that were learned from
/// (`docs/benchmarks/constants.md`).
pub(super) const RELOCATION_GAIN: f64 = 0.3;

/// Lists after which a search that started too far away goes to the tree.
pub(super) const MOST_LISTS: usize = 6;

/// Points of the surfaces are this part of the robot's radius apart. With 0.12 a graph takes three times as long and finds more narrow
/// passages; which ones, changes with the value. This and the two below are varied in `docs/benchmarks/constants.md`.
pub(super) const CLEARANCE_SPACING: f64 = 0.16;

/// Nodes that are this many such spacings apart, or fewer, lie side by side: those along the diagonals of a square lattice,
/// which are 1.42 apart, and some more, since each disc has a lattice of its own.
pub(super) const CLEARANCE_STRIDE: f64 = 1.6;

/// The widest gap in the ground that the robot crosses, as a part of its radius.
pub(super) const CROSSED_GAP: f64 = 0.5;

/// Nodes beside a node, itself included, that make it one inside of the ground: of a square lattice there are nine.
pub(super) const LEAST_INSIDE: usize = 7;
