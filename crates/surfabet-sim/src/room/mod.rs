//! A furnished room from a seed: where things stand.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_geom::{Error, Result};

use crate::furniture::{self, CUPBOARD, DOORWAY, SHELF, TABLE, WALL_CUPBOARD, WINDOW};
use crate::pose::{Frame, Pose, Vec3, looking, pose_of, upright};
use crate::scene::{Builder, Model, Scene};
use crate::solid::Shape;
use crate::texture::{Rgb, Texture, mix};

/// Thickness of walls, floor and ceiling, metres.
const WALL: f64 = 0.25;
const SKIRTING: [f64; 2] = [0.015, 0.08];
/// What the walls have to hold sets the least size.
const SMALLEST: [f64; 3] = [4.8, 4.0, 2.4];
const LARGEST: [f64; 3] = [12.0, 10.0, 4.0];
const CHAIRS_PER_TABLE: usize = 6;
const SHELF_PITCH: f64 = SHELF[0] + 0.05;

/// What a room is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomOptions {
    /// Varies colours, prints, books and where things stand.
    pub seed: u64,
    /// Inner length (x), depth (y) and height (z), metres: from 4.8 x 4.0 x 2.4 to 12 x 10 x 4.
    pub size: [f64; 3],
    /// Congruent chairs around the tables, at most six per table; one table per 28 square metres,
    /// at least one.
    pub n_chairs: usize,
    /// Congruent shelves, side by side at the east wall, at most one per 0.85 m of `size[1]`
    /// less 1.3 m.
    pub n_shelves: usize,
    /// Congruent doors, 1 to 3: two in the south wall, one that stands open in the west wall.
    pub n_doors: usize,
}

impl Default for RoomOptions {
    fn default() -> Self {
        Self { seed: 0, size: [5.4, 4.4, 2.6], n_chairs: 6, n_shelves: 3, n_doors: 3 }
    }
}

impl RoomOptions {
    fn n_tables(&self) -> usize {
        ((self.size[0] * self.size[1] / 28.0) as usize).max(1)
    }

    fn check(&self) -> Result<()> {
        if (0..3).any(|a| !(SMALLEST[a]..=LARGEST[a]).contains(&self.size[a])) {
            let size = format!("{:?}", self.size);
            return Err(Error::invalid("size", size, "from 4.8 x 4.0 x 2.4 m to 12 x 10 x 4 m"));
        }
        if self.n_chairs > CHAIRS_PER_TABLE * self.n_tables() {
            return Err(Error::invalid(
                "n_chairs",
                self.n_chairs,
                "at most six per table, and there is one table per 28 square metres of room",
            ));
        }
        if self.n_shelves > ((self.size[1] - 1.3) / SHELF_PITCH) as usize {
            return Err(Error::invalid(
                "n_shelves",
                self.n_shelves,
                "at most one per 0.85 m of size[1] less 1.3 m",
            ));
        }
        if !(1..=3).contains(&self.n_doors) {
            return Err(Error::invalid("n_doors", self.n_doors, "1, 2 or 3"));
        }
        Ok(())
    }
}

/// A wall seen from inside: x along it, y into the room, z up; its middle at the floor is the origin.
struct Wall {
    frame: Frame,
    length: f64,
}

/// An opening in a wall: middle, width, bottom, top.
#[derive(Clone, Copy)]
struct Opening {
    middle: f64,
    width: f64,
    bottom: f64,
    top: f64,
}

impl Wall {
    /// The frame of something at `x` along the wall, `y` in front of it and `z` above the floor.
    fn at(&self, x: f64, y: f64, z: f64) -> Frame {
        self.frame * Frame::translation(x, y, z)
    }

    /// The wall with its openings, as touching boxes, `past` metres longer at both ends than the room.
    fn model(&self, openings: &[Opening], height: f64, past: f64, texture: Texture) -> Model {
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
    fn skirting(&self, openings: &[Opening]) -> Model {
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

/// Numbers of models: one per class, more where copies differ.
struct Furnisher {
    builder: Builder,
    models: u32,
}

impl Furnisher {
    /// Places congruent copies of a model.
    fn place(&mut self, class: &'static str, model: &Model, frames: &[Frame]) {
        for frame in frames {
            self.builder.place(class, self.models, model, frame);
        }
        self.models += 1;
    }

    fn place_one(&mut self, class: &'static str, model: &Model, frame: Frame) {
        self.place(class, model, &[frame]);
    }
}

fn jitter(rng: &mut ChaCha8Rng, amount: f64) -> f64 {
    rng.random_range(-amount..=amount)
}

fn choose(rng: &mut ChaCha8Rng, palette: &[Rgb]) -> Rgb {
    palette[rng.random_range(0..palette.len())]
}

impl Scene {
    /// A room with walls, doors (one of them open), windows, tables, congruent chairs, shelves and cupboards,
    /// and smaller things, in the order of a fixed plan; the seed moves and colours them.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a size or number outside the limits of [`RoomOptions`].
    pub fn room(options: &RoomOptions) -> Result<Self> {
        options.check()?;
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        let rng = &mut rng;
        let [length, depth, height] = options.size;
        let (x, y) = (0.5 * length, 0.5 * depth);
        let mut house = Furnisher { builder: Builder::default(), models: 0 };

        let wall_paint = choose(rng, &[[0.86, 0.83, 0.74], [0.80, 0.85, 0.84], [0.87, 0.80, 0.76]]);
        let accent = choose(rng, &[[0.70, 0.16, 0.14], [0.16, 0.38, 0.52], [0.30, 0.46, 0.26]]);
        let cloth = choose(rng, &[[0.26, 0.34, 0.50], [0.52, 0.42, 0.30], [0.34, 0.44, 0.36]]);
        let cushion = choose(rng, &[[0.22, 0.44, 0.42], [0.66, 0.42, 0.16], [0.44, 0.26, 0.40]]);

        let walls = [
            Wall { frame: upright(Vec3::new(0.0, -y, 0.0), 0.0), length },
            Wall { frame: upright(Vec3::new(0.0, y, 0.0), PI), length },
            Wall { frame: upright(Vec3::new(x, 0.0, 0.0), FRAC_PI_2), length: depth },
            Wall { frame: upright(Vec3::new(-x, 0.0, 0.0), -FRAC_PI_2), length: depth },
        ];
        let [south, north, east, west] = &walls;

        let doorway = |middle| Opening { middle, width: DOORWAY[0], bottom: 0.0, top: DOORWAY[1] };
        // South: a door near each end, the kitchen between; west: the open door.
        let near_end = x - 0.5 * DOORWAY[0] - 0.25 - rng.random_range(0.0..0.1);
        let mut south_doors = vec![doorway(-near_end)];
        if options.n_doors >= 2 {
            south_doors.push(doorway(near_end));
        }
        let west_doors: Vec<Opening> = (options.n_doors >= 3)
            .then(|| doorway(y - 0.9 - rng.random_range(0.0..0.1)))
            .into_iter()
            .collect();
        let [window_width, window_height, sill] = WINDOW;
        let windows = [-0.25 * length, 0.25 * length].map(|middle| Opening {
            middle: middle + jitter(rng, 0.05),
            width: window_width,
            bottom: sill,
            top: sill + window_height,
        });
        let thresholds: Vec<(Frame, f64)> = south_doors
            .iter()
            .map(|o| (south.at(o.middle, 0.0, 0.0), o.width))
            .chain(west_doors.iter().map(|o| (west.at(o.middle, 0.0, 0.0), o.width)))
            .collect();
        shell(&mut house, options.size, &thresholds, rng);
        let openings: [&[Opening]; 4] = [&south_doors, &windows, &[], &west_doors];
        let papered = rng.random_range(0..4);
        for (i, (wall, openings)) in walls.iter().zip(openings).enumerate() {
            let texture = if i == papered {
                Texture::Wallpaper(wall_paint, mix(wall_paint, accent, 0.25), 0.22)
            } else {
                Texture::Paint(wall_paint)
            };
            let past = if i < 2 { WALL } else { 0.0 };
            house.place_one("wall", &wall.model(openings, height, past, texture), wall.frame);
        }
        for (wall, openings) in walls.iter().zip(openings) {
            house.place_one("skirting", &wall.skirting(openings), wall.frame);
        }

        let doorways: Vec<(Frame, f64)> = south_doors
            .iter()
            .map(|o| (south.at(o.middle, 0.0, 0.0), 0.0))
            .chain(
                west_doors
                    .iter()
                    .map(|o| (west.at(o.middle, 0.0, 0.0), 1.2 + rng.random_range(0.0..0.35))),
            )
            .collect();
        let frames: Vec<Frame> = doorways.iter().map(|d| d.0).collect();
        house.place("door_frame", &furniture::door_frame(WALL), &frames);
        let leaves: Vec<Frame> =
            doorways.iter().map(|(frame, opening)| frame * furniture::hinge(*opening)).collect();
        house.place("door", &furniture::door([0.78, 0.74, 0.66]), &leaves);

        let niches: Vec<Frame> = windows.iter().map(|w| north.at(w.middle, 0.0, 0.0)).collect();
        house.place("window", &furniture::window(WALL), &niches);
        house.place("radiator", &furniture::radiator(), &niches);

        kitchen(&mut house, south, accent, rng);
        let print = |rng: &mut ChaCha8Rng| rng.random::<u64>();

        // East: shelves side by side, a picture beside them when there is room.
        let first = -0.5 * SHELF_PITCH * (options.n_shelves as f64 - 1.0) + jitter(rng, 0.1);
        let shelves: Vec<Frame> = (0..options.n_shelves)
            .map(|i| east.at(first + SHELF_PITCH * i as f64, SKIRTING[0] + 0.005, 0.0))
            .collect();
        let shelf = furniture::shelf(rng);
        house.place("shelf", &shelf, &shelves);

        // West: the sofa with a picture above it.
        let sofa_at = -y + 1.45 + rng.random_range(0.0..0.1);
        house.place_one("sofa", &furniture::sofa(cloth), west.at(sofa_at, 0.03, 0.0));
        let seed = print(rng);
        house.place_one(
            "picture",
            &furniture::picture(0.9, 0.6, seed),
            west.at(sofa_at + jitter(rng, 0.1), 0.0, 1.55),
        );
        let seed = print(rng);
        house.place_one("picture", &furniture::picture(0.42, 0.6, seed), north.at(0.0, 0.0, 1.6));

        // Corners: pillar north-east, plant south-west of it, cartons and bin where walls meet.
        house.place_one(
            "pillar",
            &furniture::pillar(height),
            upright(Vec3::new(x - 0.30, y - 0.30, 0.0), 0.0),
        );
        house.place_one("plant", &furniture::plant(), upright(Vec3::new(0.0, y - 0.42, 0.0), 0.0));
        house.place_one(
            "bin",
            &furniture::bin(),
            upright(Vec3::new(x - 0.85 + jitter(rng, 0.05), y - 0.34, 0.0), 0.0),
        );
        let carton = furniture::carton([0.38, 0.30, 0.28]);
        let corner = Vec3::new(-x + 0.40, y - 0.36, 0.0);
        let cartons = [
            upright(corner, jitter(rng, 0.15)),
            upright(corner + Vec3::new(0.02, 0.0, 0.281), 0.5 + jitter(rng, 0.3)),
        ];
        house.place("carton", &carton, &cartons);

        dining(&mut house, options, cushion, accent, rng);
        let lamp = Vec3::new(0.0, 0.0, height - 0.5);
        house.place_one("lamp", &furniture::lamp(height), Frame::identity());
        Ok(house.builder.finish(lamp, (Vec3::new(-x, -y, 0.0), Vec3::new(x, y, height))))
    }

    /// `n` camera poses (x right, y down, z forward) that look around the room from a ring about its centre,
    /// in even steps of yaw, with pitches that alternate between down, level and up.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] when `n` is zero or above 10000.
    pub fn default_poses(&self, n: usize) -> Result<Vec<Pose>> {
        self.ring(n, 1.55, |position, yaw, i| {
            // Looking outwards over the centre, the opposite wall is a room's width away.
            let pitch = [-28.0_f64, -6.0, 14.0][i % 3];
            looking(position, yaw + PI, pitch.to_radians())
        })
    }

    /// `n` laser poses (x forward, y left, z up) on the same ring, 1.3 m above the floor.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] when `n` is zero or above 10000.
    pub fn default_lidar_poses(&self, n: usize) -> Result<Vec<Pose>> {
        self.ring(n, 1.3, |position, yaw, _| upright(position, yaw))
    }

    fn ring(
        &self,
        n: usize,
        height: f64,
        frame: impl Fn(Vec3, f64, usize) -> Frame,
    ) -> Result<Vec<Pose>> {
        if !(1..=10_000).contains(&n) {
            return Err(Error::invalid("n", n, "1 to 10000 poses"));
        }
        let (low, high) = self.interior();
        let (rx, ry) = (0.24 * (high[0] - low[0]), 0.24 * (high[1] - low[1]));
        let poses = (0..n).map(|i| {
            let yaw = TAU * i as f64 / n as f64;
            pose_of(&frame(Vec3::new(rx * yaw.cos(), ry * yaw.sin(), height), yaw, i))
        });
        Ok(poses.collect())
    }
}

/// Floor and ceiling between the walls, and the floor in the doorways (`thresholds`: frames and widths).
fn shell(
    house: &mut Furnisher,
    [length, depth, height]: [f64; 3],
    thresholds: &[(Frame, f64)],
    rng: &mut ChaCha8Rng,
) {
    let floor = if rng.random_bool(0.5) {
        Texture::Boards([0.72, 0.56, 0.38], [0.58, 0.42, 0.26], 0.14)
    } else {
        Texture::Tiles([0.74, 0.70, 0.64], [0.66, 0.62, 0.57], 0.40)
    };
    // All but the face towards the room look away from it.
    let (only_top, only_bottom) = (0b01_1111, 0b10_1111);
    let mut m = Model::default();
    let size = [length, depth, WALL];
    m.cuboid_hiding([0.0, 0.0, -0.5 * WALL], size, floor, only_top);
    for (frame, width) in thresholds {
        let half = Vec3::new(0.5 * width, 0.5 * WALL, 0.5 * WALL);
        let middle = frame * Frame::translation(0.0, -0.5 * WALL, -0.5 * WALL);
        m.solids.push((Shape::Cuboid(half), middle, floor, only_top));
    }
    house.place_one("floor", &m, Frame::identity());
    let mut m = Model::default();
    let white = Texture::Paint([0.93, 0.93, 0.91]);
    m.cuboid_hiding([0.0, 0.0, 0.5 * WALL], size, white, only_bottom);
    house.place_one("ceiling", &m, Frame::translation(0.0, 0.0, height));
}

/// A row of congruent cupboards under a worktop, with as many hanging above it, tiles between.
fn kitchen(house: &mut Furnisher, wall: &Wall, accent: Rgb, rng: &mut ChaCha8Rng) {
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
    debug_assert!(hanging + WALL_CUPBOARD[2] < SMALLEST[2]);

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

/// Tables in a row along x with chairs around them and things on them.
fn dining(
    house: &mut Furnisher,
    options: &RoomOptions,
    cushion: Rgb,
    accent: Rgb,
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
            // Pulled out by up to 15 cm (backwards is -y of the chair) and turned.
            let pulled = Frame::translation(jitter(rng, 0.04), -rng.random_range(0.0..0.15), 0.0);
            let turned = upright(Vec3::zeros(), jitter(rng, 0.35));
            tables[i % n] * upright(Vec3::new(x, y, 0.0), yaw) * pulled * turned
        })
        .collect();
    house.place("chair", &furniture::chair(cushion), &chairs);

    let on_table =
        |table: &Frame, x: f64, y: f64, yaw: f64| table * upright(Vec3::new(x, y, 0.75), yaw);
    let mugs: Vec<Frame> = tables
        .iter()
        .flat_map(|t| [(-0.55, 0.22), (0.45, -0.25), (0.62, 0.10)].map(|(x, y)| (t, x, y)))
        .map(|(t, x, y)| on_table(t, x, y, rng.random_range(0.0..TAU)))
        .collect();
    house.place("mug", &furniture::mug(accent), &mugs);
    for table in &tables {
        let yaw = jitter(rng, 0.5);
        house.place_one("laptop", &furniture::laptop(), on_table(table, -0.15, -0.08, yaw));
        let books = furniture::books(rng);
        let yaw = rng.random_range(0.0..TAU);
        house.place_one("books", &books, on_table(table, 0.25, 0.20, yaw));
        let yellow = [0.92, 0.68, 0.16];
        house.place_one("ball", &furniture::ball(0.05, yellow), on_table(table, -0.5, -0.2, 0.3));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_of_every_size_and_seed_have_what_was_asked_for() {
        for (seed, size) in
            [(0, SMALLEST), (1, [6.0, 5.0, 2.7]), (2, [9.0, 7.0, 3.0]), (3, LARGEST)]
        {
            let options = RoomOptions { seed, size, ..RoomOptions::default() };
            let scene = Scene::room(&options).unwrap();
            let count = |class| scene.instances().iter().filter(|i| i.class == class).count();
            assert_eq!((count("chair"), count("shelf"), count("door")), (6, 3, 3));
            assert_eq!((count("wall"), count("floor"), count("ceiling")), (4, 1, 1));
            for pose in scene.default_poses(24).unwrap() {
                let position = [pose[0][3], pose[1][3], pose[2][3]];
                assert!(scene.distance(position) > 0.2, "{position:?} in {size:?}");
            }
        }
    }

    #[test]
    fn things_stand_in_the_room_and_not_in_each_other() {
        for seed in 0..8 {
            let scene = Scene::room(&RoomOptions { seed, ..RoomOptions::default() }).unwrap();
            let (low, high) = scene.interior();
            let fixed = ["wall", "floor", "ceiling", "door", "door_frame", "window"];
            for instance in scene.instances().iter().filter(|i| !fixed.contains(&i.class)) {
                for a in 0..3 {
                    assert!(instance.bounds.0[a] >= low[a] - 1e-9, "{instance:?}");
                    assert!(instance.bounds.1[a] <= high[a] + 1e-9, "{instance:?}");
                }
            }
        }
    }

    #[test]
    fn refuses_what_does_not_fit() {
        let refused = |options: RoomOptions| Scene::room(&options).unwrap_err().to_string();
        let base = RoomOptions::default;
        assert!(
            refused(RoomOptions { size: [3.0, 4.0, 2.5], ..base() }).starts_with("size is [3.0")
        );
        assert!(refused(RoomOptions { size: [f64::NAN, 4.0, 2.5], ..base() }).starts_with("size"));
        assert!(refused(RoomOptions { n_chairs: 60, ..base() }).starts_with("n_chairs is 60"));
        assert!(refused(RoomOptions { n_shelves: 9, ..base() }).starts_with("n_shelves is 9"));
        assert!(refused(RoomOptions { n_doors: 0, ..base() }).starts_with("n_doors is 0"));
        let scene = Scene::room(&base()).unwrap();
        assert!(scene.default_poses(0).is_err());
    }

    #[test]
    fn the_seed_moves_things_and_repeats() {
        let room = |seed| Scene::room(&RoomOptions { seed, ..RoomOptions::default() }).unwrap();
        assert_eq!(room(5).instances(), room(5).instances());
        assert_ne!(room(5).instances(), room(6).instances());
    }
}
