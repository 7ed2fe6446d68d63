//! The axes of a patch's rectangle.

use crate::planes::constants::{RIM_STRIPS, TURNED_AREA, TURNS};
use crate::planes::patch::Frame;

/// Turns the axes of `frame`, and the coordinates `local` of points in it, first to the principal axes of the points
/// and then to those of a clearly smaller rectangle, if there is one.
pub(super) fn turned(frame: Frame, local: &mut [[f64; 3]]) -> Frame {
    let frame = to_principal(frame, local);
    let angle = smallest(local);
    turn(frame, local, angle)
}

/// Turns the axes of `frame`, and the coordinates `local` of points in it, to the principal axes of the points.
pub(in crate::planes::fit) fn to_principal(frame: Frame, local: &mut [[f64; 3]]) -> Frame {
    let angle = principal(local);
    turn(frame, local, angle)
}

/// Turns the axes of `frame` and the coordinates of points in it by an angle given by its cosine and sine.
fn turn(frame: Frame, local: &mut [[f64; 3]], [cosine, sine]: [f64; 2]) -> Frame {
    for p in local.iter_mut() {
        *p = [cosine * p[0] + sine * p[1], cosine * p[1] - sine * p[0], p[2]];
    }
    frame.turned([cosine, sine])
}

/// Lower corner and size of the bounding rectangle of points.
pub(in crate::planes::fit) fn bounds(local: &[[f64; 3]]) -> ([f64; 2], [f64; 2]) {
    let range = |a: usize| {
        local
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |r, p| [r[0].min(p[a]), r[1].max(p[a])])
    };
    let [[x0, x1], [y0, y1]] = [range(0), range(1)];
    ([x0, y0], [x1 - x0, y1 - y0])
}

/// Cosine and sine of the direction in which points of a plane spread the most: `tan 2a = 2 c_xy / (c_xx - c_yy)` with
/// their covariances `c`.
fn principal(local: &[[f64; 3]]) -> [f64; 2] {
    let n = local.len() as f64;
    let mean: [f64; 2] = std::array::from_fn(|a| local.iter().map(|p| p[a]).sum::<f64>() / n);
    let of = |a: usize, b: usize| {
        local.iter().map(|p| (p[a] - mean[a]) * (p[b] - mean[b])).sum::<f64>() / n
    };
    let angle = 0.5 * (2.0 * of(0, 1)).atan2(of(0, 0) - of(1, 1));
    [angle.cos(), angle.sin()]
}

/// Cosine and sine of the turn that makes the bounding rectangle smallest, if it is clearly smaller than that along the
/// principal axes; no turn otherwise. For what is about as wide as long the principal axis is arbitrary.
fn smallest(local: &[[f64; 3]]) -> [f64; 2] {
    let rim = rim(local);
    let area = |angle: f64| {
        let [c, s] = [angle.cos(), angle.sin()];
        let side = |[x, y]: [f64; 2]| {
            let along = rim.iter().map(|p| x * p[0] + y * p[1]);
            let ends =
                along.fold([f64::INFINITY, f64::NEG_INFINITY], |e, v| [e[0].min(v), e[1].max(v)]);
            ends[1] - ends[0]
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
    if least < TURNED_AREA * area(0.0) { [angle.cos(), angle.sin()] } else { [1.0, 0.0] }
}

/// The points with the lowest and the highest second coordinate in each strip of the first: about the convex hull.
fn rim(local: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let ends = local
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |e, p| [e[0].min(p[0]), e[1].max(p[0])]);
    let per = RIM_STRIPS as f64 / (ends[1] - ends[0]).max(f64::MIN_POSITIVE);
    let mut strips: Vec<Option<[[f64; 3]; 2]>> = vec![None; RIM_STRIPS];
    for &p in local {
        let strip = &mut strips[(((p[0] - ends[0]) * per) as usize).min(RIM_STRIPS - 1)];
        let [low, high] = strip.get_or_insert([p, p]);
        if p[1] < low[1] {
            *low = p;
        }
        if p[1] > high[1] {
            *high = p;
        }
    }
    strips.into_iter().flatten().flatten().collect()
}
