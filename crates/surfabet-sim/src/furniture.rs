//! The models that a room is furnished with.
//!
//! What stands at a wall has the wall at y = 0 and the room towards +y; what stands free faces +y from its
//! middle. The floor is z = 0. No face is covered by two solids that merely touch each other: they overlap or
//! keep a gap, so that every covered place lies inside one convex solid (see `Scene::closest_point`).

use nalgebra::{UnitQuaternion, Vector3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::pose::{Frame, Vec3};
use crate::scene::Model;
use crate::solid::Shape;
use crate::texture::{Rgb, Texture};

const OAK: Texture = Texture::Wood([0.80, 0.62, 0.40], [0.62, 0.43, 0.24], 2);
const OAK_ALONG_X: Texture = Texture::Wood([0.80, 0.62, 0.40], [0.62, 0.43, 0.24], 0);
const BEECH_ALONG_X: Texture = Texture::Wood([0.88, 0.72, 0.52], [0.74, 0.55, 0.36], 0);
const WHITE: Texture = Texture::Paint([0.90, 0.90, 0.88]);
pub(crate) const STEEL: Texture = Texture::Paint([0.66, 0.67, 0.69]);
const DARK: Texture = Texture::Paint([0.20, 0.20, 0.22]);

impl Model {
    /// A box by its middle and edge lengths.
    pub(crate) fn cuboid(&mut self, middle: [f64; 3], size: [f64; 3], texture: Texture) {
        self.cuboid_hiding(middle, size, texture, 0);
    }

    /// A box with a mask of faces that look away from the room.
    pub(crate) fn cuboid_hiding(
        &mut self,
        middle: [f64; 3],
        size: [f64; 3],
        texture: Texture,
        hidden: u8,
    ) {
        let frame = Frame::from_parts(Vec3::from(middle).into(), UnitQuaternion::identity());
        self.solids.push((Shape::Cuboid(Vec3::from(size) * 0.5), frame, texture, hidden));
    }

    /// A cylinder by its middle, radius, height and the axis (0, 1, 2) that it stands along.
    pub(crate) fn cylinder(
        &mut self,
        middle: [f64; 3],
        radius: f64,
        height: f64,
        axis: usize,
        texture: Texture,
    ) {
        let quarter = std::f64::consts::FRAC_PI_2;
        let turn = match axis {
            0 => UnitQuaternion::from_axis_angle(&Vector3::y_axis(), quarter),
            1 => UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -quarter),
            _ => UnitQuaternion::identity(),
        };
        let frame = Frame::from_parts(Vec3::from(middle).into(), turn);
        self.solids.push((Shape::Cylinder(radius, 0.5 * height), frame, texture, 0));
    }

    /// A sphere by its middle and radius.
    pub(crate) fn sphere(&mut self, middle: [f64; 3], radius: f64, texture: Texture) {
        let frame = Frame::from_parts(Vec3::from(middle).into(), UnitQuaternion::identity());
        self.solids.push((Shape::Sphere(radius), frame, texture, 0));
    }
}

pub(crate) fn chair(cushion: Rgb) -> Model {
    let mut m = Model::default();
    let seat = 0.45;
    for (x, y) in [(-0.19, 0.19), (0.19, 0.19)] {
        m.cuboid([x, y, 0.5 * (seat - 0.04)], [0.036, 0.036, seat - 0.04], OAK);
    }
    // The back legs go on behind the seat as posts of the back.
    for x in [-0.19, 0.19] {
        m.cuboid([x, -0.23, 0.46], [0.036, 0.036, 0.92], OAK);
    }
    m.cuboid([0.0, 0.0, seat - 0.02], [0.42, 0.424, 0.04], OAK_ALONG_X);
    m.cuboid([0.0, 0.012, seat + 0.0175], [0.38, 0.36, 0.035], Texture::Paint(cushion));
    for z in [0.60, 0.72, 0.86] {
        m.cuboid([0.0, -0.23, z], [0.344, 0.02, 0.07], OAK_ALONG_X);
    }
    for x in [-0.19, 0.19] {
        m.cuboid([x, -0.0205, 0.2], [0.022, 0.383, 0.03], OAK);
    }
    m
}

pub(crate) const TABLE: [f64; 2] = [1.6, 0.85];

pub(crate) fn table() -> Model {
    let mut m = Model::default();
    let [length, depth] = TABLE;
    let (x, y) = (0.5 * length - 0.06, 0.5 * depth - 0.06);
    m.cuboid([0.0, 0.0, 0.735], [length, depth, 0.03], BEECH_ALONG_X);
    for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        m.cuboid([sx * x, sy * y, 0.36], [0.06, 0.06, 0.72], OAK);
    }
    for sign in [-1.0, 1.0] {
        m.cuboid([0.0, sign * y, 0.678], [2.0 * x - 0.06, 0.02, 0.08], OAK_ALONG_X);
        m.cuboid([sign * x, 0.0, 0.678], [0.02, 2.0 * y - 0.06, 0.08], OAK);
    }
    m
}

pub(crate) const SHELF: [f64; 3] = [0.8, 0.3, 1.95];

/// An open shelf of a width, depth and height with boards and books: the same books in every copy, drawn from `rng`.
pub(crate) fn shelf(rng: &mut ChaCha8Rng, size: [f64; 3]) -> Model {
    let mut m = Model::default();
    let [width, depth, height] = size;
    let board = 0.022;
    let inner = width - 2.0 * board;
    for sign in [-1.0, 1.0] {
        let x = sign * 0.5 * (width - board);
        m.cuboid([x, 0.5 * depth, 0.5 * height], [board, depth, height], OAK);
    }
    m.cuboid([0.0, 0.004, 0.5 * height], [inner, 0.008, height], OAK);
    let rows = 5;
    let pitch = (height - 0.08 - board) / f64::from(rows);
    for row in 0..=rows {
        let z = 0.08 + pitch * f64::from(row) + 0.5 * board;
        m.cuboid([0.0, 0.5 * depth, z], [inner, depth, board], OAK_ALONG_X);
        if row == rows {
            break;
        }
        let floor = z + 0.5 * board;
        let mut x = -0.5 * inner;
        let end = 0.5 * inner - if row % 2 == 0 { 0.12 } else { 0.26 };
        while x < end {
            let thick = rng.random_range(0.022..0.055);
            let tall = rng.random_range(0.20..pitch - board - 0.05);
            let deep = rng.random_range(0.15..0.22);
            let cover: Rgb = std::array::from_fn(|_| rng.random_range(0.15..0.80));
            let band: Rgb = cover.map(|c| 0.35 + 0.6 * c);
            let texture = if rng.random_bool(0.5) {
                Texture::Paint(cover)
            } else {
                Texture::Stripes(cover, band, 0.16, 2)
            };
            m.cuboid(
                [x + 0.5 * thick, 0.03 + 0.5 * deep, floor + 0.5 * tall],
                [thick, deep, tall],
                texture,
            );
            x += thick + if rng.random_bool(0.15) { 0.03 } else { 0.002 };
        }
    }
    m
}

/// Width and height of the opening that a door fits into.
pub(crate) const DOORWAY: [f64; 2] = [0.90, 2.05];
const JAMB: f64 = 0.04;

/// The frame of a door in a wall of the given thickness; the wall's inner face is y = 0 and the opening begins
/// at its middle.
pub(crate) fn door_frame(wall: f64) -> Model {
    let mut m = Model::default();
    let [width, height] = DOORWAY;
    for sign in [-1.0, 1.0] {
        let x = sign * 0.5 * (width - JAMB);
        m.cuboid([x, -0.5 * wall, 0.5 * height], [JAMB, wall, height], WHITE);
        // The casing lies on the wall.
        let x = sign * 0.5 * (width + 0.07);
        m.cuboid([x, 0.0075, 0.5 * height + 0.035], [0.07, 0.015, height + 0.07], WHITE);
    }
    m.cuboid([0.0, -0.5 * wall, height - 0.5 * JAMB], [width, wall, JAMB], WHITE);
    m.cuboid([0.0, 0.0075, height + 0.035], [width + 0.14, 0.015, 0.07], WHITE);
    m
}

/// From the frame of a doorway to that of its leaf: the hinge stands at the left jamb, flush with the wall.
pub(crate) fn hinge(opening: f64) -> Frame {
    let position = Vec3::new(-0.5 * DOORWAY[0] + JAMB + 0.003, 0.0, 0.0);
    crate::pose::upright(position, opening)
}

/// A door leaf with two panels.
pub(crate) fn door(paint: Rgb) -> Model {
    door_with(paint, &[(0.55, 0.75), (1.47, 0.80)])
}

/// A door leaf with handles and panels (height of the middle, height); the hinge is the z axis, the leaf lies along +x
/// behind y = 0.
pub(crate) fn door_with(paint: Rgb, panels: &[(f64, f64)]) -> Model {
    let mut m = Model::default();
    let width = DOORWAY[0] - 2.0 * JAMB - 0.006;
    let height = DOORWAY[1] - JAMB - 0.012;
    let (thick, low) = (0.04, 0.008);
    let paint = Texture::Paint(paint);
    m.cuboid([0.5 * width, -0.5 * thick, low + 0.5 * height], [width, thick, height], paint);
    for &(z, tall) in panels {
        for (side, y) in [(1.0, 0.005), (-1.0, -thick - 0.005)] {
            m.cuboid([0.5 * width, y, z], [width - 0.28, 0.01, tall], paint);
            m.cuboid([0.5 * width, y + side * 0.009, z], [width - 0.40, 0.008, tall - 0.12], paint);
        }
    }
    let (x, z) = (width - 0.06, 1.02);
    for (side, face) in [(1.0, 0.0), (-1.0, -thick)] {
        m.cuboid([x, face + side * 0.003, z - 0.05], [0.035, 0.006, 0.20], STEEL);
        m.cylinder([x, face + side * 0.0285, z], 0.009, 0.045, 1, STEEL);
        m.cuboid([x - 0.05, face + side * 0.059, z], [0.12, 0.016, 0.02], STEEL);
    }
    m
}

/// Width and height of a window's niche and the height of its sill.
pub(crate) const WINDOW: [f64; 3] = [1.2, 1.25, 0.95];

/// A window deep in its niche: pane, frame with a mullion, sill. The wall's inner face is y = 0; the niche has
/// its middle at x = 0.
pub(crate) fn window(wall: f64) -> Model {
    let mut m = Model::default();
    let [width, height, sill] = WINDOW;
    let pane = 0.02;
    m.cuboid_hiding(
        [0.0, -wall + 0.5 * pane, sill + 0.5 * height],
        [width, pane, height],
        Texture::View(sill + 0.45 * height),
        1 << 2,
    );
    let bar = 0.06;
    let (y, thick) = (-wall + 0.03, 0.06);
    for sign in [-1.0, 1.0] {
        let x = sign * 0.5 * (width - bar);
        m.cuboid_hiding([x, y, sill + 0.5 * height], [bar, thick, height], WHITE, 1 << 2);
        let z = sill + 0.5 * height + sign * 0.5 * (height - bar);
        m.cuboid_hiding([0.0, y, z], [width, thick, bar], WHITE, 1 << 2);
    }
    m.cuboid_hiding([0.0, y, sill + 0.5 * height], [bar, thick, height], WHITE, 1 << 2);
    // The sill board lies in front of the wall below the niche.
    m.cuboid([0.0, 0.08, sill - 0.015], [width + 0.1, 0.16, 0.03], WHITE);
    m
}

/// A ribbed radiator in front of a wall.
pub(crate) fn radiator() -> Model {
    let mut m = Model::default();
    let ribs = 12;
    let pitch = 0.08;
    for rib in 0..ribs {
        let x = (f64::from(rib) - 0.5 * f64::from(ribs - 1)) * pitch;
        m.cuboid([x, 0.09, 0.45], [0.05, 0.10, 0.56], WHITE);
    }
    let width = f64::from(ribs - 1) * pitch;
    for z in [0.22, 0.68] {
        for rib in 0..ribs - 1 {
            let x = (f64::from(rib) + 0.5) * pitch - 0.5 * width;
            m.cylinder([x, 0.09, z], 0.02, pitch - 0.05, 0, WHITE);
        }
    }
    // Brackets hold it to the wall.
    for sign in [-1.0, 1.0] {
        m.cuboid([sign * 3.5 * pitch, 0.02, 0.45], [0.03, 0.04, 0.06], STEEL);
    }
    m
}

pub(crate) const CUPBOARD: [f64; 3] = [0.598, 0.56, 0.86];

/// A base unit of a kitchen: plinth, body, front with a bar handle.
pub(crate) fn cupboard(front: Rgb) -> Model {
    let mut m = Model::default();
    let [width, depth, height] = CUPBOARD;
    m.cuboid([0.0, 0.5 * depth - 0.05, 0.05], [width, depth - 0.1, 0.10], DARK);
    m.cuboid([0.0, 0.5 * depth, 0.5 * (height + 0.10)], [width, depth, height - 0.10], WHITE);
    let tall = height - 0.10 - 0.16 - 0.012;
    for (z, tall) in [(0.104 + 0.5 * tall, tall), (height - 0.004 - 0.08, 0.16)] {
        m.cuboid([0.0, depth + 0.009, z], [width - 0.006, 0.018, tall], Texture::Paint(front));
        bar_handle(&mut m, depth + 0.018, z + 0.5 * tall - 0.05);
    }
    m
}

fn bar_handle(m: &mut Model, y: f64, z: f64) {
    for sign in [-1.0, 1.0] {
        m.cylinder([sign * 0.09, y + 0.0125, z], 0.004, 0.025, 1, STEEL);
    }
    m.cylinder([0.0, y + 0.031, z], 0.006, 0.22, 0, STEEL);
}

pub(crate) const WALL_CUPBOARD: [f64; 3] = [0.598, 0.33, 0.60];

pub(crate) fn wall_cupboard(front: Rgb) -> Model {
    let mut m = Model::default();
    let [width, depth, height] = WALL_CUPBOARD;
    m.cuboid([0.0, 0.5 * depth, 0.5 * height], [width, depth, height], WHITE);
    m.cuboid(
        [0.0, depth + 0.009, 0.5 * height],
        [width - 0.006, 0.018, height - 0.008],
        Texture::Paint(front),
    );
    bar_handle(&mut m, depth + 0.018, 0.05);
    m
}

pub(crate) fn worktop(length: f64) -> Model {
    let mut m = Model::default();
    m.cuboid(
        [0.0, 0.30, 0.02],
        [length, 0.60, 0.04],
        Texture::Wood([0.50, 0.36, 0.24], [0.34, 0.23, 0.15], 0),
    );
    m
}

pub(crate) fn kettle() -> Model {
    let mut m = Model::default();
    m.cylinder([0.0, 0.0, 0.10], 0.075, 0.20, 2, STEEL);
    m.cylinder([0.0, 0.0, 0.21], 0.05, 0.02, 2, DARK);
    m.cuboid([0.0, 0.095, 0.12], [0.025, 0.04, 0.14], DARK);
    m
}

pub(crate) fn mug(color: Rgb) -> Model {
    let mut m = Model::default();
    m.cylinder(
        [0.0, 0.0, 0.05],
        0.042,
        0.10,
        2,
        Texture::Stripes(color, [0.92, 0.92, 0.90], 0.05, 2),
    );
    m.cuboid([0.0, 0.054, 0.05], [0.012, 0.026, 0.05], Texture::Paint(color));
    m
}

pub(crate) fn laptop() -> Model {
    let mut m = Model::default();
    m.cuboid([0.0, 0.0, 0.009], [0.34, 0.24, 0.018], STEEL);
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -0.3);
    // The hinge of the screen is the back edge of the base; the tilted box stands clear of it by a hair.
    let middle = Vec3::new(0.0, 0.124, 0.020) + tilt * Vec3::new(0.0, 0.0, 0.11);
    let half = Vec3::new(0.17, 0.004, 0.11);
    let frame = Frame::from_parts(middle.into(), tilt);
    m.solids.push((Shape::Cuboid(half), frame, DARK, 0));
    m
}

/// A pile of books, each turned a little.
pub(crate) fn books(rng: &mut ChaCha8Rng) -> Model {
    let mut m = Model::default();
    let mut z = 0.0;
    for _ in 0..rng.random_range(3..6) {
        let thick = rng.random_range(0.02..0.045);
        let half =
            Vec3::new(rng.random_range(0.08..0.11), rng.random_range(0.11..0.14), 0.5 * thick);
        let frame =
            crate::pose::upright(Vec3::new(0.0, 0.0, z + 0.5 * thick), rng.random_range(-0.4..0.4));
        let cover: Rgb = std::array::from_fn(|_| rng.random_range(0.15..0.80));
        m.solids.push((Shape::Cuboid(half), frame, Texture::Paint(cover), 0));
        z += thick;
    }
    m
}

pub(crate) fn ball(radius: f64, color: Rgb) -> Model {
    let mut m = Model::default();
    m.sphere(
        [0.0, 0.0, radius],
        radius,
        Texture::Stripes(color, [0.93, 0.92, 0.88], 0.5 * radius, 2),
    );
    m
}

pub(crate) fn bin() -> Model {
    let mut m = Model::default();
    m.cylinder(
        [0.0, 0.0, 0.19],
        0.14,
        0.38,
        2,
        Texture::Stripes([0.25, 0.36, 0.42], [0.30, 0.43, 0.50], 0.076, 2),
    );
    m.cylinder([0.0, 0.0, 0.39], 0.145, 0.02, 2, DARK);
    m
}

pub(crate) fn plant() -> Model {
    let mut m = Model::default();
    m.cylinder([0.0, 0.0, 0.14], 0.15, 0.28, 2, Texture::Paint([0.66, 0.36, 0.24]));
    m.cylinder([0.0, 0.0, 0.43], 0.015, 0.30, 2, Texture::Paint([0.36, 0.28, 0.18]));
    // The crown touches the stem in one point.
    m.sphere([0.0, 0.0, 0.83], 0.25, Texture::Wood([0.36, 0.56, 0.24], [0.16, 0.34, 0.13], 2));
    m
}

/// A globe on a rod under the ceiling at `height`; the rod touches the globe in one point.
pub(crate) fn lamp(height: f64) -> Model {
    let mut m = Model::default();
    let (radius, rod) = (0.16, 0.30);
    m.cylinder([0.0, 0.0, height - 0.02], 0.06, 0.04, 2, STEEL);
    m.cylinder([0.0, 0.0, height - 0.04 - 0.5 * rod], 0.008, rod, 2, STEEL);
    m.sphere([0.0, 0.0, height - 0.04 - rod - radius], radius, Texture::Paint([1.0, 0.97, 0.88]));
    m
}

/// A cardboard box with a strip of tape.
pub(crate) fn carton(size: [f64; 3]) -> Model {
    let mut m = Model::default();
    m.cuboid(
        [0.0, 0.0, 0.5 * size[2]],
        size,
        Texture::Wood([0.74, 0.58, 0.40], [0.68, 0.52, 0.35], 1),
    );
    m.cuboid(
        [0.0, 0.0, size[2] + 0.0005],
        [0.05, size[1], 0.001],
        Texture::Paint([0.85, 0.78, 0.60]),
    );
    m
}

/// A framed print on a wall, its middle at the origin.
pub(crate) fn picture(width: f64, height: f64, seed: u64) -> Model {
    let mut m = Model::default();
    let bar = 0.025;
    m.cuboid([0.0, 0.006, 0.0], [width, 0.012, height], Texture::Print(seed));
    for sign in [-1.0, 1.0] {
        m.cuboid([sign * 0.5 * (width - bar), 0.016, 0.0], [bar, 0.008, height], DARK);
        m.cuboid([0.0, 0.016, sign * 0.5 * (height - bar)], [width, 0.008, bar], DARK);
    }
    m
}

pub(crate) fn rug(length: f64, depth: f64) -> Model {
    let mut m = Model::default();
    m.cuboid(
        [0.0, 0.0, 0.005],
        [length, depth, 0.01],
        Texture::Stripes([0.62, 0.24, 0.20], [0.84, 0.76, 0.60], 0.25, 0),
    );
    m
}

/// A sofa for two, its back at y = 0.
pub(crate) fn sofa(cloth: Rgb) -> Model {
    let mut m = Model::default();
    let cloth = Texture::Paint(cloth);
    let pillow = Texture::Wallpaper([0.78, 0.70, 0.52], [0.70, 0.58, 0.38], 0.08);
    for (x, y) in [(-0.7, 0.08), (0.7, 0.08), (-0.7, 0.72), (0.7, 0.72)] {
        m.cylinder([x, y, 0.05], 0.025, 0.10, 2, OAK);
    }
    m.cuboid([0.0, 0.40, 0.20], [1.56, 0.80, 0.20], cloth);
    m.cuboid([0.0, 0.10, 0.55], [1.56, 0.20, 0.50], cloth);
    for sign in [-1.0, 1.0] {
        m.cuboid([sign * 0.70, 0.5025, 0.45], [0.16, 0.595, 0.30], cloth);
        m.cuboid([sign * 0.308, 0.49, 0.37], [0.60, 0.56, 0.14], cloth);
    }
    let lean = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.25);
    // The pillow leans at the back and sinks a little into the seat.
    let frame = Frame::from_parts(Vec3::new(0.35, 0.30, 0.60).into(), lean);
    m.solids.push((Shape::Cuboid(Vec3::new(0.2, 0.06, 0.18)), frame, pillow, 0));
    m
}

/// A round column from floor to ceiling.
pub(crate) fn pillar(height: f64) -> Model {
    let mut m = Model::default();
    m.cylinder([0.0, 0.0, 0.5 * height], 0.14, height, 2, Texture::Paint([0.80, 0.79, 0.76]));
    m
}
