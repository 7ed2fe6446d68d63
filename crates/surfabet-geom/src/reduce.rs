//! Fewer points: a number of them at random or far apart, and the cell size that gives a number of cells.

use std::ops::Range;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::box_tree::{BoxTree, Union, arrange};
use crate::boxes::Aabb;
use crate::cloud::PointCloud;
use crate::error::{Error, Result};
use crate::octree::Octree;
use crate::vector::squared_distance;
use crate::voxel_grid::VoxelGrid;
use surfabet_base::Progress;

/// Most cell sizes that are tried.
const MAX_TRIALS: usize = 40;

/// A number of cells is near enough from this share of the number asked for.
const NEAR_ENOUGH: f64 = 0.995;

/// Points per leaf of the tree of [`farthest_points`].
const LEAF: usize = 32;

/// Samples between two checks of the caller's wish to stop.
const BATCH: usize = 64;

/// Indices of `count` points of `len`, drawn at random without repetition, ascending.
///
/// # Errors
/// [`Error::InvalidParameter`] for more points than there are.
pub fn random_points(len: usize, count: usize, random_state: u64) -> Result<Vec<usize>> {
    check_count(len, count)?;
    let mut rng = ChaCha8Rng::seed_from_u64(random_state);
    let mut indices = rand::seq::index::sample(&mut rng, len, count).into_vec();
    indices.sort_unstable();
    Ok(indices)
}

fn check_count(len: usize, count: usize) -> Result<()> {
    if count > len {
        return Err(Error::invalid("count", count, "at most the number of points"));
    }
    Ok(())
}

/// Voxel grid with the smallest size found that has at most `count` voxels, and seldom less than 99.5 percent of
/// that unless there are fewer places.
///
/// # Errors
/// [`Error::InvalidParameter`] for a count of zero, or when no size has so few voxels: about the world's origin
/// even the largest ones are eight. [`Error::Cancelled`].
pub fn voxel_grid_with(
    cloud: &PointCloud,
    count: usize,
    progress: &dyn Progress,
) -> Result<VoxelGrid> {
    largest_within(cloud, count, |size| VoxelGrid::new(cloud, size, progress), VoxelGrid::len)
}

/// Octree with the smallest leaf size found that has at most `count` leaves, as [`voxel_grid_with`].
///
/// # Errors
/// As [`voxel_grid_with`].
pub fn octree_with(cloud: &PointCloud, count: usize, progress: &dyn Progress) -> Result<Octree> {
    let leaves = |tree: &Octree| tree.nodes(tree.depth()).map_or(0, |nodes| nodes.len());
    largest_within(cloud, count, |size| Octree::new(cloud, size, progress), leaves)
}

/// Of partitions made with a cell size, the one with the most cells that has at most `count`, by bisection.
fn largest_within<T>(
    cloud: &PointCloud,
    count: usize,
    make: impl Fn(f64) -> Result<T>,
    len: impl Fn(&T) -> usize,
) -> Result<T> {
    if count == 0 {
        return Err(Error::invalid("count", count, "at least 1"));
    }
    let extent = cloud
        .bounds()
        .map_or(0.0, |(low, high)| (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max));
    if cloud.is_empty() || extent == 0.0 {
        return make(1.0);
    }
    let mut size = extent * (3.0 / count as f64).sqrt().min(1.0);
    let (mut too_small, mut best): (Option<f64>, Option<(f64, T)>) = (None, None);
    for _ in 0..MAX_TRIALS {
        match make(size) {
            Ok(made) if len(&made) <= count => {
                let enough = len(&made) as f64 >= NEAR_ENOUGH * count as f64;
                best = Some((size, made));
                if enough {
                    break;
                }
            }
            // Too small to number the cells is too small.
            Ok(_) | Err(Error::InvalidParameter { .. }) => too_small = Some(size),
            Err(error) => return Err(error),
        }
        size = match (too_small, &best) {
            (Some(low), Some((high, _))) if high / low < 1.0 + 1e-6 => break,
            (Some(low), Some((high, _))) => (low * high).sqrt(),
            (Some(low), None) => 2.0 * low,
            (None, Some((high, _))) => 0.5 * high,
            (None, None) => break,
        };
    }
    best.map(|(_, made)| made)
        .ok_or_else(|| Error::invalid("count", count, "larger: no cell size gives so few cells"))
}

/// Indices of `count` points, each the farthest from all before it, beginning with point `start`; of equally far
/// ones the first (Eldar et al. 1997).
///
/// Exact: boxes of points, none of which a new sample can be nearer to than its own, are passed over.
///
/// # Errors
/// [`Error::InvalidParameter`] for more points than there are, or a start that is not the index of a point; [`Error::Cancelled`].
pub fn farthest_points(
    positions: &[[f32; 3]],
    count: usize,
    start: usize,
    progress: &dyn Progress,
) -> Result<Vec<usize>> {
    check_count(positions.len(), count)?;
    if count == 0 {
        return Ok(Vec::new());
    }
    if start >= positions.len() {
        return Err(Error::IndexOutOfRange { name: "start", index: start, len: positions.len() });
    }
    if positions.len() >= u32::MAX as usize {
        return Err(Error::invalid("number of points", positions.len(), "below 4294967295"));
    }
    let mut tree = FarTree::new(positions);
    let mut found = Vec::with_capacity(count);
    let mut next = start;
    while found.len() < count {
        if found.len() % BATCH == 0 {
            progress.check()?;
            progress.update("farthest points", found.len() as f32 / count as f32);
        }
        found.push(next);
        tree.take(next);
        next = tree.farthest();
    }
    Ok(found)
}

/// A point's distance to the samples, above its index turned round, so that the first of equal ones is largest;
/// zero for the samples themselves.
fn far_key(squared_distance: f32, index: u32) -> u64 {
    u64::from(squared_distance.to_bits()) << 32 | u64::from(u32::MAX - index)
}

/// A box of points with the largest key of those in it.
#[derive(Debug, Clone, Copy)]
struct Far {
    aabb: Aabb,
    key: u64,
}

impl Union for Far {
    fn union(self, other: Self) -> Self {
        Self { aabb: self.aabb.union(other.aabb), key: self.key.max(other.key) }
    }
}

struct FarTree {
    /// Over runs of [`LEAF`] points.
    boxes: BoxTree<Far>,
    /// Points in the order of the leaves.
    points: Vec<([f32; 3], u32)>,
    keys: Vec<u64>,
    /// Where each point is in that order.
    places: Vec<u32>,
}

impl FarTree {
    fn new(positions: &[[f32; 3]]) -> Self {
        let mut order: Vec<u32> = (0..positions.len() as u32).collect();
        arrange(&mut order, positions, LEAF);
        let points: Vec<([f32; 3], u32)> =
            order.into_iter().map(|i| (positions[i as usize], i)).collect();
        let mut places = vec![0; points.len()];
        for (place, &(_, index)) in (0..).zip(&points) {
            places[index as usize] = place;
        }
        // Everything is infinitely far from no sample.
        let keys: Vec<u64> = points.iter().map(|&(_, i)| far_key(f32::INFINITY, i)).collect();
        let far = |(&(p, _), &key): (&([f32; 3], u32), &u64)| Far { aabb: Aabb::point(p), key };
        let leaf = |(points, keys): (&[([f32; 3], u32)], &[u64])| {
            points.iter().zip(keys).map(far).reduce(Far::union)
        };
        let leaves = points.chunks(LEAF).zip(keys.chunks(LEAF)).filter_map(leaf).collect();
        Self { boxes: BoxTree::new(leaves), points, keys, places }
    }

    /// The point farthest from all samples; there are points.
    fn farthest(&self) -> usize {
        let key = self.boxes.root().map_or(0, |far| far.key);
        (u32::MAX - key as u32) as usize
    }

    /// Makes a point a sample.
    fn take(&mut self, index: usize) {
        let place = self.places[index] as usize;
        let (sample, _) = self.points[place];
        let (points, keys) = (&self.points, &mut self.keys);
        let enters = |far: &Far, leaves: Range<usize>| {
            // No box is farther away than a point in it, so what is passed over keeps its distances.
            leaves.contains(&(place / LEAF))
                || far.aabb.squared_distance(sample) < f32::from_bits((far.key >> 32) as u32)
        };
        self.boxes.update(enters, |leaf, far| {
            let run = leaf * LEAF..((leaf + 1) * LEAF).min(points.len());
            far.key = 0;
            for at in run {
                let (p, index) = points[at];
                let key = if at == place { 0 } else { far_key(squared_distance(p, sample), index) };
                keys[at] = keys[at].min(key);
                far.key = far.key.max(keys[at]);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use surfabet_base::Silent;

    fn by_definition(points: &[[f32; 3]], count: usize, start: usize) -> Vec<usize> {
        let mut keys: Vec<u64> =
            (0..points.len()).map(|i| far_key(f32::INFINITY, i as u32)).collect();
        let mut found = vec![start];
        loop {
            let last = found[found.len() - 1];
            keys[last] = 0;
            for (i, key) in keys.iter_mut().enumerate() {
                let d: [f32; 3] = std::array::from_fn(|a| points[i][a] - points[last][a]);
                *key = (*key).min(far_key((d[0] * d[0] + d[1] * d[1]) + d[2] * d[2], i as u32));
            }
            if found.len() == count {
                return found;
            }
            let best = (0..points.len()).max_by_key(|&i| keys[i]).unwrap();
            found.push(best);
        }
    }

    proptest! {
        #[test]
        fn farthest_points_are_farthest(
            points in prop::collection::vec(
                prop::array::uniform3(prop_oneof![(-2_i8..2).prop_map(f32::from), -5.0_f32..5.0]),
                1..200,
            ),
            share in 0.0_f64..1.0,
            start in any::<prop::sample::Index>(),
        ) {
            let count = 1 + (share * (points.len() - 1) as f64) as usize;
            let start = start.index(points.len());
            let found = farthest_points(&points, count, start, &Silent).unwrap();
            prop_assert_eq!(&found, &by_definition(&points, count, start));
            let mut sorted = found;
            sorted.sort_unstable();
            sorted.dedup();
            prop_assert_eq!(sorted.len(), count);
        }

        #[test]
        fn cells_are_at_most_as_many_as_asked_for_and_hardly_fewer(
            seed in 0_u64..50, count in 20_usize..600,
        ) {
            use rand::Rng;
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let points =
                (0..3000).map(|_| std::array::from_fn(|_| rng.random_range(0.0_f32..4.0))).collect();
            let cloud = PointCloud::from_positions(points).0;
            let grid = voxel_grid_with(&cloud, count, &Silent).unwrap();
            prop_assert!(grid.len() <= count && 10 * grid.len() >= 7 * count, "{}", grid.len());
            let tree = octree_with(&cloud, count, &Silent).unwrap();
            let leaves = tree.nodes(tree.depth()).unwrap().len();
            prop_assert!(leaves <= count && 10 * leaves >= 7 * count, "{leaves}");
        }
    }

    #[test]
    fn random_points_are_different_ones_and_follow_the_seed() {
        let found = random_points(1000, 400, 3).unwrap();
        assert_eq!(found.len(), 400);
        assert!(found.windows(2).all(|w| w[0] < w[1]) && found[399] < 1000);
        assert_eq!(found, random_points(1000, 400, 3).unwrap());
        assert_ne!(found, random_points(1000, 400, 4).unwrap());
        assert_eq!(random_points(5, 5, 0).unwrap(), [0, 1, 2, 3, 4]);
        assert!(random_points(5, 6, 0).is_err());
    }

    #[test]
    fn hardly_any_points() {
        assert!(farthest_points(&[], 0, 0, &Silent).unwrap().is_empty());
        assert!(farthest_points(&[[0.0; 3]], 1, 1, &Silent).is_err());
        assert!(farthest_points(&[[0.0; 3]], 2, 0, &Silent).is_err());
        let same = [[1.0; 3]; 40];
        assert_eq!(farthest_points(&same, 40, 7, &Silent).unwrap().len(), 40);
        let cloud = PointCloud::from_positions(same.to_vec()).0;
        assert_eq!(voxel_grid_with(&cloud, 3, &Silent).unwrap().len(), 1);
        assert!(voxel_grid_with(&cloud, 0, &Silent).is_err());
        // On both sides of the origin along every axis: eight voxels, however large.
        let around = PointCloud::from_positions(
            (0..8).map(|i| [0, 1, 2].map(|a| if i >> a & 1 == 0 { -1.0 } else { 1.0 })).collect(),
        );
        assert!(voxel_grid_with(&around.0, 7, &Silent).is_err());
        assert_eq!(voxel_grid_with(&around.0, 8, &Silent).unwrap().len(), 8);
        assert_eq!(octree_with(&around.0, 1, &Silent).unwrap().depth(), 0);
    }
}
