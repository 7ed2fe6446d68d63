//! Attributes of decoded points, from the cells around them.

use std::sync::OnceLock;

use surfabet_base::parallel;
use surfabet_geom::morton::{MortonMap, step};
use surfabet_geom::{CloudParts, Column, KdTree, Progress};

use crate::error::Result;
use crate::patches::attributes::cells::{cell_key, cell_of_key, index};
use crate::patches::attributes::{AttributeField, INTENSITIES, Values};
use crate::patches::model::Attributes;

/// Points that one task looks up.
const BLOCK: usize = 1 << 14;

/// Gives the attributes at any position.
pub(super) struct Sampler<'a> {
    attributes: &'a Attributes,
    places: MortonMap<u32>,
    /// Middles of the cells, built when first needed.
    tree: OnceLock<Option<KdTree>>,
}

/// The cells around a position and their weights; none without cells.
struct Weighted {
    cells: [u32; 8],
    weights: [f32; 8],
    n: usize,
    total: f32,
}

impl Weighted {
    const NONE: Self = Self { cells: [0; 8], weights: [0.0; 8], n: 0, total: 0.0 };

    fn push(&mut self, cell: u32, weight: f32) {
        (self.cells[self.n], self.weights[self.n]) = (cell, weight);
        self.n += 1;
        self.total += weight;
    }

    fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        let cells = self.cells[..self.n].iter().map(|&cell| cell as usize);
        cells.zip(self.weights)
    }

    /// Weighted mean of the values of the cells; zero without any.
    fn mean<const N: usize>(&self, value: impl Fn(usize) -> [f32; N]) -> [f32; N] {
        let mut sum = [0.0; N];
        for (cell, weight) in self.iter() {
            let value = value(cell);
            (0..N).for_each(|c| sum[c] += weight * value[c]);
        }
        if self.n == 0 { sum } else { sum.map(|s| s / self.total) }
    }

    /// The cell with the largest weight, of equals the first.
    fn heaviest(&self) -> Option<usize> {
        let heavier = |a: (usize, f32), b: (usize, f32)| if b.1 > a.1 { b } else { a };
        self.iter().reduce(heavier).map(|(cell, _)| cell)
    }
}

/// All attributes of some points.
struct Block {
    colors: Vec<[u8; 3]>,
    /// Those beside colour.
    others: Vec<Column>,
}

impl<'a> Sampler<'a> {
    pub fn new(attributes: &'a Attributes) -> Self {
        Self { attributes, places: index(&attributes.cells), tree: OnceLock::new() }
    }

    /// The attributes at `positions` (pixels), as parts of a cloud without positions. Colours and scalars are trilinear
    /// between the middles of the eight cells around, over those that there are; a label is that of the one which counts
    /// most. Without blending the cell that holds the position counts. Off every patch the nearest cell does.
    pub fn at(&self, positions: &[[f32; 3]], progress: &dyn Progress) -> Result<CloudParts> {
        let Attributes { color, others, .. } = self.attributes;
        if color.is_none() && others.is_empty() {
            return Ok(CloudParts::default());
        }
        let blocks = parallel::try_map_chunks(positions, BLOCK, |positions| -> Result<Block> {
            progress.check()?;
            Ok(self.block(positions))
        })?;
        let mut parts = CloudParts {
            colors: color
                .is_some()
                .then(|| blocks.iter().flat_map(|block| &block.colors).copied().collect()),
            ..CloudParts::default()
        };
        for (i, field) in others.iter().enumerate() {
            let mut whole = field.column(&[]);
            for block in &blocks {
                whole.append(&block.others[i]);
            }
            if field.name == INTENSITIES
                && let Column::F32(values) = whole
            {
                parts.intensities = Some(values);
            } else {
                parts.extra.push((field.name.clone(), whole));
            }
        }
        Ok(parts)
    }

    fn block(&self, positions: &[[f32; 3]]) -> Block {
        let Attributes { color, others, .. } = self.attributes;
        let mut cache = CornerCache::new();
        let around: Vec<Weighted> = positions.iter().map(|&p| self.around(p, &mut cache)).collect();
        let colors = color.as_ref().map_or(Vec::new(), |field| {
            let color = |cell: usize| field.colors[cell].map(f32::from);
            around.iter().map(|w| w.mean(color).map(|c| c.round() as u8)).collect()
        });
        Block { colors, others: others.iter().map(|field| field.column(&around)).collect() }
    }

    /// The cells around a position (pixels): of the eight between whose middles it is those that there are; without any the
    /// nearest of all.
    fn around(&self, position: [f32; 3], cache: &mut CornerCache) -> Weighted {
        if self.attributes.unblended {
            return self.own(position);
        }
        let shifted = position.map(|c| c - 0.5);
        let low = shifted.map(f32::floor);
        let part: [f32; 3] = std::array::from_fn(|a| shifted[a] - low[a]);
        let corners = cache.around(cell_key(low.map(|c| c as i32)), &self.places);
        let mut found = Weighted::NONE;
        for (corner, &place) in corners.iter().enumerate() {
            if place != NO_CELL {
                let side = |a: usize| if corner >> a & 1 != 0 { part[a] } else { 1.0 - part[a] };
                found.push(place, side(0) * side(1) * side(2));
            }
        }
        if found.total <= 1e-6 {
            found = Weighted::NONE;
            if let Some(nearest) = self.nearest(position) {
                found.push(nearest, 1.0);
            }
        }
        found
    }

    /// The cell that holds a position (pixels), or without one the nearest.
    fn own(&self, position: [f32; 3]) -> Weighted {
        let mut found = Weighted::NONE;
        let own = self.places.get(&cell_key(position.map(|c| c.floor() as i32))).copied();
        if let Some(cell) = own.or_else(|| self.nearest(position)) {
            found.push(cell, 1.0);
        }
        found
    }

    /// The nearest cell of all, for points off every patch.
    fn nearest(&self, position: [f32; 3]) -> Option<u32> {
        let tree = self.tree.get_or_init(|| {
            let middle = |&key: &u64| cell_of_key(key).map(|c| c as f32 + 0.5);
            let middles: Vec<[f32; 3]> = self.attributes.cells.iter().map(middle).collect();
            KdTree::new(&middles).ok()
        });
        tree.as_ref()?.nearest(position).map(|n| n.index() as u32)
    }
}

impl AttributeField {
    /// The values around some positions.
    fn column(&self, around: &[Weighted]) -> Column {
        match &self.values {
            Values::Scalar(field) => {
                let steps = |w: &Weighted| w.mean(|cell| [field.values[cell]])[0];
                let values = around.iter().map(|w| field.scale.value(f64::from(steps(w))));
                self.dtype.column_of_numbers(values)
            }
            Values::Labels(field) => {
                let number = |w: &Weighted| w.heaviest().map_or(0, |cell| field.labels[cell]);
                let values = around.iter().map(|w| field.values[usize::from(number(w))]);
                self.dtype.column_of_integers(values)
            }
        }
    }
}

/// No cell at a corner.
const NO_CELL: u32 = u32::MAX;

/// A cache of the cells at the corners of the cubes between cell middles.
struct CornerCache {
    slots: Vec<(u64, [u32; 8])>,
}

impl CornerCache {
    /// Slots; a patch passes through a few hundred cubes.
    const SIZE: usize = 1 << 10;

    fn new() -> Self {
        // No key has its highest bit set.
        Self { slots: vec![(u64::MAX, [NO_CELL; 8]); Self::SIZE] }
    }

    /// Numbers of the cell `low` and its seven successors; [`NO_CELL`] for those that there are not.
    fn around(&mut self, low: u64, places: &MortonMap<u32>) -> &[u32; 8] {
        let slot = &mut self.slots[(low ^ low >> 10 ^ low >> 20) as usize % Self::SIZE];
        if slot.0 != low {
            let corner = |corner: usize| {
                let along = (0..3).filter(|a| corner >> a & 1 != 0);
                let key = along.fold(low, |key, axis| step(key, axis, true));
                places.get(&key).copied().unwrap_or(NO_CELL)
            };
            *slot = (low, std::array::from_fn(corner));
        }
        &slot.1
    }
}
