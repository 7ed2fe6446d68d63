//! Placing models as instances, and making a scene of them.

use super::surfaces::surfaces_of;
use super::{Instance, Model, Scene, Solid, to_array};
use crate::bvh::Hierarchy;
use crate::pose::{Frame, Vec3, pose_of};
use crate::solid::Shape;

/// Collects instances and their solids.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    solids: Vec<Solid>,
    instances: Vec<Instance>,
    frames: Vec<Frame>,
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

/// Bounding box of a shape in a frame.
pub(super) fn bounds_of(shape: &Shape, frame: &Frame) -> (Vec3, Vec3) {
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

/// The box around boxes.
fn union_bounds(boxes: impl Iterator<Item = (Vec3, Vec3)>) -> ([f64; 3], [f64; 3]) {
    let start = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
    let (low, high) = boxes.fold(start, |(low, high), (l, h)| (low.inf(&l), high.sup(&h)));
    (to_array(&low), to_array(&high))
}
