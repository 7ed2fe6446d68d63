//! The tuned constants of the method. None of them is needed to read a file; sizes that the format fixes stand beside
//! the code that they bound (`lattice`, `word`, `coding`).
//!
//! Comments give the reason for a value. What half and double of it change on laser scans of a room and a hall is in
//! `docs/benchmarks/constants.md`; comments have it in a clause. Choosing is greedy, so that almost any change moves bytes
//! and the length of the description, misfit included, by some percent; only more than that says something.

// Preparing the scene.

/// Side of the cells that keep one point each, over sigma: a decoded point that explains one of the points of a cell
/// explains most others too. Half and double change bytes by -2.3 to -0.9 percent, the length by -2.2 to 1.
pub(super) const THINNING_SIDE: f32 = 0.5;

/// The same of a large scene. Up to 1.15, two over the root of three, the middle of a cell is within sigma of all of it, so
/// that a sample on a dense surface has a point near it. At 1 the merged hall takes a fifth less time and 0.3 percent more of
/// its points are not explained, in 4 percent more bytes (`docs/benchmarks/constants.md`).
pub(super) const COARSE_THINNING_SIDE: f32 = 0.8;

/// Points of a scene that is thinned to half a sigma, at most; beyond it, a scene is large. Learning takes about 30
/// microseconds of CPU time for each. All scenes but the merged hall that figures were published of have fewer.
pub(super) const MOST_FINE_POINTS: usize = 1_200_000;

/// Share of the samples of a plane that explain nothing, at most, where in a large scene its points are taken for explained
/// before smaller planes are sought: where an eighth is missing, a plane still explains three times what one of half its
/// size can.
pub(super) const WHOLE_PLANE_OUTLIERS: f32 = 0.125;

/// Points that a normal is fitted to. Half and double change bytes by -1.3 to -0.5 percent, the length by -0.9 to -0.1.
pub(super) const NORMAL_NEIGHBORS: usize = 12;

/// Smallest radius if it is not given, over the spacing of the points. On a laser scan of a room 0.1 m (4 spacings) explain
/// 81.6 % with 7.3 % of outliers in 1761 bytes, half of it 82.1 and 6.1 % in 1989, twice as much 78.3 and 10.2 % in 1451.
pub(super) const RADIUS_IN_SPACINGS: f64 = 3.0;

/// Smallest radius if it is not given, over the median sigma: the heights of a smaller word are lost in the deviation
/// that is allowed. Half costs 26 to 53 percent more bytes of two laser scans and a depth frame for fewer outliers, double
/// saves 15 to 43 percent for more (`docs/benchmarks/constants.md`).
pub(super) const RADIUS_IN_SIGMAS: f64 = 1.5;

// Finding planes.

/// Planes sought per cell: three meet in the corner of a room. 2 and 6 change bytes by -5.5 to -0.9 percent, the length
/// by -2.4 to 4.7.
pub(super) const PLANES_PER_CELL: usize = 3;

/// Rounds of fitting a plane to the points near to it. 2 and 6 change bytes by -1 to 0.1 percent, the length by 0.3 to
/// 0.7.
pub(super) const PLANE_ROUNDS: usize = 3;

/// Points within this many sigmas of a plane are on it. Half and double change bytes by -3 to 4.1 percent, the length
/// by -2 to 4.2.
pub(super) const ON_PLANE: f64 = 1.0;

/// The same in the first round, which starts from the normal of a single point. Half and double change bytes by -6.2 to
/// -0.9 percent, the length by 0.9 to 5.9.
pub(super) const ON_FIRST_PLANE: f64 = 1.5;

/// Ridge on the tilt of a plane, over the weight of its points: few points leave the tilt as it was. Half and double
/// change bytes by -6.8 to -0.5 percent, the length by -5.1 to 7.1.
pub(super) const TILT_RIDGE: f64 = 1e-3;

/// Points about a cell that planes are fitted to, at most; bounds the time that a dense cell takes. Half and double
/// change bytes by -2.1 to 0.9 percent, the length by 0.2 to 5.1.
pub(super) const MAX_FITTED: usize = 2048;

/// Smallest radius of a word over the sigma where it occurs: a smaller one holds a sample or none. Half and double
/// change bytes by -4.6 to 0.1 percent, the length by 2.1 to 9.2.
pub(super) const LEAST_RADIUS_IN_SIGMAS: f64 = 0.5;

/// Samples per side of a word at most; bounds the time that a fine word takes. Half and double change bytes by -0.5 to
/// -0.3 percent, the length by 0.3 to 1.5.
pub(super) const MAX_SAMPLES_PER_SIDE: f64 = 128.0;

// Descriptors and words.

/// A pixel of a descriptor is set when a point lies within this share of sigma of its middle, per axis. Half and double
/// change bytes by -6.1 to 4.2 percent, the length by -9.8 to 14.8.
pub(super) const DESCRIPTOR_REACH: f32 = 0.7;

/// Squared distance of descriptors, per pixel and in squared radii, where only one has a surface. Heights that are
/// further apart count as much: (0.14 radii)^2. Half and double change bytes by -6.2 to 1.1 percent, the length by -8.4
/// to 4.
pub(super) const HOLE: f32 = 0.02;

/// Squared distance up to which a descriptor counts as that of the whole plane: one and a half pixels. No other word is
/// tried there. Half and double give the same file; with 0 bytes of a second scan of the room rise by 0.7 percent.
pub(super) const PLANE_DISTANCE: f32 = 1.5 * HOLE;

/// Rounds of clustering at most. 5 and 20 change bytes by -3 to 0.1 percent, the length by 0.8 to 3.4.
pub(super) const CLUSTERING_ROUNDS: usize = 10;

/// Descriptors that are clustered at most, spread evenly over those there are. Half and double change bytes by -7.5 to
/// 2 percent, the length by -9.8 to 4.
pub(super) const MAX_CLUSTERED: usize = 4096;

/// Words tried at a place: those whose descriptors are nearest to the one there. 2 and 6 change bytes by -1.4 to 1.8
/// percent, the length by -1.5 to -0.7.
pub(super) const WORDS_PER_PLACE: usize = 3;

// Choosing occurrences.

/// Bits of an occurrence without its word, before the coder has seen any. Half and double change bytes by -14.6 to 2.5
/// percent, the length by -1.4 to 1.9.
pub(super) const FIRST_OCCURRENCE_BITS: f32 = 18.0;

/// Bits of a word, before the coder has seen any. Half and double change bytes by 0 to 0.3 percent, the length by 0.
pub(super) const FIRST_WORD_BITS: f32 = 3.0;

/// The same of the plane. Half and double give the same file.
pub(super) const FIRST_PLANE_BITS: f32 = 1.0;

/// Added to how often a word occurs before its bits are taken from its share: words that do not occur have a price.
/// Half and double change bytes by -0.1 to 0 percent, the length by 0.
pub(super) const WORD_PRIOR: f32 = 0.5;

/// Share of the description that a round of covering saves at least in a large scene, or it is the last. The rounds of the
/// hall save -1, 0.6 and 0.1 percent; words that do not pay go in the first ones.
pub(super) const LEAST_SAVING: f64 = 0.01;

/// Passes of refining occurrences one by one. 1 and 4 change bytes by 0.2 to 1 percent, the length by -0.5 to 2.3.
pub(super) const REFINEMENT_PASSES: usize = 2;

// Encoding.

/// Largest sum of residuals, in steps, at which an occurrence is coded from a predicted plane. Beyond it the pose is
/// coded directly. Half and double change bytes by -1.4 to -0.2 percent, the length by -0.4 to 0.3.
pub(super) const MAX_PREDICTION_CHANGE: i32 = 12;
