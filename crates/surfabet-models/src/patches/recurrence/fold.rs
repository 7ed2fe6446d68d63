//! A scene folded onto what recurs in it: all copies moved onto the first, of which the model is learned then.

use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_geom::PointCloud;
use surfabet_geom::cells::{cell_of, key, of_key};
use surfabet_geom::morton::MortonMap;

use super::Learned;
use super::surface::SurfacePixels;
use crate::error::Result;
use crate::patches::coding::Geometry;
use crate::patches::constants::{
    CHOSEN_CELL, COPIES_CELL, FLAG_BITS, FOLD_CELL, FOLD_REACH, MISFIT_POWER, MISFIT_SAMPLES,
};
use crate::patches::instances::{Instance, Instances, Motion, Place};
use crate::patches::model::Lattice;
use crate::patches::samples::{SidedSamples, rotate, rows_of};
use crate::patches::sheets::Sheet;
use crate::patches::surface::leaf::Leaf;

/// Which parts of a scene are moved onto which others.
pub(in crate::patches) struct Fold {
    lattice: Lattice,
    axis: u8,
    places: Vec<Place>,
    /// How many times as much the error is where copies are described by the first.
    misfit: f32,
    /// By number of the place, and one more, where each point goes; 0 where it stays.
    of_points: Vec<u16>,
    /// The same of samples.
    of_samples: Vec<u16>,
    /// The sides that the samples face where they are moved to.
    sides: Vec<u8>,
    /// Whether patches are learned of each sample.
    kept: Vec<bool>,
    /// Which copies lie in each coarse cell and those around it, a bit each: there are at most 40 motions.
    copies: MortonMap<u64>,
    /// Where each patch of the model without instances goes.
    of_leaves: Vec<u16>,
}

impl Fold {
    /// Of the samples near patches that go to some of the places: those that come near to samples that stay.
    pub(super) fn new(
        learned: &Learned<'_>,
        surface: &SurfacePixels<'_>,
        of_leaves: Vec<u16>,
        places: &[Place],
        axis: u8,
    ) -> Self {
        let lattice = learned.lattice;
        let pixel = lattice.pixel_size as f32;
        let motions: Vec<Motion> = places.iter().map(|&place| Motion::new(place, axis)).collect();
        let all = &learned.samples.all;
        let asked: Vec<(u16, [f32; 3])> = parallel::map(all, |sample| {
            let p = sample.position.map(|c| c / pixel);
            let owner = surface.owner(p, FOLD_REACH);
            (owner.map_or(0, |owner| of_leaves[owner as usize]), p)
        });
        // The sides of the samples that stay, a bit each.
        let mut staying: MortonMap<u8> = MortonMap::default();
        for (&(_, p), side) in asked.iter().zip(&learned.samples.sides).filter(|(of, _)| of.0 == 0)
        {
            *staying.entry(key(cell_of(p, FOLD_CELL))).or_default() |= 1 << side;
        }
        let found = parallel::map_range(asked.len(), |i| {
            let ((to, p), side) = (asked[i], learned.samples.sides[i]);
            if to == 0 {
                return ((0, p), side);
            }
            let motion = &motions[usize::from(to) - 1];
            let around = surfabet_geom::cells::around(cell_of(motion.source_of(p), FOLD_CELL));
            let there =
                around.filter_map(|cell| staying.get(&key(cell))).fold(0, |all, of| all | of);
            match there {
                0 => ((0, p), side),
                there => ((to, p), side_among(side_of_source(side, motion), there)),
            }
        });
        let (of_samples, sides): (Vec<(u16, [f32; 3])>, Vec<u8>) = found.into_iter().unzip();
        let mut of_points = vec![0; learned.n_points];
        for (of, points) in of_samples.iter().zip(learned.samples.points()) {
            points.iter().for_each(|&i| of_points[i as usize] = of.0);
        }
        let (copies, kept) = kept(&of_samples, &motions);
        let misfit = misfit(surface, &of_samples, &motions);
        let of_samples = of_samples.into_iter().map(|of| of.0).collect();
        let places = places.to_vec();
        Self {
            lattice,
            axis,
            places,
            misfit,
            of_points,
            of_samples,
            sides,
            kept,
            copies,
            of_leaves,
        }
    }

    fn motions(&self) -> Vec<Motion> {
        self.places.iter().map(|&place| Motion::new(place, self.axis)).collect()
    }

    /// The samples of all copies moved onto the first.
    pub fn moved<'a>(&self, mut samples: SidedSamples<'a>) -> SidedSamples<'a> {
        let motions = self.motions();
        let pixel = self.lattice.pixel_size as f32;
        let motion = |i: usize| match self.of_samples[i] {
            0 => None,
            m => Some(&motions[usize::from(m) - 1]),
        };
        parallel::for_each_mut(&mut samples.all, |i, sample| {
            if let Some(motion) = motion(i) {
                let source = motion.source_of(sample.position.map(|c| c / pixel));
                sample.position = source.map(|c| c * pixel);
            }
        });
        samples.sides.clone_from(&self.sides);
        samples
    }

    /// Of the moved samples as many as one scan has.
    pub fn as_of_one<'a>(&self, samples: &SidedSamples<'a>) -> SidedSamples<'a> {
        samples.only(&self.kept)
    }

    /// The points of these, where they are moved to, metres about the origin.
    pub fn positions_of_one(
        &self,
        samples: &SidedSamples<'_>,
        cloud: &PointCloud,
    ) -> Vec<[f32; 3]> {
        let motions = self.motions();
        let pixel = self.lattice.pixel_size as f32;
        let rows = rows_of(&self.lattice);
        let back: [[f32; 3]; 3] = std::array::from_fn(|a| std::array::from_fn(|k| rows[k][a]));
        parallel::gather(self.kept.len(), |i, found| {
            let of_sample = samples.points_of(i).iter().map(|&p| cloud.positions()[p as usize]);
            match (self.kept[i], self.of_samples[i]) {
                (false, _) => {}
                (true, 0) => found.extend(of_sample),
                (true, m) => found.extend(of_sample.map(|p| {
                    let p = rotate(&rows, p).map(|c| c / pixel);
                    rotate(&back, motions[usize::from(m) - 1].source_of(p).map(|c| c * pixel))
                })),
            }
        })
    }

    /// How many times the errors of a sheet count: as often as it has copies, but only as far as these differ. So of equal copies the
    /// first is coded as if it were alone, and of others finely enough that all come as near to the scan as they would with patches of
    /// their own.
    pub fn copies_of(&self, sheet: &Sheet) -> f32 {
        let copies = |p| {
            let of_cell = self.copies.get(&key(cell_of(p, COPIES_CELL)));
            of_cell.map_or(1, |of_cell| of_cell.count_ones().max(1)) as f32
        };
        let all = sheet.positions(self.lattice.tile_pixels()).map(copies);
        let mean = all.sum::<f32>() / sheet.runs.len().max(1) as f32;
        mean.min(self.misfit.powi(MISFIT_POWER))
    }

    /// The instances of a model of the folded scene: of each place the patches that show more of what was moved from there
    /// than of what is not there. `samples` are the moved ones, `before` is the surface of the scene as it is, and only `allowed`
    /// patches are taken.
    ///
    /// # Errors
    /// None that follow from the input: patches are finite.
    pub fn instances(
        &self,
        (samples, geometry): (&SidedSamples<'_>, &Geometry),
        before: &[Leaf],
        [density, lambda]: [f64; 2],
        allowed: impl Fn(&Leaf, &Motion) -> bool + Sync,
    ) -> Result<Instances> {
        let none = Instances::default();
        let Some(after) = SurfacePixels::new(&self.lattice, &geometry.leaves)? else {
            return Ok(none);
        };
        let Some(before) = SurfacePixels::new(&self.lattice, before)? else { return Ok(none) };
        let motions = self.motions();
        let won = self.won(&after, samples);
        let all: Vec<(u16, u32)> = (0..motions.len() as u16)
            .flat_map(|m| (0..geometry.leaves.len() as u32).map(move |leaf| (m, leaf)))
            .collect();
        let taken = parallel::map(&all, |&(m, leaf)| {
            let won = won.get(&(m, leaf)).copied().unwrap_or(0.0);
            let motion = &motions[usize::from(m)];
            let (harm, is_within) = self.harm(&after, leaf as usize, &before, (m, motion), won);
            let bonus = if is_within { FLAG_BITS * lambda as f32 } else { 0.0 };
            won + bonus > harm * density as f32 && allowed(&geometry.leaves[leaf as usize], motion)
        });
        let mut patches = vec![Vec::new(); motions.len()];
        for ((m, leaf), _) in all.into_iter().zip(taken).filter(|(_, taken)| *taken) {
            patches[usize::from(m)].push(leaf);
        }
        let instance =
            |(&place, patches): (&Place, Vec<u32>)| Instance { place, patches, points: Vec::new() };
        let all = self.places.iter().zip(patches).map(instance);
        let all = all.filter(|instance| !instance.patches.is_empty()).collect();
        Ok(Instances { axis: self.axis, all })
    }

    /// What is won, squared pixels, with each motion and patch: the samples that are moved there would be described by nothing.
    fn won(
        &self,
        after: &SurfacePixels<'_>,
        samples: &SidedSamples<'_>,
    ) -> BTreeMap<(u16, u32), f32> {
        let pixel = self.lattice.pixel_size as f32;
        let moved: Vec<(u16, [f32; 3])> = (self.of_samples.iter().zip(&samples.all))
            .filter(|(m, _)| **m > 0)
            .map(|(&m, sample)| (m - 1, sample.position.map(|c| c / pixel)))
            .collect();
        let owners = parallel::map(&moved, |&(m, p)| {
            let nearest = after.nearest(p)?;
            let won = after.cost(None) - after.cost(Some(nearest));
            Some((m, after.owners[nearest.pixel], won))
        });
        let mut won = BTreeMap::new();
        for (m, leaf, of) in owners.into_iter().flatten() {
            *won.entry((m, leaf)).or_insert(0.0) += of;
        }
        won
    }

    /// What it costs, squared pixels per sample of a pixel, that a patch is decoded where a motion takes it, and whether most of it lies
    /// where the scene is moved from. Without anything `won` a quick look may do.
    fn harm(
        &self,
        after: &SurfacePixels<'_>,
        leaf: usize,
        before: &SurfacePixels<'_>,
        (m, motion): (u16, &Motion),
        won: f32,
    ) -> (f32, bool) {
        let pixels = after.pixels_of(leaf);
        let half = after.leaves[leaf].patch.half_thickness();
        let middle = after.middles[(pixels.start + pixels.end) / 2];
        if won == 0.0 && !before.may_be_near(motion.of_position(middle)) {
            return (f32::INFINITY, false);
        }
        let (mut harm, mut within, n) = (0.0, 0, pixels.len());
        for i in pixels {
            let nearest = before.nearest(motion.of_position(after.middles[i]));
            harm += before.cost_of_decoded(nearest, half);
            let is_moved = |owner: u32| self.of_leaves[owner as usize] == m + 1;
            within += usize::from(nearest.is_some_and(|n| is_moved(before.owners[n.pixel])));
        }
        (harm, 2 * within >= n)
    }

    /// The place that each point goes to as instance of a model, and one more; 0 where there is none.
    pub fn of_points(&self, instances: &Instances) -> Vec<u16> {
        let number = |place: &Place| {
            let of = instances.all.iter().position(|instance| instance.place == *place);
            of.map_or(0, |i| i as u16 + 1)
        };
        let numbers: Vec<u16> = self.places.iter().map(number).collect();
        let renumbered = |&m: &u16| if m == 0 { 0 } else { numbers[usize::from(m) - 1] };
        self.of_points.iter().map(renumbered).collect()
    }
}

/// Which samples are kept of those that lie in one place: in each cell those of one of the copies, so that as many are kept as a scan has, and
/// patches come out as the mean of all.
fn kept(samples: &[(u16, [f32; 3])], motions: &[Motion]) -> (MortonMap<u64>, Vec<bool>) {
    let placed: Vec<[f32; 3]> = parallel::map(samples, |&(m, p)| match m {
        0 => p,
        m => motions[usize::from(m) - 1].source_of(p),
    });
    let mut copies: MortonMap<u64> = MortonMap::default();
    for (&(m, _), &p) in samples.iter().zip(&placed).filter(|(of, _)| of.0 > 0) {
        *copies.entry(key(cell_of(p, COPIES_CELL))).or_default() |= 1 << m;
    }
    for (_, &p) in samples.iter().zip(&placed).filter(|(of, _)| of.0 == 0) {
        if let Some(of_cell) = copies.get_mut(&key(cell_of(p, COPIES_CELL))) {
            *of_cell |= 1;
        }
    }
    let around = |&place: &u64| {
        let near = surfabet_geom::cells::around(of_key(place));
        near.filter_map(|cell| copies.get(&key(cell))).fold(0, |all, of| all | of)
    };
    let copies: MortonMap<u64> = copies.keys().map(|place| (*place, around(place))).collect();
    let kept = parallel::map_range(samples.len(), |i| {
        let Some(&of_cell) = copies.get(&key(cell_of(placed[i], COPIES_CELL))) else {
            return true;
        };
        // The cell chooses one of the copies, by bits that nothing in the scene follows.
        let cell = key(cell_of(placed[i], CHOSEN_CELL));
        let mixed = (cell ^ cell >> 31).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33;
        let mut left = of_cell;
        for _ in 0..mixed % u64::from(of_cell.count_ones().max(1)) {
            left &= left - 1;
        }
        left.trailing_zeros() == u32::from(samples[i].0)
    });
    (copies, kept)
}

/// The side that what faces a side had before a motion.
fn side_of_source(side: u8, motion: &Motion) -> u8 {
    let row = motion.rows[usize::from(side / 2)];
    let facing = if side.is_multiple_of(2) { 1.0 } else { -1.0 };
    let most = |&a: &usize, &b: &usize| row[a].abs().total_cmp(&row[b].abs()).then(b.cmp(&a));
    let axis = (0..3).max_by(most).unwrap_or(0);
    2 * axis as u8 + u8::from(facing * row[axis] < 0.0)
}

/// A side, or the other one where surface faces that alone: without viewpoints sides follow the axes, not what is turned.
fn side_among(side: u8, there: u8) -> u8 {
    let is_there = |side: u8| there >> side & 1 != 0;
    if !is_there(side) && is_there(side ^ 1) { side ^ 1 } else { side }
}

/// How many times as much the samples that are moved miss the surface where they are moved to, at least as much.
fn misfit(surface: &SurfacePixels<'_>, samples: &[(u16, [f32; 3])], motions: &[Motion]) -> f32 {
    let moved: Vec<&(u16, [f32; 3])> = samples.iter().filter(|of| of.0 > 0).collect();
    let some: Vec<&(u16, [f32; 3])> =
        moved.iter().copied().step_by(moved.len().div_ceil(MISFIT_SAMPLES).max(1)).collect();
    let costs = parallel::map(&some, |&&(m, p)| {
        let source = motions[usize::from(m) - 1].source_of(p);
        [p, source].map(|p| f64::from(surface.cost(surface.nearest(p))))
    });
    let sum = |k: usize| costs.iter().map(|of| of[k]).sum::<f64>();
    (sum(1) / sum(0).max(f64::MIN_POSITIVE)).max(1.0) as f32
}
