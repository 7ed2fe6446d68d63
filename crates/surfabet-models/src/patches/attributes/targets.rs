//! The values that each cell should have: those of the samples it will be compared with.

use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_base::rounding::floor_f32;
use surfabet_geom::cells::cell_of;
use surfabet_geom::morton::{MortonMap, step};

use super::blending::{Corners, Weighted};
use super::borders::BorderBlocks;
use super::cells::{cell_key, cell_of_key, index};
use super::wanted::Wanted;
use crate::patches::samples::{Sample, SidedSamples};

/// Samples of one task.
const BLOCK: usize = 1 << 11;

/// Samples whose blends are kept at once: bounds the memory.
const SAMPLES_AT_ONCE: usize = 1 << 16;

/// Which cell each sample counts for: its own, or the nearest cell around it.
pub(in crate::patches) struct Targets<'a> {
    samples: &'a SidedSamples<'a>,
    /// Sorted keys.
    cells: &'a [u64],
    places: MortonMap<u32>,
    /// Bits of the sides that each cell belongs to; cells of different sides have nothing to do with one another.
    sides: Vec<u8>,
    owners: Vec<Option<u32>>,
    /// Side of a cell, metres.
    size: f32,
    /// Points take their values from the cell that they lie in alone.
    unblended: bool,
}

impl<'a> Targets<'a> {
    /// For sorted `cells`, which are `size` metres wide. With `sides`, bits of the sides that each cell belongs to, a
    /// sample counts for cells of its own side, and points take their values from the cell that they lie in alone.
    pub fn new(
        samples: &'a SidedSamples<'a>,
        cells: &'a [u64],
        sides: Option<Vec<u8>>,
        size: f32,
    ) -> Self {
        let unblended = sides.is_some();
        let sides = sides.unwrap_or_else(|| vec![u8::MAX; cells.len()]);
        let places = index(cells);
        let owner = |i: usize| {
            let (s, side): (&Sample, u8) = (&samples.all[i], samples.sides[i]);
            owner(&places, s.position, size, |cell| sides[cell as usize] >> side & 1 != 0)
        };
        let owners = parallel::map_range(samples.all.len(), owner);
        Self { samples, cells, places, sides, owners, size, unblended }
    }

    /// What the cells should have of the values of points that `value` gives; points whose value is not finite are left out.
    pub fn wanted<const N: usize>(
        &self,
        value: impl Fn(usize) -> [f64; N] + Sync,
    ) -> Wanted<'_, N> {
        Wanted::new(self, self.samples.means(value))
    }

    /// Whether points take their values from the cell that they lie in alone.
    pub(super) fn is_unblended(&self) -> bool {
        self.unblended
    }

    /// What blending the values of the cells misses of those of the samples, summed for each cell with the weights of the
    /// blend; and the sum of these.
    pub(super) fn missed<const N: usize>(
        &self,
        values: &[[f32; N]],
        of_samples: &[Option<[f32; N]>],
    ) -> Vec<([f32; N], f32)> {
        let mut sums = vec![([0.0_f32; N], 0.0_f32); self.cells.len()];
        for first in (0..of_samples.len()).step_by(SAMPLES_AT_ONCE) {
            let n = SAMPLES_AT_ONCE.min(of_samples.len() - first);
            let blocks = parallel::map_range(n.div_ceil(BLOCK), |block| {
                let mut corners = Corners::new(&self.places);
                let of_block = first + block * BLOCK..first + n.min((block + 1) * BLOCK);
                let mut missed = Vec::with_capacity(of_block.len());
                for i in of_block {
                    if let (Some(wanted), Some(_)) = (of_samples[i], self.owners[i]) {
                        let around = self.around(i, &mut corners);
                        let blended = around.mean(|cell| values[cell]);
                        let difference: [f32; N] = std::array::from_fn(|c| wanted[c] - blended[c]);
                        missed.push((around, difference));
                    }
                }
                missed
            });
            // One after the other, so that sums are the same whatever the number of threads.
            for (around, missed) in blocks.iter().flatten() {
                for (cell, weight) in around.iter() {
                    let (sum, weights) = &mut sums[cell];
                    let weight = weight / around.total;
                    (0..N).for_each(|c| sum[c] += weight * missed[c]);
                    *weights += weight;
                }
            }
        }
        sums
    }

    /// What the cells beside a border miss, mean by block: of what lies on both sides of it, so that the tile beyond finds the same.
    /// `decoded` are the values of the cells.
    pub fn missed_across<const N: usize>(
        &self,
        border: &BorderBlocks,
        value: impl Fn(usize) -> [f64; N] + Sync,
        decoded: &[[f32; N]],
    ) -> Vec<[f32; N]> {
        let mut sums = vec![([0.0_f32; N], 0.0_f32); border.len()];
        let mut add = |of: usize, value: &dyn Fn(usize) -> f32| {
            let (sum, n) = &mut sums[of];
            (0..N).for_each(|c| sum[c] += value(c));
            *n += 1.0;
        };
        let beside = self.beside(border, value);
        for (&key, outside) in &beside {
            for (axis, up) in border.border.crossed(cell_of_key(key)) {
                let next = step(key, axis, up);
                let others = (0..3).filter(|&other| other != axis);
                let around = others.flat_map(|other| [false, true].map(|up| step(next, other, up)));
                let known = |key: u64| {
                    Some((beside.get(&key)?, *self.places.get(&key)?, border.block_of(key)?))
                };
                if let Some((inside, cell, block)) =
                    std::iter::once(next).chain(around).find_map(known)
                {
                    add(block, &|c| 0.5 * (inside[c] + outside[c]) - decoded[cell as usize][c]);
                }
            }
        }
        sums.into_iter().map(|(sum, n)| sum.map(|s| s / n.max(1.0))).collect()
    }

    /// Means of the samples in each cell on either side of a border.
    fn beside<const N: usize>(
        &self,
        border: &BorderBlocks,
        value: impl Fn(usize) -> [f64; N] + Sync,
    ) -> BTreeMap<u64, [f32; N]> {
        let mut sums: BTreeMap<u64, ([f32; N], f32)> = BTreeMap::new();
        let of_samples = self.samples.means(value);
        for (sample, mean) in self.samples.all.iter().zip(of_samples) {
            let cell = cell_of(sample.position, self.size);
            if let Some(mean) = mean.filter(|_| border.border.is_beside(cell)) {
                let (sum, n) = sums.entry(cell_key(cell)).or_insert(([0.0; N], 0.0));
                (0..N).for_each(|c| sum[c] += mean[c]);
                *n += 1.0;
            }
        }
        sums.into_iter().map(|(key, (sum, n))| (key, sum.map(|s| s / n))).collect()
    }

    /// The cells that a sample takes its values from.
    fn around(&self, sample: usize, corners: &mut Corners<'_>) -> Weighted {
        let own = || self.owners[sample].map_or(Weighted::NONE, Weighted::only);
        if self.unblended {
            return own();
        }
        let around = corners.around(self.samples.all[sample].position.map(|c| c / self.size));
        if around.total > 0.0 { around } else { own() }
    }

    /// Mean over the points of `error` of a point and the value that is decoded at its sample; 0 where no sample counts for
    /// a cell. `value` gives that of a cell.
    pub fn mean_error<const N: usize>(
        &self,
        value: impl Fn(usize) -> [f32; N] + Sync,
        error: impl Fn(usize, [f32; N]) -> f64 + Sync,
    ) -> f64 {
        self.mean_by_samples(|i, points, corners| {
            let decoded = self.around(i, corners).mean(&value);
            points.iter().map(|&point| error(point as usize, decoded)).sum()
        })
    }

    /// Mean over the points of all samples that count for a cell; 0 where none does. `sum` gives that of the points of a
    /// sample. Blocks are added in their order, so that all numbers of threads have the same result.
    fn mean_by_samples(&self, sum: impl Fn(usize, &[u32], &mut Corners<'_>) -> f64 + Sync) -> f64 {
        let n_samples = self.samples.all.len();
        let blocks = parallel::map_range(n_samples.div_ceil(BLOCK), |block| {
            let mut corners = Corners::new(&self.places);
            let of_block = block * BLOCK..n_samples.min((block + 1) * BLOCK);
            let counting = of_block.filter(|&i| self.owners[i].is_some());
            counting.fold((0.0, 0.0_f64), |(all, n), i| {
                let points = self.samples.points_of(i);
                (all + sum(i, points, &mut corners), n + points.len() as f64)
            })
        });
        let (all, n) = blocks.iter().fold((0.0, 0.0_f64), |(all, n), of| (all + of.0, n + of.1));
        all / n.max(1.0)
    }

    /// Mean over the samples of each cell. Cells without samples take the mean of those around, so that what was filled
    /// between samples has their values.
    pub(super) fn means<const N: usize>(&self, of_samples: &[Option<[f32; N]>]) -> Vec<[f32; N]> {
        let mut sums = vec![([0.0_f32; N], 0.0_f32); self.cells.len()];
        for (owner, mean) in self.owners.iter().zip(of_samples) {
            if let (Some(i), Some(mean)) = (owner, mean) {
                let (sum, n) = &mut sums[*i as usize];
                (0..N).for_each(|c| sum[c] += mean[c]);
                *n += 1.0;
            }
        }
        let mean = |(sum, n): &([f32; N], f32)| (*n > 0.0).then(|| sum.map(|s| s / n));
        let mut known: Vec<Option<[f32; N]>> = sums.iter().map(mean).collect();
        let total = sums.iter().map(|s| s.1).sum::<f32>().max(1.0);
        let whole = std::array::from_fn(|c| sums.iter().map(|s| s.0[c]).sum::<f32>() / total);
        drop(sums);
        self.spread(&mut known, |beside: &[[f32; N]]| {
            let mut sum = [0.0; N];
            beside.iter().for_each(|value| (0..N).for_each(|c| sum[c] += value[c]));
            sum.map(|s| s / beside.len() as f32)
        });
        known.into_iter().map(|k| k.unwrap_or(whole)).collect()
    }

    /// The most frequent label of the points of each cell's samples, of equals the first; `label` is below `n`, at most
    /// 256. Cells without samples take the most frequent of those around.
    pub fn modes(&self, n: usize, label: impl Fn(usize) -> u8) -> Vec<u8> {
        // Cell and label in one.
        let mut labelled: Vec<u64> = Vec::new();
        let label_of = |&key: &u64| key as u8;
        for (owner, points) in self.owners.iter().zip(self.samples.points()) {
            if let &Some(cell) = owner {
                let key = |&i: &u32| u64::from(cell) << 8 | u64::from(label(i as usize));
                labelled.extend(points.iter().map(key));
            }
        }
        parallel::sort_keys(&mut labelled);
        let mut known: Vec<Option<u8>> = vec![None; self.cells.len()];
        for cell in labelled.chunk_by(|a, b| a >> 8 == b >> 8) {
            known[(cell[0] >> 8) as usize] = Some(mode(n, cell.iter().map(label_of)));
        }
        let whole = mode(n, labelled.iter().map(label_of));
        self.spread(&mut known, |beside: &[u8]| mode(n, beside.iter().copied()));
        known.into_iter().map(|k| k.unwrap_or(whole)).collect()
    }

    /// Mean of `measure` over the points and the cells that they count for; 0 where none counts for any.
    pub fn mean_over_points(&self, measure: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
        self.mean_by_samples(|i, points, _| {
            let measured =
                |cell: u32| points.iter().map(|&p| measure(p as usize, cell as usize)).sum();
            self.owners[i].map_or(0.0, measured)
        })
    }

    /// Gives cells without a value what `join` makes of those of the six beside them that have one, round after round: first
    /// along the surface, where a cell's sides show what is along it, then in all directions.
    fn spread<T: Copy + Send + Sync>(
        &self,
        known: &mut [Option<T>],
        join: impl Fn(&[T]) -> T + Sync,
    ) {
        let beside = |i: usize, known: &[Option<T>], any_axis: bool| {
            let key = self.cells[i];
            let mut values = Vec::with_capacity(6);
            let is_along = |axis: &usize| self.sides[i] >> (2 * axis) & 0b11 == 0;
            for axis in (0..3).filter(|axis| any_axis || is_along(axis)) {
                for up in [false, true] {
                    let near = self.places.get(&step(key, axis, up)).copied();
                    let near = near.filter(|&j| self.sides[i] & self.sides[j as usize] != 0);
                    values.extend(near.and_then(|j| known[j as usize]));
                }
            }
            (!values.is_empty()).then(|| join(&values))
        };
        let mut any_axis = false;
        loop {
            let found: Vec<(usize, T)> = parallel::gather(self.cells.len(), |i, found| {
                if known[i].is_none() {
                    found.extend(beside(i, known, any_axis).map(|value| (i, value)));
                }
            });
            match (found.is_empty(), any_axis) {
                (true, true) => return,
                (true, false) => any_axis = true,
                (false, _) => {
                    for (i, value) in found {
                        known[i] = Some(value);
                    }
                }
            }
        }
    }
}

/// The most frequent label below `n`, of equals the first; 0 without any.
fn mode(n: usize, labels: impl Iterator<Item = u8>) -> u8 {
    let mut counts = vec![0_u32; n];
    labels.for_each(|label| counts[usize::from(label)] += 1);
    let most = (0..n).max_by_key(|&label| (counts[label], std::cmp::Reverse(label)));
    most.unwrap_or(0) as u8
}

/// The cell that a position lies in, or of the 26 around it the one whose middle is nearest; of those that are `allowed`.
fn owner(
    places: &MortonMap<u32>,
    position: [f32; 3],
    size: f32,
    allowed: impl Fn(u32) -> bool,
) -> Option<u32> {
    let scaled = position.map(|c| c / size);
    let cell = scaled.map(floor_f32);
    let own = cell_key(cell);
    let place = |key: &u64| places.get(key).copied().filter(|&cell| allowed(cell));
    if let Some(i) = place(&own) {
        return Some(i);
    }
    let part: [f32; 3] = std::array::from_fn(|a| scaled[a] - cell[a] as f32 - 0.5);
    let mut best: Option<(f32, u32)> = None;
    for neighbour in 0..27_usize {
        let mut key = own;
        let mut squared = 0.0;
        let along = [neighbour % 3, neighbour / 3 % 3, neighbour / 9];
        for (axis, place) in along.into_iter().enumerate() {
            let offset = place as f32 - 1.0;
            if place != 1 {
                key = step(key, axis, place == 2);
            }
            squared += (offset - part[axis]).powi(2);
        }
        if let Some(i) = place(&key)
            && best.is_none_or(|b| squared < b.0)
        {
            best = Some((squared, i));
        }
    }
    best.map(|b| b.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_are_the_most_frequent_and_of_equals_the_first() {
        assert_eq!(mode(3, [2, 1, 2].into_iter()), 2);
        assert_eq!(mode(3, [2, 1, 1, 2, 0].into_iter()), 1);
        assert_eq!(mode(3, std::iter::empty()), 0);
    }
}
