//! The tuned constants of localisation.
//!
//! Those of acceptance were chosen on the scans of `docs/benchmarks/locate.md`; comments have the counts of right and wrong
//! places that they separate. What half and double of the others change, on few queries, is in `docs/benchmarks/constants.md`, which
//! names those that were not measured.

// The map.

/// Smallest side of a cell, metres: twice the drift that maps of several scans have, and what the refinement reaches.
pub(super) const LEAST_CELL: f64 = 0.2;

/// Most cells of a map: 5 bytes each, 80 MB. Cells of larger maps are larger.
pub(super) const MAX_CELLS: f64 = 16e6;

/// Distance of the map's samples over the side of a cell: no cell that the surface crosses is skipped.
pub(super) const SAMPLES_PER_CELL: f64 = 0.6;

/// Share of the samples that may lie beyond the box of a map on each side, and by how much it is wider than the others,
/// metres.
pub(super) const FAR_SHARE: f64 = 0.002;
/// The margin.
pub(super) const FAR_MARGIN: f32 = 2.0;

/// How far from a surface a position still knows its nearest sample, cells.
pub(super) const REACH: i32 = 5;

/// Levels of the pyramid: nodes of the coarsest are 32 cells wide.
pub(super) const LEVELS: usize = 5;

/// |component| along an axis of the map from which on a surface counts as facing it: 56 degrees, so that one between two
/// axes counts for both.
pub(super) const FACES_AXIS: f32 = 0.55;

// The scan.

/// Side of the scan's voxels, cells.
pub(super) const VOXELS_PER_CELL: f64 = 2.0;

/// Points nearer to the sensor than this are the carrier's own body, metres.
pub(super) const BODY_RADIUS: f32 = 0.5;

/// Points of a voxel that a normal needs.
pub(super) const LEAST_POINTS: f32 = 5.0;

/// Largest least variance over the middle one of a voxel that shows a plane: a deviation of a quarter of the extent.
pub(super) const FLATNESS: f64 = 0.08;

/// Least standard deviation across the longest direction of a voxel's points, as a share of its side: two rings of a laser
/// are narrower, and their normal is anything. A full side has 0.29.
pub(super) const LEAST_WIDTH: f64 = 0.12;

/// Noise that points have at least, metres.
pub(super) const RANGE_NOISE: f64 = 0.01;

/// Largest standard error of a normal, radians: 3 degrees.
pub(super) const NORMAL_ERROR: f64 = 0.05;

/// Points of a scan that are used, evenly taken: more change the samples' means by less than a millimetre.
pub(super) const MAX_POINTS_USED: usize = 60_000;

// Rotations.

/// Directions of the scan and of the map that rotations are guessed from.
pub(super) const SCAN_DIRECTIONS: usize = 6;
/// The same of the map.
pub(super) const MAP_DIRECTIONS: usize = 8;

/// Cosine of the angle about a direction within which normals belong to it: 12 degrees.
pub(super) const SAME_DIRECTION: f64 = 0.978;

/// Share of the normals that a direction needs.
pub(super) const LEAST_DIRECTION_SHARE: f64 = 0.03;

/// Share of all further directions below which the yaw is tried all around.
pub(super) const LEAST_SECOND_SHARE: f64 = 0.06;

/// The density that every direction has at least, so that clutter of the scan does not exclude a rotation.
pub(super) const LEAST_DENSITY: f64 = 0.01;

/// Largest difference of the angle between two directions of the scan and of the map, radians: 5 degrees.
pub(super) const SAME_ANGLE: f64 = 0.087;

/// Rotations closer than this are one, radians: 6 degrees.
pub(super) const SAME_ROTATION: f64 = 0.105;

/// Largest angle between the vertical of scan and map where both are upright, radians: 45 degrees.
pub(super) const LARGEST_TILT: f64 = 0.785;

/// Rotations that are searched.
pub(super) const ROTATIONS: usize = 24;

/// Yaws that are tried where directions give none, all around.
pub(super) const YAWS: usize = 90;

/// Least radius of a prior, cells: 5 cm of cells of 0.2 m. Median errors of right places are up to 9 cm on a small map, so that less would
/// refuse most of them.
pub(super) const LEAST_RADIUS: f64 = 0.25;

/// Least angle of a prior, radians: a degree. Median errors are up to 0.3 degrees.
pub(super) const LEAST_ANGLE: f64 = 0.0174;

/// Least variance of the distances of a refined pose where there is a prior, square metres: distances that are all zero are known to a tenth of
/// a millimetre.
pub(super) const LEAST_VARIANCE: f64 = 1e-8;

// The search.

/// Samples of the scan that translations are scored with.
pub(super) const SEARCH_SAMPLES: usize = 192;

/// Hypotheses that are refined.
pub(super) const HYPOTHESES: usize = 128;

/// Least share of the search samples that a hypothesis explains.
pub(super) const LEAST_SHARE: f64 = 0.35;

/// Least share of what the best hypothesis explains, first and where that gives no clear answer. A scan that sees mostly what is
/// not mapped explains less at its place than where it merely fits.
pub(super) const SHARES_OF_BEST: [f64; 2] = [0.8, 0.55];

/// Share explained from which on an accepted place ends the search.
pub(super) const CLEARLY_EXPLAINED: f64 = 0.75;

/// Most nodes of the search that are opened: bounds its time. Of the hall the right pose
/// is found with at most 1,200.
pub(super) const MAX_NODES: usize = 2500;

/// Share of what the best hypothesis explains that makes a node hopeful: the search of a narrow view goes on while there are such.
/// Two views of the hall were answered wrongly since 128 hypotheses came before the right one; with 0.9 they still were.
pub(super) const HOPEFUL: f64 = 0.8;

/// How many times as many hypotheses and nodes such a search may take.
pub(super) const THOROUGH: usize = 4;

/// What a level takes from the bound of a node on average, as a share of the samples: nodes are opened by what their leaves
/// are likely to have. Without it all boxes of a large map are opened before the first leaf is reached.
pub(super) const BOUND_PER_LEVEL: f64 = 0.06;

/// Hypotheses of one rotation closer than this are one, cells.
pub(super) const SAME_TRANSLATION: f32 = 4.0;

// The refinement.

/// Samples of the rough refinement of all hypotheses, and of the fine one of the best.
pub(super) const ROUGH_SAMPLES: usize = 240;
/// The same of the fine refinement.
pub(super) const FINE_SAMPLES: usize = 2000;

/// Gauss-Newton steps of either.
pub(super) const ROUGH_STEPS: usize = 6;
/// The same of the fine refinement.
pub(super) const FINE_STEPS: usize = 10;

/// Distance from a surface at which a sample counts half, in the first and in the last step, cells.
pub(super) const ROUGH_REACH: [f64; 2] = [2.0, 0.75];
/// The same in the fine refinement. From 0.75 cells on views of 90 degrees stayed 0.2 to 0.5 m from a better pose.
pub(super) const FINE_REACH: [f64; 2] = [2.0, 0.25];

/// Least |cosine| between normals of one surface: 37 degrees.
pub(super) const SAME_NORMAL: f32 = 0.8;

/// Weight that holds a pose where no surface fixes it, over the weight of all samples.
pub(super) const HOLD: f64 = 1e-4;

/// Hypotheses that are refined finely. With 16 and 32 of narrow views 42 views of 90 degrees in the hall were answered in the same way.
pub(super) const FINALISTS: usize = 10;

// The verification.

/// Samples that a pose is verified with.
pub(super) const VERIFIED_SAMPLES: usize = 500;

/// Distance from a mapped surface up to which a sample is explained by it, cells: 0.2 m.
pub(super) const EXPLAINED: f64 = 1.0;

/// A ray that meets a mapped surface more than this before its end contradicts it, cells: 0.6 m.
pub(super) const CROSSING_MARGIN: f64 = 3.0;

/// How far behind a sample that nothing explains a mapped surface is looked for that it hides, cells: 10 m.
pub(super) const HIDDEN: f64 = 50.0;

/// Least |cosine| between a ray and the normal of a surface that it can contradict: grazing rays miss it by little.
pub(super) const LEAST_INCIDENCE: f32 = 0.3;

// The decision.

/// Samples that a scan needs.
pub(super) const LEAST_SAMPLES: usize = 30;

/// Least share of the scan on mapped surfaces.
pub(super) const LEAST_EXPLAINED: f64 = 0.5;

/// Largest share against a pose, of the samples that a pose explains or contradicts: of right poses in the hall of which up to 40 percent
/// of the scan lie beyond the map it is at most 0.073, of mirrored scans there at least 0.087.
pub(super) const MOST_AGAINST: f64 = 0.075;

/// From this share explained on more may be against, by so much per share: right poses with 0.83 explained have up to 0.15
/// against, mirrored scans with 0.78 at least 0.16.
pub(super) const FULLY_INSIDE: f64 = 0.63;
/// The slope.
pub(super) const AGAINST_PER_EXPLAINED: f64 = 0.43;

/// Least share explained, and largest share against, of a pose that is tilted by more than [`LARGEST_TILT`]: a mirrored scan of a
/// bare room with two shelves is explained by 93 % upside down.
pub(super) const TILTED_EXPLAINED: f64 = 0.95;
/// The share against.
pub(super) const TILTED_AGAINST: f64 = 0.03;

/// Sectors around the vertical by which the width of a view is measured: 10 degrees each.
pub(super) const SECTORS: usize = 36;

/// A view of less than this share of the circle is narrow: 144 degrees.
pub(super) const NARROW: f64 = 0.4;

/// Least share explained of a narrow view: in the hall, half mapped, wrong places explain up to 0.89 of one, right ones from 0.41 on;
/// what tells them apart is how many places fit.
pub(super) const NARROW_EXPLAINED: f64 = 0.6;

/// Most places that a narrow view may fit: of more the right one may be missing.
pub(super) const MOST_ALIKE: usize = 5;

/// Least probability of the only place that is accepted of a narrow view. Below it a place of several needs no more than
/// [`MOST_AGAINST`] against it, however much it explains. Of 160 mirrored and 208 foreign views of 90 degrees in four maps of the hall 13
/// were accepted without: at most 0.94 likely, most of them with 0.8 to 0.9 explained and 0.08 to 0.16 against. Of 240 mirrored views
/// that it was not chosen on 8 were accepted with it, before [`MIRROR_MARGIN`].
pub(super) const SURE: f64 = 0.95;

/// A narrow view must be likelier at its best place than its mirror image is at its own, by this logarithm. Of 960 views of 90 degrees in
/// four maps of the hall 574 are accepted without, and 12 mirrored ones: it refuses these, 2 of 544 with one place and one of 30 with
/// several. A mirrored one is accepted with 0.5, and eight with one place are refused with 1.5.
pub(super) const MIRROR_MARGIN: f64 = 1.0;

/// Independent facts that the samples of a scan amount to for a pose, by closeness, and against it.
pub(super) const FACTS_FOR: f64 = 30.0;
/// The same against it.
pub(super) const FACTS_AGAINST: f64 = 60.0;

/// Weight of samples that a pose neither explains nor contradicts, over that of explained ones: a map of few scans does not reach everywhere.
pub(super) const UNKNOWN: f64 = 0.5;

/// Least likelihood, over that of the best, of an accepted place that fewer mapped surfaces contradict. From the other end of a
/// corridor the wrong place may be explained by 0.98 with 0.05 contradicted, the right one by 0.72 with 0.01.
pub(super) const DOUBT: f64 = 0.1;

/// Share of what fixes a position, over all directions, below which one of them may be free. It only bounds where the shift is
/// tried, which decides: half and double answer 51 queries alike.
pub(super) const LOOSE: f64 = 0.04;

/// How far a position is shifted along a direction that may be free, metres: more than a door frame is wide.
pub(super) const SLIDE: f64 = 1.0;

/// How far a scan is turned about an axis that may be free, radians: 10 degrees. A floor may be turned by any angle, and the axis of a tunnel
/// beside the sensor moves by 1.5 percent of its distance.
pub(super) const SLIDE_TURN: f64 = 0.17;

/// A position is free where it is as likely after the shift, up to this logarithm.
pub(super) const FREE: f64 = 1.0;

/// A fixed place must be likelier than every free one by this logarithm. Of 960 views of 90 degrees in the hall four were answered
/// wrongly: there a free place was at least a third as likely as the best fixed one. It refuses 23 of 709 right ones.
pub(super) const LOOSE_MARGIN: f64 = 2.0;

/// Places that are this many steps of one line from the best: what fixes a narrow view along the line is a small part of it.
pub(super) const ROW: usize = 3;

/// Least share explained of a place of such a row: else the small part may be what is not mapped.
pub(super) const ROW_EXPLAINED: f64 = 0.8;

/// Independent facts of the covariance: surfaces of a model share their errors over some metres.
pub(super) const FACTS: f64 = 60.0;

/// Least probability of a place that is given.
pub(super) const LEAST_PROBABILITY: f64 = 0.02;

/// Rough refinements this much less likely than the best, as a logarithm, are not refined further.
pub(super) const HOPELESS: f64 = 9.0;

/// Poses closer than this are one place: metres and radians.
pub(super) const SAME_PLACE: (f64, f64) = (0.5, 0.17);
