//! Walls with openings for doors and windows.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::{RoomOptions, SKIRTING, WALL, jitter};
use crate::furniture::{DOORWAY, WINDOW};
use crate::pose::{Frame, Vec3, upright};
use crate::scene::Model;
use crate::texture::Texture;

/// A wall seen from inside: x along it, y into the room, z up; its middle at the floor is the origin.
pub(super) struct Wall {
    pub frame: Frame,
    length: f64,
}

/// The four walls of a room.
pub(super) struct Walls {
    pub south: Wall,
    pub north: Wall,
    pub east: Wall,
    pub west: Wall,
}

impl Walls {
    pub fn new([length, depth, _]: [f64; 3]) -> Self {
        let (x, y) = (0.5 * length, 0.5 * depth);
        let wall = |x, y, yaw, length| Wall { frame: upright(Vec3::new(x, y, 0.0), yaw), length };
        Self {
            south: wall(0.0, -y, 0.0, length),
            north: wall(0.0, y, PI, length),
            east: wall(x, 0.0, FRAC_PI_2, depth),
            west: wall(-x, 0.0, -FRAC_PI_2, depth),
        }
    }

    /// South, north, east, west.
    pub fn all(&self) -> [&Wall; 4] {
        [&self.south, &self.north, &self.east, &self.west]
    }
}

/// An opening in a wall: middle, width, bottom, top.
#[derive(Clone, Copy)]
pub(super) struct Opening {
    pub middle: f64,
    pub width: f64,
    pub bottom: f64,
    pub top: f64,
}

impl Opening {
    fn doorway(middle: f64) -> Self {
        Self { middle, width: DOORWAY[0], bottom: 0.0, top: DOORWAY[1] }
    }

    fn window(middle: f64) -> Self {
        let [width, height, sill] = WINDOW;
        Self { middle, width, bottom: sill, top: sill + height }
    }
}

/// The openings of all walls.
pub(super) struct Openings {
    /// Doorways near the ends of the south wall, the kitchen between.
    pub south: Vec<Opening>,
    /// Doorways in the north wall of a corridor.
    pub north: Vec<Opening>,
    /// Two windows in the north wall of other rooms.
    pub windows: Vec<Opening>,
    /// The doorway of the open door.
    pub west: Vec<Opening>,
}

impl Openings {
    pub fn drawn(options: &RoomOptions, rng: &mut ChaCha8Rng) -> Self {
        let [length, depth, _] = options.size;
        let (x, y) = (0.5 * length, 0.5 * depth);
        let near_end = x - 0.5 * DOORWAY[0] - 0.25 - rng.random_range(0.0..0.1);
        let mut south = vec![Opening::doorway(-near_end)];
        if options.n_doors >= 2 {
            south.push(Opening::doorway(near_end));
        }
        let west = (options.n_doors >= 3)
            .then(|| Opening::doorway(y - 0.9 - rng.random_range(0.0..0.1)))
            .into_iter()
            .collect();
        let windows = [-0.25 * length, 0.25 * length]
            .map(|middle| Opening::window(middle + jitter(rng, 0.05)));
        Self { south, north: Vec::new(), windows: windows.into(), west }
    }

    /// Doorways along both long walls, one every 2.4 m or so, none opposite the other.
    pub fn of_corridor(length: f64, rng: &mut ChaCha8Rng) -> Self {
        let n = ((length - 1.4) / 2.4) as usize;
        let mut side = |shift: f64| -> Vec<Opening> {
            let pitch = (length - 1.4) / n as f64;
            let middle = |i: usize| pitch * (i as f64 - 0.5 * (n as f64 - 1.0));
            let kept: Vec<usize> = (0..n).filter(|_| rng.random_bool(0.7)).collect();
            kept.into_iter()
                .map(|i| Opening::doorway(middle(i) + shift + jitter(rng, 0.25)))
                .collect()
        };
        let (south, north) = (side(-0.2), side(0.2));
        Self { south, north, windows: Vec::new(), west: Vec::new() }
    }

    /// Those of the south, north, east and west wall.
    pub fn by_wall(&self) -> [Vec<Opening>; 4] {
        let north = self.north.iter().chain(&self.windows).copied().collect();
        [self.south.clone(), north, Vec::new(), self.west.clone()]
    }

    /// Frames of the doorways at the floor: of the south wall, the north wall, the west wall.
    pub fn doorways(&self, walls: &Walls) -> Vec<Frame> {
        let west = &walls.west;
        let on = |wall: &Wall, openings: &[Opening]| -> Vec<Frame> {
            openings.iter().map(|o| wall.at(o.middle, 0.0, 0.0)).collect()
        };
        let walls = [(&walls.south, &self.south), (&walls.north, &self.north)];
        let closed = walls.into_iter().flat_map(|(wall, openings)| on(wall, openings));
        closed.chain(on(west, &self.west)).collect()
    }
}

impl Wall {
    /// The frame of something at `x` along the wall, `y` in front of it and `z` above the floor.
    pub fn at(&self, x: f64, y: f64, z: f64) -> Frame {
        self.frame * Frame::translation(x, y, z)
    }

    /// The wall with its openings, as touching boxes, `past` metres longer at both ends than the room.
    pub fn model(&self, openings: &[Opening], height: f64, past: f64, texture: Texture) -> Model {
        let mut m = Model::default();
        let mut part = |x0: f64, x1: f64, z0: f64, z1: f64| {
            if x1 - x0 > 1e-9 && z1 - z0 > 1e-9 {
                let middle = [0.5 * (x0 + x1), -0.5 * WALL, 0.5 * (z0 + z1)];
                // The back looks away from the room; so do the ends towards floor and ceiling.
                let ends = u8::from(z0 == 0.0) << 4 | u8::from(z1 == height) << 5;
                m.cuboid_hiding(middle, [x1 - x0, WALL, z1 - z0], texture, 1 << 2 | ends);
            }
        };
        let end = 0.5 * self.length + past;
        let mut x = -end;
        let mut sorted = openings.to_vec();
        sorted.sort_by(|a, b| a.middle.total_cmp(&b.middle));
        for o in &sorted {
            let (left, right) = (o.middle - 0.5 * o.width, o.middle + 0.5 * o.width);
            part(x, left, 0.0, height);
            part(left, right, 0.0, o.bottom);
            part(left, right, o.top, height);
            x = right;
        }
        part(x, end, 0.0, height);
        // Both ends of the wall look away from the room too. No opening reaches an end, so the first and the last
        // box are those ends.
        if let Some(first) = m.solids.first_mut() {
            first.3 |= 1;
        }
        if let Some(last) = m.solids.last_mut() {
            last.3 |= 1 << 1;
        }
        m
    }

    /// Skirting boards between the doorways.
    pub fn skirting(&self, openings: &[Opening]) -> Model {
        let [thick, tall] = SKIRTING;
        let mut m = Model::default();
        let end = 0.5 * self.length;
        let mut x = -end;
        let mut doors: Vec<&Opening> = openings.iter().filter(|o| o.bottom == 0.0).collect();
        doors.sort_by(|a, b| a.middle.total_cmp(&b.middle));
        let white = Texture::Paint([0.88, 0.88, 0.85]);
        let mut part = |x0: f64, x1: f64| {
            let middle = [0.5 * (x0 + x1), 0.5 * thick, 0.5 * tall];
            m.cuboid(middle, [x1 - x0, thick, tall], white);
        };
        for door in doors {
            // The casing of a door is 70 mm wide.
            part(x, door.middle - 0.5 * door.width - 0.07);
            x = door.middle + 0.5 * door.width + 0.07;
        }
        part(x, end);
        m
    }
}
