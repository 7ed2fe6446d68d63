//! The tuned constants of the method, in the order of the steps that use them.
//!
//! `sigma` is the standard deviation of the points across the surface: the noise.
//!
//! `SIGMAS_PER_GRID_SIZE` is the paper's (section II-E). What half and double of each change on coarse scans of two simulated
//! rooms, on a hall and on the four walls of experiment I is in `docs/benchmarks/constants.md`, section "Planes"; comments have it
//! where it is much, or nothing. `docs/benchmarks/planes.md` has the results of all of them together.

// Points.

/// Points per cell in which the spacing of the points is estimated, on average. Half finds 35 planes of the hall in place of 50,
/// double the same.
pub(super) const SPACING_POINTS: usize = 8;

// First patches.

/// Sides of the largest and smallest cells in which flat parts are searched, in sigma and in spacings of the points;
/// the larger of both counts. Spacings decide where it was measured: half and double of the sigmas gave the same planes, but
/// for double of the smallest at a noise of 20 mm; they are for scans whose noise is large beside their spacing. A smallest cell of 6
/// spacings finds 28 planes of the hall in place of 50.
pub(super) const LARGEST_CELL_SIGMAS: f64 = 12.0;
pub(super) const LARGEST_CELL_SPACINGS: f64 = 6.0;
pub(super) const SMALLEST_CELL_SIGMAS: f64 = 5.0;
pub(super) const SMALLEST_CELL_SPACINGS: f64 = 3.0;

/// Points that a cell needs before it can be flat.
pub(super) const CELL_POINTS: usize = 10;

/// A cell is flat up to this standard deviation about its plane, in sigma.
pub(super) const FLAT_CELL_SIGMAS: f64 = 1.5;

/// Deviations of chi squared from which the means of a cell's eighths are no plane, and the noise that is assumed at least, in
/// sigma: surfaces that are exact in the data still bend.
pub(super) const STEP_DEVIATIONS: f64 = 3.0;
pub(super) const LEAST_STEP_NOISE: f64 = 0.5;

/// Variance along the second axis that a cell's points need, as a share of the squared side: a filled square has a
/// twelfth, a line of points none.
pub(super) const CELL_SPREAD: f64 = 0.01;

/// The noise is estimated where cells are flat to this share of their side; in smaller cells noise is all there is.
pub(super) const NOISE_FLATNESS: f64 = 0.1;

/// Levels by which cells are larger where patches are added to those of the first: surfaces seen at a small angle have points four
/// times as far apart as most. 1 and 4 gave the same planes: the first cells had found them.
pub(super) const COARSER_LEVELS: u32 = 2;

/// Noise is along the rays if the deviations of cells then spread by this factor less, the least cosine that they are divided by,
/// and the least factor of the noise at any angle: rounding and the width of the beam are left along a surface. Half and double of
/// the cosine gave the same planes: it keeps cells seen at a few degrees from dividing by nearly zero.
pub(super) const INCIDENCE_GAIN: f64 = 0.8;
/// Noise along the rays, by the median noise across surfaces, up to which it is believed: 1.3 to 1.4 in simulated rooms; in a scan of a street,
/// whose ground is seen at a few degrees, it would be so much that walls melt into bushes.
pub(super) const MOST_ALONG_RAYS: f64 = 2.0;
pub(super) const LEAST_COSINE: f64 = 0.1;
pub(super) const LEAST_NOISE_FACTOR: f64 = 0.5;

/// Side of a random patch as a share of the scene's, and tiles along it. Half and double change nothing of experiment I by default
/// (`docs/benchmarks/constants.md`).
pub(super) const RANDOM_SIDE: f64 = 0.5;
pub(super) const RANDOM_TILES: f64 = 8.0;

// Grid size G and the scale S of the weights.

/// Grid size per standard deviation of the distances.
pub(super) const SIGMAS_PER_GRID_SIZE: f64 = 3.0;

/// Smallest grid size by default, in sigma as estimated beforehand. Half gave the same planes; double finds 44 planes of the room
/// with 20 mm of noise in place of 20, with more precision and recall: a coarse scan of much noise profits from larger tiles.
pub(super) const LEAST_GRID_SIZE_SIGMAS: f64 = 3.0;

/// Smallest scale of the weights as a share of the grid size: points that fit exactly would divide by zero. Of noisy points half and
/// double gave the same planes.
pub(super) const LEAST_SCALE: f64 = 0.01;

// Trimming.

/// Points that a tile with points holds on average; where points are sparse, tiles are as large as this needs.
pub(super) const TILE_POINTS: f64 = 4.0;

/// Doublings of the grid size that a tile may have where points are sparse.
pub(super) const TILE_DOUBLINGS: usize = 5;

/// On scan lines tiles are doubled while that covers this factor more of the rectangle: lines far apart cover twice as
/// much, a filled surface no more; between them, the root of two.
pub(super) const LINE_COVER: f64 = std::f64::consts::SQRT_2;

/// The smallest threshold T: a tile is supported by more points than this.
pub(super) const LEAST_THRESHOLD: f64 = 1.0;

/// A tile needs this share of the mean of the tiles around it, up to so many tiles away.
pub(super) const RIM_SHARE: f64 = 0.75;
pub(super) const RIM_TILES: usize = 2;

/// A rectangle turned away from the principal axes has to be smaller by this factor.
pub(super) const TURNED_AREA: f64 = 0.95;

/// Steps in which a right angle is searched for the smallest rectangle, and each step again.
pub(super) const TURNS: f64 = 30.0;

/// Strips of a rectangle whose outermost points stand for all points in that search.
pub(super) const RIM_STRIPS: usize = 128;

// Merge.

/// What the mean square of a part of few points may be above that of its noise by chance, times their number, in squared sigma.
pub(super) const CHANCE: f64 = 4.0;

// Removal of patches that the others explain as well.

/// What a point that is on no patch costs beyond one that is, in the logarithm of the likelihood. It trades precision against
/// recall: half keeps 6 of 20 and 8 of 50 planes, double 61 and 103.
pub(super) const OUTLIER_COST: f64 = 4.0;

/// Parameters of a patch: plane, sides and density. And what a spurious patch may gain per point, as noise is not normal: of 0.05,
/// 0.15 and 0.3 the last gave the most planes on simulated rooms 0 and 2.
pub(super) const REMOVED_PARAMETERS: f64 = 8.0;
pub(super) const REMOVED_GAIN: f64 = 0.3;

// Split.

/// Bins whose strip of the rectangle is shorter than this share of the longest are partial and do not count.
pub(super) const FULL_STRIP: f64 = 0.5;

/// Places at which a bin is tried, per width of a bin.
pub(super) const BIN_STEPS: f64 = 4.0;

/// Standard deviations of the count by which a bin has to fall below the mean, so that chance does not split.
pub(super) const GAP_DEVIATIONS: f64 = 3.0;

/// A patch this close to its plane, in sigma, is not tested for folds.
pub(super) const FOLD_SIGMAS: f64 = 1.1;

/// Share of the squared distances that two planes leave across a clear fold, at most.
pub(super) const CLEAR_FOLD: f64 = 0.5;

/// Deepest recursion of splits: a patch becomes at most two to this power.
pub(super) const SPLIT_DEPTH: u32 = 12;

// The end of a fit.

/// Points that a patch needs by default: one in so many, and at least this number. Half of the latter finds 80 planes of the hall in
/// place of 50, double 24.
pub(super) const POINTS_PER_PATCH_POINT: usize = 4000;
pub(super) const LEAST_PATCH_POINTS: usize = 30;

/// Share of these that a patch needs before the end of the fit. Half and double gave the same planes: it keeps patches of a few
/// points from taking part in a fit.
pub(super) const PART_SHARE: f64 = 0.25;

/// A unit of the network below: weights of the logarithms of a patch's figures, offset, and weight of what comes out.
pub(super) struct Unit {
    pub weights: [f64; 9],
    pub offset: f64,
    pub output: f64,
}

/// Whether a patch is one surface: a network of one layer of hyperbolic tangents on the logarithms of its figures, in the order of
/// `fit/surface.rs`. Learned from the 1,515 patches of simulated rooms 0, 2, 4 and 6 at noise of 5 and 20 mm, and 60 drawn at random that
/// are exact surfaces; rounded. What it keeps beside a logistic regression is in `docs/benchmarks/planes.md`.
#[rustfmt::skip]
pub(super) const SURFACE_UNITS: [Unit; 10] = [
    Unit { weights: [1.37, -1.68, 0.10, 2.15, -4.82, -0.46, 1.47, 4.80, -0.33], offset: -3.81, output: 2.10 },
    Unit { weights: [1.09, -0.48, 0.16, -0.24, 0.13, -0.38, -1.80, 2.12, 1.08], offset: 6.89, output: 2.10 },
    Unit { weights: [-1.45, 1.76, 0.65, -1.80, -0.01, -1.37, -0.79, -0.24, 0.58], offset: 6.47, output: -1.94 },
    Unit { weights: [-1.12, 1.31, -1.52, -3.57, 7.18, -0.47, 0.09, -0.80, -0.06], offset: 2.44, output: -1.88 },
    Unit { weights: [2.88, -0.43, -0.35, -3.76, 1.28, -0.43, 0.42, 2.42, 0.21], offset: -2.07, output: 1.65 },
    Unit { weights: [0.94, -0.98, -2.01, -1.45, -5.82, -0.60, -0.63, -2.85, -0.33], offset: 6.96, output: 1.56 },
    Unit { weights: [-1.74, -0.68, -0.38, 0.20, -1.78, -1.12, 0.97, -5.11, -1.51], offset: 3.96, output: -1.52 },
    Unit { weights: [-1.82, -1.26, -0.32, -1.07, 0.15, -0.85, -1.03, -5.08, -0.19], offset: 7.32, output: 1.48 },
    Unit { weights: [1.47, 0.64, -2.29, 2.31, -5.91, -0.26, -0.40, 2.27, 0.24], offset: 6.73, output: -1.42 },
    Unit { weights: [-1.07, -0.58, 1.83, 0.87, -1.75, 0.74, 0.87, 5.64, 0.24], offset: -6.63, output: 1.29 },
];

/// What the network adds to the sum over its units.
pub(super) const SURFACE_OFFSET: f64 = 0.75;

/// What a figure counts as at least, so that its logarithm is finite. Half and double gave the same planes.
pub(super) const LEAST_FIGURE: f64 = 0.01;

/// The kurtosis of points that fit exactly: that of normal noise.
pub(super) const NORMAL_KURTOSIS: f64 = 3.0;

/// Noise that is assumed at least, in grid sizes: points that fit exactly still deviate by their rounding. It trades precision
/// against recall as [`OUTLIER_COST`] does: half keeps 35, 20 and 17 planes in place of 53, 20 and 50, double 86, 48 and 109.
pub(super) const LEAST_NOISE: f64 = 0.25;

/// A patch with this many times the points that it needs is kept, however improbable: no heap of things is that large, and a
/// floor around furniture or a wall with pictures must not get lost.
pub(super) const LARGE_PATCH: usize = 80;

/// Last passes, in which the regression leaves out points near other patches.
pub(super) const CLEAR_PASSES: usize = 6;

/// How near to another patch a point has to be to be left out, in standard deviations of the distances.
pub(super) const CLEAR_SIGMAS: f64 = 2.0;

/// Share of a patch's points that has to be left for the others to be left out.
pub(super) const CLEAR_SHARE: f64 = 0.3;

// Maximum likelihood.

/// A side of a patch is short up to this length, in sigma. Beyond, what noise mixes near the edges is little beside the rest.
pub(super) const LONG_SIGMAS: f64 = 60.0;

/// A side up to which noise may hide how many surfaces there are, in sigma: EM finds the four walls of experiment I, of which
/// two are 150 long, up to noise 8. At noise 22 half finds them with one of three seeds, double and this with all.
pub(super) const MIXED_SIGMAS: f64 = 25.0;

/// Most patches of a scene that are fitted together: more are a scene in which corners are few. In simulated rooms of 50 to 120 patches it
/// changed no figure and took most of the time.
pub(super) const MOST_FITTED: usize = 8;

/// Unevenness of the points over a rectangle up to which the likelihood of even ones is taken: before merges and folds, when
/// a patch may still lie across a corner, on average over the points of a group; and after, of each rectangle. Half and double of both change
/// nothing.
pub(super) const FIRST_UNEVEN: f64 = 1.0;
pub(super) const MOST_UNEVEN: f64 = 0.4;

/// Least share of the points near a group of patches that support one: in clutter the likelihood decides nothing.
pub(super) const LEAST_SUPPORTING: f64 = 0.7;

/// Points by which merges and folds are judged, and by which the last fit is made, at most.
pub(super) const JUDGED_POINTS: usize = 8192;
pub(super) const FITTED_POINTS: usize = 200_000;

/// Gain of a step below which the last climb ends, in the logarithm of the likelihood: the parameters are then within a
/// fraction of their standard deviations of the best. And its most steps.
pub(super) const LEAST_GAIN: f64 = 0.005;
pub(super) const LAST_STEPS: usize = 30;

/// Distance up to which the middle of an edge may be on another rectangle's plane, in sigma, and the standard deviation
/// with which it is held there, in sigma. Of the first half has an error of 2.92 degrees in place of 4.07 with one of three seeds at noise 22,
/// double changes nothing; half and double of the second change errors by 0.04 degrees.
pub(super) const TIE_SIGMAS: f64 = 2.0;
pub(super) const TIE_STIFFNESS: f64 = 0.02;

/// Standard deviation up to which the points of two rectangles may be one plane, in sigma.
pub(super) const FLAT_SIGMAS: f64 = 1.6;

/// Standard deviation up to which the points of two rectangles may be a fold elsewhere, in sigma, and what that has to gain
/// in the logarithm of the likelihood.
pub(super) const EXCHANGE_SIGMAS: f64 = 4.0;
pub(super) const LEAST_EXCHANGE: f64 = 2.0;

/// Standard deviation of its points from which a patch may be a fold, in sigma: a fold of 60 degrees of two walls 150 long has
/// 1.1 at noise 22, and the likelihood decides which are folds.
pub(super) const THICK_SIGMAS: f64 = 1.0;

/// Least angle of the two planes of a fold, radians: 15 degrees. Smaller bends are found by EM and its splits.
pub(super) const FOLD_ANGLE: f64 = 0.2618;

/// Most merges and folds of a group of patches, and steps of climbing after which each is judged.
pub(super) const MOST_MOVES: usize = 12;
pub(super) const MOVE_STEPS: usize = 12;

/// Steps of climbing after which a move is given up that is worse by so much per point, in the logarithm of the
/// likelihood.
pub(super) const FIRST_STEPS: usize = 4;
pub(super) const HOPELESS: f64 = 0.01;

// The method as printed.

/// Random patches that it starts from where their number is not given (experiment II), and that it adds at most.
pub(super) const PUBLISHED_PATCHES: usize = 10;

/// Share of the points in no reduced support set from which patches are added. Half changes nothing of experiment I; double finds its walls
/// in 19 of 20 seeds in place of 12 at a noise of 2.
pub(super) const UNSUPPORTED_SHARE: f64 = 0.1;

// Rounding.

/// Position steps per grid size, at least: rounding is a tenth of the noise.
pub(super) const STEPS_PER_GRID_SIZE: f64 = 32.0;

/// Position steps per grid size of scenes that are too large for more: rounding is at most three eighths of the noise. Chosen by that alone.
pub(super) const LEAST_STEPS_PER_GRID_SIZE: f64 = 4.0;
