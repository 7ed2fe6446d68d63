//! The pyramid of cells over those of a field, and the prediction of a level from the one above.

use std::borrow::Cow;
use std::ops::Range;

use surfabet_base::parallel;
use surfabet_geom::morton::step;

use crate::patches::attributes::cells::index;

/// Cells of one size: those of a pyramid's first level carry the field, each further level joins them by eights.
pub(super) struct PyramidLevel<'a, const N: usize> {
    /// Sorted.
    pub keys: Cow<'a, [u64]>,
    /// Number of cells of the first level in each cell.
    pub weights: Vec<u32>,
    /// Children of cell i are cells `children[i]..children[i + 1]` of the level before; empty at the first.
    children: Vec<u32>,
    /// Means of the values that are to be coded; empty when reading.
    pub targets: Cow<'a, [[f32; N]]>,
}

impl<const N: usize> PyramidLevel<'_, N> {
    /// The children of each cell.
    pub fn children(&self) -> impl Iterator<Item = Range<usize>> {
        self.children.windows(2).map(|range| range[0] as usize..range[1] as usize)
    }

    /// The children of a cell.
    pub fn children_of(&self, cell: usize) -> Range<usize> {
        self.children[cell] as usize..self.children[cell + 1] as usize
    }

    /// One value per cell as one per child.
    pub fn for_children<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let n_children = self.children.last().map_or(0, |&end| end as usize);
        let mut of_children = Vec::with_capacity(n_children);
        for (&value, range) in values.iter().zip(self.children()) {
            of_children.extend(std::iter::repeat_n(value, range.len()));
        }
        of_children
    }
}

/// The levels over sorted `cells`, up to one cell. `targets` are the values that the cells should have.
pub(super) fn pyramid<'a, const N: usize>(
    cells: &'a [u64],
    targets: Option<&'a [[f32; N]]>,
) -> Vec<PyramidLevel<'a, N>> {
    let mut levels = vec![PyramidLevel {
        keys: cells.into(),
        weights: vec![1; cells.len()],
        children: Vec::new(),
        targets: targets.unwrap_or_default().into(),
    }];
    while levels[levels.len() - 1].keys.len() > 1 {
        levels.push(parents(&levels[levels.len() - 1]));
    }
    levels
}

/// The level whose cells join those of `below` by eights, with their weighted means.
fn parents<const N: usize>(below: &PyramidLevel<'_, N>) -> PyramidLevel<'static, N> {
    let (mut keys, mut children) = (Vec::new(), Vec::new());
    for (i, key) in (0..).zip(below.keys.iter()) {
        if keys.last() != Some(&(key >> 3)) {
            keys.push(key >> 3);
            children.push(i);
        }
    }
    children.push(below.keys.len() as u32);
    let (mut weights, mut targets) = (Vec::new(), Vec::new());
    for range in children.windows(2).map(|range| range[0] as usize..range[1] as usize) {
        // No more cells than a key of 63 bits tells apart in memory: a file has at most 2^26.
        let weight: u32 = below.weights[range.clone()].iter().sum();
        weights.push(weight);
        if !below.targets.is_empty() {
            let mut mean = [0.0; N];
            for i in range {
                let share = below.weights[i] as f32 / weight as f32;
                (0..N).for_each(|c| mean[c] += share * below.targets[i][c]);
            }
            targets.push(mean);
        }
    }
    PyramidLevel { keys: keys.into(), weights, children, targets: targets.into() }
}

/// Goes down from the mean of all cells, `top`, to the values of the cells: `level` gives those of a level, and how active
/// each of its parents was, from its number in the pyramid, the parents, their children, and the values and activities of
/// the parents.
pub(super) fn descend<const N: usize, V, E>(
    levels: &[PyramidLevel<'_, N>],
    top: V,
    mut level: impl FnMut(usize, [&PyramidLevel<'_, N>; 2], &[V], &[u8]) -> Result<(Vec<V>, Vec<u8>), E>,
) -> Result<Vec<V>, E> {
    let (mut values, mut activity) = (vec![top], vec![0]);
    for l in (0..levels.len() - 1).rev() {
        let (parents, children) = (&levels[l + 1], &levels[l]);
        let (of_children, active) = level(l, [parents, children], &values, &activity)?;
        activity = parents.for_children(&active);
        values = of_children;
    }
    Ok(values)
}

/// Calls `value` for every child with its parent and those of the seven parents next to it on the child's side that exist:
/// their numbers, and the axes along which each is displaced as bits. The child's own comes first.
pub(super) fn from_parents<const N: usize, V: Send>(
    parents: &PyramidLevel<'_, N>,
    children: &PyramidLevel<'_, N>,
    value: impl Fn(&[(usize, usize)]) -> V + Sync,
) -> Vec<V> {
    let places = index(&parents.keys);
    let numbers: Vec<u32> = (0..parents.keys.len() as u32).collect();
    let of_parent = parents.for_children(&numbers);
    parallel::map_range(children.keys.len(), |i| {
        let (child, parent) = (children.keys[i], of_parent[i]);
        let own = parents.keys[parent as usize];
        let (mut around, mut n) = ([(0, 0); 8], 0);
        for corner in 0..8_usize {
            let displaced = (0..3).filter(|axis| corner >> axis & 1 != 0);
            let key = displaced.fold(own, |key, axis| step(key, axis, child >> axis & 1 != 0));
            let found = if corner == 0 { Some(&parent) } else { places.get(&key) };
            if let Some(&found) = found {
                around[n] = (found as usize, corner);
                n += 1;
            }
        }
        value(&around[..n])
    })
}
