//! Classical EM plane fitting: infinite planes, as many as there were at the start (section II, figure 4).

use surfabet_geom::{Moments, Progress};

use super::learn::{mean_square, plane, random};
use super::options::MAX_PATCHES;
use super::patch::Frame;
use super::points::Points;
use crate::error::{Error, Result, positive};
use crate::vector;

/// Planes and the standard deviation of the points about them.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneFit {
    /// The planes, in the order of those given; the direction of their axes is arbitrary.
    pub planes: Vec<Frame>,
    /// For each input point the plane that it most probably belongs to.
    pub labels: Vec<u32>,
    /// Standard deviation of the points about their planes (S), metres.
    pub standard_deviation: f64,
    /// Mean log-likelihood of a point after each iteration; it never falls.
    pub log_likelihood: Vec<f64>,
}

/// The planes of the `n` patches at random that learning starts from when it is asked to (experiment I), about the
/// points' origin.
///
/// # Errors
/// [`Error::InvalidParameter`] for none or more than [`MAX_PATCHES`].
pub fn random_planes(points: &Points, n: usize, random_state: u64) -> Result<Vec<Frame>> {
    if !(1..=MAX_PATCHES).contains(&n) {
        return Err(Error::invalid("n_planes", n, "1 to 1048576"));
    }
    Ok(random(points, n, random_state).into_iter().map(|patch| patch.frame).collect())
}

/// A mixture of planes with noise of one standard deviation, by expectation maximisation (Healy and Westmacott 1956;
/// Dempster, Laird and Rubin 1977).
///
/// `start` gives points on the initial planes about the points' origin and unit normals. The E-step weighs each
/// point by exp(-d^2 / 2 S^2) for its distances d to the planes; the M-step refits every plane with these weights, and
/// S. It ends when the log-likelihood grows by less than `tolerance`, or after `max_iterations`. Same input, same
/// planes.
///
/// # Errors
/// [`Error::InvalidParameter`] without planes, for normals that have no length, or a tolerance that is not positive;
/// [`Error::Cancelled`].
pub fn fit_planes(
    points: &Points,
    start: &[([f64; 3], [f64; 3])],
    max_iterations: usize,
    tolerance: f64,
    progress: &dyn Progress,
) -> Result<PlaneFit> {
    positive("tolerance", tolerance, "a positive number")?;
    if start.is_empty() {
        return Err(Error::invalid("start", "no planes", "one plane at least"));
    }
    let mut planes = start
        .iter()
        .map(|&(center, normal)| {
            let length = vector::length(normal);
            if !(length.is_finite() && length > 0.0 && center.iter().all(|c| c.is_finite())) {
                let given = format!("{center:?} with normal {normal:?}");
                return Err(Error::invalid(
                    "start",
                    given,
                    "finite, with normals that have a length",
                ));
            }
            Ok(Frame::with_normal(center, normal.map(|c| c / length)))
        })
        .collect::<Result<Vec<Frame>>>()?;
    let mut s = first_deviation(points, &planes);
    let mut log_likelihood: Vec<f64> = Vec::new();
    let mut best = vec![0; points.len()];
    for _ in 0..max_iterations.max(1) {
        progress.check()?;
        let step = expect(points, &planes, s, &mut best);
        let gained = log_likelihood.last().map_or(f64::INFINITY, |last| step.log_likelihood - last);
        log_likelihood.push(step.log_likelihood);
        if gained < tolerance {
            break;
        }
        let mut squares = 0.0;
        for (frame, moments) in planes.iter_mut().zip(&step.moments) {
            // A plane whose points span none stays where it is.
            if let Some(fitted) = plane(moments) {
                *frame = fitted;
            }
            squares += moments.weight() * mean_square(moments, frame);
        }
        s = (squares / step.weight).sqrt().max(f64::MIN_POSITIVE.sqrt());
    }
    let labels = points.place.iter().map(|&i| best[i as usize]).collect();
    Ok(PlaneFit { planes, labels, standard_deviation: s, log_likelihood })
}

/// What the E-step gives the M-step.
struct Expected {
    /// Weighted moments of the points of each plane.
    moments: Vec<Moments>,
    weight: f64,
    log_likelihood: f64,
}

/// E-step: `p_ij ~ exp(-d_ij^2 / (2 S^2))` of all points for all planes, summed up to moments; the mean log-likelihood
/// `ln(sum_j exp(-d_ij^2 / (2 S^2)) / (n S))` of a point, without its constant; and the most probable plane of each.
fn expect(points: &Points, planes: &[Frame], s: f64, best: &mut [u32]) -> Expected {
    let mut moments = vec![Moments::new(); planes.len()];
    let (mut weight, mut sum) = (0.0, 0.0);
    let mut logs = vec![0.0; planes.len()];
    for (i, &p) in points.positions.iter().enumerate() {
        let w = f64::from(points.weights[i]);
        for (log, frame) in logs.iter_mut().zip(planes) {
            let [_, _, z] = frame.local(p);
            *log = -0.5 * (z / s) * (z / s);
        }
        let first = |m: usize, j: usize| if logs[j] > logs[m] { j } else { m };
        let most = (0..planes.len()).fold(0, first);
        best[i] = most as u32;
        // The largest is subtracted first, so that a point far from all planes still counts for the closest.
        let total: f64 = logs.iter().map(|l| (l - logs[most]).exp()).sum();
        for (m, log) in moments.iter_mut().zip(&logs) {
            m.add(p.map(f64::from), w * (log - logs[most]).exp() / total);
        }
        weight += w;
        sum += w * (logs[most] + (total / planes.len() as f64).ln() - s.ln());
    }
    Expected { moments, weight, log_likelihood: sum / weight }
}

/// Standard deviation of the points about the closest of the first planes.
fn first_deviation(points: &Points, planes: &[Frame]) -> f64 {
    let (mut squares, mut weight) = (0.0, 0.0);
    for (&p, &w) in points.positions.iter().zip(&points.weights) {
        let heights = planes.iter().map(|frame| frame.local(p)[2].abs());
        squares += f64::from(w) * heights.fold(f64::INFINITY, f64::min).powi(2);
        weight += f64::from(w);
    }
    f64::max(squares / weight, f64::MIN_POSITIVE).sqrt()
}
