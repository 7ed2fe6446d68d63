//! Convex solids in their own frame: rays, signed distances and their surface cut into cells.

use std::f64::consts::{PI, TAU};

use crate::pose::Vec3;

/// A convex solid centred at the origin of its frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Shape {
    /// Half edge lengths.
    Cuboid(Vec3),
    /// Radius and half height; the axis is z.
    Cylinder(f64, f64),
    /// Radius.
    Sphere(f64),
}

/// A point of a solid's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfacePoint {
    pub point: Vec3,
    pub normal: Vec3,
    /// Cuboid: -x +x -y +y -z +z; cylinder: side, bottom, top; sphere: 0.
    pub face: u8,
}

/// A rectangle in the parameters of one face: cuboid faces by their two remaining axes in metres; the side of a
/// cylinder by angle and z; its ends by angle and radius; spheres by longitude and latitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cell {
    pub face: u8,
    pub low: [f64; 2],
    pub high: [f64; 2],
}

fn axis_vector(axis: usize, value: f64) -> Vec3 {
    let mut v = Vec3::zeros();
    v[axis] = value;
    v
}

fn other_axes(axis: usize) -> (usize, usize) {
    [(1, 2), (0, 2), (0, 1)][axis]
}

/// The angle of `range` nearest to `angle` on the circle.
fn clamp_angle(angle: f64, low: f64, high: f64) -> f64 {
    let offset = (angle - low).rem_euclid(TAU);
    if offset <= high - low {
        low + offset
    } else if offset - (high - low) < TAU - offset {
        high
    } else {
        low
    }
}

impl Shape {
    pub(crate) fn faces(&self) -> u8 {
        match self {
            Self::Cuboid(_) => 6,
            Self::Cylinder(..) => 3,
            Self::Sphere(_) => 1,
        }
    }

    /// The outward normal of a plane face; `None` for curved ones.
    pub(crate) fn plane_normal(&self, face: u8) -> Option<Vec3> {
        match (self, face) {
            (Self::Cuboid(_), _) => {
                let sign = if face % 2 == 1 { 1.0 } else { -1.0 };
                Some(axis_vector(usize::from(face / 2), sign))
            }
            (Self::Cylinder(..), 1) => Some(-Vec3::z()),
            (Self::Cylinder(..), 2) => Some(Vec3::z()),
            _ => None,
        }
    }

    /// Where the ray enters the solid, as a distance in units of `direction`; `None` from inside.
    pub(crate) fn cast(&self, origin: &Vec3, direction: &Vec3) -> Option<(f64, SurfacePoint)> {
        match *self {
            Self::Cuboid(half) => cast_cuboid(&half, origin, direction),
            Self::Cylinder(radius, half) => cast_cylinder(radius, half, origin, direction),
            Self::Sphere(radius) => {
                let a = direction.norm_squared();
                let closest = -origin.dot(direction) / a;
                let miss = (origin + direction * closest).norm_squared();
                if miss > radius * radius {
                    return None;
                }
                let t = closest - ((radius * radius - miss) / a).sqrt();
                let normal = (origin + direction * t).normalize();
                (t > 0.0).then_some((t, SurfacePoint { point: normal * radius, normal, face: 0 }))
            }
        }
    }

    /// The nearest point of the surface and the signed distance to it, negative inside.
    pub(crate) fn closest(&self, p: &Vec3) -> (f64, SurfacePoint) {
        match *self {
            Self::Cuboid(half) => {
                let excess = p.abs() - half;
                let axis = excess.imax();
                let sign = if p[axis] < 0.0 { -1.0 } else { 1.0 };
                let mut point = Vec3::from_fn(|a, _| p[a].clamp(-half[a], half[a]));
                let inside = excess[axis] <= 0.0;
                if inside {
                    point[axis] = sign * half[axis];
                }
                let distance = if inside { excess[axis] } else { (p - point).norm() };
                let face = 2 * axis as u8 + u8::from(sign > 0.0);
                (distance, SurfacePoint { point, normal: axis_vector(axis, sign), face })
            }
            Self::Cylinder(radius, half) => {
                let across = p.x.hypot(p.y);
                // On the axis every direction is as near: take x.
                let (cos, sin) =
                    if across > 0.0 { (p.x / across, p.y / across) } else { (1.0, 0.0) };
                let (beside, above) = (across - radius, p.z.abs() - half);
                let sign = if p.z < 0.0 { -1.0 } else { 1.0 };
                let inside = beside <= 0.0 && above <= 0.0;
                let on_side = beside > above;
                let (r, z) = match (inside, on_side) {
                    (true, true) => (radius, p.z),
                    (true, false) => (across, sign * half),
                    (false, _) => (across.min(radius), p.z.clamp(-half, half)),
                };
                let point = Vec3::new(r * cos, r * sin, z);
                let distance = if inside { beside.max(above) } else { (p - point).norm() };
                let (normal, face) = if on_side {
                    (Vec3::new(cos, sin, 0.0), 0)
                } else {
                    (Vec3::new(0.0, 0.0, sign), 1 + u8::from(sign > 0.0))
                };
                (distance, SurfacePoint { point, normal, face })
            }
            Self::Sphere(radius) => {
                let norm = p.norm();
                let normal = if norm > 0.0 { p / norm } else { Vec3::x() };
                (norm - radius, SurfacePoint { point: normal * radius, normal, face: 0 })
            }
        }
    }

    /// Cells that cover one face, none wider than half a turn.
    pub(crate) fn cells(&self, face: u8) -> Vec<Cell> {
        let turns = |low: f64, high: f64| {
            (0..4)
                .map(|q| f64::from(q) * 0.5 * PI)
                .map(|a| Cell { face, low: [a, low], high: [a + 0.5 * PI, high] })
                .collect()
        };
        match *self {
            Self::Cuboid(half) => {
                let (u, v) = other_axes(usize::from(face / 2));
                vec![Cell { face, low: [-half[u], -half[v]], high: [half[u], half[v]] }]
            }
            Self::Cylinder(_, half) if face == 0 => turns(-half, half),
            Self::Cylinder(radius, _) => turns(0.0, radius),
            Self::Sphere(_) => turns(-0.5 * PI, 0.5 * PI),
        }
    }

    /// The surface at parameters `(u, v)` of a face.
    pub(crate) fn at(&self, face: u8, [u, v]: [f64; 2]) -> SurfacePoint {
        match *self {
            Self::Cuboid(half) => {
                let axis = usize::from(face / 2);
                let sign = if face % 2 == 1 { 1.0 } else { -1.0 };
                let (a, b) = other_axes(axis);
                let mut point = axis_vector(axis, sign * half[axis]);
                (point[a], point[b]) = (u, v);
                SurfacePoint { point, normal: axis_vector(axis, sign), face }
            }
            Self::Cylinder(radius, _) if face == 0 => {
                let normal = Vec3::new(u.cos(), u.sin(), 0.0);
                SurfacePoint { point: normal * radius + Vec3::z() * v, normal, face }
            }
            Self::Cylinder(_, half) => {
                let sign = if face == 2 { 1.0 } else { -1.0 };
                let point = Vec3::new(v * u.cos(), v * u.sin(), sign * half);
                SurfacePoint { point, normal: Vec3::new(0.0, 0.0, sign), face }
            }
            Self::Sphere(radius) => {
                let normal = Vec3::new(v.cos() * u.cos(), v.cos() * u.sin(), v.sin());
                SurfacePoint { point: normal * radius, normal, face }
            }
        }
    }

    /// The parameters of `cell` whose surface point is nearest to `p`; exact for plane faces and the side of a
    /// cylinder. Spheres are never cut into cells for this (see `Scene::closest_point`).
    pub(crate) fn closest_in_cell(&self, cell: &Cell, p: &Vec3) -> [f64; 2] {
        let clamp = |value: f64, k: usize| value.clamp(cell.low[k], cell.high[k]);
        match *self {
            Self::Cuboid(_) => {
                let (u, v) = other_axes(usize::from(cell.face / 2));
                [clamp(p[u], 0), clamp(p[v], 1)]
            }
            Self::Cylinder(..) if cell.face == 0 => {
                [clamp_angle(p.y.atan2(p.x), cell.low[0], cell.high[0]), clamp(p.z, 1)]
            }
            Self::Cylinder(..) => {
                let angle = clamp_angle(p.y.atan2(p.x), cell.low[0], cell.high[0]);
                // Outside the sector the nearest point lies on the nearer of its straight edges.
                let along = p.x * angle.cos() + p.y * angle.sin();
                [angle, clamp(along, 1)]
            }
            Self::Sphere(_) => {
                let angle = clamp_angle(p.y.atan2(p.x), cell.low[0], cell.high[0]);
                [angle, clamp(p.z.atan2(p.x.hypot(p.y)), 1)]
            }
        }
    }

    /// Corners of a convex set that holds `cell`, about its middle: the cell itself or a square around it for
    /// plane faces, a box for curved ones.
    pub(crate) fn hull(&self, cell: &Cell) -> Vec<Vec3> {
        let corners = [[0, 0], [0, 1], [1, 0], [1, 1]];
        if let Self::Cuboid(_) = self {
            let pick = |k: usize, upper: usize| if upper == 1 { cell.high[k] } else { cell.low[k] };
            return corners.map(|[u, v]| self.at(cell.face, [pick(0, u), pick(1, v)]).point).into();
        }
        let middle = std::array::from_fn(|k| 0.5 * (cell.low[k] + cell.high[k]));
        let centre = self.at(cell.face, middle).point;
        let radius = self.cell_radius(cell);
        let heights =
            if self.plane_normal(cell.face).is_some() { vec![0.0] } else { vec![-radius, radius] };
        let side = |upper: usize| if upper == 1 { radius } else { -radius };
        heights
            .iter()
            .flat_map(|z| corners.map(|[x, y]| centre + Vec3::new(side(x), side(y), *z)))
            .collect()
    }

    /// Radius of a ball about the middle of `cell` that holds the cell.
    pub(crate) fn cell_radius(&self, cell: &Cell) -> f64 {
        let (u, v) = (0.5 * (cell.high[0] - cell.low[0]), 0.5 * (cell.high[1] - cell.low[1]));
        let scale = match *self {
            Self::Cuboid(_) => 1.0,
            Self::Cylinder(radius, _) if cell.face == 0 => radius,
            Self::Cylinder(..) => cell.high[1],
            Self::Sphere(radius) => return radius * u.hypot(v),
        };
        (u * scale).hypot(v)
    }
}

fn cast_cuboid(half: &Vec3, origin: &Vec3, direction: &Vec3) -> Option<(f64, SurfacePoint)> {
    let (mut enter, mut leave, mut axis) = (f64::NEG_INFINITY, f64::INFINITY, 0);
    for a in 0..3 {
        if direction[a] == 0.0 {
            if origin[a].abs() > half[a] {
                return None;
            }
            continue;
        }
        let inverse = 1.0 / direction[a];
        let reach = half[a] * inverse.abs();
        let middle = -origin[a] * inverse;
        if middle - reach > enter {
            (enter, axis) = (middle - reach, a);
        }
        leave = leave.min(middle + reach);
    }
    if enter > leave || enter <= 0.0 {
        return None;
    }
    let sign = -direction[axis].signum();
    let mut point = origin + direction * enter;
    point[axis] = sign * half[axis];
    let face = 2 * axis as u8 + u8::from(sign > 0.0);
    Some((enter, SurfacePoint { point, normal: axis_vector(axis, sign), face }))
}

fn cast_cylinder(
    radius: f64,
    half: f64,
    origin: &Vec3,
    direction: &Vec3,
) -> Option<(f64, SurfacePoint)> {
    // Between the planes of the ends.
    let (mut enter, mut leave, mut end) = (f64::NEG_INFINITY, f64::INFINITY, false);
    if direction.z == 0.0 {
        if origin.z.abs() > half {
            return None;
        }
    } else {
        let (reach, middle) = (half / direction.z.abs(), -origin.z / direction.z);
        (enter, leave, end) = (middle - reach, middle + reach, true);
    }
    // Within the infinite cylinder.
    let a = direction.x * direction.x + direction.y * direction.y;
    let c = origin.x * origin.x + origin.y * origin.y;
    if a == 0.0 {
        if c > radius * radius {
            return None;
        }
    } else {
        let middle = -(origin.x * direction.x + origin.y * direction.y) / a;
        let (x, y) = (origin.x + middle * direction.x, origin.y + middle * direction.y);
        let inside = (radius * radius - x * x - y * y) / a;
        if inside < 0.0 {
            return None;
        }
        let reach = inside.sqrt();
        if middle - reach > enter {
            (enter, end) = (middle - reach, false);
        }
        leave = leave.min(middle + reach);
    }
    if enter > leave || enter <= 0.0 {
        return None;
    }
    let mut point = origin + direction * enter;
    let (normal, face) = if end {
        let sign = -direction.z.signum();
        point.z = sign * half;
        (Vec3::new(0.0, 0.0, sign), 1 + u8::from(sign > 0.0))
    } else {
        let normal = Vec3::new(point.x, point.y, 0.0).normalize();
        (point.x, point.y) = (normal.x * radius, normal.y * radius);
        (normal, 0)
    };
    Some((enter, SurfacePoint { point, normal, face }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64, z: f64) -> Vec3 {
        Vec3::new(x, y, z)
    }

    fn shapes() -> [Shape; 3] {
        [Shape::Cuboid(v(1.0, 2.0, 3.0)), Shape::Cylinder(2.0, 1.0), Shape::Sphere(2.0)]
    }

    #[test]
    fn rays_meet_the_faces_where_a_hand_calculation_puts_them() {
        let [cuboid, cylinder, sphere] = shapes();
        let (t, hit) = cuboid.cast(&v(5.0, 1.0, 1.0), &v(-1.0, 0.0, 0.0)).unwrap();
        assert_eq!((t, hit.point, hit.face), (4.0, v(1.0, 1.0, 1.0), 1));
        assert_eq!(cuboid.cast(&v(5.0, 2.5, 1.0), &v(-1.0, 0.0, 0.0)), None);
        assert_eq!(cuboid.cast(&v(0.0, 0.0, 0.0), &v(1.0, 0.0, 0.0)), None);
        assert_eq!(cuboid.cast(&v(5.0, 1.0, 1.0), &v(1.0, 0.0, 0.0)), None);

        // Side: x = -3 + 0.8 t, y = 1.2: x^2 + y^2 = 4 at x = -1.6.
        let (t, hit) = cylinder.cast(&v(-3.2, 1.2, 0.0), &v(0.8, 0.0, 0.0)).unwrap();
        assert!((t - 2.0).abs() < 1e-12 && (hit.point - v(-1.6, 1.2, 0.0)).norm() < 1e-12);
        assert!((hit.normal - v(-0.8, 0.6, 0.0)).norm() < 1e-12);
        let (t, hit) = cylinder.cast(&v(1.0, 0.0, 4.0), &v(0.0, 0.0, -1.0)).unwrap();
        assert_eq!((t, hit.point, hit.face), (3.0, v(1.0, 0.0, 1.0), 2));
        assert_eq!(cylinder.cast(&v(2.5, 0.0, 4.0), &v(0.0, 0.0, -1.0)), None);

        let (t, hit) = sphere.cast(&v(1.2, 0.0, -5.0), &v(0.0, 0.0, 1.0)).unwrap();
        assert!((t - 3.4).abs() < 1e-12 && (hit.normal - v(0.6, 0.0, -0.8)).norm() < 1e-12);
    }

    #[test]
    fn signed_distances_are_those_of_a_hand_calculation() {
        let [cuboid, cylinder, sphere] = shapes();
        assert_eq!(cuboid.closest(&v(4.0, 6.0, 0.0)).0, 5.0);
        assert_eq!(cuboid.closest(&v(0.75, 0.0, 0.0)).0, -0.25);
        assert_eq!(cylinder.closest(&v(0.0, 5.0, 5.0)).0, 5.0);
        assert_eq!(cylinder.closest(&v(0.0, 0.0, 0.5)).0, -0.5);
        assert_eq!(cylinder.closest(&v(0.0, 1.75, 0.0)).0, -0.25);
        assert_eq!(sphere.closest(&v(0.0, 3.0, 4.0)).0, 3.0);
        assert_eq!(sphere.closest(&v(0.0, 0.0, 0.0)).0, -2.0);
    }

    /// Points on a lattice that no symmetry of the shapes favours.
    fn lattice() -> impl Iterator<Item = Vec3> {
        (0..1000).map(|i| {
            let f = |k: f64| (f64::from(i) * k).fract() * 8.0 - 4.0;
            v(f(0.618_034), f(0.754_878), f(0.569_840))
        })
    }

    #[test]
    fn the_nearest_point_over_all_cells_is_the_nearest_point_of_the_surface() {
        for shape in &shapes()[..2] {
            for p in lattice() {
                let (distance, nearest) = shape.closest(&p);
                assert!(((p - nearest.point).norm() - distance.abs()).abs() < 1e-12);
                let over_cells = (0..shape.faces())
                    .flat_map(|face| shape.cells(face))
                    .map(|c| (shape.at(c.face, shape.closest_in_cell(&c, &p)).point - p).norm())
                    .fold(f64::INFINITY, f64::min);
                assert!((over_cells - distance.abs()).abs() < 1e-9, "{shape:?} {p:?}");
            }
        }
    }

    #[test]
    fn rays_end_on_the_surface_and_face_their_normal() {
        for shape in shapes() {
            let mut hits = 0;
            for (p, q) in lattice().zip(lattice().skip(7)) {
                if let Some((t, hit)) = shape.cast(&p, &(q - p)) {
                    hits += 1;
                    assert!((p + (q - p) * t - hit.point).norm() < 1e-9);
                    assert!(shape.closest(&hit.point).0.abs() < 1e-12);
                    assert!(hit.normal.dot(&(q - p)) < 0.0);
                    assert!((hit.normal.norm() - 1.0).abs() < 1e-12);
                }
            }
            assert!(hits > 100);
        }
    }
}
