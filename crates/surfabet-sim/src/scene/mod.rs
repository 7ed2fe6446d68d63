//! The scene: solids grouped into instances, rays, and what of their surface is exposed.

mod builder;
mod closest;
mod rearranged;
mod samples;
mod surfaces;

pub(crate) use builder::Builder;

use crate::bvh::Hierarchy;
use crate::pose::{Frame, Pose, Vec3};
use crate::solid::{Shape, SurfacePoint};
use crate::texture::{Rgb, Texture};

/// How far along its normal a surface point is moved to test whether another solid covers it, metres.
const LIFT: f64 = 1e-6;
/// Depth below which a lifted point is clear of another solid: solids are closed, up to rounding. A point on the
/// rim of a contact counts as covered for the face in contact; it is found as part of a free face beside it.
const COVERED: f64 = -1e-9;

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

    /// True when nothing lies between `viewpoint` and the surface point `point` with outward `normal`.
    pub fn is_visible(&self, point: [f64; 3], normal: [f64; 3], viewpoint: [f64; 3]) -> bool {
        let ray = Vec3::from(point) - Vec3::from(viewpoint);
        ray.dot(&Vec3::from(normal)) < 0.0
            && self
                .cast(viewpoint, to_array(&ray))
                .is_some_and(|hit| hit.distance >= ray.norm() - 2.0 * LIFT)
    }

    /// A surface point of solid `s` and its normal in the world.
    fn to_world(&self, s: usize, on: &SurfacePoint) -> (Vec3, Vec3) {
        let frame = &self.solids[s].frame;
        ((frame * nalgebra::Point3::from(on.point)).coords, frame.rotation * on.normal)
    }

    /// The row in [`Scene::surfaces`] of a surface point of solid `s`.
    fn surface(&self, s: usize, on: &SurfacePoint) -> u32 {
        self.surface_of_face[s][usize::from(on.face)]
    }

    /// True when a point on the surface of solid `s` is part of the scene's surface.
    fn exposed(&self, s: usize, on: &SurfacePoint) -> bool {
        if self.solids[s].hidden & (1 << on.face) != 0 {
            return false;
        }
        !self.is_covered(s, &self.to_world(s, on))
    }

    /// True when a point of solid `s` with its normal lies within another one.
    fn is_covered(&self, s: usize, (point, normal): &(Vec3, Vec3)) -> bool {
        let lifted = point + normal * LIFT;
        self.hierarchy
            .any_at(&lifted, |other| other != s && self.depth_in(other, &lifted) > COVERED)
    }

    /// How deep `p` lies in a solid; negative outside.
    fn depth_in(&self, s: usize, p: &Vec3) -> f64 {
        let local = self.inverses[s] * nalgebra::Point3::from(*p);
        -self.solids[s].shape.closest(&local.coords).0
    }

    /// The colour of a surface point under the room's lamp: its texture, shaded by the angle to the lamp and by the
    /// distance from it.
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

fn to_array(v: &Vec3) -> [f64; 3] {
    [v.x, v.y, v.z]
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
