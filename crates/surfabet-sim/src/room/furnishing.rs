//! What a room is furnished with, wall by wall.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::wall::{Openings, Wall, Walls};
use super::{RoomKind, RoomOptions, SHELF_PITCH, SKIRTING, WALL, jitter};
use crate::furniture::{self, CUPBOARD, DOORWAY, SHELF, TABLE, WALL_CUPBOARD};
use crate::pose::{Frame, Vec3, upright};
use crate::scene::{Builder, Model};
use crate::solid::Shape;
use crate::texture::{Rgb, Texture, mix};
use crate::variants;

/// Places models and numbers them: one number per class, more where things of a class differ.
#[derive(Default)]
pub(super) struct Furnisher {
    pub builder: Builder,
    models: u32,
}

impl Furnisher {
    /// Places congruent copies of a model.
    pub fn place(&mut self, class: &'static str, model: &Model, frames: &[Frame]) {
        for frame in frames {
            self.builder.place(class, self.models, model, frame);
        }
        self.models += 1;
    }

    /// Places things of one class that are not copies.
    pub fn place_each(
        &mut self,
        class: &'static str,
        frames: &[Frame],
        mut model: impl FnMut() -> Model,
    ) {
        for frame in frames {
            self.place_one(class, &model(), *frame);
        }
    }

    /// Places the only copy of a model.
    pub fn place_one(&mut self, class: &'static str, model: &Model, frame: Frame) {
        self.place(class, model, &[frame]);
    }
}

/// A colour of a palette.
fn choose(rng: &mut ChaCha8Rng, palette: &[Rgb]) -> Rgb {
    palette[rng.random_range(0..palette.len())]
}

/// The colours of a room.
pub(super) struct Palette {
    pub wall: Rgb,
    pub accent: Rgb,
    pub cloth: Rgb,
    pub cushion: Rgb,
}

impl Palette {
    pub fn drawn(rng: &mut ChaCha8Rng) -> Self {
        Self {
            wall: choose(rng, &[[0.86, 0.83, 0.74], [0.80, 0.85, 0.84], [0.87, 0.80, 0.76]]),
            accent: choose(rng, &[[0.70, 0.16, 0.14], [0.16, 0.38, 0.52], [0.30, 0.46, 0.26]]),
            cloth: choose(rng, &[[0.26, 0.34, 0.50], [0.52, 0.42, 0.30], [0.34, 0.44, 0.36]]),
            cushion: choose(rng, &[[0.22, 0.44, 0.42], [0.66, 0.42, 0.16], [0.44, 0.26, 0.40]]),
        }
    }
}

/// Floor and ceiling between the walls, and the floor in the doorways.
pub(super) fn shell(
    house: &mut Furnisher,
    [length, depth, height]: [f64; 3],
    doorways: &[Frame],
    rng: &mut ChaCha8Rng,
) {
    let floor = if rng.random_bool(0.5) {
        Texture::Boards([0.72, 0.56, 0.38], [0.58, 0.42, 0.26], 0.14)
    } else {
        Texture::Tiles([0.74, 0.70, 0.64], [0.66, 0.62, 0.57], 0.40)
    };
    // All faces but the one towards the room look away from it.
    let (only_top, only_bottom) = (0b01_1111, 0b10_1111);
    let mut m = Model::default();
    let size = [length, depth, WALL];
    m.cuboid_hiding([0.0, 0.0, -0.5 * WALL], size, floor, only_top);
    for frame in doorways {
        let half = Vec3::new(0.5 * DOORWAY[0], 0.5 * WALL, 0.5 * WALL);
        let middle = frame * Frame::translation(0.0, -0.5 * WALL, -0.5 * WALL);
        m.solids.push((Shape::Cuboid(half), middle, floor, only_top));
    }
    house.place_one("floor", &m, Frame::identity());
    let mut m = Model::default();
    let white = Texture::Paint([0.93, 0.93, 0.91]);
    m.cuboid_hiding([0.0, 0.0, 0.5 * WALL], size, white, only_bottom);
    house.place_one("ceiling", &m, Frame::translation(0.0, 0.0, height));
}

/// The walls, one of them papered, and the boards at their feet.
pub(super) fn walls_and_skirting(
    house: &mut Furnisher,
    walls: &Walls,
    openings: &Openings,
    height: f64,
    palette: &Palette,
    rng: &mut ChaCha8Rng,
) {
    let papered = rng.random_range(0..4);
    for (i, (wall, openings)) in walls.all().into_iter().zip(openings.by_wall()).enumerate() {
        let texture = if i == papered {
            Texture::Wallpaper(palette.wall, mix(palette.wall, palette.accent, 0.25), 0.22)
        } else {
            Texture::Paint(palette.wall)
        };
        // South and north wall close the corners.
        let past = if i < 2 { WALL } else { 0.0 };
        house.place_one("wall", &wall.model(&openings, height, past, texture), wall.frame);
    }
    for (wall, openings) in walls.all().into_iter().zip(openings.by_wall()) {
        house.place_one("skirting", &wall.skirting(&openings), wall.frame);
    }
}

/// Doors, that in the west wall open, and windows with radiators below them.
pub(super) fn doors_and_windows(
    house: &mut Furnisher,
    walls: &Walls,
    openings: &Openings,
    variation: f64,
    rng: &mut ChaCha8Rng,
) {
    let frames = openings.doorways(walls);
    house.place("door_frame", &furniture::door_frame(WALL), &frames);
    let closed = openings.south.len() + openings.north.len();
    let leaves: Vec<Frame> = frames
        .iter()
        .enumerate()
        .map(|(i, frame)| {
            let angle = if i < closed { 0.0 } else { 1.2 + rng.random_range(0.0..0.35) };
            frame * furniture::hinge(angle)
        })
        .collect();
    if variation > 0.0 {
        house.place_each("door", &leaves, || variants::door(rng));
    } else {
        house.place("door", &furniture::door([0.78, 0.74, 0.66]), &leaves);
    }
    let niches: Vec<Frame> =
        openings.windows.iter().map(|w| walls.north.at(w.middle, 0.0, 0.0)).collect();
    house.place("window", &furniture::window(WALL), &niches);
    house.place("radiator", &furniture::radiator(), &niches);
}

/// A row of congruent cupboards under a worktop, with as many hanging above it, tiles between.
pub(super) fn kitchen(house: &mut Furnisher, wall: &Wall, accent: Rgb, rng: &mut ChaCha8Rng) {
    let units = 3;
    // Two millimetres between the units.
    let width = CUPBOARD[0] + 0.002;
    let height = CUPBOARD[2];
    let front = SKIRTING[0] + 0.005;
    let row = |front: f64, z: f64| -> Vec<Frame> {
        (0..units).map(|i| wall.at(width * (f64::from(i) - 1.0), front, z)).collect()
    };
    let length = width * f64::from(units);
    house.place("cupboard", &furniture::cupboard(accent), &row(front, 0.0));
    house.place_one("worktop", &furniture::worktop(length), wall.at(0.0, front, height));
    let top = height + 0.04;
    let hanging = 1.42;
    let mut tiles = Model::default();
    let tile = Texture::Tiles([0.92, 0.91, 0.87], mix([0.92, 0.91, 0.87], accent, 0.35), 0.10);
    let tall = hanging - top - 0.003;
    tiles.cuboid([0.0, 0.004, top + 0.5 * tall], [length, 0.008, tall], tile);
    house.place_one("tiles", &tiles, wall.frame);
    house.place("wall_cupboard", &furniture::wall_cupboard(accent), &row(0.0, hanging));
    debug_assert!(hanging + WALL_CUPBOARD[2] < RoomKind::Dwelling.limits()[0][2]);

    house.place_one("rug", &furniture::rug(1.4, 0.4), wall.at(0.0, 0.82, 0.0));

    let shift = jitter(rng, 0.1);
    house.place_one("kettle", &furniture::kettle(), wall.at(-0.6 + shift, 0.30, top));
    let spin = rng.random_range(0.0..TAU);
    let books = furniture::books(rng);
    house.place_one(
        "books",
        &books,
        wall.at(0.6 + shift, 0.32, top) * upright(Vec3::zeros(), spin),
    );
}

/// `n` shelves side by side, congruent without variation.
pub(super) fn shelves(
    house: &mut Furnisher,
    wall: &Wall,
    n: usize,
    variation: f64,
    rng: &mut ChaCha8Rng,
) {
    let first = -0.5 * SHELF_PITCH * (n as f64 - 1.0) + jitter(rng, 0.1);
    let frames: Vec<Frame> =
        (0..n).map(|i| wall.at(first + SHELF_PITCH * i as f64, SKIRTING[0] + 0.005, 0.0)).collect();
    if variation > 0.0 {
        house.place_each("shelf", &frames, || variants::shelf(rng, variation));
    } else {
        house.place("shelf", &furniture::shelf(rng, SHELF), &frames);
    }
}

/// A sofa at the west wall with a picture above it, and a picture between the windows. The room's depth is twice `y`.
pub(super) fn sofa_and_pictures(
    house: &mut Furnisher,
    walls: &Walls,
    y: f64,
    cloth: Rgb,
    rng: &mut ChaCha8Rng,
) {
    let sofa_at = -y + 1.45 + rng.random_range(0.0..0.1);
    house.place_one("sofa", &furniture::sofa(cloth), walls.west.at(sofa_at, 0.03, 0.0));
    let picture = furniture::picture(0.9, 0.6, rng.random());
    let at = walls.west.at(sofa_at + jitter(rng, 0.1), 0.0, 1.55);
    house.place_one("picture", &picture, at);
    let picture = furniture::picture(0.42, 0.6, rng.random());
    house.place_one("picture", &picture, walls.north.at(0.0, 0.0, 1.6));
}

/// A pillar in the north-east corner, a plant between the windows, a bin and cartons along the north wall.
pub(super) fn corners(
    house: &mut Furnisher,
    [length, depth, height]: [f64; 3],
    rng: &mut ChaCha8Rng,
) {
    let (x, y) = (0.5 * length, 0.5 * depth);
    let at = |x: f64, y: f64| upright(Vec3::new(x, y, 0.0), 0.0);
    house.place_one("pillar", &furniture::pillar(height), at(x - 0.30, y - 0.30));
    house.place_one("plant", &furniture::plant(), at(0.0, y - 0.42));
    house.place_one("bin", &furniture::bin(), at(x - 0.85 + jitter(rng, 0.05), y - 0.34));
    let carton = furniture::carton([0.38, 0.30, 0.28]);
    let corner = Vec3::new(-x + 0.40, y - 0.36, 0.0);
    let cartons = [
        upright(corner, jitter(rng, 0.15)),
        upright(corner + Vec3::new(0.02, 0.0, 0.281), 0.5 + jitter(rng, 0.3)),
    ];
    house.place("carton", &carton, &cartons);
}

/// Tables in a row along x with chairs around them and things on them.
pub(super) fn dining(
    house: &mut Furnisher,
    options: &RoomOptions,
    palette: &Palette,
    rng: &mut ChaCha8Rng,
) {
    let n = options.n_tables();
    let columns = ((options.size[0] - 1.2) / 3.4).max(1.0) as usize;
    let rows = n.div_ceil(columns);
    let tables: Vec<Frame> = (0..n)
        .map(|i| {
            let (c, r) = (i % columns, i / columns);
            let in_row = columns.min(n - r * columns);
            let x = 3.4 * (c as f64 - 0.5 * (in_row as f64 - 1.0));
            let y = 2.4 * (r as f64 - 0.5 * (rows as f64 - 1.0));
            let position = Vec3::new(x + jitter(rng, 0.06), y + jitter(rng, 0.04), 0.0);
            upright(position, jitter(rng, 0.06))
        })
        .collect();
    house.place("table", &furniture::table(), &tables);

    let [length, depth] = TABLE;
    let seats = [
        (-0.38, -0.5 * depth - 0.18, 0.0),
        (0.38, 0.5 * depth + 0.18, PI),
        (0.38, -0.5 * depth - 0.18, 0.0),
        (-0.38, 0.5 * depth + 0.18, PI),
        (0.5 * length + 0.18, 0.0, FRAC_PI_2),
        (-0.5 * length - 0.18, 0.0, -FRAC_PI_2),
    ];
    let chairs: Vec<Frame> = (0..options.n_chairs)
        .map(|i| {
            let (x, y, yaw) = seats[i / n];
            // Pulled out by up to 15 cm (backwards is -y of the chair) and turned; where chairs vary some are pushed under
            // the table by up to 12 cm.
            let pushed = if options.variation > 0.0 { 0.12 } else { 0.0 };
            let pulled =
                Frame::translation(jitter(rng, 0.04), -rng.random_range(-pushed..0.15), 0.0);
            let turned = upright(Vec3::zeros(), jitter(rng, 0.35));
            tables[i % n] * upright(Vec3::new(x, y, 0.0), yaw) * pulled * turned
        })
        .collect();
    if options.variation > 0.0 {
        house.place_each("chair", &chairs, || variants::chair(rng, options.variation));
    } else {
        house.place("chair", &furniture::chair(palette.cushion), &chairs);
    }
    things_on_tables(house, &tables, palette, rng);
}

/// Mugs, a laptop, books and a ball on every table.
fn things_on_tables(
    house: &mut Furnisher,
    tables: &[Frame],
    palette: &Palette,
    rng: &mut ChaCha8Rng,
) {
    let on_table =
        |table: &Frame, x: f64, y: f64, yaw: f64| table * upright(Vec3::new(x, y, 0.75), yaw);
    let mugs: Vec<Frame> = tables
        .iter()
        .flat_map(|t| [(-0.55, 0.22), (0.45, -0.25), (0.62, 0.10)].map(|(x, y)| (t, x, y)))
        .map(|(t, x, y)| on_table(t, x, y, rng.random_range(0.0..TAU)))
        .collect();
    house.place("mug", &furniture::mug(palette.accent), &mugs);
    for table in tables {
        let yaw = jitter(rng, 0.5);
        house.place_one("laptop", &furniture::laptop(), on_table(table, -0.15, -0.08, yaw));
        let books = furniture::books(rng);
        let yaw = rng.random_range(0.0..TAU);
        house.place_one("books", &books, on_table(table, 0.25, 0.20, yaw));
        let yellow = [0.92, 0.68, 0.16];
        house.place_one("ball", &furniture::ball(0.05, yellow), on_table(table, -0.5, -0.2, 0.3));
    }
}
