//! Which positions are near to what patches decode to as measured, without decoding these.

use std::ops::Range;

use surfabet_geom::{Aabb, BoxTree, arrange};

use super::{Decoder, Grid, layer_offset};
use crate::contract::DecodeOptions;
use crate::error::Result;
use crate::patches::axes::to_axes;
use crate::patches::instances::Motion;
use crate::patches::model::Lattice;
use crate::patches::sheets::axes_of;
use crate::patches::surface::leaf::Leaf;
use crate::patches::tiles::ROUNDING;

/// A patch, and where it is an instance's the motion to where it stands.
pub(in crate::patches) type PlacedPatch<'a> = (&'a Leaf, Option<&'a Motion>);

/// Patches, some of them moved, and how near to them a position has to be.
pub(in crate::patches) struct MeasuredReach<'a> {
    decoder: Decoder<'static>,
    /// In the order of the tree.
    patches: Vec<PlacedPatch<'a>>,
    /// Boxes around the patches, pixels.
    tree: BoxTree<Aabb>,
    rotation: [[f64; 3]; 3],
    /// Pixels.
    limit: f64,
}

/// What one asker found, position after position: the next is often near the same patch.
#[derive(Default)]
pub(in crate::patches) struct LastFound {
    /// The patches whose boxes are near the position.
    hits: Vec<u32>,
    /// The patch that the last position was near to.
    near: Option<usize>,
}

impl<'a> MeasuredReach<'a> {
    /// For positions within `limit` (metres) of the points that the patches decode to at the spacing that a model is made for.
    ///
    /// # Errors
    /// None for a lattice of a model.
    pub fn new(
        lattice: Lattice,
        patches: impl Iterator<Item = PlacedPatch<'a>>,
        limit: f64,
    ) -> Result<Self> {
        let options = DecodeOptions { as_measured: true, ..DecodeOptions::default() };
        let unordered: Vec<_> = patches.collect();
        let boxes: Vec<Aabb> = unordered
            .iter()
            .map(|(leaf, motion)| {
                let bounds = leaf.bounds(&lattice);
                let [low, high] = motion.map_or(bounds, |motion| motion.of_bounds(bounds));
                let single = |c: f64| c as f32;
                Aabb {
                    low: low.map(|c| single(c - ROUNDING)),
                    high: high.map(|c| single(c + ROUNDING)),
                }
            })
            .collect();
        let middles: Vec<[f32; 3]> = boxes.iter().map(|b| b.middle().0.map(|c| c as f32)).collect();
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        arrange(&mut order, &middles, 1);
        Ok(Self {
            decoder: Decoder::new(lattice, [], 0, options)?,
            patches: order.iter().map(|&i| unordered[i as usize]).collect(),
            tree: BoxTree::new(order.iter().map(|&i| boxes[i as usize]).collect()),
            rotation: lattice.orientation.rotation(),
            limit: limit / lattice.pixel_size,
        })
    }

    /// Whether a position (metres about the origin) is near a decoded point. The answer does not depend on `last`.
    pub fn is_near(&self, position: [f32; 3], last: &mut LastFound) -> bool {
        let p = to_axes(&self.rotation, position).map(|c| c / self.decoder.lattice.pixel_size);
        let is_near = |i: &usize| self.is_near_patch(*i, p);
        if last.near.as_ref().is_some_and(is_near) {
            return true;
        }
        let single = p.map(|c| c as f32);
        let squared_limit = self.limit * self.limit;
        let hits = |b: &Aabb| f64::from(b.squared_distance(single)) <= squared_limit;
        last.hits.clear();
        self.tree.leaves_where(hits, &mut last.hits);
        last.near = last.hits.iter().map(|&i| i as usize).find(is_near);
        last.near.is_some()
    }

    fn is_near_patch(&self, i: usize, p: [f64; 3]) -> bool {
        let (leaf, motion) = self.patches[i];
        let p = motion.map_or(p, |motion| motion.exact_source_of(p));
        let grid = &self.decoder.grids[leaf.level as usize];
        let [d, u, v] = axes_of(leaf.side);
        let at = [p[u] - f64::from(leaf.corner[0]), p[v] - f64::from(leaf.corner[1])];
        let is_near = |sample: [usize; 2]| self.is_near_sample(leaf, grid, sample, at, p[d]);
        let [columns, rows] = at.map(|c| self.samples_near(grid, c));
        if columns.is_empty() || rows.is_empty() {
            return false;
        }
        // The samples about the middle one are nearest, and of most positions it is near.
        let middle = |range: &Range<usize>| range.start.midpoint(range.end - 1);
        is_near([middle(&columns), middle(&rows)])
            || rows.into_iter().any(|row| columns.clone().any(|column| is_near([column, row])))
    }

    /// The samples along a side of a patch that are no further than the limit from a place along it.
    fn samples_near(&self, grid: &Grid, at: f64) -> Range<usize> {
        let first = grid.at.partition_point(|&c| f64::from(c) < at - self.limit);
        let end = grid.at.partition_point(|&c| f64::from(c) <= at + self.limit);
        first..end
    }

    /// Whether a place over a patch is near one of the layers of a sample.
    fn is_near_sample(
        &self,
        leaf: &Leaf,
        grid: &Grid,
        sample: [usize; 2],
        at: [f64; 2],
        depth: f64,
    ) -> bool {
        if leaf.patch.mask >> grid.pixel(sample) & 1 == 0 {
            return false;
        }
        let above = depth - f64::from(self.decoder.depth(leaf, grid, sample));
        let (layers, half) = (self.decoder.layers(leaf), leaf.patch.half_thickness());
        // The layers lie evenly from -half to half.
        let place = (above / f64::from(half.max(f32::MIN_POSITIVE)) + 1.0) * 0.5 * layers as f64;
        let layer = (place.max(0.0) as usize).min(layers - 1);
        let off = [
            at[0] - f64::from(grid.at[sample[0]]),
            at[1] - f64::from(grid.at[sample[1]]),
            above - f64::from(layer_offset(half, layer, layers)),
        ];
        off.iter().map(|c| c * c).sum::<f64>() <= self.limit * self.limit
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_geom::{KdTree, Silent};

    use super::*;
    use crate::patches::coding::Geometry;
    use crate::patches::instances::Place;
    use crate::patches::model::Attributes;
    use crate::patches::model::LatticePatch;
    use crate::patches::{Orientation, PatchModel};

    const LATTICE: Lattice = Lattice {
        origin: [0.0; 3],
        orientation: Orientation { quaternion: [1 << 19, 1 << 17, 0, 0] },
        pixel_size: 0.02,
        levels: 2,
        depth_step: 12,
    };

    prop_compose! {
        fn leaf()(
            side in 0..6_u8, level in 0..2_u32, u in -2..2_i32, v in -2..2_i32, mask in 1..u64::MAX,
            depth in -20..20_i32, tilt in -9..9_i32, bend in -5..5_i32, thickness in 0..12_u8,
        ) -> Leaf {
            let mut patch = LatticePatch { mask, thickness, ..LatticePatch::default() };
            (patch.coefficients[0], patch.coefficients[1], patch.coefficients[4]) = (depth, tilt, bend);
            let width = LATTICE.patch_width(level);
            Leaf { side, level, corner: [u * width, v * width], patch }
        }
    }

    proptest! {
        #[test]
        fn positions_are_near_where_the_decoded_cloud_is(
            leaves in prop::collection::vec(leaf(), 1..6),
            positions in prop::collection::vec(prop::array::uniform3(-0.6_f32..0.6), 50),
            limit in 0.005..0.06_f64,
        ) {
            let geometry = Geometry { sheets: Vec::new(), leaves: leaves.clone() };
            let model = PatchModel::new(1, LATTICE, geometry, Attributes::default()).unwrap();
            let options = DecodeOptions { as_measured: true, ..DecodeOptions::default() };
            let tree = KdTree::new(model.decode(options, &Silent).unwrap().positions()).unwrap();
            let reach = MeasuredReach::new(LATTICE, leaves.iter().map(|leaf| (leaf, None)), limit).unwrap();
            let mut last = LastFound::default();
            for p in positions {
                let distance = f64::from(tree.nearest(p).unwrap().squared_distance()).sqrt();
                let decided = (distance - limit).abs() > 1e-5;
                prop_assert!(!decided || reach.is_near(p, &mut last) == (distance < limit));
            }
        }

        #[test]
        fn what_a_motion_moves_is_near_where_it_goes(
            leaf in leaf(), p in prop::array::uniform3(-12.0_f32..12.0), quarters in 0..4_u8, shift in -9..9_i32,
        ) {
            let place = Place { quarters, shift: [shift, -shift, 2 * shift], ..Place::default() };
            let motion = Motion::new(place, 2);
            let rotation = super::super::Rotation::of(LATTICE);
            let metres = |p: [f32; 3]| rotation.of_positions(vec![p])[0];
            let reach = |motion| MeasuredReach::new(LATTICE, [(&leaf, motion)].into_iter(), 0.05).unwrap();
            let of_source = reach(None).is_near(metres(p), &mut LastFound::default());
            let moved = metres(motion.of_position(p));
            prop_assert_eq!(reach(Some(&motion)).is_near(moved, &mut LastFound::default()), of_source);
        }
    }
}
