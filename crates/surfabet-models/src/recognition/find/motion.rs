//! Motions of the example: scenes are upright, so a turn about the vertical and a shift.

/// A turn about the vertical through the template's pivot, then a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    pub yaw: f64,
    pub shift: [f64; 3],
}

impl Motion {
    /// The motion that leaves the example where it is.
    pub const NONE: Self = Self { yaw: 0.0, shift: [0.0; 3] };

    /// A vector turned.
    pub fn turned(&self, p: [f32; 3]) -> [f64; 3] {
        let (s, c) = self.yaw.sin_cos();
        let [x, y, z] = p.map(f64::from);
        [c * x - s * y, s * x + c * y, z]
    }

    /// The turn back, without a shift.
    pub fn turn_back(&self) -> Self {
        Self { yaw: -self.yaw, shift: [0.0; 3] }
    }
}
