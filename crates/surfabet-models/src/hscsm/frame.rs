//! The pose T of a patch, quantised before anything is measured in it.
//!
//! The z-axis is the surface normal. The x- and y-axes come from the two global axes that have the larger angle
//! to the normal, made orthogonal to it (section III-A), so a position and a normal are all there is to store.

use surfabet_geom::octahedral;

use crate::vector::{add_scaled, cross, dot, minus};

/// Bits per octahedral coordinate of a normal: at most 1.3 degrees off, so 0.9 mm at the rim of an 8 cm patch, which the depth image then measures away.
pub const NORMAL_BITS: u32 = 7;

/// A pose as the file stores it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct PatchPose {
    /// Centre, in steps of the position lattice from the model's origin.
    pub position: [i32; 3],
    /// Octahedral code of the normal.
    pub normal: [i16; 2],
}

/// A pose in numbers to compute with: centre and axes relative to the model's origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Centre of the patch, metres.
    pub center: [f32; 3],
    /// Direction of growing columns.
    pub x: [f32; 3],
    /// Direction of growing rows.
    pub y: [f32; 3],
    /// Normal: direction of growing depth.
    pub z: [f32; 3],
}

impl PatchPose {
    /// The nearest storable pose to a centre and a unit normal.
    pub fn quantize(center: [f32; 3], normal: [f32; 3], position_step: f32) -> Self {
        Self {
            position: center.map(|c| (c / position_step).round() as i32),
            normal: octahedral::encode(normal, NORMAL_BITS).map(|c| c as i16),
        }
    }

    /// The frame that this pose stands for.
    pub fn frame(&self, position_step: f32) -> Frame {
        let center = self.position.map(|c| (f64::from(c) * f64::from(position_step)) as f32);
        let z = octahedral::decode(self.normal.map(i32::from), NORMAL_BITS);
        Frame::new(center, z)
    }
}

impl Frame {
    /// The frame about `center` with unit normal `z`.
    pub fn new(center: [f32; 3], z: [f32; 3]) -> Self {
        // Of the global axes nearest to the normal, the first one goes; ties break by axis order.
        let mut nearest = 0;
        for axis in 1..3 {
            if z[axis].abs() > z[nearest].abs() {
                nearest = axis;
            }
        }
        let first = if nearest == 0 { 1 } else { 0 };
        let mut global = [0.0; 3];
        global[first] = 1.0;
        let in_plane = add_scaled(global, -z[first], z);
        // |z[first]| is at most 1/sqrt(2), so the projection is at least 1/sqrt(2) long.
        let scale = 1.0 / dot(in_plane, in_plane).sqrt();
        let x = in_plane.map(|c| c * scale);
        Self { center, x, y: cross(z, x), z }
    }

    /// Coordinates of `point` in this frame: along x, y and the normal, metres.
    pub fn to_local(&self, point: [f32; 3]) -> [f32; 3] {
        let d = minus(point, self.center);
        [dot(d, self.x), dot(d, self.y), dot(d, self.z)]
    }

    /// The point at coordinates `local` of this frame.
    pub fn to_world(&self, local: [f32; 3]) -> [f32; 3] {
        let p = add_scaled(self.center, local[0], self.x);
        add_scaled(add_scaled(p, local[1], self.y), local[2], self.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_floor_patch_lies_along_the_global_axes() {
        let frame = Frame::new([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]);
        assert_eq!((frame.x, frame.y), ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]));
        assert_eq!(frame.to_local([1.5, 2.25, 2.0]), [0.5, 0.25, -1.0]);
    }

    proptest! {
        #[test]
        fn frames_are_right_handed_and_orthonormal(v in prop::array::uniform3(-1.0_f32..1.0)) {
            let length = dot(v, v).sqrt();
            prop_assume!(length > 1e-3);
            let f = Frame::new([0.0; 3], v.map(|c| c / length));
            for (a, b) in [(f.x, f.y), (f.y, f.z), (f.z, f.x)] {
                prop_assert!(dot(a, b).abs() < 1e-5);
            }
            prop_assert!((dot(cross(f.x, f.y), f.z) - 1.0).abs() < 1e-5);
        }

        #[test]
        fn local_coordinates_come_back(
            p in prop::array::uniform3(-5.0_f32..5.0),
            v in prop::array::uniform3(-1.0_f32..1.0),
        ) {
            let length = dot(v, v).sqrt();
            prop_assume!(length > 1e-3);
            let pose = PatchPose::quantize(p, v.map(|c| c / length), 0.0025);
            let frame = pose.frame(0.0025);
            let back = frame.to_world(frame.to_local(p));
            for axis in 0..3 {
                prop_assert!((back[axis] - p[axis]).abs() < 1e-5);
                prop_assert!((frame.center[axis] - p[axis]).abs() <= 0.001_251);
            }
        }
    }
}
