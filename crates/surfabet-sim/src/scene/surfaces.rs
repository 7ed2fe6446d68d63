//! Smooth pieces of surface: coplanar faces of one instance that touch are one piece.

use super::builder::bounds_of;
use super::{LIFT, Solid, Surface, SurfaceKind, to_array};
use crate::pose::{Frame, Vec3};
use crate::solid::Shape;

/// Largest difference of normals and offsets of coplanar faces.
const COPLANAR: f64 = 1e-9;

/// The smooth pieces of surface, and for every face of every solid its row among them. The solids of an instance come
/// one after the other; `inverses` lead from the world to the frames of the instances.
pub(super) fn surfaces_of(solids: &[Solid], inverses: &[Frame]) -> (Vec<Surface>, Vec<[u32; 6]>) {
    let mut pieces = Pieces(Vec::new());
    let mut piece_of_face = vec![[0_usize; 6]; solids.len()];
    let mut first_of_instance = (u32::MAX, 0);
    for (s, solid) in solids.iter().enumerate() {
        if first_of_instance.0 != solid.instance {
            first_of_instance = (solid.instance, pieces.0.len());
        }
        let inverse = &inverses[solid.instance as usize];
        for face in 0..solid.shape.faces() {
            piece_of_face[s][usize::from(face)] = pieces.0.len();
            pieces.add(solid, face, inverse, first_of_instance.1);
        }
    }
    let (surfaces, number) = pieces.numbered();
    let table = piece_of_face.iter().map(|faces| faces.map(|p| number[p])).collect();
    (surfaces, table)
}

/// A face of a solid.
struct Piece {
    surface: Surface,
    /// The box of its solid in the frame of the instance.
    bounds: (Vec3, Vec3),
    /// Itself, or a piece before it that it is one with.
    root: usize,
}

impl Piece {
    /// True for plane faces in one plane whose solids touch. Most solids are aligned with their instance, where their
    /// boxes are exact.
    fn continues(&self, other: &Self) -> bool {
        let coplanar = self.surface.kind == SurfaceKind::Plane
            && other.surface.kind == SurfaceKind::Plane
            && (Vec3::from(self.surface.direction) - Vec3::from(other.surface.direction)).amax()
                < COPLANAR
            && (self.surface.offset - other.surface.offset).abs() < COPLANAR;
        coplanar
            && (0..3).all(|a| {
                self.bounds.0[a] <= other.bounds.1[a] + LIFT
                    && other.bounds.0[a] <= self.bounds.1[a] + LIFT
            })
    }
}

/// All faces, as a forest of those that are one.
struct Pieces(Vec<Piece>);

impl Pieces {
    /// Adds a face, and joins it to those from piece `first` on that it continues.
    fn add(&mut self, solid: &Solid, face: u8, inverse: &Frame, first: usize) {
        let index = self.0.len();
        let bounds = bounds_of(&solid.shape, &(inverse * solid.frame));
        self.0.push(Piece { surface: surface(solid, face), bounds, root: index });
        for other in first..index {
            if self.0[other].continues(&self.0[index]) {
                let (a, b) = (self.root(other), self.root(index));
                // The lower number stays the root, so that numbering follows the solids.
                self.0[a.max(b)].root = a.min(b);
            }
        }
    }

    fn root(&self, mut i: usize) -> usize {
        while self.0[i].root != i {
            i = self.0[i].root;
        }
        i
    }

    /// The surfaces of the roots, and for each piece the number of its surface.
    fn numbered(&self) -> (Vec<Surface>, Vec<u32>) {
        let mut number = vec![0_u32; self.0.len()];
        let mut surfaces = Vec::new();
        for i in 0..self.0.len() {
            let root = self.root(i);
            if root == i {
                number[i] = surfaces.len() as u32;
                surfaces.push(self.0[i].surface);
            } else {
                number[i] = number[root];
            }
        }
        (surfaces, number)
    }
}

/// The plane, cylinder or sphere that a face lies on.
fn surface(solid: &Solid, face: u8) -> Surface {
    let (kind, direction, offset) = match (solid.shape.plane_normal(face), solid.shape) {
        (Some(normal), _) => {
            let normal = solid.frame.rotation * normal;
            let on = solid.frame * nalgebra::Point3::from(solid.shape.at(face, [0.0; 2]).point);
            (SurfaceKind::Plane, normal, normal.dot(&on.coords))
        }
        (None, Shape::Sphere(_)) => (SurfaceKind::Sphere, Vec3::zeros(), 0.0),
        (None, _) => (SurfaceKind::Cylinder, solid.frame.rotation * Vec3::z(), 0.0),
    };
    Surface { kind, instance: solid.instance, direction: to_array(&direction), offset }
}
