//! Regions that may be a thing.

use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_geom::disjoint::root;
use surfabet_geom::vector::{dot, minus, unit};
use surfabet_geom::{Neighbor, Progress};
use surfabet_models::Result;

use super::options::RecurringOptions;
use crate::constants::{
    IN_PLANE, LARGE_CELL, LEAST_FILLED, LINK_REACH, MARGIN_OF_THINGS, ON_LARGE, PART_MARGIN,
};
use crate::find::{Region, SearchScene};

/// A set of samples with the box around it.
#[derive(Clone, Copy)]
struct Group {
    low: [f32; 3],
    high: [f32; 3],
    n: usize,
}

impl Group {
    const NONE: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3], n: 0 };

    fn add(&mut self, p: [f32; 3]) {
        self.low = std::array::from_fn(|a| self.low[a].min(p[a]));
        self.high = std::array::from_fn(|a| self.high[a].max(p[a]));
        self.n += 1;
    }

    fn diagonal(&self) -> f64 {
        (0..3).map(|a| f64::from(self.high[a] - self.low[a]).powi(2)).sum::<f64>().sqrt()
    }

    fn region(&self, margin: f64) -> Region {
        Region::Box {
            low: self.low.map(|c| f64::from(c) - margin),
            high: self.high.map(|c| f64::from(c) + margin),
        }
    }
}

/// Boxes about the origin of the model, and which samples may belong to things: those that are no part of smooth surfaces larger than
/// `options.max_size`, nor of their edges. A box is around samples that hang together; what hangs together over more than `options.max_size`
/// is taken apart: the box of each of its smooth pieces, with a margin, is one. Those with most samples are first. After them come the boxes of the
/// smooth pieces of all others, for things that occur once as a whole and whose pieces recur, such as a short row.
///
/// # Errors
/// [`surfabet_models::Error::Cancelled`].
pub(super) fn candidates(
    scene: &SearchScene,
    options: &RecurringOptions,
    progress: &dyn Progress,
) -> Result<(Vec<Region>, Vec<bool>)> {
    let spacing = scene.surface.spacing;
    let points = &scene.surface.points;
    let (pieces, _) = scene.surface.pieces(&scene.tree, progress)?;
    let boxes = groups(points, |i| Some(pieces[i]));
    let is_small = |i: usize| boxes[pieces[i] as usize].diagonal() <= options.max_size;
    let small: Vec<bool> = (0..points.len()).map(is_small).collect();
    let mut parts = beside_large(scene, &small, progress)?;
    let bare = bare_pieces(scene, &pieces, &small, options.max_size);
    parts.iter_mut().zip(&pieces).for_each(|(part, &piece)| *part &= !bare[piece as usize]);
    let together = linked(scene, &parts, (LINK_REACH * spacing) as f32, progress)?;
    let things = groups(points, |i| parts[i].then_some(together[i]));
    // A square of the least size, filled in part.
    let least = LEAST_FILLED * (options.min_size / spacing).powi(2);
    let fits = |g: &Group| {
        let size = g.diagonal();
        (options.min_size..=options.max_size).contains(&size) && g.n as f64 >= least
    };
    let (mut found, mut pieces_of_things) = (Vec::new(), Vec::new());
    for thing in things.iter().filter(|g| fits(g)) {
        found.push((thing.n, thing.region(MARGIN_OF_THINGS * spacing)));
    }
    for (k, piece) in boxes.iter().enumerate() {
        if piece.n == 0 || !parts[k] || !fits(piece) {
            continue;
        }
        let region = piece.region(PART_MARGIN * piece.diagonal());
        if region.diagonal() <= options.max_size {
            let is_in_larger = things[together[k] as usize].diagonal() > options.max_size;
            (if is_in_larger { &mut found } else { &mut pieces_of_things }).push((piece.n, region));
        }
    }
    // The order of samples decides among equal ones.
    found.sort_by_key(|&(n, _)| std::cmp::Reverse(n));
    pieces_of_things.sort_by_key(|&(n, _)| std::cmp::Reverse(n));
    found.extend(pieces_of_things);
    Ok((found.into_iter().map(|f| f.1).collect(), parts))
}

/// Which of the `small` samples are more than the edge of what is large: beside every large surface near them they stand out of its
/// plane.
fn beside_large(scene: &SearchScene, small: &[bool], progress: &dyn Progress) -> Result<Vec<bool>> {
    let surface = &scene.surface;
    let limit = (ON_LARGE * surface.spacing) as f32;
    parallel::try_map_range_with(surface.len(), Vec::new, |near: &mut Vec<Neighbor>, i| {
        if i % 1024 == 0 {
            progress.check()?;
        }
        if !small[i] {
            return Ok(false);
        }
        scene.tree.within(surface.points[i], limit, near);
        let is_on = |j: usize| {
            let d = minus(surface.points[i], surface.points[j]);
            !small[j] && dot(d, surface.normals[j]).abs() < 0.5 * limit
        };
        Ok(!near.iter().any(|n| is_on(n.index())))
    })
}

/// Which pieces, at the number of their first sample, are bare parts of a large surface that what stands before it cuts off: they lie in its
/// plane, not farther from it than twice `size`.
fn bare_pieces(scene: &SearchScene, pieces: &[u32], small: &[bool], size: f64) -> Vec<bool> {
    let surface = &scene.surface;
    let (cell, reach) = (LARGE_CELL * size, 2.0 * size);
    let limit = 0.5 * ON_LARGE * surface.spacing;
    // Large surfaces by cells: a few hundred of a room.
    let mut large: BTreeMap<([i32; 3], u32), Patch> = BTreeMap::new();
    let mut pieces_of: BTreeMap<u32, Patch> = BTreeMap::new();
    for i in 0..surface.len() {
        let (p, n) = (surface.points[i].map(f64::from), surface.normals[i].map(f64::from));
        if small[i] {
            pieces_of.entry(pieces[i]).or_default().add(p, n);
        } else {
            let key = p.map(|c| (c / cell).floor() as i32);
            large.entry((key, pieces[i])).or_default().add(p, n);
        }
    }
    let large: Vec<([f64; 3], [f64; 3])> = large.values().map(Patch::plane).collect();
    let mut bare = vec![false; surface.len()];
    for (piece, patch) in pieces_of {
        let (middle, normal) = patch.plane();
        bare[piece as usize] = large.iter().any(|&(at, of)| {
            // The normal of what is larger: that of a piece is off by more.
            let d = minus(middle, at);
            let is_in_plane = dot(normal, of).abs() > IN_PLANE && dot(d, of).abs() < limit;
            is_in_plane && dot(d, d) < reach * reach
        });
    }
    bare
}

/// Sums of positions and normals of a smooth surface, the normals turned to the side of the first.
#[derive(Default)]
struct Patch {
    n: f64,
    points: [f64; 3],
    normals: [f64; 3],
}

impl Patch {
    fn add(&mut self, p: [f64; 3], normal: [f64; 3]) {
        let side = if dot(self.normals, normal) < 0.0 { -1.0 } else { 1.0 };
        self.n += 1.0;
        (0..3).for_each(|a| self.points[a] += p[a]);
        (0..3).for_each(|a| self.normals[a] += side * normal[a]);
    }

    /// Middle and normal.
    fn plane(&self) -> ([f64; 3], [f64; 3]) {
        (self.points.map(|c| c / self.n), unit(self.normals))
    }
}

/// The boxes of groups of samples, each at the number of its first sample.
fn groups(points: &[[f32; 3]], of: impl Fn(usize) -> Option<u32>) -> Vec<Group> {
    let mut all = vec![Group::NONE; points.len()];
    for (i, &p) in points.iter().enumerate() {
        if let Some(k) = of(i) {
            all[k as usize].add(p);
        }
    }
    all
}

/// The first sample of what each of the samples with `parts` hangs together with, over steps of at most `reach`.
fn linked(
    scene: &SearchScene,
    parts: &[bool],
    reach: f32,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let n = scene.surface.len();
    let links = parallel::try_map_range_with(
        n,
        Vec::new,
        |near: &mut Vec<Neighbor>, i| -> Result<Vec<[u32; 2]>> {
            if i % 1024 == 0 {
                progress.check()?;
            }
            if !parts[i] {
                return Ok(Vec::new());
            }
            scene.tree.within(scene.surface.points[i], reach, near);
            let later = near.iter().map(|n| n.index()).filter(|&j| j > i && parts[j]);
            Ok(later.map(|j| [i as u32, j as u32]).collect())
        },
    )?;
    let mut parent: Vec<u32> = (0..n as u32).collect();
    for [i, j] in links.into_iter().flatten() {
        let [a, b] = [root(&mut parent, i), root(&mut parent, j)];
        parent[a.max(b) as usize] = a.min(b);
    }
    Ok((0..n as u32).map(|i| root(&mut parent, i)).collect())
}
