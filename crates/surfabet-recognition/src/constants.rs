//! The tuned constants of `find`, `recurring`, `similarity` and `surface`.
//!
//! Those of the search were chosen on simulated rooms 0 and 1, six laser stations each, by recall and precision over
//! all chairs and doors, those of place similarity on eleven real scans of three places (`docs/benchmarks/alphabet.md`).
//! What other values of 71 of the 85 change is in `docs/benchmarks/constants.md`, with a list of the others. Scores from which on something is
//! found were chosen by the tables of `docs/benchmarks/recognition.md`.

// Surfaces.

/// Distance of raw samples over the spacing of those that are kept: a little less than `sqrt(1 / 2)`, so that neighbours
/// across a diagonal are less than the side of a cube apart, and no cube on the surface is skipped. Double lowers the scores
/// of right places by 0.02 to 0.05.
pub(crate) const RAW_SPACING: f64 = 0.7;

/// Samples up to this many spacings apart can belong to one piece: one skipped cube does not cut it.
pub(crate) const PIECE_REACH: f64 = 2.1;

/// Least |cosine| between normals of neighbours in one piece: 20 degrees.
pub(crate) const PIECE_COSINE: f32 = 0.94;

/// Farthest that a neighbour in one piece lies from the plane of the other, spacings.
pub(crate) const PIECE_STEP: f64 = 0.35;

/// How many times as far as chroma luma, which changes with the light, may differ.
pub(crate) const LUMA_TOLERANCE: f64 = 3.0;

/// Most raw samples of a surface; bounds memory. More are refused.
pub(crate) const MAX_SAMPLES: u64 = 20_000_000;

// The example.

/// Samples along the diagonal of an example. Half takes half of the time, and by shape alone the best wrong
/// place rises above a score of 0.5.
pub(crate) const SAMPLES_PER_DIAGONAL: f64 = 64.0;

/// Closest spacing of samples unless it is given, metres: counts for regions with a diagonal below 0.26 m.
pub(crate) const LEAST_SPACING: f64 = 0.004;

/// Least tolerance unless it is given, spacings: counts where the median sigma of the example's occurrences is less.
pub(crate) const LEAST_TOLERANCE: f64 = 0.25;

/// Pieces of an object seen from two sides may differ in size by this factor at no cost.
pub(crate) const PIECE_SIZE_RATIO: f64 = 1.5;

/// Least |cosine| between normals of one and the same surface: 53 degrees.
pub(crate) const NORMAL_COSINE: f32 = 0.6;

// Guessing motions.

/// Occurrences of the example that motions are guessed from. Of a chair half and double give the same.
pub(crate) const SEEDS: usize = 48;

/// Samples of the example that guesses are tried with: those of largest weight among four times as many.
pub(crate) const TRIAL_SAMPLES: usize = 96;

/// Guesses that are refined.
pub(crate) const GUESSES: usize = 2000;

/// Least share of the trial samples, by weight, that a guess takes to occupied cells.
pub(crate) const LEAST_TRIAL_SHARE: f64 = 0.3;

/// From this share in the region on, by its root, a piece counts as whole.
pub(crate) const WHOLE_PIECE: f64 = 0.7;

/// Pieces this many times larger than the largest whole piece of the example are not searched: a seat is not searched
/// in a wall.
pub(crate) const MAX_PIECE_RATIO: f64 = 8.0;

/// From this |z| of a normal on, its horizontal direction is too uncertain to turn by: from 53 degrees of elevation.
pub(crate) const LEVEL: f64 = 0.8;

/// Largest difference of |z| between normals of a pair of occurrences.
pub(crate) const SAME_INCLINATION: f64 = 0.3;

/// Ratios of radii of a pair of occurrences: the same scale or the next.
pub(crate) const RADIUS_RATIOS: std::ops::Range<f64> = 0.4..2.5;

/// Least similarity of colour of a pair of occurrences: saves the trials of pairs that differ in colour.
pub(crate) const LEAST_COLOR_SIMILARITY: f64 = 0.1;

/// Turns that are tried where no normal gives one: all around, an eighth of pi apart.
pub(crate) const TURNS: u32 = 16;

/// Side of the cells of occupancy, and of guesses that count as one: twice the spacing or this share of the diagonal,
/// whichever is more. Twice the spacing is 1 / 32 of the diagonal where it is not given: the share counts for closer ones
/// alone, and bounds the number of cells and guesses.
pub(crate) const GUESS_CELL: f64 = 0.03;

/// |z| of a normal that separates samples tried against level cells from those tried against steep ones.
pub(crate) const TRIAL_LEVEL: f32 = 0.68;

/// Cells are occupied by a steep surface below this |z| of its normal, by a level one above the other: they overlap, so
/// that normals may be off by 13 degrees.
pub(crate) const OCCUPANCY_LEVELS: [f32; 2] = [0.85, 0.5];

/// Most cells of occupancy: 32 MiB for each of two bits. Of a chair cells are 3.9 cm, and scenes of up to 15,000 cubic
/// metres do not reach it; of larger ones cells are larger.
pub(crate) const MAX_CELLS: f64 = (1_u64 << 28) as f64;

// Refining motions.

/// Samples of the example in the rough refinement of all guesses, and in the fine one of the best.
pub(crate) const ROUGH_SAMPLES: usize = 128;
/// The same of the fine refinement.
pub(crate) const FINE_SAMPLES: usize = 512;

/// Gauss-Newton steps of either. Half and double change scores of right places by at most 0.015, the time by -13 to 24
/// percent.
pub(crate) const ROUGH_STEPS: usize = 6;
/// The same of the fine refinement.
pub(crate) const FINE_STEPS: usize = 8;

/// How far a sample may be from the surface in the rough refinement: a share of the diagonal in the first step, a
/// number of tolerances in the last.
pub(crate) const ROUGH_REACH: (f64, f64) = (0.12, 3.0);

/// The same in the fine refinement, both in tolerances.
pub(crate) const FINE_REACH: [f64; 2] = [6.0, 1.0];

/// Tolerance of the score by which the best guesses are kept, in tolerances.
pub(crate) const ROUGH_TOLERANCE: f64 = 2.0;

/// Weight of distances along the surface beside those along its normal: along the surface the nearest sample lies anywhere
/// within the spacing.
pub(crate) const TANGENT_WEIGHT: f64 = 0.1;

/// Weight that holds a motion in directions that no surface fixes, over the weight of the samples.
pub(crate) const HOLD: f64 = 1e-3;

/// What holds sizes at those of the example, over the weight of the samples: sizes at the end of their tolerance weigh as much
/// as this share of all samples a tolerance away. Half and double change scores of right places by less than 0.01.
pub(crate) const SIZE_HOLD: f64 = 0.1;

/// Largest change of a size unless it is given, as a share, of an example of another scene: as much as chairs of the simulator differ. Half
/// loses one of twelve chairs and one of five doors, double raises the first wrong chair by 0.02.
pub(crate) const SIZE_TOLERANCE: f64 = 0.1;

/// How far from the samples of an example that is a whole model a place has to be explained, as a share of its diagonal:
/// what stands beside it is not part of it. Double lowers wrong chairs by 0.03 to 0.10 and right ones by 0.01 to 0.02; half raises wrong
/// ones by 0.04 to 0.07 and right ones by 0.02 to 0.04.
pub(crate) const SURROUNDINGS: f64 = 0.06;

/// Guesses that are refined finely. Half takes 22 percent less time, double 48 percent more; scores of right
/// places fall and rise by 0.01.
pub(crate) const FINALISTS: usize = 300;

/// Least score of what is found unless it is given.
pub(crate) const LEAST_SCORE: f64 = 0.5;

/// The same of examples of another model by shape alone, where unlike things score up to 0.55. Chairs of rooms 4 to 7, laser: recall and
/// precision 0.96 and 0.88 with 0.5, 0.92 and 0.96 with this and with 0.55, 0.79 and 1.00 with 0.6.
pub(crate) const LEAST_SCORE_OF_SHAPES: f64 = 0.525;

/// The same where colours count. Doors of rooms 4 to 7: recall and precision 0.92 and 1.00 with this and with all between 0.47 and 0.51; the next
/// right one scores 0.45, the best wrong one 0.46.
pub(crate) const LEAST_SCORE_OF_COLORS: f64 = 0.48;

/// Shifts that are tried one after the other where colours count, as shares of the diagonal.
pub(crate) const SLIDES: [f64; 6] = [0.04, 0.04, 0.02, 0.02, 0.01, 0.005];

// Scoring and suppressing.

/// How far from a sample of an example no other is where the example ends, spacings: two are within what samples of a border miss it by. While the place
/// was looked at there, half took 0.03 from scores of right doors, double added 0.01.
pub(crate) const BORDER_STEP: f64 = 3.0;

/// A position is beyond the border when the nearest sample is farther than this share of the step. 0.5 takes 0.02 from scores of right
/// doors, 0.9 adds nothing; from 1 on there is no border, for the sample itself is a step away.
pub(crate) const BEYOND_BORDER: f64 = 0.75;

/// How far on both sides of the border colours of a scene are compared, radii of its words, which mix them. Within half a word's radius of the edge of
/// a door flush with its wall its colour, unlike that of the frame, is like that of the example by 0.02 to 0.36, beyond one radius by 0.75 to 0.9.
pub(crate) const BORDER_REACH: f64 = 1.0;

/// Directions in which the border is looked for about a sample. Half and double change scores of right doors by at most 0.005.
pub(crate) const BORDER_DIRECTIONS: u32 = 8;

/// Share of the samples of a border that a side needs to count. The side that ends least decides: with the mean of all sides the best wrong place of
/// rooms 4 to 7, a wall as wide as a door, scores 0.52 in place of 0.46, and two right doors less than it.
pub(crate) const LEAST_SIDE: f64 = 0.05;

/// Samples of the example that places are scored with.
pub(crate) const SCORED_SAMPLES: usize = 4096;

/// Share of motions below which a sample that matches does not count as rarer still.
pub(crate) const RAREST: f64 = 0.05;

/// Motions closer than this share of the example's diagonal are one.
pub(crate) const SAME_PLACE: f64 = 0.25;

/// Places of several examples closer than this are one, metres: middles of things of a kind are farther apart. With half, eight
/// finds beside those of twelve chairs are second ones or wrong; double changes nothing that is found by default.
pub(crate) const SAME_PLACE_OF_ANY: f64 = 0.3;

/// The same before the fine refinement, for motions of about one direction.
pub(crate) const SAME_GUESS: f64 = 0.25 * SAME_PLACE;

/// Motions that share more of their region than this are one.
pub(crate) const OVERLAP: f64 = 0.35;

// Recurring things.

/// Closest spacing of samples unless it is given, metres: legs and rails of 2 cm show. With double, the purity of points is 0.91 in place
/// of 0.97, and the adjusted Rand index with walls is 0.21 in place of 0.24.
pub(crate) const LEAST_SPACING_OF_THINGS: f64 = 0.015;

/// Samples up to this many spacings apart hang together. With double, 0.60 of the places of room 8 are of one kind in place of 0.68; half
/// gives three classes more.
pub(crate) const LINK_REACH: f64 = 2.1;

/// What lies up to this many spacings from a large surface, and half as many from its plane, belongs to it: scraps along
/// its edges look alike. Half and double give three classes of 20 more and one less.
pub(crate) const ON_LARGE: f64 = 4.0;

/// Side of the cells in which large surfaces are compared with pieces, as a share of the largest size of a thing: 0.55 m, within which a wall or a
/// floor is flat.
pub(crate) const LARGE_CELL: f64 = 0.25;

/// Least |cosine| between the normals of a large surface and of a piece in its plane: 6 degrees, by which words of a small piece are off.
pub(crate) const IN_PLANE: f64 = 0.995;

/// Samples that a thing needs, as a share of a square of the least size that is filled: 18 at a spacing of 1.5 cm, without which
/// classes of room 8 are the same. It leaves out lines of a sample's width where a closer spacing is given.
pub(crate) const LEAST_FILLED: f64 = 0.1;

/// How much wider than its samples the box of a thing is on each side, spacings. With half and double, 0.63 and 0.65 of the places are of
/// one kind in place of 0.68; double has the larger adjusted Rand index, 0.09.
pub(crate) const MARGIN_OF_THINGS: f64 = 1.0;

/// The same of a piece of what is too large for a thing, as a share of its diagonal. Half gives 25 classes in place of 20, double 16; the
/// adjusted Rand index falls from 0.08 to 0.06 and 0.05.
pub(crate) const PART_MARGIN: f64 = 0.2;

/// Guesses that are refined, and that are refined finely, for each candidate: a third of those of a search that is asked for. With half, 0.64
/// of the places are of one kind in place of 0.68.
pub(crate) const RECURRING_GUESSES: usize = 600;
/// The same finely. With half, the adjusted Rand index is 0.05 in place of 0.08.
pub(crate) const RECURRING_FINALISTS: usize = 100;

/// Most raw samples of a scene: a room of 25 square metres has about a million at a spacing of 2 cm, and time grows with them.
pub(crate) const MAX_SAMPLES_OF_THINGS: u64 = 4_000_000;

/// A sample is covered by a thing up to this many tolerances, and a spacing, from its samples. Half gives 132 places in place of 125,
/// double 121, of as many kinds.
pub(crate) const COVERED: f64 = 2.0;

/// Weight from which on a sample of an example belongs to it and not to what goes on beyond its region. With 0.25 and 0.75 there are 119 and
/// 128 places in place of 125, of as many kinds.
pub(crate) const LEAST_OWN_WEIGHT: f64 = 0.5;

/// Share of a thing's samples from which on it belongs to a class already. Half gives 18 classes in place of 20, double 25, and 0.62 of the
/// places are of one kind in place of 0.68.
pub(crate) const CLAIMED: f64 = 0.4;

/// Least score of the places of a piece that a thing is grown from: pieces of copies that were seen from different sides score less than
/// the copies.
pub(crate) const GROWN_SCORE: f64 = 0.4;

/// Most places that a thing is grown from: bounds the time.
pub(crate) const GROWN_PLACES: usize = 24;

/// Samples around a piece by which it is decided which of its places are of one thing.
pub(crate) const GROWTH_SAMPLES: usize = 1000;

/// Share of the places of a thing, itself among them, that have a sample of it.
pub(crate) const SUPPORT: f64 = 0.6;

/// Samples of a grown thing up to this many spacings apart hang together.
pub(crate) const GROWTH_REACH: f64 = 4.0;

/// Least score of a place of a grown thing, over that which is asked of others: details, such as the books of a shelf, lower it, and that
/// so much agrees at once is seldom chance. Equal shelves of rooms 0 to 2 score 0.47 to 0.57.
pub(crate) const GROWN_LEAST: f64 = 0.85;

/// How many times as large as its piece a grown thing is at least: what grows by less is taken as it is.
pub(crate) const LEAST_GROWTH: f64 = 1.25;

// Place similarity.

/// Weight of the words against the pairs: words alone vary more between scans of one place. Half and double change the
/// margin between real places from 0.053 to 0.060 and 0.037.
pub(crate) const WORDS_WEIGHT: f64 = 0.25;

/// Mean squared difference of heights, in squared radii, that halves the similarity of two words.
pub(crate) const HALF_HEIGHT_DIFFERENCE: f64 = 0.03;

/// Squared difference of a hole and a surface, in squared radii: that of heights a quarter of the radius apart.
pub(crate) const HOLE_DIFFERENCE: f64 = 1.0 / 16.0;

/// Weight of the squared ratio of radii, in octaves, in the exponent of the similarity of two words; that of classes of
/// inclination is 1.
pub(crate) const RADIUS_WEIGHT: f64 = 0.25;

/// Most occurrences that are compared with one another, evenly taken: bounds the time of large scenes. Half
/// takes a third of the time, double three times it; the margin falls to 0.048 and stays.
pub(crate) const MAX_COMPARED: usize = 1500;

/// Shortest distance with a class of its own, metres.
pub(crate) const NEAREST: f64 = 0.25;

/// Height from which on the next class begins, metres. Half takes 0.016 of the margin of 0.053 between real places, double
/// adds as much; simulated rooms lose more than half of theirs either way.
pub(crate) const RISE_LIMITS: [f64; 3] = [0.25, 1.0, 2.5];

/// |z| of a normal from which on the next class of inclination begins: steep, sloped, level. With 0.19 and 0.98 spots of
/// one hall are separated with nearly three times the margin, simulated rooms as before.
pub(crate) const INCLINATION_LIMITS: [f64; 2] = [0.38, 0.92];

/// |cosine| between the horizontal directions of two normals below which the next class begins: equal, between,
/// perpendicular. The margin between places hardly depends on them.
pub(crate) const TURN_LIMITS: [f64; 2] = [0.9, 0.45];

// Kinds of places: chosen on simulated rooms 0 to 7, half and double of each in `docs/benchmarks/constants.md`.

/// Height of a layer, metres.
pub(crate) const LAYER: f64 = 0.1;

/// Layers above the floor, the first half one: what is higher than 2.4 m, out of reach, is in the last. How high a ceiling is says
/// little about what a room is for.
pub(crate) const LAYERS: usize = 25;

/// Share of the area of level words that is below the floor's height: a reflection below it is no floor.
pub(crate) const FLOOR_SHARE: f64 = 0.05;

/// Share of area that is added to that of a class before its logarithm is taken: less is as good as nothing.
pub(crate) const NO_SHARE: f64 = 1e-3;

/// Deviation between places of the logarithm of a share that counts as none.
pub(crate) const SAME_SHARE: f64 = 0.1;

/// What all places have in common, over the deviation of one class between them: with more of it places are alike that differ
/// little from the mean.
pub(crate) const COMMON: f64 = 0.6;
