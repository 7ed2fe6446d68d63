//! A furnished room from a seed: where things stand.

mod furnishing;
mod kinds;
mod wall;

use std::f64::consts::{PI, TAU};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_geom::{Error, Result};

use self::furnishing::{
    Furnisher, Palette, corners, dining, doors_and_windows, kitchen, shell, shelves,
    sofa_and_pictures, walls_and_skirting,
};
pub use self::kinds::RoomKind;
use self::wall::{Openings, Walls};
use crate::furniture::{self, SHELF};
use crate::pose::{Frame, Pose, Vec3, looking, pose_of, upright};
use crate::scene::Scene;

/// Thickness of walls, floor and ceiling, metres.
const WALL: f64 = 0.25;
const SKIRTING: [f64; 2] = [0.015, 0.08];
const CHAIRS_PER_TABLE: usize = 6;
const SHELF_PITCH: f64 = SHELF[0] + 0.05;

/// What a room is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomOptions {
    /// Varies colours, prints, books and where things stand.
    pub seed: u64,
    /// What the room is for.
    pub kind: RoomKind,
    /// Inner length (x), depth (y) and height (z), metres: of a dwelling from 4.8 x 4.0 x 2.4 to 12 x 10 x 4.
    pub size: [f64; 3],
    /// Chairs around the tables of a dwelling, at most six per table; one table per 28 square metres,
    /// at least one.
    pub n_chairs: usize,
    /// Shelves of a dwelling, side by side at the east wall, at most one per 0.85 m of `size[1]`
    /// less 1.3 m.
    pub n_shelves: usize,
    /// Doors of a dwelling, 1 to 3: two in the south wall, one that stands open in the west wall.
    pub n_doors: usize,
    /// By how much chairs and shelves of a dwelling differ in each of their sizes, as a share up to 0.2; above zero they,
    /// and the doors, differ in style and colour too, and some chairs are pushed under the table. At 0 they are congruent.
    pub variation: f64,
}

impl Default for RoomOptions {
    fn default() -> Self {
        Self {
            seed: 0,
            kind: RoomKind::Dwelling,
            size: [5.4, 4.4, 2.6],
            n_chairs: 6,
            n_shelves: 3,
            n_doors: 3,
            variation: 0.0,
        }
    }
}

impl RoomOptions {
    fn n_tables(&self) -> usize {
        ((self.size[0] * self.size[1] / 28.0) as usize).max(1)
    }

    fn check(&self) -> Result<()> {
        let [smallest, largest] = self.kind.limits();
        if (0..3).any(|a| !(smallest[a]..=largest[a]).contains(&self.size[a])) {
            let size = format!("{:?} m", self.size);
            let limits = format!("from {smallest:?} to {largest:?} m for this kind of room");
            return Err(Error::invalid("size", size, limits));
        }
        if !(0.0..=0.2).contains(&self.variation) {
            return Err(Error::invalid("variation", self.variation, "a share from 0 to 0.2"));
        }
        if self.kind != RoomKind::Dwelling {
            return Ok(());
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

/// A number within `amount` of zero.
fn jitter(rng: &mut ChaCha8Rng, amount: f64) -> f64 {
    rng.random_range(-amount..=amount)
}

impl Scene {
    /// A room with walls, doors, windows, and what belongs into a room of its kind: of a dwelling tables, chairs, shelves,
    /// cupboards and smaller things, in the order of a fixed plan; the seed moves and colours them.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a size or number outside the limits of [`RoomOptions`].
    pub fn room(options: &RoomOptions) -> Result<Self> {
        options.check()?;
        // Everything draws from one stream: the order of these steps is part of what a seed means.
        let rng = &mut ChaCha8Rng::seed_from_u64(options.seed);
        let [length, depth, height] = options.size;
        let (x, y) = (0.5 * length, 0.5 * depth);
        let palette = Palette::drawn(rng);
        let walls = Walls::new(options.size);
        let openings = match options.kind {
            RoomKind::Dwelling => Openings::drawn(options, rng),
            RoomKind::Corridor => Openings::of_corridor(length, rng),
            kind => {
                let n_doors = rng.random_range(1..3);
                let mut openings = Openings::drawn(&RoomOptions { n_doors, ..*options }, rng);
                if kind == RoomKind::Library {
                    openings.windows.clear();
                }
                openings
            }
        };
        let variation = options.variation;
        let mut house = Furnisher::default();
        shell(&mut house, options.size, &openings.doorways(&walls), rng);
        walls_and_skirting(&mut house, &walls, &openings, height, &palette, rng);
        doors_and_windows(&mut house, &walls, &openings, variation, rng);
        if options.kind == RoomKind::Dwelling {
            kitchen(&mut house, &walls.south, palette.accent, rng);
            shelves(&mut house, &walls.east, options.n_shelves, variation, rng);
            sofa_and_pictures(&mut house, &walls, y, palette.cloth, rng);
            corners(&mut house, options.size, rng);
            dining(&mut house, options, &palette, rng);
        } else {
            kinds::furnish(&mut house, options, &walls, &openings, rng);
        }
        house.place_one("lamp", &furniture::lamp(height), Frame::identity());
        let lamp = Vec3::new(0.0, 0.0, height - 0.5);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_of_every_size_and_seed_have_what_was_asked_for() {
        let [smallest, largest] = RoomKind::Dwelling.limits();
        for (seed, size) in
            [(0, smallest), (1, [6.0, 5.0, 2.7]), (2, [9.0, 7.0, 3.0]), (3, largest)]
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
    fn things_stand_in_the_room() {
        let mut all = Vec::new();
        for seed in 0..8 {
            for variation in [0.0, 0.1, 0.2] {
                all.push(RoomOptions { seed, variation, ..RoomOptions::default() });
            }
            for (_, kind) in RoomKind::NAMES {
                for size in kind.limits() {
                    all.push(RoomOptions { seed, kind, size, ..RoomOptions::default() });
                }
            }
        }
        for options in all {
            let scene = Scene::room(&options).unwrap();
            let (low, high) = scene.interior();
            let fixed = ["wall", "floor", "ceiling", "door", "door_frame", "window"];
            for instance in scene.instances().iter().filter(|i| !fixed.contains(&i.class)) {
                for a in 0..3 {
                    assert!(instance.bounds.0[a] >= low[a] - 1e-9, "{instance:?} of {options:?}");
                    assert!(instance.bounds.1[a] <= high[a] + 1e-9, "{instance:?} of {options:?}");
                }
            }
        }
    }

    #[test]
    fn things_that_vary_are_no_copies_and_keep_to_their_share() {
        let options = RoomOptions { seed: 3, variation: 0.1, ..RoomOptions::default() };
        let varied = Scene::room(&options).unwrap();
        let chairs: Vec<_> = varied.instances().iter().filter(|i| i.class == "chair").collect();
        let models: std::collections::BTreeSet<u32> = chairs.iter().map(|i| i.model).collect();
        assert_eq!((chairs.len(), models.len()), (6, 6));
        let height = |i: &&crate::Instance| i.extent.1[2];
        let [least, most] =
            [f64::min, f64::max].map(|pick| chairs.iter().map(height).reduce(pick).unwrap());
        assert!(least >= 0.92 * 0.9 && most <= 0.92 * 1.1 && most - least > 0.02);
    }

    #[test]
    fn kinds_of_rooms_hold_what_they_are_for() {
        let count = |kind, size, class| {
            let options = RoomOptions { kind, size, ..RoomOptions::default() };
            let scene = Scene::room(&options).unwrap();
            for pose in scene.default_lidar_poses(12).unwrap() {
                assert!(scene.distance([pose[0][3], pose[1][3], pose[2][3]]) > 0.2);
            }
            scene.instances().iter().filter(|i| i.class == class).count()
        };
        assert_eq!(count(RoomKind::Office, [5.8, 5.0, 2.6], "swivel_chair"), 4);
        assert_eq!(count(RoomKind::Classroom, [8.0, 7.0, 3.0], "chair"), 18);
        assert!(count(RoomKind::Library, [6.0, 5.0, 2.8], "shelf") >= 12);
        assert!(count(RoomKind::Corridor, [20.0, 2.0, 2.6], "door") >= 6);
        assert_eq!(count(RoomKind::Corridor, [20.0, 2.0, 2.6], "chair"), 0);
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
        assert!(refused(RoomOptions { variation: 0.3, ..base() }).starts_with("variation is 0.3"));
        let corridor = RoomOptions { kind: RoomKind::Corridor, size: [3.0, 2.0, 2.5], ..base() };
        assert!(refused(corridor).contains("for this kind of room"));
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
