//! Rooms of other kinds than a dwelling: an office, a classroom, a library, a corridor.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::furnishing::Furnisher;
use super::wall::{Openings, Wall, Walls};
use super::{RoomOptions, SHELF_PITCH, SKIRTING, jitter};
use crate::furniture::{self, TABLE};
use crate::pose::{Frame, Vec3, upright};
use crate::variants;

/// What a room is for, which sets what stands in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RoomKind {
    /// Kitchen, sofa, tables with chairs.
    #[default]
    Dwelling,
    /// Desks with swivel chairs and laptops, shelves.
    Office,
    /// Rows of tables with two chairs each, a board.
    Classroom,
    /// Shelves along three walls, a reading table.
    Library,
    /// Long and narrow, with doors on both sides.
    Corridor,
}

impl RoomKind {
    /// All kinds with their names.
    pub const NAMES: [(&'static str, Self); 5] = [
        ("dwelling", Self::Dwelling),
        ("office", Self::Office),
        ("classroom", Self::Classroom),
        ("library", Self::Library),
        ("corridor", Self::Corridor),
    ];

    /// Least and largest length, depth and height, metres.
    pub(super) fn limits(self) -> [[f64; 3]; 2] {
        match self {
            Self::Dwelling => [[4.8, 4.0, 2.4], [12.0, 10.0, 4.0]],
            Self::Office => [[3.6, 3.6, 2.4], [12.0, 10.0, 4.0]],
            Self::Classroom => [[5.5, 4.5, 2.4], [14.0, 12.0, 4.0]],
            Self::Library => [[4.5, 4.5, 2.4], [14.0, 12.0, 4.0]],
            Self::Corridor => [[6.0, 1.4, 2.4], [40.0, 4.0, 4.0]],
        }
    }
}

/// How far things of these kinds of rooms differ in size.
const VARIATION: f64 = 0.05;

/// What stands in a room of a kind other than a dwelling.
pub(super) fn furnish(
    house: &mut Furnisher,
    options: &RoomOptions,
    walls: &Walls,
    openings: &Openings,
    rng: &mut ChaCha8Rng,
) {
    match options.kind {
        RoomKind::Dwelling => {}
        RoomKind::Office => office(house, options.size, walls, rng),
        RoomKind::Classroom => classroom(house, options.size, walls, rng),
        RoomKind::Library => library(house, options.size, walls, rng),
        RoomKind::Corridor => corridor(house, walls, openings, rng),
    }
}

/// Places in rows and columns about the middle of the floor.
fn grid([length, depth]: [f64; 2], pitch: [f64; 2]) -> Vec<[f64; 2]> {
    let [columns, rows] = [length / pitch[0], depth / pitch[1]].map(|n| (n as usize).max(1));
    let at = |i: usize, n: usize, pitch: f64| pitch * (i as f64 - 0.5 * (n as f64 - 1.0));
    (0..columns * rows)
        .map(|i| [at(i % columns, columns, pitch[0]), at(i / columns, rows, pitch[1])])
        .collect()
}

/// Shelves side by side along a wall, from `margin` metres before its ends.
fn line_with_shelves(
    house: &mut Furnisher,
    wall: &Wall,
    length: f64,
    margin: f64,
    rng: &mut ChaCha8Rng,
) {
    let n = ((length - 2.0 * margin) / SHELF_PITCH) as usize;
    for i in 0..n {
        let x = SHELF_PITCH * (i as f64 - 0.5 * (n as f64 - 1.0));
        let shelf = variants::shelf(rng, VARIATION);
        house.place_one("shelf", &shelf, wall.at(x, SKIRTING[0] + 0.005, 0.0));
    }
}

/// A chair in front of a table's long side (`side` -1 or 1) at `x` along it.
fn seat(table: &Frame, x: f64, side: f64, rng: &mut ChaCha8Rng) -> Frame {
    let turned = if side < 0.0 { 0.0 } else { PI };
    let pulled = 0.20 + rng.random_range(0.0..0.2);
    table * upright(Vec3::new(x, side * (0.5 * TABLE[1] + pulled), 0.0), turned + jitter(rng, 0.4))
}

fn office(
    house: &mut Furnisher,
    [length, depth, _]: [f64; 3],
    walls: &Walls,
    rng: &mut ChaCha8Rng,
) {
    for [x, y] in grid([length - 1.2, depth - 0.8], [2.2, 2.0]) {
        let position = Vec3::new(x + jitter(rng, 0.1), y + jitter(rng, 0.1), 0.0);
        let desk = upright(position, if rng.random_bool(0.5) { 0.0 } else { PI });
        house.place_one("table", &furniture::table(), desk);
        let place = seat(&desk, jitter(rng, 0.2), -1.0, rng);
        house.place_one("swivel_chair", &variants::swivel_chair(rng), place);
        let at = |x: f64, y: f64, yaw: f64| desk * upright(Vec3::new(x, y, 0.75), yaw);
        let turned = jitter(rng, 0.4);
        house.place_one("laptop", &furniture::laptop(), at(jitter(rng, 0.15), 0.05, turned));
        let books = furniture::books(rng);
        house.place_one("books", &books, at(0.55, 0.15, jitter(rng, 0.5)));
    }
    line_with_shelves(house, &walls.east, depth, 0.6, rng);
    let at = Vec3::new(0.5 * length - 0.6, 0.5 * depth - 0.3, 0.0);
    house.place_one("bin", &furniture::bin(), upright(at, 0.0));
}

fn classroom(
    house: &mut Furnisher,
    [length, depth, _]: [f64; 3],
    walls: &Walls,
    rng: &mut ChaCha8Rng,
) {
    // Tables stand across the room, their chairs to the west of them.
    for [x, y] in grid([length - 2.4, depth - 1.2], [1.7, 1.9]) {
        let position = Vec3::new(x - 0.5 + jitter(rng, 0.06), y + jitter(rng, 0.06), 0.0);
        let table = upright(position, -FRAC_PI_2 + jitter(rng, 0.05));
        house.place_one("table", &furniture::table(), table);
        for x in [-0.38, 0.38] {
            let place = seat(&table, x, -1.0, rng);
            house.place_one("chair", &variants::chair(rng, VARIATION), place);
        }
    }
    let desk = upright(Vec3::new(0.5 * length - 1.0, jitter(rng, 0.4), 0.0), FRAC_PI_2);
    house.place_one("table", &furniture::table(), desk);
    let board = furniture::picture(2.4, 1.1, rng.random());
    house.place_one("board", &board, walls.east.at(jitter(rng, 0.3), 0.0, 1.5));
}

fn library(
    house: &mut Furnisher,
    [length, depth, _]: [f64; 3],
    walls: &Walls,
    rng: &mut ChaCha8Rng,
) {
    for (wall, length) in [(&walls.east, depth), (&walls.west, depth), (&walls.north, length)] {
        line_with_shelves(house, wall, length, 0.45, rng);
    }
    for [x, y] in grid([length - 2.2, depth - 2.2], [3.0, 2.4]) {
        let table = upright(Vec3::new(x, y, 0.0), jitter(rng, 0.1));
        house.place_one("table", &furniture::table(), table);
        for (x, side) in [(-0.4, -1.0), (0.4, -1.0), (-0.4, 1.0), (0.4, 1.0)] {
            if rng.random_bool(0.7) {
                let place = seat(&table, x, side, rng);
                house.place_one("chair", &variants::chair(rng, VARIATION), place);
            }
        }
    }
}

/// Pictures and bins beside the doors of both walls.
fn corridor(house: &mut Furnisher, walls: &Walls, openings: &Openings, rng: &mut ChaCha8Rng) {
    for (wall, doors) in [(&walls.south, &openings.south), (&walls.north, &openings.north)] {
        for door in doors {
            let x = door.middle + 0.5 * door.width + 0.45;
            match rng.random_range(0..3) {
                0 => {
                    let picture = furniture::picture(0.5, 0.7, rng.random());
                    house.place_one("picture", &picture, wall.at(x, 0.0, 1.55));
                }
                1 => house.place_one("bin", &furniture::bin(), wall.at(x, 0.2, 0.0)),
                _ => {}
            }
        }
    }
}
