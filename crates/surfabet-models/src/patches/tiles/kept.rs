//! Sheets of a tile that a scan does not touch: they stay as they are when the tile is learned again, symbol for symbol.

use std::collections::BTreeSet;

use surfabet_base::parallel;
use surfabet_geom::PointCloud;
use surfabet_geom::cells::cell_of;

use super::MARGIN_PIXELS;
use crate::patches::model::{PatchModel, SheetTree, Square};
use crate::patches::samples::{rotate, rows_of};

/// What a tile is learned from beside points that all count as one.
#[derive(Debug, Clone, Copy, Default)]
pub struct Known<'a> {
    /// Weights of the points, beside what their ranges give; all are 1 without.
    pub weights: Option<&'a [f32]>,
    /// How many measured points each of the points stands for; all are 1 without.
    pub n_measured: Option<&'a [f32]>,
    /// Sheets that stay as they are.
    pub sheets: &'a [SheetTree],
    /// So many of the first points are what these decode to.
    pub n_kept: usize,
}

/// Sheets that stay as they are.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KeptSheets {
    /// The sheets.
    pub sheets: Vec<SheetTree>,
    /// For each patch of the model whether it is of one of them.
    pub patches: Vec<bool>,
}

impl PatchModel {
    /// Sheets that no point of a scan, about the origin of the lattice, lies near enough to for any part of them to change: normals and sides
    /// of surfaces reach as far.
    pub fn untouched(&self, scan: &PointCloud) -> KeptSheets {
        let lattice = self.lattice();
        let rows = rows_of(&lattice);
        let block = (f64::from(MARGIN_PIXELS) * lattice.pixel_size) as f32;
        let blocks = parallel::map(scan.positions(), |&p| cell_of(rotate(&rows, p), block));
        let blocks: BTreeSet<[i32; 3]> = blocks.into_iter().collect();
        let is_touched = |[low, high]: [[f64; 3]; 2]| {
            let at = |c: f64| (c / f64::from(MARGIN_PIXELS)).floor() as i32;
            let (low, high) = (low.map(|c| at(c) - 1), high.map(|c| at(c) + 1));
            (low[0]..=high[0]).any(|x| {
                let mut row = blocks.range([x, i32::MIN, i32::MIN]..=[x, i32::MAX, i32::MAX]);
                let is_in = |b: &[i32; 3]| (1..3).all(|a| (low[a]..=high[a]).contains(&b[a]));
                row.any(is_in)
            })
        };
        let mut kept = KeptSheets::default();
        let mut leaves = self.leaves();
        for sheet in self.sheets() {
            let (own, rest) = leaves.split_at(n_patches(&sheet.root));
            leaves = rest;
            let is_kept = !own.iter().any(|leaf| is_touched(leaf.bounds(&lattice)));
            kept.patches.extend(own.iter().map(|_| is_kept));
            if is_kept {
                kept.sheets.push(sheet.clone());
            }
        }
        kept
    }
}

/// Number of the patches of a hierarchy.
fn n_patches(square: &Square) -> usize {
    match square {
        Square::Empty => 0,
        Square::Patch(_) => 1,
        Square::Split(children) => children.iter().map(n_patches).sum(),
    }
}
