//! The surface of a model as its finest pixels, and how well it describes what is somewhere.

use surfabet_base::parallel;
use surfabet_geom::KdTree;
use surfabet_geom::cells::{cell_of, key};
use surfabet_geom::morton::MortonMap;

use crate::error::Result;
use crate::patches::constants::{DECODED_WEIGHT, FARTHEST, NEAR_CELL, THIN_WEIGHT};
use crate::patches::model::Lattice;
use crate::patches::sheets::axes_of;
use crate::patches::surface::basis::{Basis, DEGREES, N_SHAPES, derivative, value};
use crate::patches::surface::leaf::Leaf;

/// The set finest pixels of all patches. All lengths are in finest pixels, in the frame of the lattice.
pub(super) struct SurfacePixels<'a> {
    pub leaves: &'a [Leaf],
    /// Middles of the pixels, patch by patch.
    pub middles: Vec<[f32; 3]>,
    /// The patch of each pixel.
    pub owners: Vec<u32>,
    /// Where the pixels of each patch begin; one more than there are patches.
    pub starts: Vec<usize>,
    /// Slope of each patch at its middle, along columns and rows.
    slopes: Vec<[f32; 2]>,
    tree: KdTree,
    /// Coarse cells that hold pixels, and those around them.
    near: MortonMap<()>,
}

/// What is nearest to a position.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest {
    /// Number of the pixel.
    pub pixel: usize,
    /// The position less the surface at the pixel, along its depth.
    off: f32,
    /// Squared distance of the position from the square of the pixel, across its depth.
    beside: f32,
}

impl<'a> SurfacePixels<'a> {
    /// Of patches with at least a pixel each; `None` without patches.
    pub fn new(lattice: &Lattice, leaves: &'a [Leaf]) -> Result<Option<Self>> {
        if leaves.is_empty() {
            return Ok(None);
        }
        let bases = Basis::of_levels(lattice.levels);
        let of_leaves: Vec<Vec<[f32; 3]>> =
            parallel::map(leaves, |leaf| leaf.pixels(lattice, &bases).collect());
        let mut starts = vec![0];
        let (mut middles, mut owners) = (Vec::new(), Vec::new());
        for (i, pixels) in (0..).zip(of_leaves) {
            middles.extend(pixels);
            owners.resize(middles.len(), i);
            starts.push(middles.len());
        }
        let mut near = MortonMap::default();
        let mut coarse: Vec<[i32; 3]> = middles.iter().map(|&p| cell_of(p, NEAR_CELL)).collect();
        coarse.sort_unstable();
        coarse.dedup();
        for cell in coarse {
            near.extend(surfabet_geom::cells::around(cell).map(|cell| (key(cell), ())));
        }
        Ok(Some(Self {
            leaves,
            tree: KdTree::new(&middles)?,
            middles,
            owners,
            starts,
            slopes: leaves.iter().map(|leaf| slope_at_middle(leaf, lattice)).collect(),
            near,
        }))
    }

    /// Numbers of the pixels of a patch.
    pub fn pixels_of(&self, leaf: usize) -> std::ops::Range<usize> {
        self.starts[leaf]..self.starts[leaf + 1]
    }

    /// Unit normal of a patch at its middle.
    pub fn normal(&self, leaf: usize) -> [f32; 3] {
        let [d, u, v] = axes_of(self.leaves[leaf].side);
        let [su, sv] = self.slopes[leaf];
        let facing = if self.leaves[leaf].side.is_multiple_of(2) { 1.0 } else { -1.0 };
        let length = facing / (1.0 + su * su + sv * sv).sqrt();
        let mut normal = [0.0; 3];
        (normal[d], normal[u], normal[v]) = (length, -su * length, -sv * length);
        normal
    }

    /// False only where no pixel is nearer than the side of a coarse cell.
    pub fn may_be_near(&self, p: [f32; 3]) -> bool {
        self.near.contains_key(&key(cell_of(p, NEAR_CELL)))
    }

    /// The pixel nearest to a position, unless none is within reach.
    pub fn nearest(&self, p: [f32; 3]) -> Option<Nearest> {
        if !self.may_be_near(p) {
            return None;
        }
        let found = self.tree.nearest(p)?;
        if found.squared_distance() > (FARTHEST + 1.0).powi(2) {
            return None;
        }
        let pixel = found.index();
        let leaf = self.owners[pixel] as usize;
        let [d, u, v] = axes_of(self.leaves[leaf].side);
        let from: [f32; 3] = std::array::from_fn(|a| p[a] - self.middles[pixel][a]);
        let [su, sv] = self.slopes[leaf];
        // Beyond the square the surface is taken to end.
        let within = |c: f32| c.clamp(-0.5, 0.5);
        let off = from[d] - su * within(from[u]) - sv * within(from[v]);
        let beyond = |c: f32| (c.abs() - 0.5).max(0.0).powi(2);
        Some(Nearest { pixel, off, beside: beyond(from[u]) + beyond(from[v]) })
    }

    /// The patch of the pixel nearest to a position, unless none is within `reach`.
    pub fn owner(&self, p: [f32; 3], reach: f32) -> Option<u32> {
        let found = self.tree.nearest(p)?;
        (found.squared_distance() <= reach * reach).then(|| self.owners[found.index()])
    }

    /// Numbers of the pixels within `reach` of a position, growing.
    pub fn pixels_about(&self, p: [f32; 3], reach: f32) -> Vec<u32> {
        let mut found = Vec::new();
        self.tree.visit_within(p, reach, |near| found.push(near.index() as u32));
        found.sort_unstable();
        found
    }

    /// Distance of a position from the plane of the nearest pixel, and the normal of that plane; `None` where it is further
    /// than `reach` away.
    pub fn off_plane(&self, p: [f32; 3], reach: f32) -> Option<(f32, [f32; 3])> {
        let found = self.tree.nearest(p)?;
        if found.squared_distance() > reach * reach {
            return None;
        }
        let normal = self.normal(self.owners[found.index()] as usize);
        let middle = self.middles[found.index()];
        Some(((0..3).map(|a| normal[a] * (p[a] - middle[a])).sum(), normal))
    }

    /// Whether what is nearest to a sample is further than `reach` from it.
    pub fn is_far(&self, nearest: Option<Nearest>, reach: f32) -> bool {
        nearest.is_none_or(|Nearest { pixel, off, beside }| {
            let excess = (off.abs() - self.half(pixel)).max(0.0);
            beside + excess * excess > reach * reach
        })
    }

    /// Half thickness of the patch of a pixel.
    fn half(&self, pixel: usize) -> f32 {
        self.leaves[self.owners[pixel] as usize].patch.half_thickness()
    }

    /// What it costs, squared pixels, that a sample is described by what is nearest to it: the squared distance from the slab
    /// that is decoded, and a share of that from its middle.
    pub fn cost(&self, nearest: Option<Nearest>) -> f32 {
        let most = (1.0 + THIN_WEIGHT) * FARTHEST * FARTHEST;
        let Some(Nearest { pixel, off, beside }) = nearest else { return most };
        let excess = (off.abs() - self.half(pixel)).max(0.0);
        (beside + excess * excess + THIN_WEIGHT * off * off).min(most)
    }

    /// What it costs, squared pixels, that a slab of half thickness `half` is decoded about a position where what is nearest
    /// was seen: the mean squared distance of its points from the slab there, as often as errors of decoded points count.
    pub fn cost_of_decoded(&self, nearest: Option<Nearest>, half: f32) -> f32 {
        let most = DECODED_WEIGHT * FARTHEST * FARTHEST;
        let Some(Nearest { pixel, off, beside }) = nearest else { return most };
        let own = self.half(pixel);
        // Three layers stand for the slab.
        let layers = [-half, 0.0, half].map(|layer| {
            let excess = ((off + layer).abs() - own).max(0.0);
            excess * excess
        });
        (DECODED_WEIGHT * (beside + layers.iter().sum::<f32>() / 3.0)).min(most)
    }
}

/// Slope of the depth of a patch at its middle, along columns and rows.
fn slope_at_middle(leaf: &Leaf, lattice: &Lattice) -> [f32; 2] {
    let step =
        f64::from(lattice.depth_step) / 16.0 * 2.0 / f64::from(lattice.patch_width(leaf.level));
    let mut slope = [0.0; 2];
    for k in (1..N_SHAPES).filter(|&k| leaf.patch.coefficients[k] != 0) {
        let (i, j) = (usize::from(DEGREES[k].0), usize::from(DEGREES[k].1));
        let c = f64::from(leaf.patch.coefficients[k]) * step;
        slope[0] += c * derivative(i, 0.0) * value(j, 0.0);
        slope[1] += c * value(i, 0.0) * derivative(j, 0.0);
    }
    slope.map(|c| c as f32)
}
