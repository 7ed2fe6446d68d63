//! The tuned constants of the method, with the reason for each. What half and double of a value change on a depth frame
//! and a simulated room is in `docs/benchmarks/constants.md`; comments have it in a clause, bytes and the larger rmse of
//! both directions, decoded as measured.
//!
//! Limits and sizes that the file fixes stand beside the code that they bound. What was measured of the options is in
//! `docs/benchmarks/patches.md`.

// Pixels.

/// Side of a pixel in spacings, where it is not given: five points per pixel give a mean and a thickness. It trades bytes against how far
/// decoded points are from the input, which the tolerance does not bound: 3 takes 21 to 53 percent fewer bytes for 17 to 46 percent more
/// forward rmse (`docs/benchmarks/constants.md`).
pub(super) const SPACINGS_PER_PIXEL: f64 = 2.25;

/// The same where points lie in rows. Pixels bridge from line to line of a scan: walls stay open between the 16 rings of a laser with 2.25. And of
/// coordinates that were rounded every pixel holds as many steps: a tile in UTM takes three times the bytes with 2.25.
pub(super) const SPACINGS_PER_PIXEL_IN_ROWS: f64 = 3.0;

/// The same in bounds on the distance of input to what is decoded, where that is more: finer pixels keep what need not be kept. Of coarser
/// ones files are smaller still, but decoded points, which nothing bounds, further from the input than half of the bound.
pub(super) const BOUNDS_PER_PIXEL: f64 = 0.5;

/// The same with bounds on both distances: 0.5 takes -16 to 74 percent more bytes, 2 from -5 to 111.
pub(super) const BOTH_BOUNDS_PER_PIXEL: f64 = 1.0;

// Axes of the scene.

/// Side of the cells that vote for the scene's axes, pixels: large enough for a plane to show through the noise. Half
/// and double change bytes and rmse by up to 3 percent, either way.
pub(super) const AXES_CELL: f64 = 6.0;

/// The least side of these cells in gaps between surfaces that lie close behind one another: two faces of a wall in one cell
/// look like a plane along the wall when the cell is this much wider than the gap. Half and double change bytes of three walls by -5 to 18 percent, rmse
/// by 3.
pub(super) const AXES_CELL_IN_GAPS: f64 = 8.0;

/// Points that vote for the axes, at most: bounds the time. Half of it costs a depth frame 4 percent of its bytes.
pub(super) const MAX_AXES_POINTS: usize = 400_000;

/// Directions that are tried for the first axis, at most: each is compared with all normals. Half raises the
/// rmse by 2 percent, double gives the same files.
pub(super) const MAX_AXES_CANDIDATES: usize = 1500;

/// Normals within this angle of an axis belong to it: cos 12 degrees. With 6 degrees bytes rise by 2 and rmse by 3 to
/// 4 percent, with 24 rmse changes by -3 to 6. A turned corner is found to a tenth of a degree (test in `axes`).
pub(super) const ALONG_AXIS: f64 = 0.978;

/// Second axes are at most this far from being orthogonal to the first: sin 12 degrees, as [`ALONG_AXIS`]. 6 and 24
/// degrees give the same files.
pub(super) const ACROSS_AXIS: f64 = 0.208;

/// Rounds of assigning normals to axes and turning the axes to their mean. 5 and 20 give the same files.
pub(super) const AXES_ROUNDS: usize = 10;

// Samples and their sides.

/// Side of the cells that points are merged in, pixels: a pixel then holds several samples, and their spread gives the
/// thickness.
pub(super) const SAMPLE_SIZE: f64 = 0.5;

/// Side of the cells that normals are fitted in, pixels; each takes its 26 neighbours in. Double saves the
/// simulated room 12 percent of its bytes at 2 percent more rmse, and costs the frame 5 and 12 percent; half costs the room
/// 84 percent. At the default pixels double costs rooms 3 to 4 percent at 7 to 10 percent more rmse, and laser scans up to 20
/// percent of rmse.
pub(super) const NORMAL_CELL: f32 = 2.0;

/// The same in spacings of the points, at least: in cells with fewer points each one is a surface of its own, which faces anywhere. Floors of points
/// at random places in pixels of a tenth of their spacing take 37 percent fewer bytes than without, and nearly none decode to upright pixels. It
/// decides below three quarters of a spacing alone, which is no default.
pub(super) const NORMAL_CELL_IN_SPACINGS: f32 = 1.5;

/// The least side of these cells in gaps between surfaces that lie close behind one another: with its neighbours a cell is
/// then three times as wide, and both faces of a wall in it look like a plane along the wall. Half costs three walls 8 to 84 percent of
/// their bytes, double saves 1.
pub(super) const NORMAL_CELL_IN_GAPS: f32 = 2.0;

/// Samples about one with a normal, itself included, whose axes it votes with: as many as the survey of the cloud takes
/// first (`surfabet_geom::Survey`). 4 and 14 give the same files of three walls.
pub(super) const NEAREST_SAMPLES: usize = 7;

/// How much the axis of a neighbouring cell counts, against 1 for the own normal of a flat cell that is along the axis.
/// All 27 together, the cell itself among them, count 1.08: a cell gives way where nearly all around it agree. Half
/// and double change bytes by 2 percent, rmse by 1, either way.
pub(super) const NEIGHBOUR_PULL: f32 = 0.04;

/// How much a cell counts whose samples lie on a line, against 1 for a plane: any plane along the line will do, so
/// its neighbours decide. The frame, the room and a laser scan have the same files with 1; with 0.05 the laser
/// scan has 1 percent fewer bytes and 1 percent more rmse.
pub(super) const LINE_WEIGHT: f32 = 0.2;

/// Rounds of choosing axes, each with the neighbours' choice of the round before. 2 and 8 change bytes by at most
/// 1 percent.
pub(super) const SIDE_ROUNDS: usize = 4;

/// A cell of which at least this share of the samples faces one way faces that way as a whole. 0.7 and 0.95
/// change bytes by 0.1 percent.
pub(super) const SIDE_AGREEMENT: f32 = 0.85;

// Sheets.

/// Samples of a column further apart than this are two runs, pixels: several empty samples of [`SAMPLE_SIZE`]. Half
/// costs the room 9 percent of its bytes, double saves 9 and 2 percent of the rmse; the frame hardly changes.
/// Laser scans have up to a fifth more rmse with double, since surfaces behind one another become one.
pub(super) const MAX_GAP: f32 = 2.5;

/// The same where surfaces lie close behind one another: this share of the gap between them, but at least so many pixels,
/// since a surface may lie at 45 degrees to the column. With 1 the faces of three walls become one: forward rmse rises by 47 to 64
/// percent. 0.25 gives the same files.
pub(super) const SHARE_OF_GAP: f32 = 0.5;

/// See [`SHARE_OF_GAP`]; with 2 the faces of three walls become one, too, and 0.5 gives the same files.
pub(super) const LEAST_GAP: f32 = 1.0;

/// Largest step between depths of pixels that touch, in such gaps: less than from one surface to the other. Double, where it
/// is more, costs three walls 72 to 121 percent of their bytes and 14 to 31 of forward rmse; half changes bytes by 3.
pub(super) const STEP_SHARE_OF_GAP: f32 = 0.6;

/// Rounding of depths in such gaps, where it is not given and not finer anyway: a surface is then decoded at most a sixteenth
/// of the gap off its place. Half costs three walls 2 to 16 percent of their bytes for 1 to 3 of backward rmse, double saves 1 to 9 for up to 10.
pub(super) const DEPTH_STEP_IN_GAPS: f64 = 0.125;

/// Rounding of depths, where it is not given, pixels (docs/benchmarks/patches.md).
pub(super) const DEPTH_STEP: f64 = 0.75;

/// Longest run, pixels. A half thickness is at most 63 quarters of a pixel, so no patch is thicker than 31.5. Half
/// and double give the same files of the frame, the room and a laser scan.
pub(super) const MAX_RUN: f32 = 24.0;

/// Depth step between neighbouring runs that one surface may make, pixels, beside their mean half thickness: a slope
/// of 51 degrees, where one of 45 may face another axis. Half costs 1 to 3 percent of the bytes, double saves 1.
pub(super) const MAX_STEP: f32 = 1.25;

/// Least half thickness of a run, and of what is decoded when the choice compares, pixels: what one layer of samples
/// stands for, half of [`SAMPLE_SIZE`].
pub(super) const THINNEST: f32 = 0.25;

/// Sheets of fewer samples are small: they are joined to others, and may be left out of the model at the price of
/// their distance to the large ones. Half of a full patch of one layer of samples. Against 256 and with points beside the
/// patches up to the same completeness, it saves rooms at 2 cm 9 to 11 percent of their bytes and changes other scenes by
/// -2.3 to 1.0, with errors of distance that rise by at most 0.2 percent on the half of the scenes that did not choose it.
/// 64 raises the rmse of three of four scenes by 2 to 3 percent.
pub(super) const SMALL_SHEET: f32 = 128.0;

/// Reaches at which small sheets are joined to others, pixels, one after the other: for surfaces that are sampled more
/// coarsely than the pixel. Half costs the room 13 percent of its bytes for 7 percent less rmse, double saves 10 for 4
/// percent more; the frame changes by 1 and 2 percent.
pub(super) const JOIN_REACHES: [i32; 2] = [2, 4];

// Choice of hierarchy, mask, shapes and thickness.

/// How much the distance of the thin surface from the middle of a run counts, per sample: slabs overlap well even
/// where their middles are apart, and the surface is decoded too. Half changes nothing by more than 0.6 percent;
/// double costs the frame 2 percent of its bytes for 1.5 of the rmse.
pub(super) const THIN_WEIGHT: f32 = 0.5;

/// How much the error of decoded points counts against that of input points: filled thickness has many. It
/// trades bytes against rmse: half gives -13 to 13 percent of rmse for 6 to 8 percent more bytes, double 55 percent more
/// rmse in the room for 11 percent fewer.
pub(super) const DECODED_WEIGHT: f32 = 2.0;

/// The same of depths where points beside the patches bring the input within the tolerance: the less it can miss, the more counts how
/// far decoded points are from it. 2 gives 4 to 7 percent more forward rmse for -11 to 4 percent of the bytes, 10 takes 5 to 51 percent
/// more bytes for 4 to 8 less. Which pixels are set is weighed as without, so that lines of a scan are bridged.
pub(super) const DECODED_WEIGHT_WITHIN_TOLERANCE: f32 = 4.0;

/// Bits of a point beside the patches where the choice of patches prices it: more than most cost, since those that are left when
/// patches have taken the others lie apart. 6 takes 4 to 28 percent more bytes for 2 to 7 less forward rmse, 24 changes bytes by -7 to
/// 10 percent for 1 to 7 more.
pub(super) const POINT_BITS: f64 = 12.0;

/// How far from the decoded slab input needs no point, as a share of the bound: decoded points lie half a pixel apart, so
/// that the nearest one is off along the surface too. 0.7 changes bytes by -13 to 3 percent and rmse by 3.
pub(super) const POINT_REACH: f64 = 0.85;

/// Where patches with the full price of points need none, less of it is tried, so many times: each share is the geometric mean of one that
/// was too little and one that was enough.
pub(super) const PRICE_STEPS: u32 = 4;

/// A share of the price that is taken to be too little. Half and double give the same files of four scans.
pub(super) const LEAST_PRICE_SHARE: f64 = 1.0 / 64.0;

/// Most shapes in a patch: bounds the time. Half and double change bytes by at most 0.3 percent.
pub(super) const MAX_SHAPES: usize = 12;

/// Shapes tried after the last one that lowered the cost. 1 and 6 change bytes and rmse by at most 0.6 percent.
pub(super) const SHAPE_PATIENCE: usize = 3;

/// Pull of coefficients to zero: a diagonal of this times the samples and the order of the shape. Half and
/// double change bytes by at most 0.5 percent.
pub(super) const SHAPE_PULL: f32 = 0.01;

/// Passes over the pixels of a mask. One costs 1 to 2 percent of the bytes and takes 6 off the rmse of the
/// room, four save 0.5 for 1.
pub(super) const MASK_PASSES: usize = 2;

/// Weight of a pixel without samples against one with samples in the fit of depths. Half and double change
/// rmse by at most 0.4 percent; double costs the frame 1 percent of its bytes.
pub(super) const HOLE_WEIGHT: f32 = 0.2;

/// How much nearer than its middle the samples of a neighbouring pixel may be, pixels: half of [`SAMPLE_SIZE`].
pub(super) const NEAREST_SAMPLE: f32 = 0.25;

/// Bits of a sheet beside those of its squares: tile, number of sheets and base. An estimate; half costs
/// 1 percent of the bytes, double saves 1 to 3.
pub(super) const SHEET_BITS: f32 = 10.0;

/// A small sheet is left out at the price of at most this distance per sample, pixels: far beyond any that is worth
/// it, so that squares stay finite.
pub(super) const MAX_STRAY: f32 = 1e4;

// Colour and scalars. All are part of the file format: the first two that of older files.

/// Weight of a cell's own parent, and of the one next to it, along each axis, where colours are predicted; of 64. Linear interpolation
/// between middles would be 48 and 16. On a simulated scan shares of 0.28, 0.24 and 0.2 took 10.2, 13.1 and 14.9 percent off the bytes of
/// colour at equal error, against what older files do, 0.32 took 4.4; on the fused frames of a kitchen 0.28 took 6.4, 0.22 with the steps
/// below 5.4 and 0.26 with them 6.2. Here it is 0.266.
pub(super) const PARENT_WEIGHTS: [i64; 2] = [47, 17];

/// The share, of 256, of what the prediction missed at each of up to three cells beside a child that is added to its own: 0.3.
/// 0.25 and 0.35 changed bytes at equal error by less than half a percent.
pub(super) const MISSED_SHARE: i64 = 77;

/// Step of a level of the pyramid against that of the model, of 32: for the cells themselves, their parents, and so on.
/// Coefficients of coarse cells also predict the finer ones, so they are rounded more finely. 1.15, 1, 0.9 and 0.8 took 1
/// percent less at equal error than the steps of older files; these are the nearest to them.
pub(super) const STEP_SHARES: [u32; 4] = [37, 32, 29, 26];

/// Doublings from the side of a cell to that of a block of cells at the border of a tile, and the part of the steps of colours and
/// scalars by which what is missed there is rounded. With blocks of 8 and 4 cells and 64 parts colours jumped 2.2 and 1.5 times as
/// far across borders as inside in simulated rooms with tiles of 152 pixels, for 1.0 and 2.1 percent more bytes; with 4 cells and 16
/// or 32 parts 2.2 and 1.75 times, for 0.9 and 1.45 percent. Uncorrected it is 5 times.
pub(super) const BORDER_BLOCK_BITS: u32 = 2;

/// See [`BORDER_BLOCK_BITS`].
pub(super) const BORDER_FINENESS: i64 = 64;

// Choice of colours and scalars.

/// Share of the squared error that a bit must save, for the cells themselves, their parents, and so on: what is coded of coarse cells
/// also predicts finer ones.
pub(super) const LEVEL_RATES: [f32; 4] = [1.0, 0.8, 0.65, 0.55];

/// Length of the second step of back projection, from what is decoded, and what is added to the samples of a cell for it.
pub(super) const AGAIN_LENGTH: f32 = 1.7;

/// See [`AGAIN_LENGTH`].
pub(super) const AGAIN_DAMPING: f32 = 0.3;

// Points beside the patches.

/// The largest tolerance in gaps between surfaces that lie close behind one another: so that one surface does not stand for
/// the other. Double gives the same files of three walls; half takes 1.7 to 6.6 times the bytes for 1 to 5 percent of backward rmse.
pub(super) const POINT_TOLERANCE_IN_GAPS: f64 = 0.6;

/// Half the side of the cells of points beside the patches, in such gaps: so that none lies in the middle of the gap. Of three walls one has such
/// points: half costs 36 percent of its bytes, double saves 11 for 2 of backward rmse.
pub(super) const POINT_CELL_IN_GAPS: f64 = 0.24;

/// Half the diagonal of these cells in pixels, at most: points of finer pixels than the spacing do not lie as far from a surface as others of it lie
/// from one another. On floors in pixels of half the spacing they lay up to 1.8 pixels beside it, and now 0.9. It decides below two thirds of a
/// tolerance alone, which is no default; with 1 `quality='fine'` takes 1 to 14 percent more bytes of four scans for up to 1 percent of forward rmse.
pub(super) const POINT_CELL_IN_PIXELS: f64 = 1.5;

/// The share of the tolerance at which points are kept beside the patches: others may measure spacing and noise
/// otherwise. It trades bytes against backward rmse: 0.6 takes -1 to 41 percent more bytes for 15 to 21 less, 1 takes 0 to 24 percent
/// fewer for 16 to 22 more.
pub(super) const TOLERANCE_SHARE: f64 = 0.8;

/// Side of the cells of extra points, as a multiple of the bound on the error. A cube of this side has half a diagonal
/// of 0.996, so that its points are within the bound of its middle.
pub(super) const EXTRA_CELL: f64 = 1.15;

/// Most cells around one that is left out where others cover its points. With a bound both ways of 5 and 10 cm the
/// points of a room, a hall and a street take 0.90 to 1.00 of the bytes that they take without; without this limit the room, whose walls
/// are dense, takes 1.05 to 1.08 of that, hall and street 0.99 to 1.00. With 4 the three take 0.98 to 1.03.
pub(super) const MOST_AROUND_LEFT_OUT: u8 = 6;

// Maps that go on.

/// How far beyond the thickness of a patch points of another scan are still of its surface, finest pixels: as far as one layer
/// of samples and the rounding of depths reach.
pub(super) const SHOWN_MARGIN: f32 = 0.5;

/// How far from the points of another scan a layer of a patch is that they still show, finest pixels.
pub(super) const SHOWN_REACH: f32 = 0.5;

// Fragments, which the thin surface leaves out. In the simulated room they are a sixth of all patches and one percent
// of the decoded points, with a sixth of the squared error (docs/benchmarks/patches.md).

/// Most finest pixels of a fragment, of all patches that touch one another. Half and double change forward rmse of four scans by 0.2
/// percent, and backward by -19 to 3.
pub(super) const LARGEST_FRAGMENT: u32 = 16;

/// Fragments stand off larger pieces by at least this, finest pixels: what is nearer continues them. Half leaves out 1 to 7
/// percent of the points for 2 to 17 more of backward rmse; double keeps 0.1 to 2 percent more of them.
pub(super) const FRAGMENT_GAP: f32 = 1.5;

/// From this distance on, finest pixels, a small piece stands for itself. Rooms hardly have such pieces; of a hall and a street half takes 37 and 20
/// percent off the backward rmse for 0.2 and 0.6 more of forward, double adds 38 and 33 to it and takes as little off.
pub(super) const FRAGMENT_REACH: f32 = 10.0;

// What recurs. Half and double are in `docs/benchmarks/constants.md`, of before scenes were folded onto their copies; those that came
// with that were not halved and doubled but where their comment says so. The search is off by default, and what it finds is taken only
// where the file gets a tenth smaller.

/// Side of the cells that surface is gathered in, pixels.
pub(super) const KEYPOINT_CELL: f32 = 4.0;

/// Cells on either side that normals are gathered from: about as far as a patch is wide.
pub(super) const NORMALS_AROUND: i32 = 2;

/// Cells on either side of which none is more of a corner: few more keypoints than corners, so that noise takes none away.
pub(super) const KEYPOINTS_APART: i32 = 1;

/// Least third eigenvalue of the sum of `n n'` over the pixels around a corner.
pub(super) const LEAST_CORNER: f64 = 4.0;

/// Keypoints, at most: those with most surface of a third direction.
pub(super) const MOST_KEYPOINTS: usize = 4000;

/// Side of the cells of a descriptor, pixels.
pub(super) const DESCRIPTOR_CELL: f32 = 8.0;

/// Keypoints whose invariant numbers are nearest, of which all turns are compared.
pub(super) const COMPARED_KEYPOINTS: usize = 96;

/// Least product of two descriptors, of unit length, that count as similar.
pub(super) const ALIKE: f32 = 0.75;

/// How much less the product of another turn may be than that of the best, of things that are symmetric.
pub(super) const SYMMETRY_MARGIN: f32 = 0.03;

/// Matches that are kept of a keypoint: so many that are most similar ...
pub(super) const BEST_MATCHES: usize = 4;

/// ... and so many of the first in the order of sources, so that all that recurs points to the same sources.
pub(super) const FIRST_MATCHES: usize = 8;

/// Side of the cells of shifts that votes are counted in, pixels.
pub(super) const SHIFT_CELL: f32 = 6.0;

/// Keypoints that must agree.
pub(super) const LEAST_VOTES: usize = 4;

/// Motions that are tried, at most: those with most votes.
pub(super) const MOST_MOTIONS: usize = 40;

/// How far from keypoints the surface is aligned, pixels: what their descriptors cover.
pub(super) const ALIGNED_REACH: f32 = 24.0;

/// Keypoints whose surface is aligned, at most.
pub(super) const ALIGNED_KEYPOINTS: usize = 32;

/// Pixels that are aligned, at most.
pub(super) const ALIGNED_PIXELS: usize = 500;

/// Distances within which surfaces are paired, pixels, round by round.
pub(super) const PAIRED: [f32; 8] = [8.0, 6.0, 4.5, 3.5, 3.0, 2.5, 2.0, 2.0];

/// Pull to the angle and shift at hand, pixels that count as staying: along an edge nothing else would hold.
pub(super) const PULL: f64 = 0.5;

/// Least share of the pixels that must lie on the surface in the end, within the last distance.
pub(super) const LEAST_ALIGNED: f64 = 0.5;

/// Distances beyond this count as this, pixels: what is not described at all.
pub(super) const FARTHEST: f32 = 4.0;

/// Side of the coarse cells, pixels: a quick test whether any surface is near.
pub(super) const NEAR_CELL: f32 = 4.0;

/// Samples of a patch that are compared, at most: of a patch of 8 x 8 pixels nearly one per pixel.
pub(super) const COMPARED_SAMPLES: usize = 48;

/// What a label that differs costs, bits: about what coding it where no neighbour has it takes.
pub(super) const LABEL_BITS: f32 = 8.0;

/// Pixels of a patch by which it is decided whether all are compared.
pub(super) const PROBED_PIXELS: usize = 6;

/// How many of these must have surface near.
pub(super) const LEAST_PROBED: usize = 4;

/// Samples of a patch by which it is decided whether the others are compared.
pub(super) const FIRST_SAMPLES: usize = 8;

/// How much a difference in error counts. Whether a patch or what stands for it is a little nearer to the scan is mostly
/// chance. With 1 a fifth of the patches of an exact copy stay coded for it; with a half six copies of a room decode to 1
/// percent more error.
pub(super) const ERROR_SHARE: f32 = 0.5;

/// Side of the regions in which patches are left out together, pixels.
pub(super) const REGION: f32 = 24.0;

/// Share of its bits by which more must be won of a patch whose surroundings do not recur.
pub(super) const OWN_MARGIN: f32 = 0.5;

/// Share of the bits around a patch that must go with one motion for the patch to go with it too.
pub(super) const SPREAD_SHARE: f32 = 0.6;

/// Samples by which it is measured how well copies are described by the first.
pub(super) const MISFIT_SAMPLES: usize = 100_000;

/// Errors of a surface with copies count as this power of how many times as much copies miss the first as themselves, and at most once
/// for each. Of rooms scanned ten times it gives the error of the model without instances, within 0.2 percent (13.34 and 13.32 mm;
/// 13.80 with power 0), of six scans of a room 2.6 percent more (12.47 and 12.15 mm; 13.01 with 0 for 15 percent fewer bytes).
pub(super) const MISFIT_POWER: i32 = 4;

/// How near a sample must come to one that stays, pixels, to be taken there: it or a neighbour in cells of this side.
pub(super) const FOLD_CELL: f32 = 1.5;

/// Side of the cells in which it is asked which copies are there, pixels.
pub(super) const COPIES_CELL: f32 = 4.0;

/// Side of the cells of each of which one of the copies is learned of, pixels.
pub(super) const CHOSEN_CELL: f32 = 1.0;

/// What it is worth, bits, that a patch of a region goes with the others.
pub(super) const FLAG_BITS: f32 = 4.0;

/// How far from the surface samples still go where it goes, pixels.
pub(super) const FOLD_REACH: f32 = 16.0;

/// What a sample further than the tolerance costs, bits: a point beside the patches takes about ten, and stands for several.
pub(super) const FAR_BITS: f32 = 3.0;

/// Least share of the samples of a patch that a source describes; others are not needed for it.
pub(super) const LEAST_DESCRIBED: f32 = 0.1;

/// Bits of an instance beside its patches: place and box.
pub(super) const INSTANCE_BITS: f32 = 110.0;

/// Bits that encode where a run of patches of an instance begins and ends in the order of the file.
pub(super) const RUN_BITS: f32 = 8.0;

/// A motion that many patches go with is taken where it wins at least this share of the best.
pub(super) const LEAST_OF_BEST: f32 = 0.8;

/// How often every motion is tried to do without, at most.
pub(super) const REMOVAL_ROUNDS: usize = 3;

/// Largest share of the bytes of a model without instances that one with them may take: 1 percent less error costs about 4 percent of the
/// bytes, and what is given again has 0 to 3 percent more error. A single room would take 0.7 percent fewer bytes at 1.6 percent more
/// error, and of colour 9.
pub(super) const WORTH: f64 = 0.9;

// Tiles.

/// Side of a tile where it is not given, finest pixels: 15 m at 1 cm. Small tiles take more bytes, since all adaptive models
/// start afresh in each: 24 percent more with 64 pixels (`docs/benchmarks/tiles.md`).
pub(super) const TILE_SIDE: i32 = 1536;

/// Least side of a tile in squares of the coarsest level: with less the margin is larger than the tile.
pub(super) const LEAST_TILE_SQUARES: i32 = 4;

/// Finest pixels on either side of a border in which surfaces along it count: so far apart squares of the coarsest level are.
pub(super) const BESIDE_BORDER: i32 = 16;

/// The margin of a tile in squares of the coarsest level: a sheet covers one of them, and its depth rises by no more than
/// 1.25 pixels per pixel where it is thin.
pub(super) const MARGIN_SQUARES: i32 = 2;

/// The rest of the margin, finest pixels: normals, and the votes for sides, reach as far.
pub(super) const MARGIN_PIXELS: i32 = 16;
