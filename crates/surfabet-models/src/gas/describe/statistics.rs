//! Statistics of the points nearest to a neuron: number, colour, intensity, normal, radius and thickness.

use surfabet_base::parallel;
use surfabet_geom::{Moments, Progress};

use super::orient::orient;
use crate::error::Result;
use crate::gas::adjacency::Adjacency;
use crate::gas::ordered::Ordered;
use crate::gas::winners::{Groups, Nearby, Winner};

/// Colour of neurons of a coloured map without a colour of their own.
const GREY: [f32; 3] = [127.0; 3];

/// Points to describe, all with the same weight.
pub(in crate::gas) struct Observed<'a> {
    /// The values of the others are in the order of the input.
    pub points: &'a Ordered,
    pub colors: Option<&'a [[u8; 3]]>,
    pub intensities: Option<&'a [f32]>,
    /// Direction to the viewpoint of each point, or its known normal; zero where unknown.
    pub facing: Option<Vec<[f32; 3]>>,
    pub weight: f64,
}

/// What is known of the points before neurons are described.
pub(in crate::gas) struct Known {
    /// The neurons, and the two nearest to each point of each set, before they moved.
    pub nearby: Nearby,
    pub winners: Vec<Vec<[Winner; 2]>>,
    /// By how much they moved at most, metres.
    pub moved: f32,
}

/// Description of every neuron.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::gas) struct Statistics {
    /// Sum of the weights of the nearest points.
    pub counts: Vec<f64>,
    /// Unit normals; zero where unknown.
    pub normals: Vec<[f32; 3]>,
    /// Mean colours.
    pub colors: Option<Vec<[f32; 3]>>,
    /// Mean intensities.
    pub intensities: Option<Vec<f32>>,
    /// Radius of the disc over which the points would spread as they do in their plane, metres.
    pub radii: Vec<f64>,
    /// Standard deviation of the points across their plane, metres.
    pub thicknesses: Vec<f64>,
    /// Mean distance of points to their neurons, metres.
    pub mean_distance: f64,
}

/// Sums over the points nearest to a neuron, with their weights.
#[derive(Clone, Copy, Default)]
struct PointSums {
    moments: Moments,
    color: [f64; 3],
    /// Weight of the points with a colour.
    colored: f64,
    intensity: f64,
    /// Weight of the points with an intensity.
    measured: f64,
    facing: [f64; 3],
    distance: f64,
}

impl PointSums {
    /// Mean colour, where there is one.
    fn mean_color(&self) -> Option<[f32; 3]> {
        (self.colored > 0.0).then(|| self.color.map(|c| (c / self.colored) as f32))
    }

    /// Mean intensity, where there is one.
    fn mean_intensity(&self) -> Option<f32> {
        (self.measured > 0.0).then(|| (self.intensity / self.measured) as f32)
    }
}

/// Describes neurons at `positions` by the points of `sets`, of which at least one has points, and what is `known` of them.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(in crate::gas) fn describe(
    positions: &[[f32; 3]],
    adjacency: &Adjacency,
    sets: &[Observed<'_>],
    known: Option<Known>,
    progress: &dyn Progress,
) -> Result<Statistics> {
    let mut sums = vec![PointSums::default(); positions.len()];
    for (winners, set) in winners(positions, sets, known, progress)?.iter().zip(sets) {
        progress.check()?;
        gather(&mut sums, winners, set);
    }
    progress.check()?;
    let counts: Vec<f64> = sums.iter().map(|of| of.moments.weight()).collect();
    let total: f64 = counts.iter().sum();
    let mean_distance = sums.iter().map(|of| of.distance).sum::<f64>() / total;
    let normals = normals(positions, adjacency, &sums);
    let spreads = parallel::map_range(sums.len(), |i| spread(&sums[i].moments, normals[i]));
    let (radii, thicknesses) = spreads.into_iter().unzip();
    Ok(Statistics {
        counts,
        normals: normals.into_iter().map(|n| n.map(|c| c as f32)).collect(),
        colors: filled(adjacency, &sums, PointSums::mean_color, GREY),
        intensities: filled(adjacency, &sums, PointSums::mean_intensity, mean_intensity(&sums)),
        radii,
        thicknesses,
        mean_distance,
    })
}

/// For the points of each set two neurons, the first of which is the nearest.
fn winners(
    positions: &[[f32; 3]],
    sets: &[Observed<'_>],
    known: Option<Known>,
    progress: &dyn Progress,
) -> Result<Vec<Vec<[Winner; 2]>>> {
    let Some(Known { mut nearby, mut winners, moved }) = known else {
        let nearby = Nearby::new(positions, progress)?;
        return sets.iter().map(|set| nearby.assigned(&set.points.points, progress)).collect();
    };
    nearby.shift(positions, moved)?;
    for (set, winners) in sets.iter().zip(&mut winners) {
        nearby.follow(&set.points.points, winners, moved, progress)?;
    }
    Ok(winners)
}

/// Unit normal of the plane through the points of each neuron and its neighbours, on the side of the sensor or that of
/// the neighbours (see [`orient`]); zero where there is no plane.
///
/// A neuron's own points are few and about as thick as wide; with those of its neighbours they span a plane.
fn normals(positions: &[[f32; 3]], adjacency: &Adjacency, sums: &[PointSums]) -> Vec<[f64; 3]> {
    let mut normals: Vec<[f64; 3]> = parallel::map_range(positions.len(), |i| {
        let mut moments = sums[i].moments;
        for &j in adjacency.of(i) {
            moments.merge(&sums[j as usize].moments);
        }
        let magnitude = positions[i].iter().fold(0.0_f32, |m, c| m.max(c.abs()));
        moments.plane(f64::from(f32::EPSILON * magnitude)).map_or([0.0; 3], |p| p.normal)
    });
    let facing: Vec<[f64; 3]> = sums.iter().map(|of| of.facing).collect();
    orient(&mut normals, positions, adjacency, &facing);
    normals
}

/// Radius of the disc over which points spread, and their standard deviation across it: for the covariance C and the
/// normal n, `sqrt(2 (tr C - n' C n))`, as a disc of radius r has the variance `r^2 / 4` along either axis, and
/// `sqrt(n' C n)`.
fn spread(moments: &Moments, n: [f64; 3]) -> (f64, f64) {
    let covariance = moments.covariance();
    let trace: f64 = (0..3).map(|a| covariance[a][a]).sum();
    let across: f64 = (0..3)
        .map(|r| (0..3).map(|c| n[r] * covariance[r][c] * n[c]).sum::<f64>())
        .sum::<f64>()
        .clamp(0.0, trace);
    ((2.0 * (trace - across)).sqrt(), across.sqrt())
}

/// What `mean` gives of each neuron's points; without any that of a neighbour, or `else_`. `None` where no point has it.
fn filled<T: Copy>(
    adjacency: &Adjacency,
    sums: &[PointSums],
    mean: impl Fn(&PointSums) -> Option<T>,
    else_: T,
) -> Option<Vec<T>> {
    let value = |(i, own): (usize, &PointSums)| {
        let around = || adjacency.of(i).iter().find_map(|&j| mean(&sums[j as usize]));
        mean(own).or_else(around).unwrap_or(else_)
    };
    let any = sums.iter().any(|of| mean(of).is_some());
    any.then(|| sums.iter().enumerate().map(value).collect())
}

/// Mean intensity of all points; 0 without any.
fn mean_intensity(sums: &[PointSums]) -> f32 {
    let total = |part: fn(&PointSums) -> f64| sums.iter().map(part).sum::<f64>();
    let measured = total(|of| of.measured);
    if measured > 0.0 { (total(|of| of.intensity) / measured) as f32 } else { 0.0 }
}

/// Adds the points of a set to the sums of their nearest neurons, in the order of the points.
fn gather(sums: &mut [PointSums], winners: &[[Winner; 2]], set: &Observed<'_>) {
    let groups = Groups::new(sums.len(), winners);
    parallel::for_each_mut(sums, |i, of| {
        for m in groups.of(i) {
            of.moments.add(set.points.points[m].map(f64::from), set.weight);
            of.distance += set.weight * f64::from(winners[m][0].squared_distance()).sqrt();
            let m = set.points.source[m] as usize;
            if let Some(colors) = set.colors {
                (0..3).for_each(|c| of.color[c] += set.weight * f64::from(colors[m][c]));
                of.colored += set.weight;
            }
            if let Some(intensities) = set.intensities {
                of.intensity += set.weight * f64::from(intensities[m]);
                of.measured += set.weight;
            }
            if let Some(facing) = &set.facing {
                (0..3).for_each(|a| of.facing[a] += set.weight * f64::from(facing[m][a]));
            }
        }
    });
}
