//! Tuned constants of the method. What a user may set is in [`BicAlphabetOptions`](super::BicAlphabetOptions); what the
//! file format fixes is beside the code that writes it. What half and double change on a laser scan of a room is in
//! `docs/benchmarks/constants.md`.

// The radius of words, where it is not given.

/// In spacings: about fifty points of a surface, twice as many as a descriptor has pixels within its circle. The paper's
/// 0.1 m is as many spacings of its scans. Half takes 2.5 times the bytes of a laser scan with 1.5 in place of 4.0 percent
/// outliers, double less than half of the bytes with 9.4.
pub(super) const RADIUS_IN_SPACINGS: f64 = 4.0;

/// In parts of the scene's diagonal: a word is tried at every radius' distance, so that finer words of dense scans take
/// hours. With twice as many a scan of a hall takes 1.9 times the bytes with 6 in place of 14 percent outliers, with half as
/// many half the bytes with 37.
pub(super) const RADII_PER_SCENE: f64 = 300.0;

/// For a scene without any length, metres: the paper's, though any would do.
pub(super) const ANY_RADIUS: f64 = 0.1;

/// Side of a pixel of the range image (III-C) in angles between beams, alpha: scanners differ in both directions, and a
/// pixel should not be empty. Half
/// costs 1 percent of the bytes, double saves 3 at a quarter more outliers.
pub(super) const PIXEL_PER_ALPHA: f64 = 1.5;

/// Least side of a pixel of the range image, radians, so that an image has at most 8 million pixels. Half and double
/// give the same file.
pub(super) const LEAST_PIXEL: f64 = 0.0016;

/// Least share of a Gaussian's weight that has to lie on pixels with a point. Half saves 2 percent of the bytes, double
/// costs 3; the BIC changes by 0.4 percent.
pub(super) const LEAST_WEIGHT: f32 = 0.3;

/// Least distance between interest points in feature spacings: nearer ones would describe the same structure. Half
/// saves 8 percent of the bytes at 15 percent more outliers, double costs 2 with 13 percent fewer.
pub(super) const INTEREST_SPACING: f32 = 0.5;

/// Bandwidth of a descriptor's pixel in mean spacings of the points about the feature, where that is more than a pixel:
/// a feature far away has only a few points. Half lowers the BIC by 5 percent and costs 9 percent of the bytes, for 4
/// percent more inliers and 7 percent more outliers; double lowers it by 1 and saves 4, for 3 percent fewer inliers and 18 percent
/// more outliers. One seed of one scan; 0.7 stays.
pub(super) const BANDWIDTH: f32 = 0.7;

/// Points so many bandwidths below the highest one about a pixel are hidden by it: twice, so that a slope of 45 degrees
/// counts on both sides of the pixel's middle.
pub(super) const VISIBLE_DEPTH: f32 = 2.0;

/// Largest distance of an occurrence's points from its middle, in radii: a word's points lie within one radius before
/// each coordinate is rounded to 1/64 of it, by at most `sqrt(3) / 128` = 0.014 in all. 1.015 and 1.06
/// give the same file.
pub(super) const OCCURRENCE_RADIUS: f32 = 1.03;

/// Most candidates tried at once per thread; results do not depend on it. While candidates are rejected, twice as many
/// are tried each time, since none is tried in vain; after one is accepted, one per thread.
pub(super) const CANDIDATES_PER_THREAD: usize = 4;

/// Decoded points whose Gaussians are summed in 32 bits before they are added: no more than 2^10, since each is at most
/// 2^22. Results do not depend on it. Columns of so many points stay in the first-level cache.
pub(super) const POINTS_PER_SCATTER: usize = 64;

/// Points of an occurrence whose share in the sums of a block is kept in 32 bits: no more than 2^10, since each is at most
/// 2^22. Results do not depend on it.
pub(super) const MAX_SHARED_POINTS: usize = 1000;

/// Blocks that occurrences may reach, all together, up to which the share of each is kept: 128 MB at most. Results do not
/// depend on it.
pub(super) const MAX_SHARED_BLOCKS: usize = 1 << 22;

/// Features per unit of parallel work when the blocks near them are searched, some milliseconds; results do not depend on it.
pub(super) const FEATURES_PER_SEARCH: usize = 512;

/// Features per unit of parallel work when they are described, some milliseconds; results do not depend on it.
pub(super) const FEATURES_PER_TASK: usize = 256;

/// Points between two checks whether the caller wants to stop, some milliseconds.
pub(super) const POINTS_PER_CHECK: usize = 1 << 16;

/// Occurrences between two checks whether the caller wants to stop, some milliseconds.
pub(super) const OCCURRENCES_PER_CHECK: usize = 256;
