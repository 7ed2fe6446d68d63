//! Points beside the patches that an instance gives again: where something recurs exactly, so does what its patches leave out.

use std::collections::BTreeSet;

use surfabet_base::parallel;
use surfabet_geom::KdTree;

use super::instances::Motion;
use super::instances::order::place_in_order;
use super::model::{PatchModel, extra_key};
use super::samples::{rotate, rows_of};
use crate::error::Result;
use crate::vector::squared_distance;

/// Points that an instance must make up for: what fewer save its box takes.
const LEAST: usize = 16;

/// Share of the limit that rounding leaves.
const WITHIN: f64 = 0.999;

/// Leaves out points beside the patches where an instance of others is as near to the input: `far` are the input points that
/// the model's points stand for, metres about the origin, each of them to be within `limit` of a point.
///
/// # Errors
/// None that follow from the input: points of a model are finite.
pub(super) fn with_shared_points(
    model: PatchModel,
    far: &[[f32; 3]],
    limit: f64,
) -> Result<PatchModel> {
    let motions = model.instances().motions();
    if motions.is_empty() || model.header().n_extra == 0 {
        return Ok(model);
    }
    let points = WeighedPoints::new(&model, far, WITHIN * limit)?;
    let first = points.shared(&motions);
    // Again without the instances that make up for too few.
    let used: Vec<bool> = first.of_instances.iter().map(|of| of.len() >= LEAST).collect();
    let motions: Vec<Option<&Motion>> =
        motions.iter().zip(used).map(|(motion, used)| used.then_some(motion)).collect();
    let Shared { kept, of_instances } = points.shared_by(&motions);
    let mut numbers = vec![0; kept.len()];
    let mut n = 0;
    for (number, &kept) in numbers.iter_mut().zip(&kept) {
        *number = n;
        n += u32::from(kept);
    }
    let (keys, _) = model.extra();
    let keys = keys.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(&key, _)| key).collect();
    let renumbered = |of: BTreeSet<u32>| of.into_iter().map(|i| numbers[i as usize]).collect();
    let of_instances = of_instances.into_iter().map(renumbered).collect();
    Ok(model.with_shared_extra(keys, of_instances))
}

/// Points beside the patches with the input that they stand for; all in pixels of the lattice.
struct WeighedPoints {
    middles: Vec<[f32; 3]>,
    tree: KdTree,
    /// The input that each stands for.
    input: Vec<Vec<[f32; 3]>>,
    /// Their numbers in the order of sources.
    order: Vec<u32>,
    /// Largest squared distance from the input to a point.
    limit: f32,
}

/// Which points are coded, and which of these each instance gives again.
struct Shared {
    kept: Vec<bool>,
    of_instances: Vec<BTreeSet<u32>>,
}

impl WeighedPoints {
    fn new(model: &PatchModel, far: &[[f32; 3]], limit: f64) -> Result<Self> {
        let lattice = model.lattice();
        let pixel = lattice.pixel_size as f32;
        let (keys, size) = model.extra();
        let rows = rows_of(&lattice);
        let middles: Vec<[f32; 3]> =
            model.points().into_iter().map(|p| p.map(|c| c / pixel)).collect();
        let tree = KdTree::new(&middles)?;
        let limit = (limit / lattice.pixel_size).powi(2) as f32;
        // The point of its own cell stands for input, or where there is none, the nearest one.
        let stands_for = |&p: &[f32; 3]| {
            let p = rotate(&rows, p);
            let own = keys.binary_search(&extra_key(p, size)).ok();
            let p = p.map(|c| c / pixel);
            let near = |&i: &usize| squared_distance(middles[i], p) <= limit;
            let nearest = || tree.nearest(p).map(|found| found.index()).filter(near);
            own.or_else(nearest).map(|i| (i, p))
        };
        let mut input = vec![Vec::new(); middles.len()];
        for (i, p) in parallel::map(far, stands_for).into_iter().flatten() {
            input[i].push(p);
        }
        let place = |i: u32| place_in_order(middles[i as usize]);
        let mut order: Vec<u32> = (0..middles.len() as u32).collect();
        order.sort_by(|&a, &b| place(a).total_cmp(&place(b)).then(a.cmp(&b)));
        Ok(Self { tree, middles, input, order, limit })
    }

    fn shared(&self, motions: &[Motion]) -> Shared {
        self.shared_by(&motions.iter().map(Some).collect::<Vec<_>>())
    }

    /// Leaves points out one after another: what makes up for one comes before it, and stays.
    fn shared_by(&self, motions: &[Option<&Motion>]) -> Shared {
        let mut kept = vec![true; self.middles.len()];
        let mut of_instances = vec![BTreeSet::new(); motions.len()];
        for &i in &self.order {
            for (motion, of_instance) in motions.iter().zip(&mut of_instances) {
                let Some(sources) = motion.and_then(|motion| self.sources(i, motion, &kept)) else {
                    continue;
                };
                of_instance.extend(sources);
                kept[i as usize] = false;
                break;
            }
        }
        Shared { kept, of_instances }
    }

    /// The points that, moved, are near to all input that a point stands for; `None` where there are none before it.
    fn sources(&self, point: u32, motion: &Motion, kept: &[bool]) -> Option<Vec<u32>> {
        let input = &self.input[point as usize];
        let before = place_in_order(self.middles[point as usize]);
        let source = |&p: &[f32; 3]| {
            let source = self.tree.nearest(motion.source_of(p))?.index();
            let middle = self.middles[source];
            let is_near = squared_distance(motion.of_position(middle), p) <= self.limit;
            let is_there = kept[source] && place_in_order(middle) < before;
            (is_near && is_there).then_some(source as u32)
        };
        if input.is_empty() { None } else { input.iter().map(source).collect() }
    }
}
