//! The axes of a patch's rectangle.

use super::Members;
use crate::planes::constants::{RIM_STRIPS, TURNED_AREA, TURNS};
use crate::planes::patch::Frame;

/// Lower corner and size of a rectangle.
pub(in crate::planes::fit) type Bounds = ([f64; 2], [f64; 2]);

/// Turns the axes of `frame`, and the coordinates of points in it, first to the principal axes of the points and then to those of
/// a clearly smaller rectangle, if there is one. Gives also their bounding rectangle.
pub(super) fn turned(frame: Frame, members: &mut Members) -> (Frame, Bounds) {
    let (frame, bounds) = to_principal(frame, members);
    match smallest(&members.local, bounds) {
        Some(angle) => turn(frame, &mut members.local, angle),
        None => (frame, bounds),
    }
}

/// Turns the axes of `frame`, and the coordinates of points in it, to the principal axes of the points. Gives also their bounding
/// rectangle.
pub(in crate::planes::fit) fn to_principal(frame: Frame, members: &mut Members) -> (Frame, Bounds) {
    let angle = principal(members);
    turn(frame, &mut members.local, angle)
}

/// Turns the axes of `frame` and the coordinates of points in it by an angle given by its cosine and sine. Gives also their
/// bounding rectangle.
fn turn(frame: Frame, local: &mut [[f64; 3]], [cosine, sine]: [f64; 2]) -> (Frame, Bounds) {
    let [mut low, mut high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for p in local.iter_mut() {
        *p = [cosine * p[0] + sine * p[1], cosine * p[1] - sine * p[0], p[2]];
        for a in 0..2 {
            // As in `smallest`.
            low[a] = if p[a] < low[a] { p[a] } else { low[a] };
            high[a] = if p[a] > high[a] { p[a] } else { high[a] };
        }
    }
    (frame.turned([cosine, sine]), (low, [high[0] - low[0], high[1] - low[1]]))
}

/// Cosine and sine of the direction in which points of a plane spread the most: `tan 2a = 2 c_xy / (c_xx - c_yy)` with
/// their covariances `c`.
fn principal(members: &Members) -> [f64; 2] {
    let n = members.local.len() as f64;
    let mean = members.sum.map(|s| s / n);
    let products = members.local.iter().fold([0.0; 3], |[xx, xy, yy], p| {
        let [x, y] = [p[0] - mean[0], p[1] - mean[1]];
        [xx + x * x, xy + x * y, yy + y * y]
    });
    let [xx, xy, yy] = products.map(|s| s / n);
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    [angle.cos(), angle.sin()]
}

/// Cosine and sine of the turn that makes the bounding rectangle smallest, if it is clearly smaller than that along the
/// principal axes. For what is about as wide as long the principal axis is arbitrary.
fn smallest(local: &[[f64; 3]], bounds: Bounds) -> Option<[f64; 2]> {
    let outermost = outermost(rim(local, bounds));
    let area = |angle: f64| {
        let [c, s] = [angle.cos(), angle.sin()];
        let side = |[x, y]: [f64; 2]| {
            let [mut low, mut high] = [f64::INFINITY, f64::NEG_INFINITY];
            for p in &outermost {
                let along = x * p[0] + y * p[1];
                // Faster than `min` and `max`, which look for what is not a number.
                low = if along < low { along } else { low };
                high = if along > high { along } else { high };
            }
            high - low
        };
        side([c, s]) * side([-s, c])
    };
    let best = |angles: &mut dyn Iterator<Item = f64>| {
        angles
            .map(|a| (area(a), a))
            .fold((f64::INFINITY, 0.0), |b, c| if c.0 < b.0 { c } else { b })
    };
    let coarse = std::f64::consts::FRAC_PI_2 / TURNS;
    let (_, about) = best(&mut (0..TURNS as i32).map(|k| f64::from(k) * coarse));
    let fine = coarse / TURNS;
    let half = TURNS as i32;
    let (least, angle) = best(&mut (-half..=half).map(|k| about + f64::from(k) * fine));
    (least < TURNED_AREA * area(0.0)).then(|| [angle.cos(), angle.sin()])
}

/// The points with the lowest and the highest second coordinate in each strip of the first: about the convex hull.
fn rim(local: &[[f64; 3]], (low, size): Bounds) -> Vec<[f64; 2]> {
    let per = RIM_STRIPS as f64 / size[0].max(f64::MIN_POSITIVE);
    let mut strips: Vec<Option<[[f64; 2]; 2]>> = vec![None; RIM_STRIPS];
    for &[x, y, _] in local {
        let strip = &mut strips[(((x - low[0]) * per) as usize).min(RIM_STRIPS - 1)];
        let [lowest, highest] = strip.get_or_insert([[x, y]; 2]);
        if y < lowest[1] {
            *lowest = [x, y];
        }
        if y > highest[1] {
            *highest = [x, y];
        }
    }
    strips.into_iter().flatten().flatten().collect()
}

/// How far inside of others a point has to lie to be left out, as a share of their distance: far more than rounding, so that extents
/// are the same along all directions.
const INSIDE: f64 = 1e-9;

/// The points that are not inside of others: their convex hull (Andrew's monotone chain), the first and the last twice.
fn outermost(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_unstable_by(|p, q| p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1])));
    let mut outermost: Vec<[f64; 2]> = Vec::new();
    for side in [1.0, -1.0] {
        let start = outermost.len();
        for &p in &points {
            while let [.., a, b] = outermost[start..] {
                let [to, by] = [[p[0] - a[0], p[1] - a[1]], [b[0] - a[0], b[1] - a[1]]];
                let inside = side * (to[1] * by[0] - to[0] * by[1]);
                if inside <= INSIDE * (to[0] * to[0] + to[1] * to[1]) {
                    break;
                }
                outermost.pop();
            }
            outermost.push(p);
        }
    }
    outermost
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use surfabet_geom::PointCloud;

    use super::*;
    use crate::planes::points::Points;

    /// A square with more points along a diagonal, which is the principal axis: its rectangle is twice as large as the square.
    #[test]
    fn axes_are_those_of_a_clearly_smaller_rectangle() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let frame = Frame::with_normal([0.0; 3], [0.0, 0.0, 1.0]);
        let mut point = || {
            let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.random_range(0.0..1.0));
            let [x, y] = if rng.random_bool(0.25) { [x, x] } else { [x, y] };
            [0.6 * x - 0.8 * y, 0.8 * x + 0.6 * y, 0.0]
        };
        let before: Vec<[f64; 3]> = (0..4000).map(|_| point()).collect();
        let positions = before.iter().map(|p| p.map(|c| c as f32)).collect();
        let points = Points::new(&PointCloud::from_positions(positions).0, None).unwrap();
        let all: Vec<u32> = (0..points.len() as u32).collect();
        let area = |(_, size): Bounds| size[0] * size[1];
        let mut members = Members::new(&points, &frame, &all);
        assert!(area(to_principal(frame, &mut members).1) > 1.8);
        members = Members::new(&points, &frame, &all);
        let (turned, bounds) = turned(frame, &mut members);
        assert!((area(bounds) - 1.0).abs() < 0.02);
        // Coordinates are those of the frame.
        for (p, q) in points.positions.iter().zip(&members.local) {
            let at = turned.at([q[0], q[1]]);
            assert!((0..3).all(|a| (f64::from(p[a]) - at[a]).abs() < 1e-6));
        }
    }

    /// Those inside are on neither end along any direction.
    #[test]
    fn the_outermost_points_extend_as_far_as_all() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for round in 0..50 {
            let points: Vec<[f64; 2]> = (0..200)
                .map(|_| {
                    // On a coarse lattice many are on one line.
                    let p: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
                    if round % 2 == 0 { p } else { p.map(|c| (4.0 * c).round()) }
                })
                .collect();
            let outer = outermost(points.clone());
            assert!(round % 2 == 1 || outer.len() < 80);
            for k in 0..900 {
                let angle = f64::from(k).to_radians() * 0.4;
                let end = |of: &[[f64; 2]]| {
                    let along = of.iter().map(|p| angle.cos() * p[0] + angle.sin() * p[1]);
                    along.fold(f64::NEG_INFINITY, f64::max)
                };
                assert_eq!(end(&outer), end(&points));
            }
        }
    }
}
