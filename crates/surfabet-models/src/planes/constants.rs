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

/// Where no cells are flat, neighbourhoods of points are, up to so many times the deviation of the flattest quarter of them: the rest reach over
/// edges. Twice keeps nearly all of 10 points of one noisy plane. Chosen by that alone.
pub(super) const NEIGHBORHOOD_SPREAD: f64 = 2.0;

/// Variance along the second axis that a cell's points need, as a share of the squared side: a filled square has a
/// twelfth, a line of points none.
pub(super) const CELL_SPREAD: f64 = 0.01;

/// The noise is estimated where cells are flat to this share of their side; in smaller cells noise is all there is.
pub(super) const NOISE_FLATNESS: f64 = 0.1;

/// Places at which the noise of small discs is measured, points that a disc needs, and blocks of points that stand for those of a large one.
/// Discs of 16 to 24 points gave the same noise up to a tenth (`docs/benchmarks/planes.md`, section "Steps and layers").
pub(super) const DISCS: usize = 256;
pub(super) const DISC_POINTS: usize = 20;
pub(super) const DISC_BLOCKS: usize = 64;

/// Radius of a disc in standard deviations across it, at least: points that fill a ball have 2.2. With 3.5 or 4 discs reach over
/// the steps of stairs at a noise of 30 mm. Then the part of the radius over which the deviation is taken.
pub(super) const DISC_DEVIATIONS: f64 = 3.0;
pub(super) const DISC_WIDTH: f64 = 0.8;

/// The share of the discs, the flattest, whose largest deviation is the noise: of stairs fewer than half lie on one surface.
pub(super) const DISC_SHARE: f64 = 1.0 / 3.0;

/// Factor by which the noise of flat cells may be above that of discs: beyond it the cells reach over steps and edges. In simulated rooms 0
/// and 4 it is 1.05 to 1.12 above at 2 to 20 mm; 1.4 melts shelves of 2 cm at 6 mm.
pub(super) const MOST_OF_DISCS: f64 = 1.25;

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

/// What the deviation of patches that start from the data counts as at most, in sigma as estimated beforehand, unless the smallest grid size
/// is more. Without it louvres melt at a noise of 15 mm; with 1 walls that are warped by more than the noise are cut
/// (`docs/benchmarks/planes.md`, section "Steps and layers"). Rooms are the same with 1.2, 1.5 and without.
pub(super) const MOST_DEVIATION: f64 = 1.35;

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

/// Rows of a regular grid that a bin may hold less than others by where it starts: one, and a tenth for how well rows are known.
pub(super) const GAP_ROWS: f64 = 1.1;

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

/// Figures by which a patch is judged.
pub const FIGURES: usize = 14;

/// A unit of the network below: weights of the logarithms of a patch's figures, offset, and weight of what comes out.
pub(super) struct Unit {
    pub weights: [f64; FIGURES],
    pub offset: f64,
    pub output: f64,
}

/// Whether a patch is one surface: a network of one layer of hyperbolic tangents on the logarithms of its figures, in the order of
/// `fit/surface.rs`. Learned from patches of simulated rooms and of generated scenes by an earlier form of `benches/papers/planes_judge.py`,
/// from figures of an earlier state, which are not kept: the script prints other weights now, which did worse. How well these do, and
/// those, is in `docs/benchmarks/planes.md`.
#[rustfmt::skip]
pub(super) const SURFACE_UNITS: [Unit; 16] = [
    Unit { weights: [-0.47, -0.73, -0.32, 1.06, -1.20, -0.39, 0.87, 1.96, 0.93, 0.26, -0.07, -0.12, 0.12, -0.03], offset: -0.74, output: -3.50 },
    Unit { weights: [1.13, 0.58, -0.23, 0.45, 1.51, -0.13, 0.30, 2.68, -0.98, 0.12, -0.00, 0.10, -0.47, -0.23], offset: -1.40, output: 3.23 },
    Unit { weights: [0.89, 0.21, 0.11, -0.24, -0.67, -2.03, 2.29, -2.25, -1.30, 0.58, 0.17, -0.21, -0.17, 0.09], offset: -6.71, output: 2.60 },
    Unit { weights: [-0.68, -0.70, -0.47, 0.22, -0.74, -0.02, -0.15, 1.25, -0.31, 0.29, 0.89, 0.10, -0.00, -0.08], offset: 1.91, output: 2.55 },
    Unit { weights: [1.58, 1.81, -0.31, 0.02, -1.81, -0.48, 0.78, 0.23, -1.31, 0.07, -1.29, 0.19, 0.11, 0.18], offset: -2.29, output: 2.45 },
    Unit { weights: [0.48, 3.63, 0.36, -0.70, -1.86, 0.39, -0.91, 2.38, -1.76, 0.11, 0.45, -0.15, 0.08, 0.02], offset: -0.30, output: 2.38 },
    Unit { weights: [-1.26, -0.69, 0.44, 1.94, -3.90, -0.03, 1.00, -0.14, 0.26, -0.16, -0.12, 3.86, 0.03, -0.01], offset: -1.13, output: 2.37 },
    Unit { weights: [1.26, 0.18, -0.10, 2.36, -10.96, 0.29, -0.47, 2.94, 0.16, 0.22, 0.32, 0.07, 0.24, -0.08], offset: -0.31, output: -2.23 },
    Unit { weights: [-1.02, 0.64, 0.26, -0.85, 2.47, 0.08, -0.14, 0.33, 0.02, 0.12, -0.35, -1.34, 0.29, -0.03], offset: -0.62, output: 2.14 },
    Unit { weights: [-1.97, 1.11, -0.22, -4.86, 10.14, -0.47, 0.52, -1.61, -1.22, -0.56, 0.04, 0.12, -0.04, 0.02], offset: 3.76, output: -1.92 },
    Unit { weights: [3.73, 1.34, -0.13, 0.60, 1.70, 0.46, 0.15, 0.08, -0.58, -0.47, -0.36, -0.00, 0.13, -0.18], offset: -2.89, output: 1.85 },
    Unit { weights: [1.61, 0.35, 3.07, -1.16, -3.19, -0.10, -0.41, 6.21, -0.25, -0.17, -0.21, 0.04, -0.13, 0.12], offset: -0.71, output: 1.72 },
    Unit { weights: [-0.10, 2.16, 1.05, -1.82, -3.67, -0.13, 0.34, 3.34, -2.24, -0.26, 0.11, 1.54, 0.05, 0.02], offset: 0.07, output: -1.52 },
    Unit { weights: [-3.12, -0.01, 0.79, -0.10, -3.98, -0.03, 0.78, 3.20, -0.27, -0.01, -0.71, 0.92, -0.18, 0.03], offset: -1.62, output: 1.52 },
    Unit { weights: [-2.57, -0.46, 0.70, 0.07, -1.33, -0.84, -0.24, -3.48, 0.77, -0.19, 0.21, 0.81, 0.72, -0.75], offset: 6.51, output: 1.52 },
    Unit { weights: [0.04, -0.18, 0.49, -0.63, 0.66, -0.01, -0.37, -0.67, 0.28, -0.28, 0.09, 0.40, 0.01, -0.94], offset: -0.01, output: -1.48 },
];

/// What the network adds to the sum over its units.
pub(super) const SURFACE_OFFSET: f64 = -0.43;

/// Length and width in standard deviations of the noise, and points, beyond which more says nothing: the judge has seen little that is
/// larger. With none of the three it keeps as much.
pub(super) const MOST_LENGTH: f64 = 400.0;
pub(super) const MOST_WIDTH: f64 = 200.0;
pub(super) const MOST_POINTS: f64 = 4000.0;

/// Half the part of a rectangle, along each side, in which a patch may not be bent, as a share of half the side.
pub(super) const BEND_INNER: f64 = 0.8;

/// What a figure counts as at least, so that its logarithm is finite. Half and double gave the same planes.
pub(super) const LEAST_FIGURE: f64 = 0.01;

/// The kurtosis of points that fit exactly: that of normal noise.
pub(super) const NORMAL_KURTOSIS: f64 = 3.0;

/// Noise that is assumed at least, in grid sizes: points that fit exactly still deviate by their rounding. It trades precision
/// against recall as [`OUTLIER_COST`] does: half keeps 35, 20 and 17 planes in place of 53, 20 and 50, double 86, 48 and 109.
pub(super) const LEAST_NOISE: f64 = 0.25;

/// The least probability falls, in the logarithm of a patch's points, from `min_probability` at the first many times the points that it
/// needs to a share of it at the second: no heap of things is that large, and a floor around furniture or a wall with pictures must not
/// get lost. Real walls are not exactly flat, which the judge doubts.
pub(super) const LARGE_PATCH: [f64; 2] = [4.0, 16.0];
pub(super) const LARGE_SHARE: f64 = 1.0 / 3.0;

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

/// Directions in a rectangle along which folds are searched, places along each, and folds that are tried for each rectangle.
pub(super) const FOLD_DIRECTIONS: usize = 4;
pub(super) const FOLD_PLACES: usize = 16;
pub(super) const FOLDS: usize = 2;

/// How far from a rectangle its density counts, in sigma: beyond it is below 1e-8 of the largest.
pub(super) const DENSITY_SIGMAS: f64 = 6.0;

/// Least side of a rectangle, in sigma: a narrower one is a line, and its sides have no meaning.
pub(super) const LEAST_SIDE_SIGMAS: f64 = 0.5;

/// Probabilities below this do not count, and the least share of the points that are anywhere: so small that only rounding sees it.
pub(super) const LEAST_MIXTURE_SHARE: f64 = 1e-6;
pub(super) const LEAST_REST: f64 = 1e-9;

/// First damping of a climb as a share of the diagonal, its factors after good and bad steps, and where climbing ends. They decide how
/// many steps a climb takes, not where its top is.
pub(super) const DAMPING: f64 = 1e-2;
pub(super) const LESS_DAMPING: f64 = 0.2;
pub(super) const MORE_DAMPING: f64 = 8.0;
pub(super) const MOST_DAMPING: f64 = 1e6;

/// Most that a step turns a rectangle, radians, and changes the logarithm of a weight: where the scores are no longer straight.
pub(super) const MOST_TURN: f64 = 0.3;
pub(super) const MOST_GROWTH: f64 = 1.0;

// The method as printed.

/// Random patches that it starts from where their number is not given (experiment II), and that it adds at most.
pub(super) const PUBLISHED_PATCHES: usize = 10;

/// Share of the points in no reduced support set from which patches are added. Half changes nothing of experiment I; double finds its walls
/// in 19 of 20 seeds in place of 12 at a noise of 2, before the grid size had the spacing of the points as its least.
pub(super) const UNSUPPORTED_SHARE: f64 = 0.1;

// Rounding.

/// Position steps per grid size, at least: rounding is a tenth of the noise.
pub(super) const STEPS_PER_GRID_SIZE: f64 = 32.0;

/// Position steps per grid size of scenes that are too large for more: rounding is at most three eighths of the noise. Chosen by that alone.
pub(super) const LEAST_STEPS_PER_GRID_SIZE: f64 = 4.0;
