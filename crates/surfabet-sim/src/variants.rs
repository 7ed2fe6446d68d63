//! Things of one kind that are not copies: chairs, doors and shelves of other sizes, styles and colours.
//!
//! As in `furniture`, no two solids merely touch where neither covers the other.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::furniture::{self, SHELF, STEEL};
use crate::scene::Model;
use crate::texture::{Rgb, Texture};

const WOODS: [[Rgb; 2]; 4] = [
    [[0.80, 0.62, 0.40], [0.62, 0.43, 0.24]],
    [[0.42, 0.30, 0.20], [0.30, 0.20, 0.13]],
    [[0.90, 0.89, 0.86], [0.84, 0.83, 0.80]],
    [[0.26, 0.26, 0.28], [0.20, 0.20, 0.22]],
];

const CUSHIONS: [Rgb; 5] = [
    [0.22, 0.44, 0.42],
    [0.66, 0.42, 0.16],
    [0.44, 0.26, 0.40],
    [0.70, 0.20, 0.18],
    [0.30, 0.32, 0.36],
];

const PAINTS: [Rgb; 4] =
    [[0.78, 0.74, 0.66], [0.92, 0.92, 0.90], [0.60, 0.42, 0.26], [0.55, 0.62, 0.66]];

/// A factor within `variation` of 1.
fn factor(rng: &mut ChaCha8Rng, variation: f64) -> f64 {
    1.0 + rng.random_range(-variation..=variation)
}

fn one_of<T: Copy>(rng: &mut ChaCha8Rng, all: &[T]) -> T {
    all[rng.random_range(0..all.len())]
}

/// A chair like `furniture::chair`: width, depth, height of seat and back each within `variation` of its, with a back of
/// boards, of bars or closed, with or without cushion and stretchers, in any wood.
pub(crate) fn chair(rng: &mut ChaCha8Rng, variation: f64) -> Model {
    let [width, depth, seat, top] =
        [0.42, 0.424, 0.45, 0.92].map(|length| length * factor(rng, variation));
    let [light, dark] = one_of(rng, &WOODS);
    let (upright, along) = (Texture::Wood(light, dark, 2), Texture::Wood(light, dark, 0));
    let post = 0.036;
    let (x, y) = (0.5 * width - 0.02, 0.5 * depth - 0.022);
    let mut m = Model::default();
    for sign in [-1.0, 1.0] {
        m.cuboid([sign * x, y, 0.5 * (seat - 0.04)], [post, post, seat - 0.04], upright);
        m.cuboid([sign * x, -0.5 * depth - 0.018, 0.5 * top], [post, post, top], upright);
    }
    m.cuboid([0.0, 0.0, seat - 0.02], [width, depth, 0.04], along);
    if rng.random_bool(0.6) {
        let cloth = Texture::Paint(one_of(rng, &CUSHIONS));
        m.cuboid([0.0, 0.012, seat + 0.0175], [width - 0.04, depth - 0.064, 0.035], cloth);
    }
    if rng.random_bool(0.5) {
        for sign in [-1.0, 1.0] {
            m.cuboid([sign * x, -0.009, 0.2], [0.022, y + 0.5 * depth - 0.018, 0.03], upright);
        }
    }
    back(&mut m, rng, [2.0 * x - post, -0.5 * depth - 0.018, seat], top, along);
    m
}

/// The back between the posts: `inner` is its width, its y and the height of the seat.
fn back(m: &mut Model, rng: &mut ChaCha8Rng, inner: [f64; 3], top: f64, along: Texture) {
    let [width, y, seat] = inner;
    let (low, high) = (seat + 0.12, top - 0.02);
    let mut board = |x: f64, z: f64, size: [f64; 2]| {
        m.cuboid([x, y, z], [size[0], 0.02, size[1]], along);
    };
    match rng.random_range(0..3) {
        0 => {
            let n = rng.random_range(2..5);
            let pitch = (high - low) / f64::from(n);
            for i in 0..n {
                board(0.0, low + pitch * (f64::from(i) + 0.5), [width, 0.6 * pitch]);
            }
        }
        1 => {
            board(0.0, high - 0.03, [width, 0.06]);
            board(0.0, low, [width, 0.04]);
            let n = rng.random_range(4..7);
            let (from, to) = (low + 0.02, high - 0.06);
            for i in 0..n {
                let x = width * ((f64::from(i) + 0.5) / f64::from(n) - 0.5);
                board(x, 0.5 * (from + to), [0.025, to - from]);
            }
        }
        _ => board(0.0, 0.5 * (low + high), [width, high - low]),
    }
}

/// A door leaf as `furniture::door`, of its size since doorways are equal: with two or three panels or plain, in any paint.
pub(crate) fn door(rng: &mut ChaCha8Rng) -> Model {
    let paint = one_of(rng, &PAINTS);
    match rng.random_range(0..3) {
        0 => furniture::door(paint),
        1 => furniture::door_with(paint, &[(0.40, 0.50), (1.02, 0.50), (1.64, 0.50)]),
        _ => furniture::door_with(paint, &[]),
    }
}

/// A shelf as `furniture::shelf` with books of its own: up to 4 cm wider, within `variation` narrower, lower or higher, and
/// deeper.
pub(crate) fn shelf(rng: &mut ChaCha8Rng, variation: f64) -> Model {
    let [width, depth, height] = SHELF;
    let width = (width * factor(rng, variation)).min(width + 0.04);
    let size = [width, depth * factor(rng, variation), height * factor(rng, variation)];
    furniture::shelf(rng, size)
}

/// A swivel chair: seat and back on a foot with five arms.
pub(crate) fn swivel_chair(rng: &mut ChaCha8Rng) -> Model {
    let cloth = Texture::Paint(one_of(rng, &CUSHIONS));
    let mut m = Model::default();
    m.cylinder([0.0, 0.0, 0.25], 0.03, 0.36, 2, STEEL);
    for i in 0..5 {
        let turn = f64::from(i) * std::f64::consts::TAU / 5.0;
        let middle = [0.14 * turn.cos(), 0.14 * turn.sin(), 0.055 + 0.002 * f64::from(i)];
        let frame = crate::pose::upright(middle.into(), turn);
        let half = crate::pose::Vec3::new(0.15, 0.02, 0.02);
        m.solids.push((crate::solid::Shape::Cuboid(half), frame, STEEL, 0));
    }
    m.cuboid([0.0, 0.0, 0.465], [0.46, 0.46, 0.07], cloth);
    m.cuboid([0.0, -0.21, 0.56], [0.06, 0.03, 0.16], STEEL);
    m.cuboid([0.0, -0.225, 0.82], [0.42, 0.05, 0.40], cloth);
    m
}
