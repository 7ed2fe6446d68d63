//! The points that planes are learned from: distinct, weighted, along a space-filling curve, in a tree of boxes.

use std::ops::Range;

use surfabet_base::parallel;
use surfabet_geom::{Aabb, BoxTree, Moments, PointCloud, boxes_of, morton};

use super::constants::SPACING_POINTS;
use crate::error::{Error, Result};
use crate::vector::dot;

/// Points per leaf of the tree of boxes.
pub(super) const BLOCK: usize = 64;

/// The distinct points of a cloud.
#[derive(Debug, Clone)]
pub struct Points {
    /// World position of the local zero, metres.
    pub(super) origin: [f64; 3],
    /// Positions about the origin along a Morton curve, metres.
    pub(super) positions: Vec<[f32; 3]>,
    /// Sum of the weights of the input points at each position.
    pub(super) weights: Vec<f32>,
    /// Unit vectors towards the side that each was seen from; zero where unknown.
    pub(super) facing: Option<Vec<[f32; 3]>>,
    /// The distinct point that each input point is.
    pub(super) place: Vec<u32>,
    /// Morton codes of the positions.
    pub(super) codes: Vec<u64>,
    /// Side of the smallest cell of the curve, metres.
    pub(super) cell: f64,
    /// Median spacing of the points, metres.
    pub(super) spacing: f64,
    /// Median distance between scan lines, metres, where the points lie on such.
    pub(super) line_spacing: Option<f64>,
    /// Boxes, level by level: leaves of [`BLOCK`] points first, each box above holds two below.
    boxes: BoxTree<Aabb>,
}

impl Points {
    /// Sorts the points of a cloud; `weights` are by how much each counts, one if `None`. Where each was seen from is not
    /// known: see [`Points::facing_as`].
    ///
    /// # Errors
    /// [`Error::EmptyCloud`]; [`Error::InvalidParameter`] for weights that are not one per point, finite and not
    /// negative, or all zero.
    pub fn new(cloud: &PointCloud, weights: Option<&[f32]>) -> Result<Self> {
        let (low, high) = cloud.bounds().ok_or(Error::EmptyCloud)?;
        let origin = std::array::from_fn(|a| (0.5 * (low[a] + high[a])).round());
        Self::sorted(cloud, weights, origin)
    }

    /// The points about a given origin.
    pub(super) fn about(cloud: &PointCloud, origin: [f64; 3]) -> Result<Self> {
        Self::sorted(cloud, None, origin)
    }

    fn sorted(cloud: &PointCloud, weights: Option<&[f32]>, origin: [f64; 3]) -> Result<Self> {
        let (low, high) = cloud.bounds().ok_or(Error::EmptyCloud)?;
        check_weights(cloud.len(), weights)?;
        let input = cloud.positions_about(origin);
        let extent = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        let cells = (1_u64 << morton::BITS) as f64;
        // A cell more than fits, so that the largest coordinate is inside after rounding.
        let cell = (extent / (cells - 2.0)).max(f64::MIN_POSITIVE.sqrt());
        let code = |p: &[f32; 3]| {
            morton::encode(std::array::from_fn(|a| {
                (((f64::from(p[a]) + origin[a] - low[a]) / cell).max(0.0)) as u64
            }))
        };
        // Zero is one place, whatever its sign.
        let bits = |i: u32| input[i as usize].map(|c| (c + 0.0).to_bits());
        let mut order = vec![(0_u64, 0_u32); input.len()];
        parallel::for_each_mut(&mut order, |i, at| *at = (code(&input[i]), i as u32));
        parallel::sort_keyed(&mut order);
        for cell in order.chunk_by_mut(|a, b| a.0 == b.0).filter(|cell| cell.len() > 1) {
            cell.sort_unstable_by_key(|&(_, i)| (bits(i), i));
        }
        let mut points = Self {
            origin,
            positions: Vec::with_capacity(order.len()),
            weights: Vec::with_capacity(order.len()),
            facing: None,
            place: vec![0; order.len()],
            codes: Vec::with_capacity(order.len()),
            cell,
            spacing: 0.0,
            line_spacing: None,
            boxes: BoxTree::new(Vec::new()),
        };
        let mut last = None;
        for (code, i) in order {
            let weight = weights.map_or(1.0, |w| w[i as usize]);
            let bits = bits(i);
            if last != Some(bits) {
                last = Some(bits);
                points.positions.push(bits.map(f32::from_bits));
                points.weights.push(0.0);
                points.codes.push(code);
            }
            let at = points.positions.len() - 1;
            points.weights[at] += weight;
            points.place[i as usize] = at as u32;
        }
        points.spacing = points.median_spacing();
        points.boxes = BoxTree::new(boxes_of(&points.positions, BLOCK));
        Ok(points)
    }

    /// The same points of `cloud`, with the side that each was seen from; of several at one place the first counts. Only for
    /// clouds of which it is known which way surfaces face ([`surfabet_geom::has_facings`]).
    #[must_use]
    pub fn facing_as(mut self, cloud: &PointCloud) -> Self {
        self.facing = cloud.facing().map(|of| {
            let mut facing = vec![[0.0; 3]; self.len()];
            for (&at, &direction) in self.place.iter().zip(&of).rev() {
                facing[at as usize] = direction;
            }
            facing
        });
        self
    }

    /// The same points, known to lie on scan lines this far apart, metres, or on none.
    #[must_use]
    pub fn on_lines(self, line_spacing: Option<f64>) -> Self {
        Self { line_spacing, ..self }
    }

    /// Number of distinct points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Never true: a cloud without points is refused.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// World position of the local zero, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Median spacing of the points, metres.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// What is smaller than this may have no points, metres: the spacing of points or of scan lines.
    pub(super) fn resolution(&self) -> f64 {
        self.line_spacing.map_or(self.spacing, |lines| lines.max(self.spacing))
    }

    /// Points that were seen from the side of `normal`, or from nowhere known, and those that were seen from the other.
    pub(super) fn sides(&self, members: &[u32], normal: [f64; 3]) -> [Vec<u32>; 2] {
        let Some(facing) = &self.facing else { return [members.to_vec(), Vec::new()] };
        let (away, towards) =
            members.iter().partition(|&&i| dot(facing[i as usize].map(f64::from), normal) < 0.0);
        [towards, away]
    }

    /// Largest side of the bounding box, metres.
    pub(super) fn extent(&self) -> f64 {
        let (_, half) = self.boxes.root().unwrap_or(&Aabb::EMPTY).middle();
        2.0 * half.into_iter().fold(0.0, f64::max)
    }

    /// Number of blocks of consecutive points.
    pub(super) fn n_blocks(&self) -> usize {
        self.positions.len().div_ceil(BLOCK)
    }

    /// The points of a block.
    pub(super) fn block(&self, b: usize) -> Range<usize> {
        b * BLOCK..((b + 1) * BLOCK).min(self.positions.len())
    }

    /// Blocks of which `hits` lets the box and all boxes around it pass, in order.
    pub(super) fn blocks_where(&self, hits: impl Fn(&Aabb) -> bool, found: &mut Vec<u32>) {
        self.boxes.leaves_where(hits, found);
    }

    /// Consecutive points that share a cell of side `cell * 2^level`.
    pub(super) fn cells(&self, level: u32) -> impl Iterator<Item = Range<usize>> {
        let mut start = 0;
        let key = move |code: u64| code >> (3 * level);
        std::iter::from_fn(move || {
            let first = key(*self.codes.get(start)?);
            let more = self.codes[start..].iter().take_while(|&&c| key(c) == first).count();
            let range = start..start + more;
            start += more;
            Some(range)
        })
    }

    /// Number of cells that points occupy on each level, finest first.
    pub(super) fn occupied(&self) -> [usize; morton::BITS as usize + 1] {
        let mut parted = [0_usize; morton::BITS as usize + 1];
        for pair in self.codes.windows(2) {
            // The lowest level on which both are in one cell.
            let shared = (u64::BITS - (pair[0] ^ pair[1]).leading_zeros()).div_ceil(3);
            parted[shared as usize] += 1;
        }
        let mut left = self.codes.len();
        std::array::from_fn(|level| {
            left -= parted[level];
            left
        })
    }

    /// The finest level on which an occupied cell holds `count` points on average.
    pub(super) fn level_with(&self, count: usize) -> u32 {
        let occupied = self.occupied();
        let fits = |&n: &usize| n * count <= self.len();
        occupied.iter().position(fits).unwrap_or(morton::BITS as usize) as u32
    }

    /// Side of a cell of a level, metres.
    pub(super) fn side(&self, level: u32) -> f64 {
        self.cell * f64::from(level).exp2()
    }

    /// Median over all points of the spacing in their cells, as if these were filled by a surface.
    fn median_spacing(&self) -> f64 {
        let level = self.level_with(SPACING_POINTS);
        let mut counts: Vec<usize> = self.cells(level).map(|c| c.len()).collect();
        counts.sort_unstable();
        let mut seen = 0;
        for n in counts {
            seen += n;
            if 2 * seen >= self.len() {
                return self.side(level) / (n as f64).sqrt();
            }
        }
        self.side(level)
    }

    /// Moments of consecutive points, with their weights.
    pub(super) fn moments(&self, range: Range<usize>) -> Moments {
        let Some(center) = self.positions.get(range.start).copied() else {
            return Moments::new();
        };
        self.moments_about(center.map(f64::from), range.map(|i| (i as u32, 1.0)))
    }

    /// Moments of some points about the origin, computed near `center`; each with a share of its weight.
    pub(super) fn moments_about(
        &self,
        center: [f64; 3],
        points: impl IntoIterator<Item = (u32, f32)>,
    ) -> Moments {
        let offsets = points.into_iter().map(|(i, share)| {
            let p = self.positions[i as usize];
            let offset = std::array::from_fn(|a| (f64::from(p[a]) - center[a]) as f32);
            (offset, share * self.weights[i as usize])
        });
        Moments::of_offsets(offsets).shifted(center)
    }

    /// Weight of some points, each with a share of its own.
    pub(super) fn weight_of(&self, points: impl IntoIterator<Item = (u32, f32)>) -> f64 {
        points.into_iter().map(|(i, share)| f64::from(share * self.weights[i as usize])).sum()
    }
}

pub(super) fn check_weights(len: usize, weights: Option<&[f32]>) -> Result<()> {
    let Some(weights) = weights else { return Ok(()) };
    if weights.len() != len {
        let given = format!("{} values for {len} points", weights.len());
        return Err(Error::invalid("weights", given, "one per point"));
    }
    if let Some(bad) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
        return Err(Error::invalid("weights", bad, "finite and not negative"));
    }
    if weights.iter().all(|&w| w == 0.0) {
        return Err(Error::invalid("weights", "0 everywhere", "positive for some point"));
    }
    Ok(())
}
