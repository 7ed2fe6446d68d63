//! What of a surface another map of the same place does not have, though it looked there.
//!
//! 1. A point is **the same** when the other map measured something within the tolerance.
//! 2. Of the rest, cell by cell, those count whose place the other map has seen to be free:
//!    - with viewpoints, when lines from two of them, or from the only one, pass the place and meet a surface behind it, and none
//!      before, and the place is none between two rays that ended on one surface: a laser has nothing between its lines. Lines along the
//!      surface do not count;
//!    - without, when the place lies between surfaces that face it: opposite rays from it that both meet a front.
//!
//!    In both cases rays from it meet hardly any surface from behind, as they do behind surfaces and inside of things.
//! 3. Cells that touch are one change, which must have a least area.

use surfabet_base::{Progress, parallel};

use crate::boxes::Aabb;
use crate::cells::{around, cell_of, key};
use crate::cloud::PointCloud;
use crate::disjoint::root;
use crate::error::{Error, Result};
use crate::kdtree::KdTree;
use crate::morton::MortonMap;
use crate::sight::Sight;
use crate::vector::{add_scaled, cross, dot, least_axis, length, minus, squared_distance, unit};

/// Viewpoints that looked through a place, where there are as many: errors of the poses let a line pass beside a surface.
const LEAST_LINES: usize = 2;

/// Pairs of opposite rays from a place.
const PAIRS: usize = 32;

/// Least share of the pairs of which both rays meet a front.
const LEAST_BETWEEN: f32 = 0.2;

/// Largest share of backs among the surfaces that rays meet.
const MOST_BACKS: f32 = 0.15;

/// Radians between one direction and the next on the spiral.
const GOLDEN_ANGLE: f32 = 2.399_963;

/// How far behind a place, in tolerances, its line of sight must go on: nearer surfaces are those of the place itself.
const BEHIND: f32 = 1.5;

/// How far apart the rays of a sensor may be, radians: 2 degrees between the lines of a laser with 16, and a little.
const LINE_ANGLE: f32 = 0.0436;

/// Rays on one side of a line of sight, up to [`LINE_ANGLE`] from it: a patch bridges less than what lies between two of them.
const LINE_STEPS: usize = 5;

/// Directions across a line of sight in which rays lie on both sides of it.
const LINE_DIRECTIONS: usize = 4;

/// Largest sine between a chord and the surface at its ends for these to be one surface.
const MOST_BEND: f32 = 0.5;

/// Least sine between a line of sight and the surface that it passes: along a surface, an error of the height of the line by a tolerance
/// moves the place where it crosses by six.
const LEAST_CROSSING: f32 = 0.17;

/// Cells that one task looks from.
const BATCH: usize = 64;

/// What became of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Fate {
    /// The other map has it, or what differs is smaller than the least area.
    Same = 0,
    /// The other map has seen that its place is free.
    Changed = 1,
    /// The other map has no surface there and did not look.
    Unseen = 2,
}

/// Things that changed: cells that touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Box in world coordinates, metres.
    pub bounds: Aabb<f64>,
    /// Number of points.
    pub n_points: usize,
    /// Area of the surface, square metres.
    pub area: f64,
}

/// What of a surface another map does not have.
#[derive(Debug, Clone, PartialEq)]
pub struct Changes {
    /// What became of each point.
    pub fates: Vec<Fate>,
    /// The change that each point belongs to; `u32::MAX` without one.
    pub of_points: Vec<u32>,
    /// The largest first.
    pub all: Vec<Change>,
    /// Area of what the other map did not look at, square metres.
    pub unseen_area: f64,
}

/// The other map.
#[derive(Debug, Clone, Copy)]
pub struct Other<'a> {
    /// Points of its surface with normals towards where they were seen from.
    pub surface: &'a PointCloud,
    /// Its points with the thickness that was measured; the surface again where none is known.
    pub measured: &'a PointCloud,
    /// World positions of its sensors, where they are known.
    pub viewpoints: Option<&'a [[f64; 3]]>,
}

/// What of `surface`, points with normals, `other` does not have though it looked. Neighbouring points should be no further
/// apart than half of `tolerance` metres; a change has at least `min_area` square metres.
///
/// # Errors
/// [`Error::InvalidParameter`] for a tolerance or area that is not positive or viewpoints that are not finite,
/// [`Error::MissingAttribute`] without normals, [`Error::Cancelled`].
pub fn changes(
    surface: &PointCloud,
    other: &Other<'_>,
    tolerance: f64,
    min_area: f64,
    progress: &dyn Progress,
) -> Result<Changes> {
    check(other, tolerance, min_area)?;
    let missing = Error::MissingAttribute { operation: "diff", attribute: "normals" };
    let normals = surface.normals().ok_or_else(|| missing.clone())?;
    let others = other.surface.normals().ok_or(missing)?;
    let cell = tolerance as f32;
    let origin = surface.origin();
    let differs = differing(surface, other.measured, cell, progress)?;
    let cells = ChangeCells::new(surface.positions(), normals, &differs, cell);
    progress.check()?;
    let sight = Sight::new(&other.surface.positions_about(origin), others, cell);
    let viewpoints = other.viewpoints.map(|all| local(all, origin));
    progress.update("looking", 0.0);
    let numbers: Vec<usize> = (0..cells.middles.len()).collect();
    let seen = parallel::try_map_chunks(&numbers, BATCH, |numbers| -> Result<_> {
        progress.check()?;
        let is_seen = |&i: &usize| match &viewpoints {
            Some(all) => looked_through(&sight, all, (cells.middles[i], cells.normals[i]), cell),
            None => {
                let around = OppositeHits::of(&sight, cells.middles[i]);
                around.is_before_surfaces() && around.is_between_surfaces()
            }
        };
        Ok(numbers.iter().map(is_seen).collect::<Vec<bool>>())
    })?;
    Ok(cells.grouped(&seen.concat(), surface, min_area))
}

fn check(other: &Other<'_>, tolerance: f64, min_area: f64) -> Result<()> {
    for (name, value) in [("tolerance", tolerance), ("min_area", min_area)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Error::invalid(name, value, "a positive number"));
        }
    }
    let finite = |v: &[f64; 3]| v.iter().all(|c| c.is_finite());
    match other.viewpoints.and_then(|all| all.iter().find(|v| !finite(v))) {
        Some(v) => Err(Error::invalid("viewpoints", format!("{v:?}"), "finite")),
        None => Ok(()),
    }
}

/// Positions about an origin.
fn local(world: &[[f64; 3]], origin: [f64; 3]) -> Vec<[f32; 3]> {
    world.iter().map(|v| std::array::from_fn(|a| (v[a] - origin[a]) as f32)).collect()
}

/// Numbers of the points that are further than `tolerance` from all of `measured`.
fn differing(
    surface: &PointCloud,
    measured: &PointCloud,
    tolerance: f32,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let all = 0..surface.len() as u32;
    if measured.is_empty() {
        return Ok(all.collect());
    }
    let tree = KdTree::new(&measured.positions_about(surface.origin()))?;
    let nearest = tree.nearest_batch(surface.positions(), progress)?;
    let is_far = |&i: &u32| nearest[i as usize].squared_distance() > tolerance * tolerance;
    Ok(all.filter(is_far).collect())
}

/// Whether a sensor at `from` looked through `place`: nothing stands before it, and something behind.
fn looked_from(sight: &Sight, from: [f32; 3], place: [f32; 3], tolerance: f32) -> bool {
    let arm = minus(place, from);
    let distance = length(arm);
    let direction = unit(arm);
    let before = sight.first(from, direction, 0.0, distance - tolerance);
    distance > 0.0
        && before.is_none()
        && sight
            .first(from, direction, distance + BEHIND * tolerance, f32::MAX)
            .is_some_and(|met| met.front)
}

/// Whether a place lies where rays from `from` on both sides of it, no further than lines of a laser are, end on one surface:
/// within `tolerance` of the chord between these ends. What is behind it may be seen between the two, but no ray was there.
fn is_between_lines(sight: &Sight, from: [f32; 3], place: [f32; 3], tolerance: f32) -> bool {
    let direction = unit(minus(place, from));
    let [across, up] = frame_about(direction);
    (0..LINE_DIRECTIONS).any(|k| {
        let angle = k as f32 * std::f32::consts::PI / LINE_DIRECTIONS as f32;
        let side = add_scaled(across.map(|c| c * angle.cos()), angle.sin(), up);
        let [one, other] = [1.0, -1.0].map(|sign| ends_beside(sight, from, direction, side, sign));
        one.iter().any(|a| other.iter().any(|b| is_on_chord(place, a, b, tolerance)))
    })
}

/// Where rays end that are turned from a direction to one side of it, step by step, and the normals there.
fn ends_beside(
    sight: &Sight,
    from: [f32; 3],
    direction: [f32; 3],
    side: [f32; 3],
    sign: f32,
) -> Vec<[[f32; 3]; 2]> {
    let end = |step: usize| {
        let angle = LINE_ANGLE * step as f32 / LINE_STEPS as f32;
        let turned = add_scaled(direction.map(|c| c * angle.cos()), sign * angle.sin(), side);
        let met = sight.first(from, turned, 0.0, f32::MAX)?;
        Some([add_scaled(from, met.distance, turned), met.normal])
    };
    (1..=LINE_STEPS).filter_map(end).collect()
}

/// Whether two ends of rays, with their normals, are of one surface that goes on between them, and a place lies on it.
fn is_on_chord(place: [f32; 3], a: &[[f32; 3]; 2], b: &[[f32; 3]; 2], tolerance: f32) -> bool {
    let chord = minus(b[0], a[0]);
    let along = unit(chord);
    let is_along = |normal: [f32; 3]| dot(along, normal).abs() <= MOST_BEND;
    let at = dot(minus(place, a[0]), along).clamp(0.0, length(chord));
    is_along(a[1])
        && is_along(b[1])
        && squared_distance(place, add_scaled(a[0], at, along)) <= tolerance * tolerance
}

/// Two unit vectors across a direction and each other.
fn frame_about(direction: [f32; 3]) -> [[f32; 3]; 2] {
    let across = unit(cross(direction, least_axis(direction)));
    [across, cross(direction, across)]
}

/// Whether a line of sight crosses a surface with a normal, in place of going along it.
fn crosses(from: [f32; 3], place: [f32; 3], normal: [f32; 3]) -> bool {
    dot(unit(minus(place, from)), normal).abs() >= LEAST_CROSSING
}

/// Whether sensors looked through the `place` of a surface with a normal, which is not behind surfaces.
fn looked_through(
    sight: &Sight,
    viewpoints: &[[f32; 3]],
    (place, normal): ([f32; 3], [f32; 3]),
    tolerance: f32,
) -> bool {
    let lines = viewpoints.iter().filter(|&&v| {
        crosses(v, place, normal)
            && looked_from(sight, v, place, tolerance)
            && !is_between_lines(sight, v, place, tolerance)
    });
    let needed = LEAST_LINES.min(viewpoints.len()).max(1);
    lines.take(needed).count() == needed && OppositeHits::of(sight, place).is_before_surfaces()
}

/// What opposite rays from a place meet.
#[derive(Debug, Clone, Copy, Default)]
struct OppositeHits {
    /// Rays that meet a front.
    fronts: f32,
    /// Rays that meet a back.
    backs: f32,
    /// Pairs of rays that both meet a front.
    between: f32,
}

impl OppositeHits {
    fn of(sight: &Sight, place: [f32; 3]) -> Self {
        let mut found = Self::default();
        for i in 0..PAIRS {
            // Directions evenly over half a sphere, on a spiral.
            let z = (i as f32 + 0.5) / PAIRS as f32;
            let angle = i as f32 * GOLDEN_ANGLE;
            let r = (1.0 - z * z).sqrt();
            let direction = [r * angle.cos(), r * angle.sin(), z];
            let ends = [1.0, -1.0].map(|sign: f32| {
                let met = sight.first(place, direction.map(|c| sign * c), 0.0, f32::MAX);
                met.map(|met| met.front)
            });
            let count = |what: bool| ends.iter().filter(|end| **end == Some(what)).count() as f32;
            found.fronts += count(true);
            found.backs += count(false);
            found.between += f32::from(u8::from(ends == [Some(true); 2]));
        }
        found
    }

    /// Whether hardly any of the surfaces around is seen from behind.
    fn is_before_surfaces(&self) -> bool {
        self.backs <= MOST_BACKS * (self.fronts + self.backs)
    }

    /// Whether the place lies between surfaces that face it.
    fn is_between_surfaces(&self) -> bool {
        self.between >= LEAST_BETWEEN * PAIRS as f32
    }
}

/// Points that differ, by cells.
struct ChangeCells {
    /// Points, cell by cell.
    points: Vec<u32>,
    /// First point of each cell, and the end.
    starts: Vec<usize>,
    /// Coordinates of each cell.
    places: Vec<[i32; 3]>,
    /// Mean position of each.
    middles: Vec<[f32; 3]>,
    /// Mean normal of each.
    normals: Vec<[f32; 3]>,
    /// Area of the surface in each, square metres.
    areas: Vec<f64>,
}

impl ChangeCells {
    fn new(positions: &[[f32; 3]], normals: &[[f32; 3]], points: &[u32], cell: f32) -> Self {
        let mut keyed: Vec<(u64, u32)> =
            parallel::map(points, |&i| (key(cell_of(positions[i as usize], cell)), i));
        parallel::sort_keyed(&mut keyed);
        let mut cells = Self {
            points: keyed.iter().map(|&(_, i)| i).collect(),
            starts: vec![0],
            places: Vec::new(),
            middles: Vec::new(),
            normals: Vec::new(),
            areas: Vec::new(),
        };
        for group in keyed.chunk_by(|a, b| a.0 == b.0) {
            let members = || group.iter().map(|&(_, i)| i as usize);
            let n = group.len() as f32;
            let sum =
                |all: &[[f32; 3]]| members().fold([0.0; 3], |sum, i| add_scaled(sum, 1.0, all[i]));
            // A plane crosses |n_x| + |n_y| + |n_z| cells per area of a face of one.
            let normal = unit(sum(normals));
            let crossed: f32 = normal.iter().map(|c| c.abs()).sum::<f32>().max(1.0);
            cells.starts.push(cells.starts[cells.starts.len() - 1] + group.len());
            cells.places.push(cell_of(positions[group[0].1 as usize], cell));
            cells.normals.push(normal);
            cells.middles.push(sum(positions).map(|c| c / n));
            cells.areas.push(f64::from(cell * cell / crossed));
        }
        cells
    }

    fn members(&self, cell: usize) -> &[u32] {
        &self.points[self.starts[cell]..self.starts[cell + 1]]
    }

    /// Cells that were `seen` and touch, as changes.
    fn grouped(&self, seen: &[bool], surface: &PointCloud, min_area: f64) -> Changes {
        let n = self.places.len();
        let numbers: MortonMap<u32> =
            (0..n).filter(|&i| seen[i]).map(|i| (key(self.places[i]), i as u32)).collect();
        let mut parent: Vec<u32> = (0..n as u32).collect();
        for i in (0..n).filter(|&i| seen[i]) {
            for near in around(self.places[i]).filter_map(|cell| numbers.get(&key(cell))) {
                let (a, b) = (root(&mut parent, i as u32), root(&mut parent, *near));
                // The lowest stands for its set, whatever the order.
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut sets: Vec<Vec<usize>> = vec![Vec::new(); n];
        for i in (0..n).filter(|&i| seen[i]) {
            sets[root(&mut parent, i as u32) as usize].push(i);
        }
        let area = |cells: &Vec<usize>| cells.iter().map(|&i| self.areas[i]).sum::<f64>();
        sets.retain(|cells| !cells.is_empty() && area(cells) >= min_area);
        sets.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a[0].cmp(&b[0])));
        let mut fates = vec![Fate::Same; surface.len()];
        let mut of_points = vec![u32::MAX; surface.len()];
        let mut unseen_area = 0.0;
        for i in (0..n).filter(|&i| !seen[i]) {
            unseen_area += self.areas[i];
            self.members(i).iter().for_each(|&p| fates[p as usize] = Fate::Unseen);
        }
        let mut all = Vec::new();
        for (number, cells) in sets.iter().enumerate() {
            let points = || cells.iter().flat_map(|&i| self.members(i)).map(|&p| p as usize);
            let Some(bounds) = Aabb::of(points().map(|p| surface.world(p))) else { continue };
            for p in points() {
                fates[p] = Fate::Changed;
                of_points[p] = number as u32;
            }
            all.push(Change { bounds, n_points: points().count(), area: area(cells) });
        }
        Changes { fates, of_points, all, unseen_area }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::CloudParts;
    use surfabet_base::Silent;

    const STEP: f32 = 0.02;
    const TOLERANCE: f64 = 0.05;

    /// Adds a rectangle from `corner` along two edges, with a normal.
    fn add(parts: &mut CloudParts, corner: [f32; 3], [a, b]: [[f32; 3]; 2], normal: [f32; 3]) {
        let n = |edge: [f32; 3]| (length(edge) / STEP).round() as usize;
        for (i, j) in (0..n(a)).flat_map(|i| (0..n(b)).map(move |j| (i, j))) {
            let [s, t] = [(i, a), (j, b)].map(|(i, e)| (i as f32 + 0.5) / n(e) as f32);
            parts.positions.push(add_scaled(add_scaled(corner, s, a), t, b));
            parts.normals.get_or_insert_default().push(normal);
        }
    }

    /// The faces of a box, seen from outside or inside; `leave_out` is twice the axis of a face, plus one for the upper.
    fn add_box(
        parts: &mut CloudParts,
        low: [f32; 3],
        size: [f32; 3],
        outward: f32,
        leave_out: Option<usize>,
    ) {
        for face in (0..6).filter(|&face| Some(face) != leave_out) {
            let axis = face / 2;
            let upper = face % 2 == 1;
            let mut corner = low;
            if upper {
                corner[axis] += size[axis];
            }
            let edge = |a: usize| {
                let mut edge = [0.0; 3];
                edge[a] = size[a];
                edge
            };
            let mut normal = [0.0; 3];
            normal[axis] = if upper { outward } else { -outward };
            add(parts, corner, [edge((axis + 1) % 3), edge((axis + 2) % 3)], normal);
        }
    }

    fn cloud(build: impl FnOnce(&mut CloudParts)) -> PointCloud {
        let mut parts = CloudParts { origin: [100.0, -50.0, 3.0], ..CloudParts::default() };
        build(&mut parts);
        PointCloud::from_parts(parts).unwrap().0
    }

    fn room(parts: &mut CloudParts) {
        add_box(parts, [0.0; 3], [4.0, 3.0, 2.4], -1.0, None);
    }

    fn found(a: &PointCloud, b: &PointCloud, viewpoints: Option<&[[f64; 3]]>) -> Changes {
        let other = Other { surface: b, measured: b, viewpoints };
        changes(a, &other, TOLERANCE, 0.02, &Silent).unwrap()
    }

    #[test]
    fn a_box_that_stands_in_one_room_alone_is_found() {
        let empty = cloud(room);
        let with = cloud(|parts| {
            room(parts);
            add_box(parts, [1.0, 1.0, 0.0], [0.5, 0.4, 0.6], 1.0, Some(4));
        });
        for viewpoints in [None, Some([[102.0, -48.5, 4.5], [100.5, -47.5, 4.5]])] {
            let changes = found(&with, &empty, viewpoints.as_ref().map(|v| &v[..]));
            assert_eq!(changes.all.len(), 1, "{viewpoints:?}");
            let change = &changes.all[0];
            // The lowest five centimetres are within the tolerance of the floor.
            let (low, high) = (change.bounds.low, change.bounds.high);
            for (a, (from, to)) in [(1.0, 1.5), (1.0, 1.4), (0.05, 0.6)].into_iter().enumerate() {
                let origin = [100.0, -50.0, 3.0][a];
                assert!((low[a] - origin - from).abs() < 0.03, "{low:?}");
                assert!((high[a] - origin - to).abs() < 0.03, "{high:?}");
            }
            let area = 0.5 * 0.4 + 2.0 * (0.5 + 0.4) * 0.55;
            assert!((change.area / area - 1.0).abs() < 0.35, "{}", change.area);
            assert_eq!(change.n_points, changes.of_points.iter().filter(|&&c| c == 0).count());
            assert_eq!(found(&empty, &empty, None).all, []);
        }
        // What the box hides of the floor was not looked at, so it is not new in the empty room.
        let is_below =
            |p: &[f32; 3]| p[2] < 0.01 && (1.0..1.5).contains(&p[0]) && (1.0..1.4).contains(&p[1]);
        let seen: Vec<usize> =
            (0..with.len()).filter(|&i| !is_below(&with.positions()[i])).collect();
        let changes = found(&empty, &with.select(&seen).unwrap(), None);
        assert_eq!(changes.all, []);
        assert!(changes.fates.contains(&Fate::Unseen));
    }

    #[test]
    fn what_stands_where_the_other_did_not_look_is_no_change() {
        // The other map saw the front of a cupboard, closed; one stands in it.
        let closed = cloud(|parts| {
            room(parts);
            add_box(parts, [1.0, 0.0, 0.0], [1.0, 0.8, 2.0], 1.0, None);
        });
        let open = cloud(|parts| {
            room(parts);
            add_box(parts, [1.3, 0.2, 0.5], [0.4, 0.3, 0.5], 1.0, None);
        });
        assert_eq!(found(&open, &closed, None).all, []);
        // The cupboard itself is gone, and that was seen.
        assert_eq!(found(&closed, &open, None).all.len(), 1);
        // A room that was never scanned, beyond the wall.
        let beyond = cloud(|parts| {
            room(parts);
            add_box(parts, [4.2, 0.0, 0.0], [3.0, 3.0, 2.4], -1.0, None);
        });
        let changes = found(&beyond, &cloud(room), None);
        assert_eq!(changes.all, []);
        assert!(changes.unseen_area > 30.0);
    }

    #[test]
    fn a_viewpoint_behind_a_wall_saw_nothing() {
        let empty = cloud(room);
        let with = cloud(|parts| {
            room(parts);
            add_box(parts, [1.0, 1.0, 0.0], [0.5, 0.4, 0.6], 1.0, Some(4));
        });
        assert_eq!(found(&with, &empty, Some(&[[110.0, -48.0, 4.0]])).all, []);
        assert_eq!(found(&with, &empty, Some(&[])).all, []);
    }

    /// A wall 8 m away, and one at 5 m of strips `gap` apart, as the lines of a laser show it; with `whole` without gaps.
    fn two_walls(parts: &mut CloudParts, gap: f32, whole: bool) {
        let toward = [-1.0, 0.0, 0.0];
        add(parts, [8.0, -4.0, -3.0], [[0.0, 8.0, 0.0], [0.0, 0.0, 6.0]], toward);
        let n = (1.05 / gap).floor() as i32;
        let half = n as f32 * gap;
        if whole {
            add(parts, [5.0, -1.0, -half], [[0.0, 2.0, 0.0], [0.0, 0.0, 2.0 * half]], toward);
            return;
        }
        for line in -n..=n {
            let low = line as f32 * gap - 0.03;
            add(parts, [5.0, -1.0, low], [[0.0, 2.0, 0.0], [0.0, 0.0, 0.06]], toward);
        }
    }

    #[test]
    fn between_the_lines_of_a_laser_nothing_was_seen() {
        let viewpoints = [[100.0, -50.0, 3.0], [100.0, -49.9, 3.0]];
        let gaps = |gap: f32| {
            let whole = cloud(|parts| two_walls(parts, gap, true));
            let lines = cloud(|parts| two_walls(parts, gap, false));
            found(&whole, &lines, Some(&viewpoints))
        };
        // 3.4 degrees apart: each place is within 2.5 of the lines on both sides.
        let narrow = gaps(0.3);
        assert_eq!(narrow.all, []);
        assert!(narrow.fates.contains(&Fate::Unseen));
        // 8 degrees apart: no laser leaves as much out.
        assert!(!gaps(0.7).all.is_empty());
    }

    #[test]
    fn a_thing_before_a_wall_of_lines_is_found() {
        let viewpoints = [[100.0, -50.0, 3.0], [100.0, -49.9, 3.0]];
        let lines = cloud(|parts| two_walls(parts, 0.3, false));
        let with = cloud(|parts| {
            two_walls(parts, 0.3, false);
            add_box(parts, [4.0, -0.2, -0.2], [0.4, 0.4, 0.4], 1.0, None);
        });
        let changes = found(&with, &lines, Some(&viewpoints));
        assert!(!changes.all.is_empty());
        assert!(changes.all.iter().all(|change| change.bounds.high[0] < 104.5));
    }

    #[test]
    fn lines_along_a_surface_do_not_look_through_it() {
        // A wall far away; before it lies a board that the other map has not, seen from above its edge.
        let wall = |parts: &mut CloudParts| {
            let toward = [-1.0, 0.0, 0.0];
            add(parts, [8.0, -4.0, -6.0], [[0.0, 8.0, 0.0], [0.0, 0.0, 12.0]], toward);
        };
        let with = cloud(|parts| {
            wall(parts);
            add(parts, [4.0, -0.2, 0.0], [[0.4, 0.0, 0.0], [0.0, 0.4, 0.0]], [0.0, 0.0, 1.0]);
        });
        let n_found = |height: f64| {
            let viewpoints = [[100.0, -50.0, 3.0 + height], [100.0, -49.9, 3.0 + height]];
            found(&with, &cloud(wall), Some(&viewpoints)).all.len()
        };
        // At 4.2 m a sine of 0.17 is a height of 0.72 m; the ends of the board are at 0.69 and 0.76.
        assert_eq!((n_found(0.6), n_found(0.9)), (0, 1));
    }

    #[test]
    fn small_differences_are_none() {
        let empty = cloud(room);
        let with = cloud(|parts| {
            room(parts);
            add_box(parts, [1.0, 1.0, 0.3], [0.04, 0.04, 0.04], 1.0, None);
        });
        assert_eq!(found(&with, &empty, None).all, []);
        let other = Other { surface: &empty, measured: &empty, viewpoints: None };
        assert!(changes(&with, &other, 0.0, 0.02, &Silent).is_err());
        assert!(changes(&with, &other, 0.05, f64::NAN, &Silent).is_err());
        let bare = PointCloud::from_positions(vec![[0.0; 3]]).0;
        assert!(changes(&bare, &other, 0.05, 0.02, &Silent).is_err());
    }
}
