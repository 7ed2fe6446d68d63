//! Octree: the occupied cubes of every level from the bounding cube down, with two representatives each.

use surfabet_base::parallel;

use crate::cloud::PointCloud;
use crate::error::{Error, Result};
use crate::morton;
use surfabet_base::Progress;

/// Deepest level.
const DEEPEST: u32 = morton::BITS;

/// A linear octree: points sorted along the Morton curve, so that every node of every level is a run of them.
///
/// Level 0 is one cube around the cloud; each level halves the edges. Nodes come in Morton order and points
/// within them by index, whatever the number of threads.
#[derive(Debug, Clone, PartialEq)]
pub struct Octree {
    /// Lower corner of the root, relative to the cloud's origin.
    low: [f64; 3],
    root_size: f64,
    depth: u32,
    /// Sorted Morton codes at level `depth`.
    codes: Vec<u64>,
    /// Point of each code.
    order: Vec<u32>,
}

impl Octree {
    /// Sorts the points of `cloud` down to leaves with edges of `leaf_size` metres.
    ///
    /// The root is the smallest cube of `leaf_size * 2^depth` edges that holds the cloud; it starts at the lower
    /// corner of the bounding box.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] when the size is not positive and finite, or when it takes more than 21 levels;
    /// [`Error::Cancelled`].
    pub fn new(cloud: &PointCloud, leaf_size: f64, progress: &dyn Progress) -> Result<Self> {
        if !(leaf_size > 0.0 && leaf_size.is_finite()) {
            return Err(Error::invalid("leaf_size", leaf_size, "a positive length in metres"));
        }
        if cloud.len() >= u32::MAX as usize {
            return Err(Error::invalid("number of points", cloud.len(), "below 4294967295"));
        }
        let origin = cloud.origin();
        let (low, high) = cloud.bounds().unwrap_or((origin, origin));
        let extent = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        // A point on the upper side of the box belongs to the cell that starts there.
        let Some(depth) = (0..=DEEPEST).find(|&d| extent / leaf_size < f64::from(1_u32 << d))
        else {
            return Err(Error::invalid(
                "leaf_size",
                leaf_size,
                "at least the extent of the cloud divided by 2^21",
            ));
        };
        let low: [f64; 3] = std::array::from_fn(|a| low[a] - origin[a]);
        let last = (1_u64 << depth) - 1;
        let mut sorted: Vec<(u64, u32)> = parallel::map_range(cloud.len(), |i| {
            let p = cloud.positions()[i];
            let cell = std::array::from_fn(|a| {
                (((f64::from(p[a]) - low[a]) / leaf_size) as u64).min(last)
            });
            (code_of(cell), i as u32)
        });
        progress.check()?;
        parallel::sort_keyed(&mut sorted);
        progress.check()?;
        let (codes, order) = sorted.into_iter().unzip();
        Ok(Self { low, root_size: leaf_size * f64::from(1_u32 << depth), depth, codes, order })
    }

    /// Levels below the root: leaves are at this one.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Edge length of the nodes at `level`, metres.
    pub fn node_size(&self, level: u32) -> f64 {
        self.root_size / f64::from(1_u32 << level.min(DEEPEST))
    }

    /// The deepest level with at most `count` occupied nodes, for thinning to a number of points; level 0 where
    /// there is none.
    pub fn level_with_at_most(&self, count: usize) -> u32 {
        // The number of nodes never falls from a level to the next.
        let mut level = 0;
        while level < self.depth && self.nodes_at(level + 1).count() <= count {
            level += 1;
        }
        level
    }

    /// The occupied nodes at `level`: the indices of the points in each, ascending within a leaf.
    ///
    /// # Errors
    /// [`Error::IndexOutOfRange`] for a level below the leaves.
    pub fn nodes(&self, level: u32) -> Result<Vec<&[u32]>> {
        self.check(level)?;
        Ok(self.nodes_at(level).map(|(_, points)| points).collect())
    }

    /// Centres of the occupied nodes at `level`, relative to the cloud's origin.
    ///
    /// # Errors
    /// As [`Octree::nodes`].
    pub fn centers(&self, level: u32) -> Result<Vec<[f32; 3]>> {
        self.check(level)?;
        let size = self.node_size(level);
        let center = |code| {
            let cell = cell_of(code);
            std::array::from_fn(|a| (self.low[a] + (cell[a] as f64 + 0.5) * size) as f32)
        };
        Ok(self.nodes_at(level).map(|(code, _)| center(code)).collect())
    }

    /// Means of the points in each occupied node at `level`, relative to the cloud's origin.
    ///
    /// # Errors
    /// As [`Octree::nodes`], and [`Error::LengthMismatch`] when `cloud` is not as long as the one that the tree was
    /// made from.
    pub fn centroids(&self, cloud: &PointCloud, level: u32) -> Result<Vec<[f32; 3]>> {
        self.check(level)?;
        if cloud.len() != self.order.len() {
            return Err(Error::LengthMismatch {
                attribute: "cloud".into(),
                found: cloud.len(),
                expected: self.order.len(),
            });
        }
        let centroid = |points: &[u32]| {
            let sum = points.iter().fold([0.0; 3], |sum: [f64; 3], &i| {
                let p = cloud.positions()[i as usize];
                std::array::from_fn(|a| sum[a] + f64::from(p[a]))
            });
            sum.map(|s| (s / points.len() as f64) as f32)
        };
        Ok(self.nodes_at(level).map(|(_, points)| centroid(points)).collect())
    }

    fn check(&self, level: u32) -> Result<()> {
        if level > self.depth {
            let (index, len) = (level as usize, self.depth as usize + 1);
            return Err(Error::IndexOutOfRange { name: "octree level", index, len });
        }
        Ok(())
    }

    /// Morton code at `level` and points of each occupied node.
    fn nodes_at(&self, level: u32) -> impl Iterator<Item = (u64, &[u32])> {
        let shift = 3 * (self.depth - level);
        let mut begin = 0;
        self.codes.chunk_by(move |a, b| a >> shift == b >> shift).map(move |run| {
            let points = &self.order[begin..begin + run.len()];
            begin += run.len();
            (run[0] >> shift, points)
        })
    }
}

/// Morton code with x highest, so that nodes come in the order of x first.
fn code_of([x, y, z]: [u64; 3]) -> u64 {
    morton::encode([z, y, x])
}

fn cell_of(code: u64) -> [u64; 3] {
    let [z, y, x] = morton::decode(code);
    [x, y, z]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use surfabet_base::Silent;

    fn bare(positions: Vec<[f32; 3]>) -> PointCloud {
        PointCloud::from_positions(positions).0
    }

    #[test]
    fn a_case_by_hand() {
        let c = bare(vec![[0.0; 3], [3.5, 0.0, 0.0], [0.5, 0.5, 0.0], [3.0, 1.0, 0.0]]);
        let tree = Octree::new(&c, 1.0, &Silent).unwrap();
        assert_eq!((tree.depth(), tree.node_size(0), tree.node_size(2)), (2, 4.0, 1.0));
        assert_eq!(tree.nodes(2).unwrap(), [&[0, 2][..], &[1], &[3]]);
        assert_eq!(tree.nodes(1).unwrap(), [&[0, 2][..], &[1, 3]]);
        assert_eq!(tree.centers(1).unwrap(), [[1.0; 3], [3.0, 1.0, 1.0]]);
        assert_eq!(tree.centroids(&c, 1).unwrap(), [[0.25, 0.25, 0.0], [3.25, 0.5, 0.0]]);
        assert_eq!(tree.level_with_at_most(2), 1);
        assert_eq!(tree.level_with_at_most(100), 2);
        assert!(tree.nodes(3).is_err());
    }

    #[test]
    fn empty_one_point_and_refused_sizes() {
        assert!(Octree::new(&bare(vec![]), 1.0, &Silent).unwrap().nodes(0).unwrap().is_empty());
        let one = Octree::new(&bare(vec![[5.0; 3]]), 0.1, &Silent).unwrap();
        assert_eq!((one.depth(), one.nodes(0).unwrap().len()), (0, 1));
        let wide = bare(vec![[0.0; 3], [1000.0; 3]]);
        assert!(Octree::new(&wide, 1e-5, &Silent).is_err());
        assert!(Octree::new(&wide, 0.0, &Silent).is_err());
    }

    proptest! {
        #[test]
        fn every_point_lies_in_its_node(
            points in prop::collection::vec(prop::array::uniform3(-4.0_f32..4.0), 1..200),
            size in 0.05_f64..3.0,
        ) {
            let c = bare(points);
            let tree = Octree::new(&c, size, &Silent).unwrap();
            for level in 0..=tree.depth() {
                let nodes = tree.nodes(level).unwrap();
                let centers = tree.centers(level).unwrap();
                let mut seen: Vec<u32> = nodes.concat();
                seen.sort_unstable();
                prop_assert_eq!(seen, (0..c.len() as u32).collect::<Vec<_>>());
                for (node, center) in nodes.iter().zip(centers) {
                    for &i in *node {
                        for (p, c) in c.positions()[i as usize].iter().zip(center) {
                            let off = (p - c).abs();
                            prop_assert!(f64::from(off) <= 0.5 * tree.node_size(level) + 1e-5);
                        }
                    }
                }
            }
        }
    }
}
