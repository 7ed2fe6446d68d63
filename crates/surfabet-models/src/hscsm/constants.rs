//! The tuned constants of the method, with the reason for each. What other values change on a depth frame and
//! a simulated room is in `docs/benchmarks/constants.md`; comments have it in a clause.
//!
//! Limits and sizes that the file fixes stand beside the code that they bound.

/// Side of a pixel in spacings, where it is not given. With 3 up to 1.04 percent of real scans were further from the decoded
/// cloud than two spacings, with one per half pixel; a sheet has no points beside it that could make up for it.
pub(super) const SPACINGS_PER_PIXEL: f64 = 2.5;

// Samples and the lattice of poses.

/// Side of the cells that points are merged in, pixels of the lowest level: a pixel then holds several samples, so that
/// growth and masking can tell them apart. Half changes bytes by -4 to 0.2 percent; double costs 2 to 8 for 0.3 to 3 of
/// the rmse.
pub(super) const SAMPLE_SIZE: f64 = 0.5;

/// Position lattice, pixels: a quarter of a pixel moves no sample visibly, since depth and colour are measured after
/// the pose is rounded. Half changes bytes by -2.5 to 3.5 percent, double by -4.6 to -0.9, at rmse within 1.4.
pub(super) const POSITION_STEP: f64 = 0.25;

/// Share of the intensities that is clamped at each end, where they take the place of colours: retroreflectors are tens
/// of times as bright as anything else, and would leave a few grey levels to all of it: with 0 intensities of two halls are 10 percent
/// further off. Half and double change bytes by at most 2.2 percent.
pub(super) const CLAMPED_SHARE: f64 = 0.001;

// What a level accepts.

/// Largest deviation of colour in a pixel above the lowest level, grey levels. On the table frame the error of colour is that of
/// one level to 2 percent, with 60 it is 9 percent larger and the file 1 percent smaller; on the objects, which did not
/// choose it, 0.3 and 37 percent.
pub(super) const MAX_COLOR_DEVIATION: f64 = 20.0;

/// Share of a patch's pixels that must be left above the lowest level when those that deviate too much are masked
/// out: below it, the patches of the next level describe the same with fewer poses than would be needed twice. With fine
/// masks 0.25 and 0.75 change the bytes of a room by -0.8 and 1.2 percent and its rmse by 0.5, and other scenes not at all.
pub(super) const LEFT_PIXELS: f64 = 0.5;

/// Above the lowest level growth accepts depths within this many times the largest deviation, sqrt(3): a layer of
/// points spread evenly over that deviates just as much as a pixel may. What is thicker becomes several sheets, as at
/// the lowest level, where the gate is a pixel. Half costs up to 10 percent of the bytes, double changes them by -0.5 to 1.3.
pub(super) const GATE_DEVIATIONS: f64 = 1.732_050_807_568_877_2;

/// Above the lowest level the mean place of a pixel's samples is off its centre by at most this many pixels: beyond,
/// the surface ends inside the pixel, and the smaller pixels of the level below follow its rim. Samples of a quarter of
/// a pixel that cover all of one are off by an eighth at most. It counts without fine masks alone. With masks as printed 0.1 costs the
/// frame 11 percent of its bytes; 0.4 saves 2 to 7 at 4 to 6 percent more rmse.
pub(super) const MAX_PIXEL_OFFSET: f64 = 0.2;

// Plane of a patch.

/// Radii of the neighbourhoods that compete for the normal of a patch, in patch sizes. The plane that explains most
/// points wins, so that a patch beside a corner follows one wall and not the diagonal. Half of all costs a room 6 percent of
/// its bytes, double a laser scan 7.
pub(super) const FIT_RADII: [f32; 4] = [0.7, 0.5, 0.35, 0.25];

/// Radius of the neighbourhood that gives the normal of a candidate, in patch sizes: within those of [`FIT_RADII`],
/// since one is fitted to all candidates. Half changes bytes by -1 to 2 percent, double by -1 to 0.4.
pub(super) const CANDIDATE_RADIUS: f32 = 0.4;

/// A point counts for a plane within this distance, pixels. Half changes bytes by -3 to 0 percent, with up to 2 percent more
/// error of colour; double costs 1 to 6.
pub(super) const PLANE_GATE: f32 = 1.5;

/// Points about a seed that its plane is fitted to, at most: bounds the time. Half changes bytes by -0.9 to 0.4 percent,
/// double by 0.2.
pub(super) const FIT_POINTS: usize = 512;

/// An aligned patch keeps the normal of the patch it was found from when that explains at least this share of what the
/// best plane explains: parallel neighbours join without gaps. 0.9 and 0.975 change bytes by -1.2 to 0 percent.
pub(super) const SAME_NORMAL: f32 = 0.95;

/// The plane of a seed is fitted to the points on it at most this often; it moves little after the second time: 2 and 8
/// change bytes by at most 0.6 percent.
pub(super) const REFITS: usize = 4;

/// Refitting ends when the normal turns by less than this, radians: a twentieth of what rounding turns stored normals by
/// at most, 1.3 degrees. Half gives the same files, double changes bytes by 0.1 percent.
pub(super) const SAME_ANGLE: f32 = 1e-3;

/// Points whose second variance is below this fraction of the first lie on a line. Half and double give the same files: it guards
/// against points that are exactly on one, as in generated clouds.
pub(super) const LINE: f64 = 1e-6;

// Placement. Greedy placement as a whole saves 5 and 7 percent of the bytes over subsampling
// (docs/benchmarks/patches.md).

/// An aligned position is taken when at least this fraction of its pixels would be set. 0.25 and 0.75 change bytes by -0.9 to
/// 0.9 percent.
pub(super) const ALIGNED_COVERAGE: f32 = 0.5;

/// Candidates that would set at least this fraction of their pixels begin a tiling one at a time, so that no two of
/// them meet on one surface. 0.5 and 0.9 change bytes by at most 0.1 percent.
pub(super) const TILING_COVERAGE: f32 = 0.75;

/// A trial whose samples were partly taken in the meantime is committed when this fraction of its pixels is left;
/// else its candidate is scored again. 0.5 and 0.9 give the same files: it counts where patches that are tried at once want the
/// same samples, and keeps them from being placed for a few pixels.
pub(super) const KEPT_PIXELS: f32 = 0.75;

/// A proposal is tried when its approximate coverage is this fraction of what it needs: saves trials, which are dearer
/// than scores. 0.6 and 1 change bytes by -0.3 to 0.8 percent.
pub(super) const PROMISING_COVERAGE: f32 = 0.8;

/// Candidates that are scored together: few where the first tilings will cover most others. Half and double change bytes by
/// -1.1 to 0 percent.
pub(super) const TILING_CHUNK: usize = 512;

/// As [`TILING_CHUNK`], once the large surfaces are tiled. Half and double give the same files: it bounds how many scores are
/// in vain.
pub(super) const CHUNK: usize = 1 << 14;

/// Trials of a batch.
pub(super) const BATCH: usize = 64;

/// A placed patch changes the score of candidates within this distance of it, in patch sizes: two patches overlap when
/// their centres are closer than a diagonal, 1.41. Half and double change bytes by at most 0.5 percent.
pub(super) const CHANGED_RADIUS: f32 = 1.5;

// Dictionaries.

/// Patches per entry of a depth dictionary, where its size is not given: a dictionary must not take more than its
/// codes save. With 128 and 256 entries it is a third of the file of the table frame and three fifths of that of the objects
/// (`docs/benchmarks/hscsm.md`). 40 costs a laser scan 5 percent of its bytes for 0.4 of its rmse, 160 saves 2 for 0.4 more.
pub(super) const PATCHES_PER_DEPTH_ATOM: usize = 80;

/// As [`PATCHES_PER_DEPTH_ATOM`], for colour: half costs a room 3 percent of its bytes for 0.3 of the error of colour, double
/// saves 6 for 2 more.
pub(super) const PATCHES_PER_COLOR_ATOM: usize = 40;

/// Most entries of a depth dictionary where its size is not given; the least is an eighth. Half saves up to 4 percent of the
/// bytes for up to 1.5 more rmse, double costs up to 5 for 1 less.
pub(super) const MAX_DEPTH_ATOMS: usize = 128;

/// As [`MAX_DEPTH_ATOMS`], for colour: half saves 5 and 12 percent of the bytes for 1 and 2 more error of colour, double costs
/// a frame 26 for 2 less.
pub(super) const MAX_COLOR_ATOMS: usize = 256;

/// Entries of the dictionaries of the paper's rooms (Table I); its single frame has 100 and 200.
pub(super) const PUBLISHED_DEPTH_ATOMS: u32 = 500;

/// As [`PUBLISHED_DEPTH_ATOMS`], for colour.
pub(super) const PUBLISHED_COLOR_ATOMS: u32 = 3500;

/// Step of a stored dictionary value. Entries have unit norm, so the values of an 8 x 8 patch are about an eighth: this
/// keeps each to a few percent, well below what the codes' own quantisation does.
pub(super) const ENTRY_STEP: f32 = 1.0 / 64.0;

/// The same of values of 16 bits: a hundredth of a percent of them.
pub(super) const WIDE_ENTRY_STEP: f32 = ENTRY_STEP / 256.0;
