//! Motions of the example: scenes are upright, so a turn about the vertical and a shift; and, of another thing of its kind, other
//! sizes.

/// Sizes and a turn about the vertical through the template's pivot, then a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    pub yaw: f64,
    pub shift: [f64; 3],
    /// Factors of what is level and of what is upright.
    pub size: [f64; 2],
}

impl Motion {
    /// The motion that leaves the example where it is.
    pub const NONE: Self = Self { yaw: 0.0, shift: [0.0; 3], size: [1.0; 2] };

    /// A direction turned.
    pub fn turned(&self, p: [f32; 3]) -> [f64; 3] {
        turned(self.yaw, p.map(f64::from))
    }

    /// A direction turned back.
    pub fn turned_back(&self, p: [f32; 3]) -> [f64; 3] {
        turned(-self.yaw, p.map(f64::from))
    }

    /// An arm from the pivot, sized and turned.
    pub fn arm(&self, p: [f32; 3]) -> [f64; 3] {
        let [x, y, z] = p.map(f64::from);
        let [level, upright] = self.size;
        turned(self.yaw, [level * x, level * y, upright * z])
    }

    /// The arm of which `p` is made by [`Self::arm`].
    pub fn arm_back(&self, p: [f32; 3]) -> [f64; 3] {
        let [x, y, z] = self.turned_back(p);
        let [level, upright] = self.size;
        [x / level, y / level, z / upright]
    }
}

fn turned(yaw: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let (s, c) = yaw.sin_cos();
    [c * x - s * y, s * x + c * y, z]
}
