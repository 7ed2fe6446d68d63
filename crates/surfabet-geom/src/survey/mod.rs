//! The figures of a cloud before anything is learned from it: spacing, noise, layers, scan lines, extent and outliers.
//!
//! Defaults follow from these figures. Spacing, noise, layers and lines are medians over a sample of the points, outliers and
//! extent are of all points. All depend on the cloud alone.
//!
//! | file | what is measured |
//! |---|---|
//! | `sample` | the points that are measured |
//! | `around` | their neighbours |
//! | `facing` | which way surfaces face |
//! | `rounding` | coordinates that are multiples of a step |
//! | `noise` | deviation of neighbouring points from their plane |
//! | `layers` | distance to a second surface behind the first |
//! | `lines` | distance between scan lines |
//! | `outliers` | small groups of points far from all others |

mod around;
mod facing;
mod layers;
mod lines;
mod noise;
mod outliers;
mod rounding;
mod sample;

use crate::cloud::PointCloud;
use crate::error::Result;
pub use facing::has_facings;
use layers::layer_gap;
use lines::line_spacing;
use noise::Planes;
use outliers::Outliers;
use rounding::rounding;
use sample::SampledCloud;
use surfabet_base::Progress;

/// Figures of a cloud.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Survey {
    /// Median distance of a point to the nearest one at another place, metres; the rounding where that is more. Zero where
    /// all points are at one place.
    pub spacing: f64,
    /// Largest step that the coordinates of all points along an axis are multiples of, metres, where it is larger than the
    /// distance of neighbours: there is nothing between the steps; else zero.
    pub rounding: f64,
    /// Median standard deviation of neighbouring points about their plane, metres: the noise of a thin scan, the
    /// thickness of a fused one.
    pub noise: f64,
    /// Where at least a seventh of the points have a second surface close behind theirs: the distance of the two, metres.
    pub layer_gap: Option<f64>,
    /// Whether it is known which way surfaces face: points have viewpoints, or normals that somebody oriented.
    pub has_facings: bool,
    /// Where at least half of the points lie on scan lines that are at least three spacings apart: the median distance
    /// from a point to the next line, metres.
    pub line_spacing: Option<f64>,
    /// Lower and upper corner of the box around all points but the outliers, world coordinates, metres; `None` without
    /// points.
    pub bounds: Option<([f64; 3], [f64; 3])>,
    /// Points of small groups that are far from all others, by number, ascending.
    pub outliers: Vec<u32>,
    /// Those of the outliers that are further from the box of the others than the box is large: they alone would make
    /// the scene many times as large as it is.
    pub strays: Vec<u32>,
}

/// The tolerance in spacings. Of a surface that was sampled at random half is within the median distance to the nearest
/// sample, and all but a sixteenth within two of them. One and four change the tolerance of 29 and 37 of 40 clouds, at
/// most to half and double; that of the others follows from their noise (`docs/benchmarks/constants.md`).
const SPACINGS: f64 = 2.0;

/// The tolerance in standard deviations of the noise: 99.7 percent of normal deviations are less.
const DEVIATIONS: f64 = 3.0;

impl Survey {
    /// Measures a cloud.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn of(cloud: &PointCloud, progress: &dyn Progress) -> Result<Self> {
        if cloud.is_empty() {
            return Ok(Self::default());
        }
        let sample = SampledCloud::of(cloud)?;
        progress.check()?;
        let surroundings = sample.surroundings();
        let nearest = median(surroundings.iter().filter_map(|around| around.nearest).collect());
        // A thousandth more is the same length in single precision: points of a lattice are a step apart.
        let rounding = rounding(&sample.positions, 1.001 * nearest);
        let spacing = nearest.max(rounding);
        let planes = Planes::about(&surroundings);
        progress.check()?;
        let noise = planes.noise;
        let layer_gap = layer_gap(&sample, &surroundings, &planes, spacing);
        progress.check()?;
        let line_spacing = line_spacing(&sample, &surroundings, spacing);
        progress.check()?;
        let Outliers { all: outliers, strays, bounds } = Outliers::of(cloud, spacing)?;
        progress.check()?;
        let has_facings = sample.facings.is_some();
        Ok(Self {
            spacing,
            rounding,
            noise,
            layer_gap,
            line_spacing,
            has_facings,
            bounds,
            outliers,
            strays,
        })
    }

    /// How far a decoded cloud may be from a point and still show it, metres: two spacings, or three standard
    /// deviations of the noise where that is more.
    pub fn tolerance(&self) -> f64 {
        (SPACINGS * self.spacing).max(DEVIATIONS * self.noise)
    }

    /// Extent of the box, metres.
    pub fn extent(&self) -> [f64; 3] {
        self.bounds.map_or([0.0; 3], |(low, high)| std::array::from_fn(|a| high[a] - low[a]))
    }
}

/// Median standard deviation of neighbouring points about their plane, metres, as [`Survey::noise`].
///
/// # Errors
/// [`crate::Error::InvalidParameter`] for a coordinate that is not finite.
pub fn estimate_noise(positions: &[[f32; 3]]) -> Result<f64> {
    if positions.is_empty() {
        return Ok(0.0);
    }
    Ok(Planes::about(&SampledCloud::of_positions(positions)?.surroundings()).noise)
}

/// The middle of the sorted values, of an even number the upper one; zero of none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use surfabet_base::Silent;

    use super::*;
    use crate::cloud::CloudParts;

    /// Points of a square lattice of spacing `step`, `n` to a side, moved by `moved`.
    fn lattice(n: i32, step: f32, moved: impl Fn(i32, i32) -> [f32; 3]) -> Vec<[f32; 3]> {
        let at = |i: i32, j: i32| {
            let m = moved(i, j);
            [i as f32 * step + m[0], j as f32 * step + m[1], m[2]]
        };
        (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| at(i, j)).collect()
    }

    /// Evenly spread in -1..1, the same for the same numbers.
    fn spread(i: i32, j: i32) -> f32 {
        let golden = 0.618_034 * (i as f32 * 131.0 + j as f32 * 17.0);
        2.0 * golden.fract() - 1.0
    }

    fn survey(positions: Vec<[f32; 3]>) -> Survey {
        Survey::of(&PointCloud::from_positions(positions).0, &Silent).unwrap()
    }

    #[test]
    fn spacing_and_noise_of_a_lattice() {
        // An even slab of half width 3 mm has a standard deviation of 3 / sqrt(3) mm.
        let found = survey(lattice(120, 0.01, |i, j| [0.0, 0.0, 0.003 * spread(i, j)]));
        assert!((0.0100..0.0108).contains(&found.spacing), "{}", found.spacing);
        assert!((0.0014..0.0020).contains(&found.noise), "{}", found.noise);
        assert_eq!(found.layer_gap, None);
        assert_eq!(found.outliers, []);
        assert!((found.tolerance() - 2.0 * found.spacing).abs() < 1e-12);
    }

    #[test]
    fn coordinates_that_were_rounded_are_no_closer_than_their_step() {
        // Rows 2 cm apart whose points are rounded to 50 cm along one axis, as far from zero as single precision does it.
        let rounded = |step: f32| {
            let at = |i: i32| i as f32 * 0.037 + 0.01 * spread(i, 0);
            let along = move |i: i32| (at(i) / step).round() * step;
            let row = |j: i32| (0..3000).map(move |i| [along(i), 0.02 * j as f32, 0.0]);
            survey((0..4).flat_map(row).collect())
        };
        let found = rounded(0.5);
        assert_eq!((found.rounding, found.spacing), (0.5, 0.5));
        // A step below the distance of neighbours changes nothing.
        let found = rounded(0.001);
        assert_eq!(found.rounding, 0.0);
        assert!((found.spacing - 0.02).abs() < 1e-6);
        // Neither do the few heights of flat floors, nor points of a lattice.
        assert_eq!(survey(lattice(80, 0.01, |i, _| [0.0, 0.0, (i % 5) as f32])).rounding, 0.0);
        assert_eq!(survey(lattice(80, 0.01, |_, _| [0.0; 3])).rounding, 0.0);
    }

    #[test]
    fn duplicates_do_not_make_the_spacing_zero() {
        let once = lattice(60, 0.02, |_, _| [0.0; 3]);
        let thrice: Vec<[f32; 3]> = once.iter().flat_map(|&p| [p; 3]).collect();
        assert!((survey(thrice).spacing - 0.02).abs() < 1e-6);
    }

    #[test]
    fn lengths_follow_the_unit() {
        let metres = lattice(80, 0.01, |i, j| [0.0, 0.0, 0.002 * spread(i, j)]);
        let millimetres: Vec<[f32; 3]> = metres.iter().map(|p| p.map(|c| 1000.0 * c)).collect();
        let (m, mm) = (survey(metres), survey(millimetres));
        assert!((mm.spacing / m.spacing - 1000.0).abs() < 1.0, "{} {}", m.spacing, mm.spacing);
        assert!((mm.noise / m.noise - 1000.0).abs() < 5.0, "{} {}", m.noise, mm.noise);
    }

    #[test]
    fn a_second_sheet_behind_the_first_is_found() {
        let front = lattice(80, 0.01, |i, j| [0.0, 0.0, 0.001 * spread(i, j)]);
        let both: Vec<[f32; 3]> =
            front.iter().flat_map(|&p| [p, [p[0], p[1], p[2] + 0.03]]).collect();
        let gap = survey(both).layer_gap.unwrap();
        assert!((0.026..0.031).contains(&gap), "{gap}");
        assert_eq!(survey(front).layer_gap, None);
    }

    /// A wall of two faces with opposite normals, and heights that overlap: a standard deviation of a third of the gap.
    fn overlapping_faces(oriented: bool) -> PointCloud {
        let front = lattice(80, 0.01, |i, j| [0.0, 0.0, 0.01 * 3.0_f32.sqrt() * spread(i, j)]);
        let back = lattice(80, 0.01, |i, j| [0.0, 0.0, 0.03 + 0.017 * spread(j + 7, i)]);
        let sign = |i: usize| if oriented || i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let of_front = (0..front.len()).map(|i| [0.0, 0.0, -sign(i)]);
        let of_back = (0..back.len()).map(|i| [0.0, 0.0, sign(i)]);
        let normals = of_front.chain(of_back).collect();
        let positions = front.iter().chain(&back).copied().collect();
        let parts = CloudParts { positions, normals: Some(normals), ..CloudParts::default() };
        PointCloud::from_parts(parts).unwrap().0
    }

    #[test]
    fn faces_whose_points_overlap_are_told_apart_by_their_normals() {
        let found = Survey::of(&overlapping_faces(true), &Silent).unwrap();
        assert!(found.has_facings);
        let gap = found.layer_gap.unwrap();
        assert!((0.025..0.035).contains(&gap), "{gap}");
        // Normals of random signs have no side.
        let found = Survey::of(&overlapping_faces(false), &Silent).unwrap();
        assert!(!found.has_facings);
        assert_eq!(found.layer_gap, None);
    }

    #[test]
    fn there_are_no_layers_between_scan_lines() {
        // Rows 20 cm apart, with noise as wide as two steps along them.
        let rows = (0..40).flat_map(|row| (0..400).map(move |i| (row, i)));
        let at = |(row, i): (i32, i32)| {
            let noise = [0.02 * spread(i, row), 0.02 * spread(row, i + 3)];
            [0.01 * i as f32, noise[0], 0.2 * row as f32 + 0.1 * noise[1]]
        };
        assert_eq!(survey(rows.map(at).collect()).layer_gap, None);
    }

    #[test]
    fn noise_of_scan_lines_is_that_across_the_surface() {
        // A wall of rows 15 cm apart. Noise along the rays, level with the rows: none of it is across the planes of the
        // rows.
        let random = |i: i32, j: i32| {
            let mixed = ((i * 7919 + j) as u32).wrapping_mul(0x9e37_79b1);
            f64::from(mixed ^ (mixed >> 15)) / f64::from(u32::MAX) * 2.0 - 1.0
        };
        let at = |i: i32, row: i32| {
            let position = [0.02 * f64::from(i), 0.02 * random(i, row), 0.15 * f64::from(row)];
            position.map(|c| c as f32)
        };
        let rows: Vec<[f32; 3]> =
            (0..40).flat_map(|row| (0..400).map(move |i| at(i, row))).collect();
        // The standard deviation of an even distribution.
        let noise = 0.02 / 3.0_f64.sqrt();
        let found = survey(rows.clone()).noise;
        assert!((found / noise - 1.0).abs() < 0.15, "{found} {noise}");
        // Points that stand there three times are no nearer to their plane.
        let thrice = survey(rows.into_iter().flat_map(|p| [p; 3]).collect());
        assert_eq!(thrice.noise, found);
    }

    #[test]
    fn scan_lines_are_as_far_apart_as_they_are() {
        // Lines of points 1 cm apart; along and across at random by the noise.
        let lines = |apart: f32, noise: f32| -> Vec<[f32; 3]> {
            let at = |i: i32, j: i32| {
                let moved = [spread(i, j), spread(j, i), spread(i + j, i)].map(|m| m * noise);
                [0.01 * i as f32 + moved[0], apart * j as f32 + moved[1], moved[2]]
            };
            (0..12).flat_map(|j| (0..400).map(move |i| (i, j))).map(|(i, j)| at(i, j)).collect()
        };
        for (apart, noise) in [(0.05, 0.0), (0.3, 0.001), (0.3, 0.005), (1.0, 0.005)] {
            let found = survey(lines(apart, noise)).line_spacing.unwrap();
            assert!((found / f64::from(apart) - 1.0).abs() < 0.1, "{found} {apart}");
        }
        assert_eq!(survey(lines(0.02, 0.0)).line_spacing, None);
        assert_eq!(survey(lattice(80, 0.01, |_, _| [0.0; 3])).line_spacing, None);
        let random = |i: i32, j: i32| [spread(i, j), spread(j, i), 0.0].map(|m| 0.02 * m);
        assert_eq!(survey(lattice(80, 0.01, random)).line_spacing, None);
    }

    #[test]
    fn points_far_from_all_others_are_outliers_and_from_further_on_strays() {
        let mut positions = lattice(100, 0.01, |_, _| [0.0; 3]);
        // A pair two metres off, and one beyond the scene's own size.
        positions.extend([[0.5, 0.5, 2.0], [0.5, 0.51, 2.0], [0.0, 300.0, 0.0]]);
        let found = survey(positions);
        assert_eq!(found.outliers, [10_000, 10_001, 10_002]);
        assert_eq!(found.strays, [10_000, 10_001, 10_002]);
        let (low, high) = found.bounds.unwrap();
        assert_eq!(low, [0.0; 3]);
        assert!(high.iter().all(|&c| c < 1.0), "{high:?}");
    }

    #[test]
    fn scenes_of_few_or_equal_points_have_no_outliers() {
        assert_eq!(survey(Vec::new()), Survey::default());
        let one = survey(vec![[1.0, 2.0, 3.0]]);
        assert_eq!((one.spacing, one.noise, one.outliers.len()), (0.0, 0.0, 0));
        assert_eq!(one.bounds, Some(([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])));
        let two = survey(vec![[0.0; 3], [0.0, 0.0, 5.0]]);
        assert_eq!((two.spacing, two.outliers.len()), (5.0, 0));
        assert_eq!(survey(vec![[2.0; 3]; 50]).spacing, 0.0);
    }
}
