//! The scene: rays, exact distances to the exposed surface, samples of it, and who is who.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use surfabet_geom::{Error, Result};

use crate::bvh::Hierarchy;
use crate::pose::{Frame, Pose, Vec3, pose_of};
use crate::solid::{Cell, Shape, SurfacePoint};
use crate::texture::{Rgb, Texture};

/// How far along its normal a surface point is moved to ask whether another solid covers it, metres.
const LIFT: f64 = 1e-6;
/// Depth below which a lifted point is clear of another solid: solids are closed, up to rounding. A point on the
/// rim of a contact counts as covered for the face in contact; it is found as part of a free face beside it.
const COVERED: f64 = -1e-9;
/// Cells of surface smaller than this are not cut further when looking for their exposed part, metres.
const SMALLEST_CELL: f64 = 1e-5;

/// A named thing in the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Instance {
    /// `wall`, `floor`, `chair`, `door`, ...
    pub class: &'static str,
    /// Instances with the same number are congruent, geometry and colour: one model in several poses.
    pub model: u32,
    /// From the model's frame to the world.
    pub pose: Pose,
    /// Lower and upper corner of the bounding box in the model's own frame.
    pub extent: ([f64; 3], [f64; 3]),
    /// Lower and upper corner of the bounding box in the world.
    pub bounds: ([f64; 3], [f64; 3]),
}

/// The kind of a smooth piece of surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SurfaceKind {
    /// A plane piece; coplanar faces of one instance that touch are one piece.
    Plane,
    /// The side of a cylinder.
    Cylinder,
    /// A sphere.
    Sphere,
}

/// A smooth piece of surface of one instance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Plane, cylinder or sphere.
    pub kind: SurfaceKind,
    /// Row in [`Scene::instances`].
    pub instance: u32,
    /// Outward unit normal of a plane, direction of a cylinder's axis, zero for a sphere.
    pub direction: [f64; 3],
    /// For a plane, `direction` times its points; zero else.
    pub offset: f64,
}

/// Where a ray meets the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Metres from the origin of the ray.
    pub distance: f64,
    /// In the world, metres.
    pub point: [f64; 3],
    /// Unit outward normal.
    pub normal: [f64; 3],
    /// Red, green, blue, 0 to 255, before any noise.
    pub color: [f64; 3],
    /// Row in [`Scene::instances`].
    pub instance: u32,
    /// Row in [`Scene::surfaces`].
    pub surface: u32,
}

/// The point of the exposed surface nearest to a query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoint {
    /// Metres, never negative.
    pub distance: f64,
    /// In the world, metres.
    pub point: [f64; 3],
    /// Unit outward normal there.
    pub normal: [f64; 3],
    /// Row in [`Scene::instances`].
    pub instance: u32,
    /// Row in [`Scene::surfaces`].
    pub surface: u32,
}

/// Points of the exposed surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SurfaceSamples {
    /// In the world, metres.
    pub points: Vec<[f64; 3]>,
    /// Unit outward normals.
    pub normals: Vec<[f32; 3]>,
    /// Rows in [`Scene::instances`].
    pub instances: Vec<u32>,
    /// Rows in [`Scene::surfaces`].
    pub surfaces: Vec<u32>,
}

/// A solid in place.
#[derive(Debug, Clone)]
pub(crate) struct Solid {
    pub shape: Shape,
    pub frame: Frame,
    pub texture: Texture,
    pub instance: u32,
    /// Bit k: face k looks away from the room (back of a wall) and is no part of the surface.
    pub hidden: u8,
}

/// What a room is built from, before it is a scene: solids in the frame of a model.
#[derive(Debug, Clone, Default)]
pub(crate) struct Model {
    pub solids: Vec<(Shape, Frame, Texture, u8)>,
}

/// Collects instances and their solids.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    solids: Vec<Solid>,
    instances: Vec<Instance>,
    frames: Vec<Frame>,
}

fn to_array(v: &Vec3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

/// Bounding box of a shape in a frame.
fn bounds_of(shape: &Shape, frame: &Frame) -> (Vec3, Vec3) {
    let centre = frame.translation.vector;
    let rotation = frame.rotation.to_rotation_matrix();
    let m = rotation.matrix();
    let reach = match *shape {
        Shape::Cuboid(half) => m.abs() * half,
        // A disc of radius r with unit normal a reaches r sqrt(1 - a_k^2) along axis k.
        Shape::Cylinder(radius, half) => Vec3::from_fn(|k, _| {
            let a = m[(k, 2)];
            radius * (1.0 - a * a).max(0.0).sqrt() + half * a.abs()
        }),
        Shape::Sphere(radius) => Vec3::repeat(radius),
    };
    (centre - reach, centre + reach)
}

fn union_bounds(boxes: impl Iterator<Item = (Vec3, Vec3)>) -> ([f64; 3], [f64; 3]) {
    let start = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
    let (low, high) = boxes.fold(start, |(low, high), (l, h)| (low.inf(&l), high.sup(&h)));
    (to_array(&low), to_array(&high))
}

impl Builder {
    /// Places `model` and returns its row.
    pub(crate) fn place(
        &mut self,
        class: &'static str,
        number: u32,
        model: &Model,
        frame: &Frame,
    ) -> u32 {
        let row = self.instances.len() as u32;
        let placed = model.solids.iter().map(|(shape, local, texture, hidden)| Solid {
            shape: *shape,
            frame: frame * local,
            texture: *texture,
            instance: row,
            hidden: *hidden,
        });
        let first = self.solids.len();
        self.solids.extend(placed);
        self.frames.push(*frame);
        self.instances.push(Instance {
            class,
            model: number,
            pose: pose_of(frame),
            extent: union_bounds(model.solids.iter().map(|(s, f, ..)| bounds_of(s, f))),
            bounds: union_bounds(
                self.solids[first..].iter().map(|s| bounds_of(&s.shape, &s.frame)),
            ),
        });
        row
    }

    /// A scene with its lamp at `lamp`; `interior` is the room's inner box.
    pub(crate) fn finish(self, lamp: Vec3, interior: (Vec3, Vec3)) -> Scene {
        let boxes: Vec<_> = self.solids.iter().map(|s| bounds_of(&s.shape, &s.frame)).collect();
        let hierarchy = Hierarchy::new(&boxes);
        let inverses = self.solids.iter().map(|s| s.frame.inverse()).collect();
        let instance_inverses: Vec<Frame> = self.frames.iter().map(Frame::inverse).collect();
        let (surfaces, surface_of_face) = surfaces_of(&self.solids, &instance_inverses);
        Scene {
            solids: self.solids,
            inverses,
            instances: self.instances,
            instance_inverses,
            surfaces,
            surface_of_face,
            hierarchy,
            lamp,
            interior,
        }
    }
}

/// The smooth pieces of surface, and for every face of every solid its row among them.
fn surfaces_of(solids: &[Solid], inverses: &[Frame]) -> (Vec<Surface>, Vec<[u32; 6]>) {
    struct Piece {
        surface: Surface,
        bounds: (Vec3, Vec3),
        root: usize,
    }
    fn root(pieces: &[Piece], mut i: usize) -> usize {
        while pieces[i].root != i {
            i = pieces[i].root;
        }
        i
    }
    let mut pieces: Vec<Piece> = Vec::new();
    let mut piece_of_face = vec![[0_usize; 6]; solids.len()];
    let mut first_of_instance = (u32::MAX, 0);
    for (s, solid) in solids.iter().enumerate() {
        if first_of_instance.0 != solid.instance {
            first_of_instance = (solid.instance, pieces.len());
        }
        for face in 0..solid.shape.faces() {
            let index = pieces.len();
            piece_of_face[s][usize::from(face)] = index;
            let (kind, direction, offset) = match (solid.shape.plane_normal(face), solid.shape) {
                (Some(normal), _) => {
                    let normal = solid.frame.rotation * normal;
                    let on =
                        solid.frame * nalgebra::Point3::from(solid.shape.at(face, [0.0; 2]).point);
                    (SurfaceKind::Plane, normal, normal.dot(&on.coords))
                }
                (None, Shape::Sphere(_)) => (SurfaceKind::Sphere, Vec3::zeros(), 0.0),
                (None, _) => (SurfaceKind::Cylinder, solid.frame.rotation * Vec3::z(), 0.0),
            };
            // Coplanar faces touch where their solids do; most solids are aligned with their instance, where
            // their boxes are exact.
            let inverse = &inverses[solid.instance as usize];
            let bounds = bounds_of(&solid.shape, &(inverse * solid.frame));
            let surface =
                Surface { kind, instance: solid.instance, direction: to_array(&direction), offset };
            pieces.push(Piece { surface, bounds, root: index });
            if kind != SurfaceKind::Plane {
                continue;
            }
            for other in first_of_instance.1..index {
                let o = &pieces[other];
                let coplanar = o.surface.kind == SurfaceKind::Plane
                    && (Vec3::from(o.surface.direction) - direction).amax() < 1e-9
                    && (o.surface.offset - offset).abs() < 1e-9;
                let touching = (0..3).all(|a| {
                    o.bounds.0[a] <= bounds.1[a] + LIFT && bounds.0[a] <= o.bounds.1[a] + LIFT
                });
                if coplanar && touching {
                    let (a, b) = (root(&pieces, other), root(&pieces, index));
                    // The lower number stays the root, so that numbering follows the solids.
                    pieces[a.max(b)].root = a.min(b);
                }
            }
        }
    }
    let mut number = vec![0_u32; pieces.len()];
    let mut surfaces = Vec::new();
    for i in 0..pieces.len() {
        let r = root(&pieces, i);
        if r == i {
            number[i] = surfaces.len() as u32;
            surfaces.push(pieces[i].surface);
        } else {
            number[i] = number[r];
        }
    }
    let table = piece_of_face.iter().map(|faces| faces.map(|p| number[p])).collect();
    (surfaces, table)
}

/// A furnished room or another set of solids, immutable, with its surface known exactly.
///
/// The surface is that of the union of all solids, without the faces that look away from the room (the
/// outside of walls, floor and ceiling) and without the parts where solids touch or overlap.
#[derive(Debug)]
pub struct Scene {
    solids: Vec<Solid>,
    inverses: Vec<Frame>,
    instances: Vec<Instance>,
    instance_inverses: Vec<Frame>,
    surfaces: Vec<Surface>,
    surface_of_face: Vec<[u32; 6]>,
    hierarchy: Hierarchy,
    lamp: Vec3,
    interior: (Vec3, Vec3),
}

/// A cell of surface ordered by its distance, the nearest first.
struct Candidate {
    distance: f64,
    cell: Cell,
    nearest: SurfacePoint,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Candidate {}
impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        // Ties by face and parameters, so that the order is total.
        other
            .distance
            .total_cmp(&self.distance)
            .then_with(|| other.cell.face.cmp(&self.cell.face))
            .then_with(|| other.cell.low[0].total_cmp(&self.cell.low[0]))
            .then_with(|| other.cell.low[1].total_cmp(&self.cell.low[1]))
    }
}

impl Scene {
    /// Everything with a name, in a fixed order.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The smooth pieces of surface, in a fixed order.
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Lower and upper corner of the room between its walls, floor and ceiling, metres.
    pub fn interior(&self) -> ([f64; 3], [f64; 3]) {
        (to_array(&self.interior.0), to_array(&self.interior.1))
    }

    /// The first point of the surface on a ray; `None` when it leaves the scene (through an open door) or when
    /// `direction` is zero or anything is not finite. `direction` need not be of unit length.
    ///
    /// A solid that contains the origin is not seen: surfaces have one side.
    pub fn cast(&self, origin: [f64; 3], direction: [f64; 3]) -> Option<Hit> {
        let (origin, direction) = (Vec3::from(origin), Vec3::from(direction));
        let length = direction.norm();
        if !(length.is_finite() && length > 0.0 && origin.iter().all(|c| c.is_finite())) {
            return None;
        }
        let direction = direction / length;
        let mut nearest: Option<(usize, SurfacePoint)> = None;
        let distance = self.hierarchy.along_ray(&origin, &direction, f64::INFINITY, |s, best| {
            let inverse = &self.inverses[s];
            let o = inverse * nalgebra::Point3::from(origin);
            let d = inverse.rotation * direction;
            match self.solids[s].shape.cast(&o.coords, &d) {
                // Faces of two solids in one plane: the lower row is seen.
                Some((t, hit)) if t < best || (t == best && nearest.is_some_and(|n| s < n.0)) => {
                    nearest = Some((s, hit));
                    t
                }
                _ => best,
            }
        });
        let (s, hit) = nearest?;
        let (point, normal) = self.to_world(s, &hit);
        Some(Hit {
            distance,
            point: to_array(&point),
            normal: to_array(&normal),
            color: self.color(s, &point, &normal).map(|c| 255.0 * c),
            instance: self.solids[s].instance,
            surface: self.surface(s, &hit),
        })
    }

    /// The exact unsigned distance from `point` to the exposed surface, metres; NaN for a point that is not
    /// finite. See [`Scene::closest_point`] for the one case that is exact to 10 micrometres only.
    pub fn distance(&self, point: [f64; 3]) -> f64 {
        self.closest_point(point).map_or(f64::NAN, |c| c.distance)
    }

    /// The nearest point of the exposed surface; `None` for a point that is not finite.
    ///
    /// Where the nearest point of a solid is covered by another one, its faces are cut into cells and searched
    /// best first for the nearest exposed one, down to 10 micrometres: such a point lies inside a solid, nearest
    /// to the rim of a contact. Spheres touch others in single points only and are never cut.
    pub fn closest_point(&self, point: [f64; 3]) -> Option<ClosestPoint> {
        let p = Vec3::from(point);
        if !p.iter().all(|c| c.is_finite()) {
            return None;
        }
        let mut nearest: Option<(usize, SurfacePoint)> = None;
        let mut covered = Vec::new();
        let local = |s: usize| (self.inverses[s] * nalgebra::Point3::from(p)).coords;
        let bound = self.hierarchy.near(&p, f64::INFINITY, |s, best| {
            let solid = &self.solids[s];
            let (signed, on) = solid.shape.closest(&local(s));
            let found = signed.abs();
            if found > best {
                return best;
            }
            if !(matches!(solid.shape, Shape::Sphere(_)) || self.exposed(s, &on)) {
                covered.push((found, s));
                return best;
            }
            if found < best || nearest.is_some_and(|n| s < n.0) {
                nearest = Some((s, on));
            }
            found
        });
        // Only what is nearer than the bound has to be searched, so the cells to cut are few.
        let mut distance = bound;
        covered.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (least, s) in covered {
            if least >= distance {
                break;
            }
            if let Some((found, on)) = self.closest_exposed(s, &local(s), distance)
                && found < distance
            {
                (distance, nearest) = (found, Some((s, on)));
            }
        }
        let (s, on) = nearest?;
        let (point, normal) = self.to_world(s, &on);
        Some(ClosestPoint {
            distance,
            point: to_array(&point),
            normal: to_array(&normal),
            instance: self.solids[s].instance,
            surface: self.surface(s, &on),
        })
    }

    /// True when nothing lies between `viewpoint` and the surface point `point` with outward `normal`.
    pub fn is_visible(&self, point: [f64; 3], normal: [f64; 3], viewpoint: [f64; 3]) -> bool {
        let ray = Vec3::from(point) - Vec3::from(viewpoint);
        ray.dot(&Vec3::from(normal)) < 0.0
            && self
                .cast(viewpoint, to_array(&ray))
                .is_some_and(|hit| hit.distance >= ray.norm() - 2.0 * LIFT)
    }

    /// Points of the exposed surface, about one per `spacing` x `spacing`, each the middle of a cell of at most
    /// that size; cells whose middle is covered by another solid are left out.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] unless `spacing` is at least 0.5 mm.
    pub fn sample_surface(&self, spacing: f64) -> Result<SurfaceSamples> {
        if !(spacing >= 5e-4 && spacing.is_finite()) {
            return Err(Error::invalid("spacing", spacing, "finite and at least 0.0005 m"));
        }
        let mut samples = SurfaceSamples::default();
        for (s, solid) in self.solids.iter().enumerate() {
            for face in (0..solid.shape.faces()).filter(|f| solid.hidden & (1 << f) == 0) {
                for parameters in sample_face(&solid.shape, face, spacing) {
                    let on = solid.shape.at(face, parameters);
                    if !self.exposed(s, &on) {
                        continue;
                    }
                    let (point, normal) = self.to_world(s, &on);
                    samples.points.push(to_array(&point));
                    samples.normals.push(to_array(&normal).map(|c| c as f32));
                    samples.instances.push(solid.instance);
                    samples.surfaces.push(self.surface(s, &on));
                }
            }
        }
        Ok(samples)
    }

    fn to_world(&self, s: usize, on: &SurfacePoint) -> (Vec3, Vec3) {
        let frame = &self.solids[s].frame;
        ((frame * nalgebra::Point3::from(on.point)).coords, frame.rotation * on.normal)
    }

    fn surface(&self, s: usize, on: &SurfacePoint) -> u32 {
        self.surface_of_face[s][usize::from(on.face)]
    }

    /// True when a point on the surface of solid `s` is part of the scene's surface.
    fn exposed(&self, s: usize, on: &SurfacePoint) -> bool {
        if self.solids[s].hidden & (1 << on.face) != 0 {
            return false;
        }
        let (point, normal) = self.to_world(s, on);
        let lifted = point + normal * LIFT;
        !self
            .hierarchy
            .any_at(&lifted, |other| other != s && self.depth_in(other, &lifted) > COVERED)
    }

    /// How deep `p` lies in a solid; negative outside.
    fn depth_in(&self, s: usize, p: &Vec3) -> f64 {
        let local = self.inverses[s] * nalgebra::Point3::from(*p);
        -self.solids[s].shape.closest(&local.coords).0
    }

    /// The exposed point of solid `s` nearest to `p` (in the frame of the solid), when nearer than `limit`.
    fn closest_exposed(&self, s: usize, p: &Vec3, limit: f64) -> Option<(f64, SurfacePoint)> {
        let solid = &self.solids[s];
        let shape = &solid.shape;
        let candidate = |cell: Cell| {
            let nearest = shape.at(cell.face, shape.closest_in_cell(&cell, p));
            Candidate { distance: (nearest.point - p).norm(), cell, nearest }
        };
        let mut queue: BinaryHeap<Candidate> = (0..shape.faces())
            .filter(|face| solid.hidden & (1 << face) == 0)
            .flat_map(|face| shape.cells(face))
            .map(candidate)
            .collect();
        while let Some(Candidate { distance, cell, nearest }) = queue.pop() {
            if distance >= limit {
                return None;
            }
            let radius = shape.cell_radius(&cell);
            if radius < SMALLEST_CELL || self.exposed(s, &nearest) {
                return Some((distance, nearest));
            }
            let middle: [f64; 2] = std::array::from_fn(|k| 0.5 * (cell.low[k] + cell.high[k]));
            if self.wholly_covered(s, &cell) {
                continue;
            }
            for (u, v) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let half = |k: usize, upper: usize| {
                    if upper == 1 { (middle[k], cell.high[k]) } else { (cell.low[k], middle[k]) }
                };
                let ((u0, u1), (v0, v1)) = (half(0, u), half(1, v));
                queue.push(candidate(Cell { face: cell.face, low: [u0, v0], high: [u1, v1] }));
            }
        }
        None
    }

    /// True when one other solid, being convex, covers all of a cell of surface.
    fn wholly_covered(&self, s: usize, cell: &Cell) -> bool {
        let solid = &self.solids[s];
        let middle = std::array::from_fn(|k| 0.5 * (cell.low[k] + cell.high[k]));
        let (centre, normal) = self.to_world(s, &solid.shape.at(cell.face, middle));
        let lift = normal * LIFT;
        let hull: Vec<Vec3> = solid
            .shape
            .hull(cell)
            .iter()
            .map(|p| (solid.frame * nalgebra::Point3::from(*p)).coords + lift)
            .collect();
        self.hierarchy.any_at(&(centre + lift), |other| {
            other != s && hull.iter().all(|p| self.depth_in(other, p) > COVERED)
        })
    }

    /// The colour of a surface point under the room's light.
    fn color(&self, s: usize, point: &Vec3, normal: &Vec3) -> Rgb {
        let solid = &self.solids[s];
        let inverse = &self.instance_inverses[solid.instance as usize];
        let local = (inverse * nalgebra::Point3::from(*point)).coords;
        let color = solid.texture.color(&local, &(inverse.rotation * normal));
        let towards = self.lamp - point;
        let facing = normal.dot(&towards) / (towards.norm() + 0.3);
        let light = 0.74 + 0.26 * (0.5 + 0.5 * facing) / (1.0 + 0.03 * towards.norm_squared());
        color.map(|c| (c * light).clamp(0.0, 1.0))
    }
}

/// Parameters of cell middles over a face, cells of about `spacing` in both directions.
fn sample_face(shape: &Shape, face: u8, spacing: f64) -> Vec<[f64; 2]> {
    let steps = |length: f64| ((length / spacing).ceil()).max(1.0) as usize;
    let middle =
        |low: f64, high: f64, i: usize, n: usize| low + (high - low) * (i as f64 + 0.5) / n as f64;
    let turn = std::f64::consts::TAU;
    let mut parameters = Vec::new();
    match *shape {
        Shape::Cuboid(_) => {
            for cell in shape.cells(face) {
                let (n, m) = (steps(cell.high[0] - cell.low[0]), steps(cell.high[1] - cell.low[1]));
                for i in 0..n {
                    let u = middle(cell.low[0], cell.high[0], i, n);
                    parameters.extend((0..m).map(|j| [u, middle(cell.low[1], cell.high[1], j, m)]));
                }
            }
        }
        Shape::Cylinder(radius, half) if face == 0 => {
            let (n, m) = (steps(turn * radius), steps(2.0 * half));
            for i in 0..n {
                let angle = middle(0.0, turn, i, n);
                parameters.extend((0..m).map(|j| [angle, middle(-half, half, j, m)]));
            }
        }
        Shape::Cylinder(radius, _) => {
            let m = steps(radius);
            for j in 0..m {
                let r = middle(0.0, radius, j, m);
                let n = steps(turn * r);
                parameters.extend((0..n).map(|i| [middle(0.0, turn, i, n), r]));
            }
        }
        Shape::Sphere(radius) => {
            let m = steps(0.5 * turn * radius);
            for j in 0..m {
                let latitude = middle(-0.25 * turn, 0.25 * turn, j, m);
                let n = steps(turn * radius * latitude.cos());
                parameters.extend((0..n).map(|i| [middle(0.0, turn, i, n), latitude]));
            }
        }
    }
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;

    const GREY: Texture = Texture::Paint([0.5; 3]);

    fn scene(models: &[(Model, Frame)]) -> Scene {
        let mut builder = Builder::default();
        for (number, (model, frame)) in models.iter().enumerate() {
            builder.place("thing", number as u32, model, frame);
        }
        builder.finish(Vec3::new(0.0, 0.0, 3.0), (Vec3::repeat(-1.0), Vec3::repeat(1.0)))
    }

    /// A block of 2 x 2 x 1 m with a block of 0.4 x 0.6 x 1 m in the middle of its top (z = 0).
    fn step() -> Scene {
        let mut m = Model::default();
        m.cuboid([0.0, 0.0, -0.5], [2.0, 2.0, 1.0], GREY);
        m.cuboid([0.0, 0.0, 0.5], [0.4, 0.6, 1.0], GREY);
        scene(&[(m, Frame::identity())])
    }

    #[test]
    fn rays_see_the_nearest_solid() {
        let scene = step();
        let hit = scene.cast([0.1, 0.1, 5.0], [0.0, 0.0, -2.0]).unwrap();
        assert_eq!((hit.distance, hit.point, hit.normal), (4.0, [0.1, 0.1, 1.0], [0.0, 0.0, 1.0]));
        let hit = scene.cast([0.9, 0.1, 5.0], [0.0, 0.0, -1.0]).unwrap();
        assert_eq!((hit.distance, hit.point), (5.0, [0.9, 0.1, 0.0]));
        assert_eq!(scene.cast([1.1, 0.1, 5.0], [0.0, 0.0, -1.0]), None);
        assert_eq!(scene.cast([0.9, 0.1, 5.0], [0.0; 3]), None);
        assert_eq!(scene.cast([f64::NAN, 0.1, 5.0], [0.0, 0.0, 1.0]), None);
    }

    #[test]
    fn distances_outside_are_those_of_a_hand_calculation() {
        let scene = step();
        assert_eq!(scene.distance([0.9, 0.0, 0.5]), 0.5);
        assert!((scene.distance([0.5, 0.0, 0.4]) - 0.3).abs() < 1e-12);
        assert_eq!(scene.distance([4.0, 1.0, -5.0]), 5.0);
        assert!((scene.distance([0.2 + 0.3, 0.3 + 0.4, 0.9]) - 0.5).abs() < 1e-12);
        assert!(scene.distance([f64::NAN, 0.0, 0.0]).is_nan());
    }

    #[test]
    fn distances_inside_are_to_the_exposed_surface_only() {
        let scene = step();
        // Below the small block the top of the large one is covered: its rim is the nearest, 0.2 m aside.
        assert!((scene.distance([0.0, 0.0, -0.15]) - 0.25).abs() < 2e-5);
        // Above, on the axis of the small block: its sides.
        assert!((scene.distance([0.0, 0.0, 0.1]) - 0.2).abs() < 2e-5);
        // On the covered face itself.
        let closest = scene.closest_point([0.1, 0.0, 0.0]).unwrap();
        assert!((closest.distance - 0.1).abs() < 2e-5);
        assert!((closest.point[0] - 0.2).abs() < 2e-5);
        // Clear of it, the top is as usual.
        assert!((scene.distance([0.6, 0.0, -0.1]) - 0.1).abs() < 1e-12);
    }

    #[test]
    fn distances_inside_a_covered_disc_are_to_its_rim() {
        let mut m = Model::default();
        m.cuboid([0.0, 0.0, -0.5], [2.0, 2.0, 1.0], GREY);
        m.cylinder([0.0, 0.0, 0.5], 0.3, 1.0, 2, GREY);
        let scene = scene(&[(m, Frame::identity())]);
        assert!((scene.distance([0.06, 0.0, -0.32]) - 0.4).abs() < 2e-5);
        assert!((scene.distance([0.1, 0.0, 0.05]) - 0.2).abs() < 2e-5);
        assert!((scene.distance([0.1, 0.0, 0.0]) - 0.2).abs() < 2e-5);
    }

    #[test]
    fn samples_cover_the_exposed_area_and_nothing_else() {
        let scene = step();
        let spacing = 0.02;
        let samples = scene.sample_surface(spacing).unwrap();
        // Large block 8 + 8 m2, small block sides 2 m2 and top 0.24 m2, less twice nothing: the foot of the
        // small one covers as much as its top adds.
        let area = 2.0 * 4.0 + 4.0 * 2.0 + 2.0 * (0.4 + 0.6);
        let sampled = samples.points.len() as f64 * spacing * spacing;
        assert!((sampled / area - 1.0).abs() < 0.01, "{sampled} of {area}");
        for p in samples.points.iter().step_by(13) {
            assert!(scene.distance(*p) < 1e-9);
        }
        assert!(scene.sample_surface(0.0).is_err() && scene.sample_surface(f64::NAN).is_err());
    }

    #[test]
    fn distances_agree_with_dense_samples_of_a_room() {
        let scene = Scene::room(&crate::RoomOptions::default()).unwrap();
        let spacing = 0.02;
        let samples = scene.sample_surface(spacing).unwrap();
        let (low, high) = scene.interior();
        for i in 0..120 {
            let f = |k: f64| (f64::from(i) * k).fract();
            let ratios = [f(0.618_034), f(0.754_878), f(0.569_840)];
            // A little beyond the walls as well, where noise puts points.
            let p: [f64; 3] =
                std::array::from_fn(|a| low[a] - 0.1 + (high[a] - low[a] + 0.2) * ratios[a]);
            let sampled = samples
                .points
                .iter()
                .map(|q| (Vec3::from(*q) - Vec3::from(p)).norm())
                .fold(f64::INFINITY, f64::min);
            let exact = scene.distance(p);
            // A sample lies within half a cell's diagonal of every exposed point; where the exposed part of a
            // cell is small, within two.
            assert!(exact <= sampled + 2e-5, "{p:?} {exact} {sampled}");
            assert!(sampled <= exact + 2.0 * spacing, "{p:?} {exact} {sampled}");
        }
    }

    #[test]
    fn touching_coplanar_faces_are_one_surface() {
        let mut m = Model::default();
        m.cuboid([0.0, 0.0, 0.0], [1.0, 1.0, 1.0], GREY);
        m.cuboid([1.0, 0.0, 0.0], [1.0, 1.0, 1.0], GREY);
        m.cuboid([3.0, 0.0, 0.0], [1.0, 1.0, 1.0], GREY);
        let scene = scene(&[(m, crate::pose::upright(Vec3::new(1.0, 2.0, 0.0), 0.7))]);
        // The touching pair shares four planes and has two outer and two inner ends: 8; the third has 6.
        assert_eq!(scene.surfaces().len(), 14);
    }

    #[test]
    fn congruent_chairs_have_the_same_surface_in_their_own_frame() {
        let scene = Scene::room(&crate::RoomOptions::default()).unwrap();
        let samples = scene.sample_surface(0.02).unwrap();
        let chairs: Vec<usize> = (0..scene.instances().len())
            .filter(|i| scene.instances()[*i].class == "chair")
            .collect();
        assert_eq!(chairs.len(), 6);
        let of = |row: usize| -> Vec<Vec3> {
            let inverse = crate::pose::frame_of(&scene.instances()[row].pose).unwrap().inverse();
            let own = samples.points.iter().zip(&samples.instances);
            own.filter(|(_, i)| **i as usize == row)
                .map(|(p, _)| (inverse * nalgebra::Point3::from(Vec3::from(*p))).coords)
                .collect()
        };
        let first = of(chairs[0]);
        assert!(first.len() > 1000);
        for &row in &chairs[1..] {
            let other = of(row);
            let same = first.iter().zip(&other).all(|(a, b)| (a - b).norm() < 1e-9);
            assert!(first.len() == other.len() && same);
            assert_eq!(scene.instances()[row].model, scene.instances()[chairs[0]].model);
            assert_eq!(scene.instances()[row].extent, scene.instances()[chairs[0]].extent);
        }
    }
}
