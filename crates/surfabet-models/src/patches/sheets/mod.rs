//! Samples of one side as sheets: single-valued height fields over the tiles of the coarsest level.
//!
//! Within a pixel's column, samples without a gap between them are one run: a stretch of depth with a middle and
//! a thickness. Runs of neighbouring pixels whose depths agree grow into a sheet, never two of one pixel, so that
//! what lies behind one another (a table top and its underside, two boxes) becomes several sheets.
//!
//! All lengths here are in pixels of the finest level.

use std::collections::VecDeque;

use rayon::prelude::*;
use surfabet_geom::KdTree;

use crate::error::Result;
use crate::patches::coding::MAX_SHEETS;
use crate::patches::samples::Samples;

/// Samples of a column further apart than this are two runs, pixels.
const GAP: f32 = 2.5;

/// Longest run, pixels: no patch is thicker.
const LONGEST: f32 = 24.0;

/// Depth step between neighbouring runs that one surface may make, pixels, beside the mean half thickness.
const STEP: f32 = 1.25;

/// Thinnest half thickness of a run and of what is decoded, pixels: what one layer of samples stands for.
pub(in crate::patches) const THINNEST: f32 = 0.25;

/// Sheets of fewer samples may be left out of the model at the price of their distance to the others.
const SMALL: f32 = 256.0;

/// A stretch of depth in the column of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::patches) struct Run {
    /// Pixel within the tile.
    pub u: u8,
    pub v: u8,
    /// Number of samples.
    pub n: f32,
    /// Mean depth.
    pub depth: f32,
    /// Half thickness: sqrt(3) standard deviations, the half width of a slab of that variance.
    pub half: f32,
    /// Distance to the nearest run of any large sheet; of no account in large sheets.
    pub stray: f32,
}

/// A height field over a tile.
#[derive(Debug, Clone)]
pub(in crate::patches) struct Sheet {
    pub side: u8,
    /// Tile of the coarsest level, along the two axes of the side.
    pub tile: [i32; 2],
    pub runs: Vec<Run>,
    /// Whether it may be left out.
    pub small: bool,
}

/// Depth axis and the axes of columns and rows of a side.
pub(in crate::patches) fn axes_of(side: u8) -> [usize; 3] {
    let depth = usize::from(side / 2);
    [depth, (depth + 1) % 3, (depth + 2) % 3]
}

/// Sheets of all sides, by side, tile and depth.
pub(in crate::patches) fn grow(
    samples: &Samples,
    pixel: f32,
    tile_pixels: i32,
) -> Result<Vec<Sheet>> {
    // One entry per sample: tile and pixel as a key, then depth.
    let mut entries: Vec<(u128, f32, f32)> = samples
        .samples
        .par_iter()
        .zip(&samples.sides)
        .map(|(sample, &side)| {
            let [d, u, v] = axes_of(side).map(|a| sample.position[a] / pixel);
            let (pu, pv) = (u.floor() as i32, v.floor() as i32);
            let tile = [pu.div_euclid(tile_pixels), pv.div_euclid(tile_pixels)];
            let within = [pu.rem_euclid(tile_pixels), pv.rem_euclid(tile_pixels)];
            let shifted = |t: i32| (i64::from(t) + (1 << 31)) as u128;
            let key = u128::from(side) << 80
                | shifted(tile[0]) << 48
                | shifted(tile[1]) << 16
                | (within[1] as u128) << 8
                | within[0] as u128;
            (key, d, sample.weight)
        })
        .collect();
    entries.par_sort_unstable_by(|a, b| {
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    });
    let tiles: Vec<&[(u128, f32, f32)]> = entries.chunk_by(|a, b| a.0 >> 16 == b.0 >> 16).collect();
    let grown: Vec<Vec<Sheet>> =
        tiles.par_iter().map(|tile| grow_tile(tile, tile_pixels as usize)).collect();
    let mut sheets: Vec<Sheet> = grown.into_iter().flatten().collect();
    measure_strays(&mut sheets, tile_pixels)?;
    Ok(sheets)
}

fn runs_of(column: &[(u128, f32, f32)], runs: &mut Vec<Run>) {
    let (u, v) = ((column[0].0 & 0xff) as u8, (column[0].0 >> 8 & 0xff) as u8);
    let mut rest = column;
    while let Some(first) = rest.first() {
        let mut end = 1;
        while end < rest.len()
            && rest[end].1 - rest[end - 1].1 <= GAP
            && rest[end].1 - first.1 <= LONGEST
        {
            end += 1;
        }
        let (run, behind) = rest.split_at(end);
        rest = behind;

        let n = run.len() as f64;
        let weight: f64 = run.iter().map(|e| f64::from(e.2)).sum();
        let depth = run.iter().map(|e| f64::from(e.2) * f64::from(e.1)).sum::<f64>() / weight;
        let variance = run.iter().map(|e| (f64::from(e.1) - depth).powi(2)).sum::<f64>() / n;
        runs.push(Run {
            u,
            v,
            n: n as f32,
            depth: depth as f32,
            half: ((3.0 * variance).sqrt() as f32).max(THINNEST),
            stray: 0.0,
        });
    }
}

fn grow_tile(tile: &[(u128, f32, f32)], side_pixels: usize) -> Vec<Sheet> {
    let mut runs = Vec::new();
    for column in tile.chunk_by(|a, b| a.0 == b.0) {
        runs_of(column, &mut runs);
    }
    let mut by_pixel = vec![0_u32..0; side_pixels * side_pixels];
    for (i, run) in (0..).zip(&runs) {
        let range = &mut by_pixel[usize::from(run.v) * side_pixels + usize::from(run.u)];
        if range.start == range.end {
            range.start = i;
        }
        range.end = i + 1;
    }
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|&a, &b| runs[b].n.total_cmp(&runs[a].n).then(a.cmp(&b)));
    let mut taken = vec![false; runs.len()];
    // Sheet that took a pixel last, so that no sheet takes a pixel twice.
    let mut seen = vec![usize::MAX; side_pixels * side_pixels];
    let key = tile[0].0;
    let unshifted = |t: u128| ((t & 0xffff_ffff) as i64 - (1 << 31)) as i32;
    let (side, at) = ((key >> 80) as u8, [unshifted(key >> 48), unshifted(key >> 16)]);
    let mut grown: Vec<Vec<usize>> = Vec::new();
    for seed in order {
        if taken[seed] {
            continue;
        }
        let mut members = vec![seed];
        let mut queue = VecDeque::from([seed]);
        taken[seed] = true;
        let pixel_of = |r: &Run| usize::from(r.v) * side_pixels + usize::from(r.u);
        seen[pixel_of(&runs[seed])] = seed;
        while let Some(i) = queue.pop_front() {
            let run = runs[i];
            for (du, dv) in NEIGHBOURS {
                let (u, v) = (i32::from(run.u) + du, i32::from(run.v) + dv);
                if u < 0 || v < 0 || u >= side_pixels as i32 || v >= side_pixels as i32 {
                    continue;
                }
                let pixel = v as usize * side_pixels + u as usize;
                if seen[pixel] == seed {
                    continue;
                }
                let distance = du.abs().max(dv.abs()) as f32;
                let nearest =
                    by_pixel[pixel].clone().map(|j| j as usize).filter(|&j| !taken[j]).min_by(
                        |&a, &b| {
                            let off = |j: usize| (runs[j].depth - run.depth).abs();
                            off(a).total_cmp(&off(b))
                        },
                    );
                let Some(j) = nearest else { continue };
                let gate = STEP * distance + 0.5 * (run.half + runs[j].half);
                if (runs[j].depth - run.depth).abs() <= gate {
                    taken[j] = true;
                    seen[pixel] = seed;
                    members.push(j);
                    queue.push_back(j);
                }
            }
        }
        grown.push(members);
    }
    for scale in SCALES {
        join(&runs, &by_pixel, side_pixels, scale, &mut grown);
    }
    let mut sheets: Vec<Sheet> = grown
        .into_iter()
        .filter(|members| !members.is_empty())
        .map(|mut members| {
            members.sort_unstable();
            let runs: Vec<Run> = members.iter().map(|&i| runs[i]).collect();
            let small = runs.iter().map(|r| r.n).sum::<f32>() < SMALL;
            Sheet { side, tile: at, runs, small }
        })
        .collect();
    // What no tile of a scan holds, but noise may: the smallest go.
    let samples = |s: &Sheet| s.runs.iter().map(|r| f64::from(r.n)).sum::<f64>();
    sheets.sort_by(|a, b| samples(b).total_cmp(&samples(a)));
    sheets.truncate(MAX_SHEETS);
    let mean =
        |s: &Sheet| s.runs.iter().map(|r| f64::from(r.depth)).sum::<f64>() / s.runs.len() as f64;
    sheets.sort_by(|a, b| mean(a).total_cmp(&mean(b)));
    sheets
}

/// Joins small sheets to the neighbour that they touch most, where no pixel would hold two runs: a surface that is
/// sampled more coarsely than the pixel, or in steps of depth, falls apart into strips otherwise.
fn join(
    runs: &[Run],
    by_pixel: &[std::ops::Range<u32>],
    side_pixels: usize,
    scale: i32,
    sheets: &mut [Vec<usize>],
) {
    let mut sheet_of = vec![usize::MAX; runs.len()];
    for (s, members) in sheets.iter().enumerate() {
        members.iter().for_each(|&i| sheet_of[i] = s);
    }
    let samples = |members: &[usize]| members.iter().map(|&i| runs[i].n).sum::<f32>();
    let mut order: Vec<usize> =
        (0..sheets.len()).filter(|&s| samples(&sheets[s]) < SMALL).collect();
    order.sort_by(|&a, &b| samples(&sheets[a]).total_cmp(&samples(&sheets[b])).then(a.cmp(&b)));
    for small in order {
        // Contacts with other sheets, and those that share a pixel with this one.
        let mut contacts: Vec<(usize, u32)> = Vec::new();
        let mut shared: Vec<usize> = Vec::new();
        for &i in &sheets[small] {
            let run = runs[i];
            for dv in -scale..=scale {
                for du in -scale..=scale {
                    let (u, v) = (i32::from(run.u) + du, i32::from(run.v) + dv);
                    if u < 0 || v < 0 || u >= side_pixels as i32 || v >= side_pixels as i32 {
                        continue;
                    }
                    for j in by_pixel[v as usize * side_pixels + u as usize].clone() {
                        let other = sheet_of[j as usize];
                        if other == small {
                            continue;
                        }
                        if du == 0 && dv == 0 {
                            shared.push(other);
                            continue;
                        }
                        let distance = du.abs().max(dv.abs()) as f32;
                        let near = &runs[j as usize];
                        let gate =
                            STEP * distance.max(0.5 * scale as f32) + 0.5 * (run.half + near.half);
                        if (near.depth - run.depth).abs() <= gate {
                            match contacts.iter_mut().find(|c| c.0 == other) {
                                Some(contact) => contact.1 += 1,
                                None => contacts.push((other, 1)),
                            }
                        }
                    }
                }
            }
        }
        let best = contacts
            .into_iter()
            .filter(|c| !shared.contains(&c.0))
            .max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)));
        if let Some((other, _)) = best {
            let members = std::mem::take(&mut sheets[small]);
            members.iter().for_each(|&i| sheet_of[i] = other);
            sheets[other].extend(members);
        }
    }
}

/// Reaches, in pixels, at which small sheets are joined to others.
const SCALES: [i32; 2] = [2, 4];

/// The eight pixels around one, then the four behind the nearest: a scan line missing does not cut a sheet.
const NEIGHBOURS: [(i32, i32); 12] = [
    (-1, 0),
    (1, 0),
    (0, -1),
    (0, 1),
    (-1, -1),
    (1, -1),
    (-1, 1),
    (1, 1),
    (-2, 0),
    (2, 0),
    (0, -2),
    (0, 2),
];

/// How far the runs of small sheets are from large ones.
fn measure_strays(sheets: &mut [Sheet], tile_pixels: i32) -> Result<()> {
    let position = |sheet: &Sheet, run: &Run| {
        let [d, u, v] = axes_of(sheet.side);
        let mut p = [0.0; 3];
        p[d] = run.depth;
        p[u] = (sheet.tile[0] * tile_pixels + i32::from(run.u)) as f32 + 0.5;
        p[v] = (sheet.tile[1] * tile_pixels + i32::from(run.v)) as f32 + 0.5;
        p
    };
    let large: Vec<[f32; 3]> = sheets
        .iter()
        .filter(|s| !s.small)
        .flat_map(|s| s.runs.iter().map(|r| position(s, r)))
        .collect();
    let tree = if large.is_empty() { None } else { Some(KdTree::new(&large)?) };
    sheets.par_iter_mut().filter(|s| s.small).for_each(|sheet| {
        let positions: Vec<[f32; 3]> = sheet.runs.iter().map(|r| position(sheet, r)).collect();
        for (run, p) in sheet.runs.iter_mut().zip(positions) {
            let nearest = tree.as_ref().and_then(|t| t.nearest(p));
            run.stray = nearest.map_or(f32::MAX.sqrt(), |n| n.squared_distance().sqrt());
        }
    });
    Ok(())
}
