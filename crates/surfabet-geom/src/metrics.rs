//! How close a decoded cloud is to the one it was made from: the measures that every figure of surfabet uses.
//!
//! `forward` takes every decoded point to its nearest reference point, `backward` every reference point to its
//! nearest decoded point. Every point is queried, none is sampled. Nearest neighbours are exact, the earlier
//! point of equally distant ones; sums are in `f64`, in chunks of fixed size, so that results do not depend on
//! the number of threads.

use surfabet_base::parallel;
use surfabet_base::{Meter, Progress};

use crate::cloud::PointCloud;
use crate::error::{Error, Result};
use crate::kdtree::{KdTree, Neighbor};
use crate::normals::fit_normal;
use crate::vector::{distance, dot, minus};

/// Pairs per partial sum.
const CHUNK: usize = 8192;

/// How near a point of the other cloud must be for a point to count as matched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tolerance {
    /// The same distance everywhere, metres.
    Distance(f64),
    /// `scale * tan(angular_resolution / 2) * range` at each reference point: eq. 13 of "Alphabets" (III-B), with
    /// lambda and alpha as there. The range is the one stored, else the distance to the point's viewpoint.
    Range {
        /// lambda, a factor.
        scale: f64,
        /// alpha, the angle between neighbouring beams, radians.
        angular_resolution: f64,
    },
}

/// What to measure beyond distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvaluateOptions {
    /// Reports inliers and outliers for this tolerance.
    pub tolerance: Option<Tolerance>,
    /// Peak of the PSNR in metres; the diagonal of the reference's bounding box if not given.
    pub peak: Option<f64>,
    /// Where the reference has no normals, planes are fitted to this number of reference points nearest to each
    /// decoded point; `None` leaves point-to-plane out then.
    pub normal_neighbors: Option<usize>,
}

impl Default for EvaluateOptions {
    fn default() -> Self {
        Self { tolerance: None, peak: None, normal_neighbors: Some(16) }
    }
}

/// Distances from the points of one cloud to their nearest points of the other, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectedErrors {
    /// Root of the mean squared distance.
    pub rmse: f64,
    /// Mean distance.
    pub mean: f64,
    /// The smallest distance that 95 percent of the points do not exceed.
    pub p95: f64,
    /// The smallest distance that 99 percent of the points do not exceed.
    pub p99: f64,
    /// The largest distance.
    pub max: f64,
    /// Root of the mean squared distance along the reference's normal.
    pub plane_rmse: Option<f64>,
    /// Root of the mean squared colour difference over pairs and channels, 0 to 255.
    pub color_rmse: Option<f64>,
}

/// How far values of an attribute that both clouds have are off, over the same pairs as the distances.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributeErrors {
    /// Name of the attribute; "intensities" for these.
    pub name: String,
    /// True for labels, integers of at most 32 different values in the reference: the numbers are shares of pairs with equal
    /// labels. Else they are root mean square differences in the unit of the attribute.
    pub labels: bool,
    /// Over the decoded points.
    pub forward: f64,
    /// Over the reference points.
    pub backward: f64,
    /// Over the pairs of both directions.
    pub pooled: f64,
}

/// All measures of one comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Number of reference points.
    pub reference_points: usize,
    /// Number of decoded points.
    pub decoded_points: usize,
    /// Decoded to reference.
    pub forward: DirectedErrors,
    /// Reference to decoded.
    pub backward: DirectedErrors,
    /// The larger root mean square of both directions: the figure for comparisons, metres.
    pub rmse: f64,
    /// Root mean square over the pairs of both directions together: the papers' figure, metres. Decoding more
    /// points lowers it.
    pub rmse_pooled: f64,
    /// Root mean square distance along normals over the pairs of both directions, metres.
    pub plane_rmse_pooled: Option<f64>,
    /// Colour difference over the pairs of both directions, 0 to 255.
    pub color_rmse_pooled: Option<f64>,
    /// Peak of both PSNRs, metres.
    pub psnr_peak: f64,
    /// Point-to-point PSNR in dB, 20 log10(peak / rmse), of the worse direction; infinite without error.
    ///
    /// MPEG's `pc_error` computes 10 log10(3 p^2 / mse) with p the edge of the cube that holds the cloud; give
    /// sqrt(3) p as peak for its figure.
    pub d1_psnr: f64,
    /// Point-to-plane PSNR in dB, likewise.
    pub d2_psnr: Option<f64>,
    /// Share of the reference points with a decoded point within the tolerance.
    pub inliers: Option<f64>,
    /// Share of the decoded points without a reference point within the tolerance. With a tolerance by range,
    /// the one of the nearest reference point counts.
    pub outliers: Option<f64>,
    /// Intensities and further attributes that both clouds have, in the order of the reference. Those without a pair of
    /// finite values are left out.
    pub attributes: Vec<AttributeErrors>,
}

/// Squared errors of one direction, with the number of pairs they are over.
#[derive(Clone, Copy)]
struct Squares {
    sum: f64,
    count: usize,
}

impl Squares {
    fn root_mean(self) -> f64 {
        (self.sum / self.count as f64).sqrt()
    }

    fn pooled(self, other: Self) -> f64 {
        Self { sum: self.sum + other.sum, count: self.count + other.count }.root_mean()
    }
}

/// Compares `decoded` with `reference`, which it was made from.
///
/// Both are brought to the reference's origin in `f64`.
///
/// Point-to-plane distances are `|(q - p) . n|` for the pair of reference point p and decoded point q. Where the
/// reference has normals, n is that of p. Where it has none, n is the normal of the plane fitted to the
/// `normal_neighbors` reference points nearest to q. Where n is unknown the full distance counts.
///
/// # Errors
/// [`Error::TooFewPoints`] when either cloud is empty, [`Error::InvalidParameter`] for a tolerance or peak that is
/// not positive or fewer than three neighbours, [`Error::MissingAttribute`] for a tolerance by range when the
/// reference knows no range, [`Error::Cancelled`].
pub fn evaluate(
    reference: &PointCloud,
    decoded: &PointCloud,
    options: &EvaluateOptions,
    progress: &dyn Progress,
) -> Result<Quality> {
    check(reference, decoded, options)?;
    let tolerances = options.tolerance.map(|t| Tolerances::new(t, reference)).transpose()?;
    let psnr_peak = peak(reference, options.peak)?;
    let pairs = Pairs::find(reference, decoded, options, progress)?;

    let distances = pairs.squares_of(|pair, _, _| f64::from(pair.squared_distance()));
    let planes =
        pairs.has_planes().then(|| pairs.squares_of(|_, i, j| pairs.squared_plane_distance(i, j)));
    progress.check()?;
    let colors = reference.colors().zip(decoded.colors()).map(|(a, b)| {
        let squared = |x: u8, y: u8| (f64::from(x) - f64::from(y)).powi(2);
        pairs.squares_of(|_, i, j| (0..3).map(|c| squared(a[i][c], b[j][c])).sum::<f64>() / 3.0)
    });
    progress.check()?;

    let root_means = |squares: Option<[Squares; 2]>| squares.map(|s| s.map(Squares::root_mean));
    let (plane_rmse, color_rmse) = (root_means(planes), root_means(colors));
    let directed = |way: usize, pairs: &[Neighbor]| {
        directed(pairs, distances[way], plane_rmse.map(|r| r[way]), color_rmse.map(|r| r[way]))
    };
    let forward = directed(0, &pairs.forward);
    let backward = directed(1, &pairs.backward);
    let pooled = |[forward, backward]: [Squares; 2]| forward.pooled(backward);
    let psnr = |rmse: f64| 20.0 * (psnr_peak / rmse).log10();
    let rmse = forward.rmse.max(backward.rmse);
    Ok(Quality {
        reference_points: reference.len(),
        decoded_points: decoded.len(),
        forward,
        backward,
        rmse,
        rmse_pooled: pooled(distances),
        plane_rmse_pooled: planes.map(pooled),
        color_rmse_pooled: colors.map(pooled),
        psnr_peak,
        d1_psnr: psnr(rmse),
        d2_psnr: plane_rmse.map(|[forward, backward]| psnr(forward.max(backward))),
        inliers: tolerances.as_ref().map(|t| pairs.inliers(t)),
        outliers: tolerances.as_ref().and_then(|t| pairs.outliers(t)),
        attributes: pairs.attributes(decoded, progress)?,
    })
}

/// Refuses clouds without points and too few neighbours for a plane.
fn check(reference: &PointCloud, decoded: &PointCloud, options: &EvaluateOptions) -> Result<()> {
    for (operation, cloud) in [("evaluate (reference)", reference), ("evaluate (decoded)", decoded)]
    {
        if cloud.is_empty() {
            return Err(Error::TooFewPoints { operation, needed: 1, found: 0 });
        }
    }
    if let Some(k) = options.normal_neighbors.filter(|&k| k < 3) {
        return Err(Error::invalid("normal_neighbors", k, "at least 3 to span a plane"));
    }
    Ok(())
}

/// The nearest point of the other cloud to every point of both.
struct Pairs<'a> {
    reference: &'a PointCloud,
    /// Decoded points about the reference's origin.
    decoded: Vec<[f32; 3]>,
    /// Of each decoded point, its nearest reference point.
    forward: Vec<Neighbor>,
    /// Of each reference point, its nearest decoded point.
    backward: Vec<Neighbor>,
    /// Normals of the reference's surface at the decoded points, where the reference has none itself.
    fitted: Option<Vec<[f32; 3]>>,
}

impl<'a> Pairs<'a> {
    fn find(
        reference: &'a PointCloud,
        decoded: &PointCloud,
        options: &EvaluateOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let p = reference.positions();
        let q = decoded.positions_about(reference.origin());
        // One tree at a time: with both, memory would peak a third higher.
        let (forward, fitted) = {
            let tree = KdTree::new(p)?;
            let forward = tree.nearest_batch(&q, progress)?;
            let k = options.normal_neighbors.filter(|_| reference.normals().is_none());
            let fitted = k.map(|k| fit_normals(&tree, p, &q, k, progress)).transpose()?;
            (forward, fitted)
        };
        let backward = KdTree::new(&q)?.nearest_batch(p, progress)?;
        Ok(Self { reference, decoded: q, forward, backward, fitted })
    }

    /// True when normals are known, of the reference or fitted to it.
    fn has_planes(&self) -> bool {
        self.reference.normals().is_some() || self.fitted.is_some()
    }

    /// `((q - p) . n)^2` of reference point p and decoded point q; `|q - p|^2` where n is unknown.
    fn squared_plane_distance(&self, p: usize, q: usize) -> f64 {
        let n = match (self.reference.normals(), &self.fitted) {
            (Some(normals), _) => normals[p],
            (None, Some(fitted)) => fitted[q],
            (None, None) => [0.0; 3],
        };
        let [at, from] = [self.decoded[q], self.reference.positions()[p]];
        let d = minus(at.map(f64::from), from.map(f64::from));
        let along = dot(d, n.map(f64::from));
        if n == [0.0; 3] { dot(d, d) } else { along * along }
    }

    /// Sums of an error over the pairs of both directions, forward first. The error is that of a pair, of its reference
    /// point and of its decoded point.
    fn squares_of(&self, error: impl Fn(&Neighbor, usize, usize) -> f64 + Sync) -> [Squares; 2] {
        let Self { forward, backward, .. } = self;
        let over = |count: usize, error: &(dyn Fn(usize) -> f64 + Sync)| Squares {
            sum: sum_by(count, error),
            count,
        };
        [
            over(forward.len(), &|j| error(&forward[j], forward[j].index(), j)),
            over(backward.len(), &|i| error(&backward[i], i, backward[i].index())),
        ]
    }

    /// Errors of all attributes that the reference has beside colour, and `decoded` too.
    fn attributes(
        &self,
        decoded: &PointCloud,
        progress: &dyn Progress,
    ) -> Result<Vec<AttributeErrors>> {
        let mut found = Vec::new();
        if let Some((a, b)) = self.reference.intensities().zip(decoded.intensities()) {
            let of = |i: usize, j: usize| (f64::from(a[i]), f64::from(b[j]));
            found.extend(self.attribute("intensities", false, of));
        }
        for (name, a) in self.reference.extra() {
            progress.check()?;
            if let Some((_, b)) = decoded.extra().iter().find(|(other, _)| other == name) {
                let of = |i: usize, j: usize| (a.number(i), b.number(j));
                found.extend(self.attribute(name, a.labels().is_some(), of));
            }
        }
        Ok(found)
    }

    /// Errors of an attribute that has the values `of` at a reference point and a decoded one. Pairs with a value that is
    /// not finite are left out; `None` when there is no other.
    fn attribute(
        &self,
        name: &str,
        labels: bool,
        of: impl Fn(usize, usize) -> (f64, f64) + Sync,
    ) -> Option<AttributeErrors> {
        let error = |i: usize, j: usize| {
            let (a, b) = of(i, j);
            let error = if labels { f64::from(u8::from(a == b)) } else { (a - b).powi(2) };
            (a.is_finite() && b.is_finite()).then_some(error)
        };
        let pairs = [(self.forward.len(), true), (self.backward.len(), false)];
        let [forward, backward] = pairs.map(|(n, is_forward)| {
            let at = |k: usize| match is_forward {
                true => error(self.forward[k].index(), k),
                false => error(k, self.backward[k].index()),
            };
            let sum = sum_by(n, |k| at(k).unwrap_or(0.0));
            Squares { sum, count: count_by(n, |k| at(k).is_some()) }
        });
        if forward.count == 0 || backward.count == 0 {
            return None;
        }
        let both =
            Squares { sum: forward.sum + backward.sum, count: forward.count + backward.count };
        let [forward, backward, pooled] = [forward, backward, both].map(|s| match labels {
            true => s.sum / s.count as f64,
            false => s.root_mean(),
        });
        Some(AttributeErrors { name: name.to_owned(), labels, forward, backward, pooled })
    }

    /// Share of the reference points, where their tolerance is known, with a decoded point within it.
    fn inliers(&self, tolerances: &Tolerances<'_>) -> f64 {
        let n = self.backward.len();
        let matched =
            |i: usize, limit: f64| f64::from(self.backward[i].squared_distance()) <= limit;
        let known = count_by(n, |i| tolerances.squared(i).is_some());
        let inside = count_by(n, |i| tolerances.squared(i).is_some_and(|l| matched(i, l)));
        inside as f64 / known as f64
    }

    /// Share of the decoded points, where the tolerance of the nearest reference point is known, that are farther from
    /// it; none where all are unknown.
    fn outliers(&self, tolerances: &Tolerances<'_>) -> Option<f64> {
        let n = self.forward.len();
        let limit = |j: usize| tolerances.squared(self.forward[j].index());
        let lone = |j: usize, limit: f64| f64::from(self.forward[j].squared_distance()) > limit;
        let known = count_by(n, |j| limit(j).is_some());
        let outside = count_by(n, |j| limit(j).is_some_and(|l| lone(j, l)));
        (known > 0).then(|| outside as f64 / known as f64)
    }
}

fn peak(reference: &PointCloud, given: Option<f64>) -> Result<f64> {
    match given {
        Some(peak) if peak > 0.0 && peak.is_finite() => Ok(peak),
        Some(peak) => Err(Error::invalid("peak", peak, "a positive length in metres")),
        None => Ok(reference.bounds().map_or(0.0, |(low, high)| distance(low, high))),
    }
}

/// Normals of the reference's surface at the decoded points; zero where unknown.
fn fit_normals(
    tree: &KdTree,
    reference: &[[f32; 3]],
    decoded: &[[f32; 3]],
    k: usize,
    progress: &dyn Progress,
) -> Result<Vec<[f32; 3]>> {
    const BATCH: usize = 1024;
    let mut normals = vec![[0.0; 3]; decoded.len()];
    let meter = Meter::new(progress, "reference planes", decoded.len().div_ceil(BATCH));
    parallel::try_for_each(
        normals.chunks_mut(BATCH).zip(decoded.chunks(BATCH)),
        |_, (normals, decoded)| {
            let mut found = Vec::new();
            for (normal, &query) in normals.iter_mut().zip(decoded) {
                tree.k_nearest(query, k, &mut found);
                let points = found.iter().map(|n| reference[n.index()]);
                if let Some((direction, _)) = fit_normal(reference[found[0].index()], points) {
                    *normal = direction.map(|c| c as f32);
                }
            }
            meter.step()
        },
    )?;
    Ok(normals)
}

/// Squared tolerance per reference point, square metres.
struct Tolerances<'a> {
    tolerance: Tolerance,
    reference: &'a PointCloud,
}

impl<'a> Tolerances<'a> {
    fn new(tolerance: Tolerance, reference: &'a PointCloud) -> Result<Self> {
        let positive = |name, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(Error::invalid(name, value, "positive and finite"))
            }
        };
        let tolerances = Self { tolerance, reference };
        match tolerance {
            Tolerance::Distance(distance) => positive("sigma", distance)?,
            Tolerance::Range { scale, angular_resolution } => {
                positive("sigma's scale", scale)?;
                positive("sigma's angular resolution", angular_resolution)?;
                if angular_resolution >= std::f64::consts::PI {
                    return Err(Error::invalid(
                        "sigma's angular resolution",
                        angular_resolution,
                        "an angle below pi, in radians",
                    ));
                }
                if (0..reference.len()).all(|i| tolerances.range(i).is_none()) {
                    return Err(Error::MissingAttribute {
                        operation: "a tolerance that grows with the range",
                        attribute: "ranges or viewpoints",
                    });
                }
            }
        }
        Ok(tolerances)
    }

    /// Range of reference point `i`, where known.
    fn range(&self, i: usize) -> Option<f64> {
        let stored = self.reference.ranges().map_or(0.0, |r| f64::from(r[i]));
        if stored > 0.0 {
            return Some(stored);
        }
        let viewpoint = self.reference.local_viewpoint(i)?;
        let p = self.reference.positions()[i];
        Some(distance(viewpoint.map(f64::from), p.map(f64::from)))
    }

    /// `None` where the range is unknown: such points are not counted.
    fn squared(&self, i: usize) -> Option<f64> {
        let sigma = match self.tolerance {
            Tolerance::Distance(distance) => distance,
            Tolerance::Range { scale, angular_resolution } => {
                scale * (0.5 * angular_resolution).tan() * self.range(i)?
            }
        };
        Some(sigma * sigma)
    }
}

fn directed(
    pairs: &[Neighbor],
    squares: Squares,
    plane_rmse: Option<f64>,
    color_rmse: Option<f64>,
) -> DirectedErrors {
    let mut distances: Vec<f32> = pairs.iter().map(|n| n.squared_distance()).collect();
    let count = distances.len();
    let sum = sum_by(count, |i| f64::from(pairs[i].squared_distance()).sqrt());
    let mut quantile = |percent: usize| {
        // Nearest rank: the smallest value that is not below this share of the values.
        let rank = (count * percent).div_ceil(100).max(1) - 1;
        let (_, value, _) = distances.select_nth_unstable_by(rank, f32::total_cmp);
        f64::from(*value).sqrt()
    };
    DirectedErrors {
        rmse: squares.root_mean(),
        mean: sum / count as f64,
        p95: quantile(95),
        p99: quantile(99),
        max: quantile(100),
        plane_rmse,
        color_rmse,
    }
}

/// Sum of `term` over `0..count`, the same for any number of threads.
fn sum_by(count: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let partial: Vec<f64> = parallel::map_range(count.div_ceil(CHUNK), |chunk| {
        (chunk * CHUNK..((chunk + 1) * CHUNK).min(count)).map(&term).sum()
    });
    partial.iter().sum()
}

fn count_by(count: usize, is: impl Fn(usize) -> bool + Sync) -> usize {
    let counts: Vec<usize> = parallel::map_range(count.div_ceil(CHUNK), |chunk| {
        (chunk * CHUNK..((chunk + 1) * CHUNK).min(count)).filter(|&i| is(i)).count()
    });
    counts.iter().sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::cloud::{CloudParts, Viewpoints};
    use surfabet_base::Silent;

    fn cloud(parts: CloudParts) -> PointCloud {
        PointCloud::from_parts(parts).unwrap().0
    }

    fn bare(positions: Vec<[f32; 3]>) -> PointCloud {
        cloud(CloudParts { positions, ..CloudParts::default() })
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-9 * (1.0 + b.abs())
    }

    fn quality(a: &PointCloud, b: &PointCloud, options: &EvaluateOptions) -> Quality {
        evaluate(a, b, options, &Silent).unwrap()
    }

    #[test]
    fn attributes_by_hand() {
        let with = |x: Vec<f32>, intensities: Vec<f32>, label: Vec<u8>, time: Vec<f64>| {
            cloud(CloudParts {
                positions: x.into_iter().map(|x| [x, 0.0, 0.0]).collect(),
                intensities: Some(intensities),
                extra: vec![("label".to_owned(), label.into()), ("time".to_owned(), time.into())],
                ..CloudParts::default()
            })
        };
        let nan = f64::NAN;
        let reference =
            with(vec![0.0, 1.0, 2.0], vec![10.0, 20.0, 30.0], vec![1, 2, 2], vec![1.0, nan, 5.0]);
        let decoded = with(vec![0.2, 1.9], vec![13.0, 30.0], vec![1, 7], vec![1.0, 3.0]);
        // Forward pairs are (0, 0) and (2, 1), backward ones these and (1, 0).
        let found = quality(&reference, &decoded, &EvaluateOptions::default());
        let [intensity, label, time] = &found.attributes[..] else { panic!("{found:?}") };
        assert_eq!((intensity.name.as_str(), intensity.labels), ("intensities", false));
        assert!(close(intensity.forward, 4.5_f64.sqrt()));
        assert_eq!((label.name.as_str(), label.labels, label.forward), ("label", true, 0.5));
        assert!(close(label.backward, 1.0 / 3.0) && close(label.pooled, 0.4));
        // Without the pair of the point that has no time.
        assert_eq!((time.name.as_str(), time.labels), ("time", false));
        assert!(close(time.forward, 2.0_f64.sqrt()) && close(time.backward, 2.0_f64.sqrt()));
        let bare = bare(vec![[0.0; 3]]);
        assert!(quality(&reference, &bare, &EvaluateOptions::default()).attributes.is_empty());
    }

    #[test]
    fn a_case_by_hand() {
        let reference = cloud(CloudParts {
            positions: vec![[0.0; 3], [3.0, 0.0, 0.0], [3.0, 4.0, 0.0]],
            colors: Some(vec![[10, 20, 30], [0; 3], [255; 3]]),
            normals: Some(vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0; 3]]),
            ..CloudParts::default()
        });
        let decoded = cloud(CloudParts {
            positions: vec![[1.0, 0.0, 2.0], [3.0, 0.0, 0.0]],
            colors: Some(vec![[13, 20, 30], [0; 3]]),
            ..CloudParts::default()
        });
        let options =
            EvaluateOptions { tolerance: Some(Tolerance::Distance(2.5)), ..Default::default() };
        let found = quality(&reference, &decoded, &options);
        // Forward: squared distances 5 and 0. Backward: 5, 0 and 16.
        assert!(close(found.forward.rmse, 2.5_f64.sqrt()));
        assert!(close(found.backward.rmse, 7.0_f64.sqrt()));
        assert!(close(found.rmse, 7.0_f64.sqrt()));
        assert!(close(found.rmse_pooled, 5.2_f64.sqrt()));
        assert!(close(found.forward.max, 5.0_f64.sqrt()));
        assert!(close(found.backward.p95, 4.0));
        assert!(close(found.backward.mean, (5.0_f64.sqrt() + 4.0) / 3.0));
        // Along the normals: 4 and 0 forward; 4, 0 and, without normal, 16 backward.
        assert!(close(found.forward.plane_rmse.unwrap(), 2.0_f64.sqrt()));
        assert!(close(found.backward.plane_rmse.unwrap(), (20.0_f64 / 3.0).sqrt()));
        assert!(close(found.plane_rmse_pooled.unwrap(), (24.0_f64 / 5.0).sqrt()));
        // Colours: 9 / 3 and 0 forward; 9 / 3, 0 and 255^2 backward.
        assert!(close(found.forward.color_rmse.unwrap(), 1.5_f64.sqrt()));
        assert!(close(found.color_rmse_pooled.unwrap(), ((6.0 + 65_025.0_f64) / 5.0).sqrt()));
        assert!(close(found.psnr_peak, 5.0));
        assert!(close(found.d1_psnr, 10.0 * (25.0_f64 / 7.0).log10()));
        assert!(close(found.d2_psnr.unwrap(), 10.0 * (25.0 / (20.0_f64 / 3.0)).log10()));
        assert!(close(found.inliers.unwrap(), 2.0 / 3.0));
        assert_eq!(found.outliers.unwrap(), 0.0);
    }

    #[test]
    fn a_cloud_equals_itself() {
        let c = bare((0..50).map(|i| [i as f32, (i * i % 7) as f32, 0.0]).collect());
        let found = quality(&c, &c, &EvaluateOptions::default());
        assert_eq!((found.rmse, found.rmse_pooled, found.backward.max), (0.0, 0.0, 0.0));
        assert_eq!(found.d1_psnr, f64::INFINITY);
        assert_eq!(found.color_rmse_pooled, None);
        assert_eq!(found.inliers, None);
    }

    #[test]
    fn planes_are_fitted_where_there_are_no_normals() {
        let sheet =
            |z: f32| bare((0..900).map(|i| [(i % 30) as f32, (i / 30) as f32, z]).collect());
        let mut shifted = sheet(0.25).into_parts();
        for p in &mut shifted.positions {
            p[0] += 0.5;
        }
        let found = quality(&sheet(0.0), &cloud(shifted), &EvaluateOptions::default());
        assert!(close(found.forward.plane_rmse.unwrap(), 0.25));
        assert!(close(found.backward.plane_rmse.unwrap(), 0.25));
        assert!(found.forward.rmse > 0.5);
        let without = EvaluateOptions { normal_neighbors: None, ..Default::default() };
        assert_eq!(quality(&sheet(0.0), &sheet(0.25), &without).d2_psnr, None);
    }

    #[test]
    fn clouds_with_different_origins_meet_in_double_precision() {
        let at = |origin: [f64; 3], position| {
            cloud(CloudParts { origin, positions: vec![position], ..CloudParts::default() })
        };
        let a = at([500_000.0, 5_400_000.0, 0.0], [1.5, 0.0, 0.0]);
        let b = at([499_000.0, 5_400_000.0, 0.0], [1001.501, 0.0, 0.0]);
        let found = quality(&a, &b, &EvaluateOptions::default());
        assert!((found.rmse - 0.001).abs() < 1e-4);
    }

    #[test]
    fn tolerance_grows_with_the_range() {
        // Eq. 13 with lambda = 2, alpha = 0.02: sigma is 0.0200007 m per metre of range.
        let reference = cloud(CloudParts {
            positions: vec![[1.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 20.0, 0.0]],
            ranges: Some(vec![1.0, 10.0, 0.0]),
            viewpoints: Some(Viewpoints { origins: vec![[0.0; 3]], index: vec![0; 3] }),
            ..CloudParts::default()
        });
        let decoded = bare(vec![[1.03, 0.0, 0.0], [10.15, 0.0, 0.0], [0.0, 20.39, 0.0]]);
        let tolerance = Some(Tolerance::Range { scale: 2.0, angular_resolution: 0.02 });
        let options = EvaluateOptions { tolerance, ..Default::default() };
        let found = quality(&reference, &decoded, &options);
        assert!(close(found.inliers.unwrap(), 2.0 / 3.0));
        assert!(close(found.outliers.unwrap(), 1.0 / 3.0));
        assert!(matches!(
            evaluate(&decoded, &reference, &options, &Silent),
            Err(Error::MissingAttribute { .. })
        ));
    }

    #[test]
    fn refuses_empty_clouds_and_senseless_options() {
        let one = bare(vec![[0.0; 3]]);
        let empty = bare(vec![]);
        let default = EvaluateOptions::default();
        let message = evaluate(&one, &empty, &default, &Silent).unwrap_err().to_string();
        assert_eq!(message, "evaluate (decoded) needs at least 1 points, the cloud has 0");
        assert!(evaluate(&empty, &one, &default, &Silent).is_err());
        for options in [
            EvaluateOptions { tolerance: Some(Tolerance::Distance(0.0)), ..default },
            EvaluateOptions { peak: Some(f64::NAN), ..default },
            EvaluateOptions { normal_neighbors: Some(2), ..default },
        ] {
            assert!(evaluate(&one, &one, &options, &Silent).is_err());
        }
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let points = |seed: u32| {
            bare(
                (0..30_000_u32)
                    .map(|i| {
                        [i.wrapping_mul(seed) % 977, i * 31 % 613, i % 89].map(|c| c as f32 * 0.37)
                    })
                    .collect(),
            )
        };
        let (a, b) = (points(7919), points(104_729));
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| quality(&a, &b, &EvaluateOptions::default()))
        };
        assert_eq!(run(1), run(2));
        assert_eq!(run(1), run(8));
    }

    proptest! {
        #[test]
        fn agrees_with_brute_force(
            a in prop::collection::vec(prop::array::uniform3(-3.0_f32..3.0), 1..60),
            b in prop::collection::vec(prop::array::uniform3(-3.0_f32..3.0), 1..60),
        ) {
            let nearest = |from: &[[f32; 3]], to: &[[f32; 3]]| -> Vec<f64> {
                let mut all: Vec<f64> = from
                    .iter()
                    .map(|p| {
                        to.iter()
                            .map(|q| {
                                (0..3)
                                    .map(|c| (f64::from(p[c]) - f64::from(q[c])).powi(2))
                                    .sum::<f64>()
                            })
                            .fold(f64::INFINITY, f64::min)
                    })
                    .collect();
                all.sort_by(f64::total_cmp);
                all
            };
            let (forward, backward) = (nearest(&b, &a), nearest(&a, &b));
            let found = quality(&bare(a), &bare(b), &EvaluateOptions::default());
            let rms = |d: &[f64]| (d.iter().sum::<f64>() / d.len() as f64).sqrt();
            let all: Vec<f64> = forward.iter().chain(&backward).copied().collect();
            prop_assert!((found.forward.rmse - rms(&forward)).abs() < 1e-5);
            prop_assert!((found.backward.rmse - rms(&backward)).abs() < 1e-5);
            prop_assert!((found.rmse_pooled - rms(&all)).abs() < 1e-5);
            prop_assert_eq!(found.rmse, found.forward.rmse.max(found.backward.rmse));
            let p95 = backward[(backward.len() * 95).div_ceil(100) - 1].sqrt();
            prop_assert!((found.backward.p95 - p95).abs() < 1e-5);
            prop_assert!((found.backward.max - backward[backward.len() - 1].sqrt()).abs() < 1e-5);
            prop_assert!(found.plane_rmse_pooled.unwrap() <= found.rmse_pooled + 1e-6);
        }
    }
}
