//! Rounds of choosing patches: each with the adaptive models as coding the round before left them, and with the price of points
//! beside the patches that keeps enough of the input near at the fewest bytes.

use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_entropy::Price;
use surfabet_geom::Progress;

use super::{Choice, PointPrice};
use crate::error::Result;
use crate::patches::coding::{Geometry, GeometryModels, MAX_SHEETS, code_geometry, first_depth};
use crate::patches::constants::{LEAST_PRICE_SHARE, PRICE_STEPS};
use crate::patches::model::{Lattice, SheetTree, Square};
use crate::patches::options::{DEPTH_STEPS, PatchesOptions};
use crate::patches::sheets::Sheet;
use crate::patches::surface::basis::Basis;
use crate::patches::surface::leaf::Leaf;

/// The sheets that patches are chosen for, and what the choice depends on.
pub(in crate::patches) struct Rounds<'a> {
    pub lattice: Lattice,
    /// Sheets of the part that is described.
    pub sheets: &'a [Sheet],
    /// What of it stays as it was.
    pub kept: &'a [SheetTree],
    /// Those just beyond it.
    pub near: &'a [Sheet],
    /// Shapes of all levels.
    pub bases: &'a [Basis],
    /// Samples of a pixel.
    pub density: f64,
    pub options: &'a PatchesOptions,
    pub progress: &'a dyn Progress,
}

/// What the rounds chose.
#[derive(Default)]
pub(in crate::patches) struct RoundsOutcome {
    pub geometry: Geometry,
    /// Patches just beyond the part that is described.
    pub near: Vec<Leaf>,
    /// Of the geometry, after each round.
    pub bytes: Vec<f64>,
    models: GeometryModels,
}

impl RoundsOutcome {
    /// What the next rounds start from.
    fn trained(&self) -> Self {
        let (models, bytes) = (self.models.clone(), self.bytes.clone());
        Self { models, bytes, ..Self::default() }
    }
}

impl Rounds<'_> {
    /// The patches of least cost. Where they are not near enough to the input by themselves, points beside them have a
    /// `price`, if one is given: all of it where points are needed anyway, else as little as keeps the patches near enough, since
    /// what is left out then costs nothing until the allowance is used up.
    pub fn choose(
        &self,
        price: Option<PointPrice>,
        is_near_enough: impl Fn(&RoundsOutcome) -> Result<bool>,
    ) -> Result<RoundsOutcome> {
        let rounds = self.options.rounds;
        let Some(price) = price else { return self.rounds(rounds, None, RoundsOutcome::default()) };
        let mut free = self.rounds(1, None, RoundsOutcome::default())?;
        if is_near_enough(&free)? {
            free = self.rounds(rounds - 1, None, free)?;
            if is_near_enough(&free)? {
                return Ok(free);
            }
        }
        // From untrained models: those that were trained without a price expect masks that leave out what lies between the lines of a
        // laser.
        drop(free);
        let full = self.rounds(rounds, Some(price), RoundsOutcome::default())?;
        if !is_near_enough(&full)? {
            return Ok(full);
        }
        let mut best = full;
        let (mut too_little, mut enough) = (LEAST_PRICE_SHARE, 1.0);
        for _ in 0..PRICE_STEPS {
            let share = f64::sqrt(too_little * enough);
            let chosen = self.rounds(1, Some(price.scaled(share)), best.trained())?;
            if is_near_enough(&chosen)? {
                (best, enough) = (chosen, share);
            } else {
                too_little = share;
            }
        }
        Ok(best)
    }

    /// Some more rounds.
    fn rounds(
        &self,
        count: u32,
        points: Option<PointPrice>,
        before: RoundsOutcome,
    ) -> Result<RoundsOutcome> {
        // At most: one without a price, all with the full one, and those that look for less.
        let most = 1 + self.options.rounds + PRICE_STEPS;
        let mut outcome = before;
        for _ in 0..count {
            self.progress.update("choosing patches", outcome.bytes.len() as f32 / most as f32);
            // A scattered cloud has trees as large as itself: not two rounds of them at once.
            drop(std::mem::take(&mut outcome.geometry));
            let (geometry, models, bytes) =
                self.round((self.sheets, self.kept), &outcome.models, points)?;
            (outcome.geometry, outcome.models) = (geometry, models);
            outcome.bytes.push(bytes);
        }
        if count > 0 {
            // Of what lies beyond the part one round is enough.
            let (beyond, _, _) =
                self.round((self.near, &[]), &GeometryModels::default(), points)?;
            outcome.near = beyond.leaves;
        }
        Ok(outcome)
    }

    /// The patches of least cost for some sheets by the prices of `models`, the models as coding them leaves these, and the bytes.
    fn round(
        &self,
        (sheets, kept): (&[Sheet], &[SheetTree]),
        models: &GeometryModels,
        points: Option<PointPrice>,
    ) -> Result<(Geometry, GeometryModels, f64)> {
        let mut trees = self.trees(sheets, models, points)?;
        if !kept.is_empty() {
            trees = with_kept(trees, kept);
        }
        let (mut price, mut models) = (Price::default(), GeometryModels::default());
        let Ok(geometry) = code_geometry(&mut price, &mut models, self.lattice, &trees, usize::MAX);
        Ok((geometry, models, price.bits / 8.0))
    }

    /// The best hierarchy of every sheet that is not left out.
    fn trees(
        &self,
        sheets: &[Sheet],
        models: &GeometryModels,
        points: Option<PointPrice>,
    ) -> Result<Vec<SheetTree>> {
        let choice = Choice {
            models,
            bases: self.bases,
            // Distortion is summed over samples. What a bit must save is given per pixel, so that dense and sparse
            // scans are treated alike.
            lambda: (self.options.rate * self.density) as f32,
            step: self.lattice.depth_step as f32 / DEPTH_STEPS as f32,
            lattice: self.lattice,
            points,
        };
        let of_sheet = |sheet: &Sheet| -> Result<_> {
            self.progress.check()?;
            let root = choice.sheet(sheet);
            let tree = SheetTree { side: sheet.side, tile: sheet.tile, root };
            Ok((tree.root != Square::Empty).then_some(tree))
        };
        let trees: Vec<Option<SheetTree>> = parallel::try_map(sheets, of_sheet)?;
        Ok(trees.into_iter().flatten().collect())
    }
}

/// Sheets with those that are kept, by side, tile and depth; of more over one tile than a file may hold, those that are kept.
fn with_kept(mut trees: Vec<SheetTree>, kept: &[SheetTree]) -> Vec<SheetTree> {
    let mut counts: BTreeMap<(u8, [i32; 2]), usize> = BTreeMap::new();
    let place = |tree: &SheetTree| (tree.side, tree.tile);
    kept.iter().for_each(|tree| *counts.entry(place(tree)).or_default() += 1);
    trees.retain(|tree| {
        let count = counts.entry(place(tree)).or_default();
        *count += 1;
        *count <= MAX_SHEETS
    });
    trees.extend_from_slice(kept);
    trees.sort_by_key(|tree| (place(tree), first_depth(&tree.root)));
    trees
}
