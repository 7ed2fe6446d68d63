//! How far points spread about their surface, before any patch is known.

use std::ops::Range;

use surfabet_base::parallel;
use surfabet_geom::morton;

use super::discs::noise_of_discs;
use super::flat_cells::{moments_of, spanned};
use crate::planes::constants::{
    CELL_POINTS, LEAST_GRID_SIZE_SIGMAS, MOST_OF_DISCS, NOISE_FLATNESS,
};
use crate::planes::fit::incidence::{Incidence, weighted_median};
use crate::planes::fit::trim::facing;
use crate::planes::points::Points;
use crate::vector::dot;

/// Standard deviation of the points about their planes, metres: the median over the points, in the smallest cells in
/// which at least half of the points lie in flat cells; and how it depends on the angle at which they were seen. `None` when that is so at
/// no size of cells. Where it is known from where points were seen, those seen from either side of a cell count each
/// about their own plane. Where small discs of surface have
/// clearly less, the cells reach over steps and edges, and that of the discs counts.
pub(in crate::planes::fit) fn noise(points: &Points) -> Option<(f64, Incidence)> {
    let (of_cells, incidence) = noise_of_cells(points)?;
    // On scan lines a disc may hold one of them. Surfaces nearer than the spacing are not told apart, however thin they are.
    let of_discs = noise_of_discs(points).filter(|_| points.line_spacing.is_none());
    let of_discs = of_discs.map(|of| of.max(points.spacing() / LEAST_GRID_SIZE_SIGMAS));
    let less = of_discs.filter(|of_discs| of_cells > MOST_OF_DISCS * of_discs);
    Some((less.unwrap_or(of_cells), incidence))
}

/// As [`noise`], of cells alone.
fn noise_of_cells(points: &Points) -> Option<(f64, Incidence)> {
    for level in points.level_with(CELL_POINTS)..morton::BITS {
        let cells: Vec<Range<usize>> = points.cells(level).collect();
        if cells.len() < 2 {
            break;
        }
        let side = points.side(level);
        let found: Vec<(f64, f64, f64)> = parallel::gather(cells.len(), |i, found| {
            found.extend(deviations(points, cells[i].clone(), side));
        });
        let mut deviations: Vec<(f64, f64)> = found.iter().map(|c| (c.0, c.2)).collect();
        let middle = weighted_median(&mut deviations);
        if middle <= NOISE_FLATNESS * side {
            // What is not flat is no noise.
            let flat: Vec<_> = found.into_iter().filter(|c| c.0 <= NOISE_FLATNESS * side).collect();
            return Some((middle, Incidence::of(&flat)));
        }
    }
    None
}

/// Standard deviation of the points of a cell of side `side` about their plane, infinite where they span none, the mean cosine of
/// the angle at which they were seen, and their weight; of each side that they were seen from.
fn deviations(points: &Points, cell: Range<usize>, side: f64) -> Vec<(f64, f64, f64)> {
    let moments = points.moments(cell.clone());
    let Some((frame, deviation)) = spanned(&moments, side) else {
        return vec![(f64::INFINITY, 1.0, moments.weight())];
    };
    if points.facing.is_none() {
        return vec![(deviation, 1.0, moments.weight())];
    }
    let n = cell.len();
    let members: Vec<u32> = cell.map(|i| i as u32).collect();
    let sides = points.sides(&members, frame.normal).into_iter().filter(|s| !s.is_empty());
    sides
        .map(|members| {
            // Mostly all were seen from one side.
            let (weight, spanned) = if members.len() == n {
                (moments.weight(), Some((frame, deviation)))
            } else {
                let moments = moments_of(points, &members);
                (moments.weight(), spanned(&moments, side))
            };
            let Some((frame, deviation)) = spanned else {
                return (f64::INFINITY, 1.0, weight);
            };
            let seen = facing(points, &members).unwrap_or_default();
            (deviation, dot(seen, frame.normal).abs() / members.len() as f64, weight)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use surfabet_geom::PointCloud;

    use super::*;

    /// The noise measured of 40,000 points of stairs, with risers of 17 cm and treads of 28 cm over 1 m, and even noise of this
    /// standard deviation along each axis.
    fn of_stairs(sigma: f64) -> [f64; 2] {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let half = sigma * f64::sqrt(3.0);
        let positions = (0..40_000).map(|_| {
            let step = f64::from(rng.random_range(0..10));
            let along = rng.random_range(-0.17..0.28_f64);
            let [x, z] = [0.28 * step + along.max(0.0), 0.17 * (step + 1.0) + along.min(0.0)];
            let p = [x, rng.random_range(0.0..1.0), z];
            p.map(|c| (c + rng.random_range(-half..half)) as f32)
        });
        let points = Points::new(&PointCloud::from_positions(positions.collect()).0, None).unwrap();
        [noise(&points), noise_of_cells(&points)].map(|found| found.unwrap().0)
    }

    /// Cells that are large enough to be flat beside 1 cm and more reach over several steps.
    #[test]
    fn noise_is_not_the_height_of_steps() {
        for sigma in [0.003, 0.012, 0.02] {
            let [found, of_cells] = of_stairs(sigma);
            assert!((0.75..1.25).contains(&(found / sigma)), "{found} {sigma}");
            assert_eq!(of_cells > 2.0 * sigma, sigma > 0.01, "{of_cells} {sigma}");
        }
    }
}
