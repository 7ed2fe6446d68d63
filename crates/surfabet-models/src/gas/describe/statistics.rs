//! What a neuron stands for: the points nearest to it, as number, colour, plane, radius and thickness.

use rayon::prelude::*;
use surfabet_geom::{KdTree, Moments, Progress};

use crate::error::Result;
use crate::gas::adjacency::Adjacency;
use crate::gas::describe::orient::orient;

/// Neurons per unit of parallel work.
const BATCH: usize = 256;

/// Points to describe, all with the same weight.
pub(crate) struct Observed<'a> {
    pub points: &'a [[f32; 3]],
    pub colors: Option<&'a [[u8; 3]]>,
    /// Towards where each point was seen from, or its known normal; zero where unknown.
    pub facing: Option<Vec<[f32; 3]>>,
    pub weight: f64,
}

/// Description of every neuron.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Statistics {
    /// Sum of the weights of the nearest points.
    pub counts: Vec<f64>,
    /// Unit normals; zero where unknown.
    pub normals: Vec<[f32; 3]>,
    /// Mean colours.
    pub colors: Option<Vec<[f32; 3]>>,
    /// Radius of the disc over which the points would spread as they do in their plane, metres.
    pub radii: Vec<f64>,
    /// Standard deviation of the points across their plane, metres.
    pub thicknesses: Vec<f64>,
    /// Mean distance of points to their neurons, metres.
    pub mean_distance: f64,
}

#[derive(Clone, Copy, Default)]
struct Cell {
    moments: Moments,
    color: [f64; 3],
    colored: f64,
    facing: [f64; 3],
    distance: f64,
}

/// Describes neurons at `positions` by the points of `sets`, of which at least one has points.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(crate) fn describe(
    positions: &[[f32; 3]],
    adjacency: &Adjacency,
    sets: &[Observed<'_>],
    progress: &dyn Progress,
) -> Result<Statistics> {
    let tree = KdTree::new(positions)?;
    let mut cells = vec![Cell::default(); positions.len()];
    for set in sets {
        gather(&mut cells, &tree, set, progress)?;
    }
    progress.check()?;
    let counts: Vec<f64> = cells.iter().map(|cell| cell.moments.weight()).collect();
    let total: f64 = counts.iter().sum();
    let mean_distance = cells.iter().map(|cell| cell.distance).sum::<f64>() / total;
    let mut normals: Vec<[f64; 3]> = (0..positions.len())
        .into_par_iter()
        .with_min_len(BATCH)
        .map(|i| {
            // A neuron's own points are few and about as thick as wide; with those of its neighbours they span
            // a plane.
            let mut moments = cells[i].moments;
            for &j in adjacency.of(i) {
                moments.merge(&cells[j as usize].moments);
            }
            let magnitude = positions[i].iter().fold(0.0_f32, |m, c| m.max(c.abs()));
            moments.plane(f64::from(f32::EPSILON * magnitude)).map_or([0.0; 3], |p| p.normal)
        })
        .collect();
    let facing: Vec<[f64; 3]> = cells.iter().map(|cell| cell.facing).collect();
    orient(&mut normals, positions, adjacency, &facing);
    let spread = |i: usize| -> (f64, f64) {
        let (covariance, n) = (cells[i].moments.covariance(), normals[i]);
        let trace: f64 = (0..3).map(|a| covariance[a][a]).sum();
        let across: f64 = (0..3)
            .map(|r| (0..3).map(|c| n[r] * covariance[r][c] * n[c]).sum::<f64>())
            .sum::<f64>()
            .clamp(0.0, trace);
        // A disc of radius r has variance r^2 / 4 along either axis.
        ((2.0 * (trace - across)).sqrt(), across.sqrt())
    };
    let (radii, thicknesses) =
        (0..positions.len()).into_par_iter().with_min_len(BATCH).map(spread).unzip();
    let colors = cells.iter().any(|cell| cell.colored > 0.0).then(|| {
        let of = |cell: &Cell| cell.color.map(|c| (c / cell.colored) as f32);
        let around = |i: usize| {
            let known = adjacency.of(i).iter().map(|&j| &cells[j as usize]);
            known.filter(|cell| cell.colored > 0.0).map(of).next().unwrap_or([127.0; 3])
        };
        let color =
            |(i, cell): (usize, &Cell)| if cell.colored > 0.0 { of(cell) } else { around(i) };
        cells.iter().enumerate().map(color).collect()
    });
    Ok(Statistics {
        counts,
        normals: normals.into_iter().map(|n| n.map(|c| c as f32)).collect(),
        colors,
        radii,
        thicknesses,
        mean_distance,
    })
}

/// Adds the points of a set to the cells of their nearest neurons, in the order of the points.
fn gather(
    cells: &mut [Cell],
    tree: &KdTree,
    set: &Observed<'_>,
    progress: &dyn Progress,
) -> Result<()> {
    if set.points.is_empty() {
        return Ok(());
    }
    let nearest = tree.nearest_batch(set.points, progress)?;
    let mut starts = vec![0_usize; cells.len() + 1];
    for n in &nearest {
        starts[n.index() + 1] += 1;
    }
    for i in 0..cells.len() {
        starts[i + 1] += starts[i];
    }
    let mut next = starts.clone();
    let mut order = vec![0_u32; nearest.len()];
    for (i, n) in nearest.iter().enumerate() {
        order[next[n.index()]] = i as u32;
        next[n.index()] += 1;
    }
    progress.check()?;
    cells.par_iter_mut().with_min_len(BATCH).enumerate().for_each(|(i, cell)| {
        let members = &order[starts[i]..starts[i + 1]];
        for m in members.iter().map(|&m| m as usize) {
            cell.moments.add(set.points[m].map(f64::from), set.weight);
            cell.distance += set.weight * f64::from(nearest[m].squared_distance().sqrt());
            if let Some(colors) = set.colors {
                (0..3).for_each(|c| cell.color[c] += set.weight * f64::from(colors[m][c]));
                cell.colored += set.weight;
            }
            if let Some(facing) = &set.facing {
                (0..3).for_each(|a| cell.facing[a] += set.weight * f64::from(facing[m][a]));
            }
        }
    });
    Ok(())
}
