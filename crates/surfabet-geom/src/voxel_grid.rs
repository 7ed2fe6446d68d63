//! Voxel grid: points by the cube of space that they lie in, and one mean point per cube.

use surfabet_base::parallel;
use surfabet_base::rounding::round_f64;

use crate::attribute::{Column, Scalar, heaviest, with_column};
use crate::cells::wide_cell_of;
use crate::cloud::{CloudParts, PointCloud, Viewpoints};
use crate::error::{Error, Result};
use surfabet_base::Meter;
use surfabet_base::Progress;

/// Largest cell number per axis that `f64` counts without gaps.
const LARGEST_CELL: f64 = 9_007_199_254_740_992.0;

/// Points or voxels per unit of parallel work.
const BATCH: usize = 8192;

/// Points sorted into cubes of equal size, which are aligned to the world's axes and origin.
///
/// The cell of a point is the floor of its world coordinates, computed in `f64`, divided by the size. Cells are
/// compared by all three numbers, never by a hash alone. Voxels come in the order of their cells (x, then y,
/// then z), whatever the order of the points or the number of threads.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelGrid {
    size: f64,
    cells: Vec<[i64; 3]>,
    /// Point indices, voxel by voxel.
    order: Vec<u32>,
    /// Where each voxel starts in `order`; one more than there are voxels.
    starts: Vec<u32>,
}

impl VoxelGrid {
    /// Sorts the points of `cloud` into cubes with edges of `size` metres.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] when the size is not positive and finite, or so small that cells cannot be
    /// numbered: from 2^53 edges between a point and the world's origin, or 2^32 across the cloud.
    /// [`Error::Cancelled`].
    pub fn new(cloud: &PointCloud, size: f64, progress: &dyn Progress) -> Result<Self> {
        if !(size > 0.0 && size.is_finite()) {
            return Err(Error::invalid("size", size, "a positive length in metres"));
        }
        let Some(bounds) = cloud.bounds() else {
            return Ok(Self { size, cells: Vec::new(), order: Vec::new(), starts: vec![0] });
        };
        if cloud.len() >= u32::MAX as usize {
            return Err(Error::invalid("number of points", cloud.len(), "below 4294967295"));
        }
        progress.update("voxel grid", 0.0);
        let grid = sorted_by_cell(cloud, bounds, size, progress)?;
        progress.update("voxel grid", 1.0);
        Ok(grid)
    }

    /// Number of voxels that hold a point.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// True when no voxel holds a point.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Edge length in metres.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Cell numbers of each voxel: it reaches from `cell * size` up to but not including `(cell + 1) * size`.
    pub fn cells(&self) -> &[[i64; 3]] {
        &self.cells
    }

    /// Indices of the points in voxel `v`, ascending; at least one.
    pub fn members(&self, v: usize) -> &[u32] {
        &self.order[self.starts[v] as usize..self.starts[v + 1] as usize]
    }

    /// Number of points in each voxel.
    pub fn counts(&self) -> Vec<u32> {
        self.starts.windows(2).map(|w| w[1] - w[0]).collect()
    }

    /// The voxel of each point.
    pub fn voxel_of_points(&self) -> Vec<u32> {
        let mut voxels = vec![0; self.order.len()];
        for v in 0..self.len() {
            for &point in self.members(v) {
                voxels[point as usize] = v as u32;
            }
        }
        voxels
    }

    /// One point per voxel, in the order of the voxels: the mean of its points, in every attribute.
    ///
    /// Positions, colours (rounded) and intensities are (weighted) arithmetic means. Normals are the direction of
    /// the mean of the known ones, zero where none is known or they cancel. Ranges are means of the known ones,
    /// zero where none is. The viewpoint is the one with the most weight, the earlier one of equals. Of extra columns
    /// floating-point numbers are (weighted) means, and integers, which count or label, the value with the most
    /// weight, the smaller one of equals.
    ///
    /// `weights` holds a positive number per point; without it all count the same.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] when `cloud` is not as long as the one that the grid was made from, or `weights`
    /// not as long as `cloud`; [`Error::InvalidParameter`] for a weight that is not positive and finite;
    /// [`Error::Cancelled`].
    pub fn means(
        &self,
        cloud: &PointCloud,
        weights: Option<&[f32]>,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        let expected = self.order.len();
        if cloud.len() != expected {
            return Err(Error::LengthMismatch {
                attribute: "cloud".into(),
                found: cloud.len(),
                expected,
            });
        }
        if let Some(weights) = weights {
            if weights.len() != expected {
                let found = weights.len();
                return Err(Error::LengthMismatch { attribute: "weights".into(), found, expected });
            }
            if let Some(w) = weights.iter().find(|w| !(**w > 0.0 && w.is_finite())) {
                return Err(Error::invalid("weight", w, "positive and finite"));
            }
        }
        let weight = |i: usize| weights.map_or(1.0, |w| f64::from(w[i]));
        let positions = self.column(progress, |members| {
            mean(cloud.positions(), members, weight).map(|c| c as f32)
        })?;
        let colors = cloud.colors().map(|colors| {
            // Between 0 and 255 like every value it is a mean of.
            self.column(progress, |members| {
                mean(colors, members, weight).map(|c| round_f64(c) as u8)
            })
        });
        let intensities = cloud.intensities().map(|intensities| {
            let intensities = intensities.as_chunks::<1>().0;
            self.column(progress, |members| mean(intensities, members, weight)[0] as f32)
        });
        let normals = cloud.normals().map(|normals| {
            self.column(progress, |members| mean_direction(normals, members, weight))
        });
        let ranges = cloud
            .ranges()
            .map(|ranges| self.column(progress, |members| mean_of_known(ranges, members, weight)));
        let viewpoints = cloud.viewpoints().map(|viewpoints| {
            let index =
                self.column(progress, |members| heaviest(&viewpoints.index, members, weight))?;
            Ok::<_, Error>(Viewpoints { origins: viewpoints.origins.clone(), index })
        });
        let merged = |(name, column): &(String, Column)| {
            Ok((name.clone(), self.merged(column, weight, progress)?))
        };
        let extra = cloud.extra().iter().map(merged).collect::<Result<_>>()?;
        let parts = CloudParts {
            origin: cloud.origin(),
            positions,
            colors: colors.transpose()?,
            intensities: intensities.transpose()?,
            normals: normals.transpose()?,
            ranges: ranges.transpose()?,
            viewpoints: viewpoints.transpose()?,
            extra,
            crs: cloud.crs().map(str::to_owned),
        };
        PointCloud::from_parts(parts).map(|(cloud, _)| cloud)
    }

    /// One value per voxel for a column of any type.
    fn merged(
        &self,
        column: &Column,
        weight: impl Fn(usize) -> f64 + Copy + Sync,
        progress: &dyn Progress,
    ) -> Result<Column> {
        with_column!(column, values => {
            let merged =
                self.column(progress, |members| Scalar::merged(values, members, weight))?;
            Ok(merged.into())
        })
    }

    /// One value per voxel, computed from the voxel's points, in parallel.
    fn column<T: Clone + Default + Send>(
        &self,
        progress: &dyn Progress,
        value: impl Fn(&[u32]) -> T + Sync,
    ) -> Result<Vec<T>> {
        let mut values = vec![T::default(); self.len()];
        let meter = Meter::new(progress, "voxel means", values.len().div_ceil(BATCH));
        parallel::try_for_each(values.chunks_mut(BATCH), |chunk, values| {
            for (j, place) in values.iter_mut().enumerate() {
                *place = value(self.members(chunk * BATCH + j));
            }
            meter.step()
        })?;
        Ok(values)
    }
}

/// Sorts the points of a cloud with these bounds by one integer each, its cell above its index.
fn sorted_by_cell(
    cloud: &PointCloud,
    (low, high): ([f64; 3], [f64; 3]),
    size: f64,
    progress: &dyn Progress,
) -> Result<VoxelGrid> {
    let too_small = |requirement| Err(Error::invalid("size", size, requirement));
    if low.iter().chain(&high).any(|c| (c / size).abs() >= LARGEST_CELL) {
        return too_small("at least the largest coordinate divided by 2^53");
    }
    let (first, last) = (wide_cell_of(low, size), wide_cell_of(high, size));
    let bits: [u32; 3] = std::array::from_fn(|a| 64 - (last[a] - first[a]).leading_zeros());
    if bits.iter().any(|&b| b > 32) {
        return too_small("at least the extent of the cloud divided by 2^32");
    }
    // At most 32, like each of `bits`: a cloud has less than 2^32 points.
    let index_bits = 64 - (cloud.len() as u64 - 1).leading_zeros();
    let offset = |i: usize| -> [u64; 3] {
        let cell = wide_cell_of(cloud.world(i), size);
        std::array::from_fn(|a| (cell[a] - first[a]) as u64)
    };
    let cell_at = |offset: [u64; 3]| std::array::from_fn(|a| first[a] + offset[a] as i64);
    if bits.iter().sum::<u32>() + index_bits <= 64 {
        let mut keys: Vec<u64> = parallel::map_range(cloud.len(), |i| {
            let [x, y, z] = offset(i);
            ((x << bits[1] | y) << bits[2] | z) << index_bits | i as u64
        });
        progress.check()?;
        parallel::sort_keys(&mut keys);
        progress.check()?;
        let (starts, found) = runs(keys.len(), |j| keys[j] >> index_bits);
        let low = |key: u64, n_bits: u32| key & ((1 << n_bits) - 1);
        let cells = parallel::map(&found, |&key| {
            let xy = key >> bits[2];
            cell_at([xy >> bits[1], low(xy, bits[1]), low(key, bits[2])])
        });
        let order = parallel::map(&keys, |&key| low(key, index_bits) as u32);
        Ok(VoxelGrid { size, cells, order, starts })
    } else {
        let mut keys: Vec<u128> = parallel::map_range(cloud.len(), |i| {
            let [x, y, z] = offset(i).map(u128::from);
            x << 96 | y << 64 | z << 32 | i as u128
        });
        progress.check()?;
        parallel::sort_wide_keys(&mut keys);
        progress.check()?;
        let (starts, found) = runs(keys.len(), |j| keys[j] >> 32);
        let cells = parallel::map(&found, |&key| {
            cell_at([key >> 64, key >> 32, key].map(|c| u64::from(c as u32)))
        });
        let order = parallel::map(&keys, |&key| key as u32);
        Ok(VoxelGrid { size, cells, order, starts })
    }
}

/// Where each run of `n` equal values starts, and its value; behind the last start stands `n`.
fn runs<T: Copy + PartialEq + Send>(
    n: usize,
    value: impl Fn(usize) -> T + Sync,
) -> (Vec<u32>, Vec<T>) {
    let parts = parallel::map_range(n.div_ceil(BATCH), |batch| {
        let begin = batch * BATCH;
        let mut previous = begin.checked_sub(1).map(&value);
        let mut found = Vec::new();
        for j in begin..n.min(begin + BATCH) {
            let value = value(j);
            if previous != Some(value) {
                found.push((j as u32, value));
                previous = Some(value);
            }
        }
        found
    });
    let (mut starts, values): (Vec<u32>, Vec<T>) = parts.into_iter().flatten().unzip();
    starts.push(n as u32);
    (starts, values)
}

/// Direction of the mean of vectors, zero where they cancel.
fn mean_direction(
    vectors: &[[f32; 3]],
    members: &[u32],
    weight: impl Fn(usize) -> f64,
) -> [f32; 3] {
    let mean = mean(vectors, members, weight);
    let length = mean.iter().map(|c| c * c).sum::<f64>().sqrt();
    // Unit vectors that cancel leave rounding errors behind.
    if length > 1e-6 { mean.map(|c| (c / length) as f32) } else { [0.0; 3] }
}

/// Mean of the values above zero, zero without any.
fn mean_of_known(values: &[f32], members: &[u32], weight: impl Fn(usize) -> f64) -> f32 {
    let known = members.iter().map(|&i| i as usize).filter(|&i| values[i] > 0.0);
    let (sum, total) = known.fold((0.0, 0.0), |(sum, total), i| {
        (sum + weight(i) * f64::from(values[i]), total + weight(i))
    });
    if total > 0.0 { (sum / total) as f32 } else { 0.0 }
}

fn mean<T: Copy + Into<f64>, const N: usize>(
    values: &[[T; N]],
    members: &[u32],
    weight: impl Fn(usize) -> f64,
) -> [f64; N] {
    let mut total = 0.0;
    let mut sum = [0.0; N];
    for i in members.iter().map(|&i| i as usize) {
        let w = weight(i);
        total += w;
        for (s, &v) in sum.iter_mut().zip(&values[i]) {
            *s += w * v.into();
        }
    }
    sum.map(|s| s / total)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;
    use surfabet_base::Silent;

    fn cloud(parts: CloudParts) -> PointCloud {
        PointCloud::from_parts(parts).unwrap().0
    }

    fn bare(positions: Vec<[f32; 3]>) -> PointCloud {
        PointCloud::from_positions(positions).0
    }

    #[test]
    fn means_by_hand() {
        let c = cloud(CloudParts {
            origin: [0.0; 3],
            positions: vec![[0.1, 0.1, 0.1], [1.5, 0.5, 0.5], [0.3, 0.1, 0.5], [-0.1, 0.2, 0.2]],
            colors: Some(vec![[0, 10, 255], [1; 3], [3, 20, 255], [7; 3]]),
            intensities: Some(vec![1.0, 5.0, 2.0, 9.0]),
            normals: Some(vec![[1.0, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
            ranges: Some(vec![0.0, 4.0, 2.0, 0.0]),
            viewpoints: Some(Viewpoints {
                origins: vec![[0.0; 3], [1.0; 3]],
                index: vec![1, 0, 0, 1],
            }),
            extra: vec![
                ("label".to_owned(), vec![6_u8, 2, 5, 2].into()),
                ("time".to_owned(), vec![1e9 + 1.0, 0.0, 1e9 + 3.0, 0.5].into()),
            ],
            crs: Some("EPSG:25832".to_owned()),
        });
        let grid = VoxelGrid::new(&c, 1.0, &Silent).unwrap();
        assert_eq!(grid.cells(), [[-1, 0, 0], [0, 0, 0], [1, 0, 0]]);
        assert_eq!(grid.members(1), [0, 2]);
        assert_eq!(grid.counts(), [1, 2, 1]);
        assert_eq!(grid.voxel_of_points(), [1, 2, 1, 0]);

        let m = grid.means(&c, None, &Silent).unwrap();
        assert_eq!(m.positions()[1], [0.2, 0.1, 0.3]);
        assert_eq!(m.colors().unwrap()[1], [2, 15, 255]);
        assert_eq!(m.intensities().unwrap(), [9.0, 1.5, 5.0]);
        assert!((m.normals().unwrap()[1][0] - 0.5_f32.sqrt()).abs() < 1e-6);
        assert_eq!(m.normals().unwrap()[2], [0.0; 3]);
        assert_eq!(m.ranges().unwrap(), [0.0, 2.0, 4.0]);
        assert_eq!(m.viewpoints().unwrap().index, [1, 0, 0]);
        assert_eq!(m.extra()[0], ("label".to_owned(), vec![2_u8, 5, 2].into()));
        assert_eq!(m.extra()[1], ("time".to_owned(), vec![0.5, 1e9 + 2.0, 0.0].into()));
        assert_eq!(m.crs(), Some("EPSG:25832"));

        let m = grid.means(&c, Some(&[3.0, 1.0, 1.0, 1.0]), &Silent).unwrap();
        assert!((m.positions()[1][0] - 0.15).abs() < 1e-7);
        assert_eq!(m.viewpoints().unwrap().index, [1, 1, 0]);
        assert_eq!(m.extra()[0].1, vec![2_u8, 6, 2].into());
    }

    #[test]
    fn huge_coordinates_over_tiny_voxels_are_told_apart_or_refused() {
        // Cells 2^40 apart on all axes would collide in a packed 64-bit key.
        let c = cloud(CloudParts {
            origin: [5e8, -5e8, 5e8],
            positions: vec![[0.0; 3], [0.000_5, 0.0, 0.0], [4000.0; 3], [-4000.0; 3]],
            ..CloudParts::default()
        });
        let grid = VoxelGrid::new(&c, 1e-5, &Silent).unwrap();
        assert_eq!(grid.len(), 4);
        assert_eq!(grid.members(0), [3]);
        assert!(VoxelGrid::new(&c, 1e-8, &Silent).is_err());
        assert!(VoxelGrid::new(&c, 1e-7, &Silent).unwrap_err().to_string().contains("2^32"));
    }

    #[test]
    fn refuses_sizes_and_weights_without_meaning() {
        let c = bare(vec![[0.0; 3]; 2]);
        for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(VoxelGrid::new(&c, size, &Silent).is_err());
        }
        let grid = VoxelGrid::new(&c, 1.0, &Silent).unwrap();
        assert!(grid.means(&c, Some(&[1.0]), &Silent).is_err());
        assert!(grid.means(&c, Some(&[1.0, 0.0]), &Silent).is_err());
        assert!(grid.means(&bare(vec![[0.0; 3]]), None, &Silent).is_err());
    }

    #[test]
    fn an_empty_cloud_has_no_voxel() {
        let empty = bare(vec![]);
        let grid = VoxelGrid::new(&empty, 1.0, &Silent).unwrap();
        assert!(grid.is_empty());
        assert!(grid.means(&empty, None, &Silent).unwrap().is_empty());
    }

    #[test]
    fn normals_that_cancel_are_unknown() {
        let c = cloud(CloudParts {
            positions: vec![[0.1; 3]; 2],
            normals: Some(vec![[0.6, 0.0, 0.8], [-0.6, 0.0, -0.8]]),
            ..CloudParts::default()
        });
        let m = VoxelGrid::new(&c, 1.0, &Silent).unwrap().means(&c, None, &Silent).unwrap();
        assert_eq!(m.normals().unwrap(), [[0.0; 3]]);
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let c = bare(
            (0..50_000_u32).map(|i| [i % 97, i * 7919 % 89, i % 31].map(|c| c as f32)).collect(),
        );
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let grid = VoxelGrid::new(&c, 3.0, &Silent).unwrap();
                let means = grid.means(&c, None, &Silent).unwrap();
                (grid, means)
            })
        };
        assert!(run(1) == run(2) && run(1) == run(8));
    }

    proptest! {
        #[test]
        fn agrees_with_a_map_of_cells(
            points in prop::collection::vec(prop::array::uniform3(-4.0_f32..4.0), 0..300),
            size in 0.05_f64..3.0,
            far in prop_oneof![Just(0.0), Just(5_400_000.25)],
        ) {
            let c = cloud(CloudParts {
                origin: [far; 3],
                positions: points,
                ..CloudParts::default()
            });
            let mut expected: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
            for i in 0..c.len() {
                let cell = c.world(i).map(|x| (x / size).floor() as i64);
                expected.entry(cell).or_default().push(i as u32);
            }
            let grid = VoxelGrid::new(&c, size, &Silent).unwrap();
            let means = grid.means(&c, None, &Silent).unwrap();
            prop_assert_eq!(grid.len(), expected.len());
            for (v, (cell, members)) in expected.iter().enumerate() {
                prop_assert_eq!(grid.cells()[v], *cell);
                prop_assert_eq!(grid.members(v), &members[..]);
                for a in 0..3 {
                    let sum: f64 =
                        members.iter().map(|&i| f64::from(c.positions()[i as usize][a])).sum();
                    let mean = sum / members.len() as f64;
                    prop_assert!((f64::from(means.positions()[v][a]) - mean).abs() < 1e-6);
                }
            }
        }
    }
}
