//! Attributes of decoded points, from the cells around them.

use std::sync::OnceLock;

use surfabet_base::parallel;
use surfabet_base::rounding::floor_f32;
use surfabet_geom::morton::MortonMap;
use surfabet_geom::{CloudParts, Column, KdTree, Progress};

use crate::color::rounded;
use crate::error::Result;
use crate::patches::attributes::blending::{Corners, Weighted};
use crate::patches::attributes::cells::{cell_key, cell_of_key, index};
use crate::patches::attributes::{AttributeField, INTENSITIES, Values};
use crate::patches::model::Attributes;

/// Points that one task looks up.
const BLOCK: usize = 1 << 14;

/// Gives the attributes at any position.
pub(in crate::patches) struct Sampler<'a> {
    attributes: &'a Attributes,
    places: MortonMap<u32>,
    /// Middles of the cells, built when first needed.
    tree: OnceLock<Option<KdTree>>,
}

/// All attributes of some points.
struct PointAttributes {
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
        let blocks =
            parallel::try_map_chunks(positions, BLOCK, |positions| -> Result<PointAttributes> {
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

    fn block(&self, positions: &[[f32; 3]]) -> PointAttributes {
        let Attributes { color, others, .. } = self.attributes;
        let mut corners = Corners::new(&self.places);
        let around: Vec<Weighted> =
            positions.iter().map(|&p| self.around(p, &mut corners)).collect();
        let colors = color.as_ref().map_or(Vec::new(), |field| {
            let color = |cell: usize| field.colors[cell].map(f32::from);
            around.iter().map(|w| rounded(w.mean(color))).collect()
        });
        PointAttributes {
            colors,
            others: others.iter().map(|field| field.column(&around)).collect(),
        }
    }

    /// The cells around a position (pixels); without any the nearest of all.
    fn around(&self, position: [f32; 3], corners: &mut Corners<'_>) -> Weighted {
        let found = match self.attributes.unblended {
            true => self.own(position).map_or(Weighted::NONE, Weighted::only),
            false => corners.around(position),
        };
        match found.total > 0.0 {
            true => found,
            false => self.nearest(position).map_or(Weighted::NONE, Weighted::only),
        }
    }

    /// The cell that holds a position (pixels).
    fn own(&self, position: [f32; 3]) -> Option<u32> {
        self.places.get(&cell_key(position.map(floor_f32))).copied()
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
