//! The scene that is searched, and motions in it.

use surfabet_geom::KdTree;

use crate::recognition::surface::Surface;

/// The samples of a scene.
pub(super) struct Place<'a> {
    pub surface: &'a Surface,
    pub tree: &'a KdTree,
    pub pieces: &'a [u32],
    pub sizes: &'a [u32],
}

impl Place<'_> {
    /// Samples of the i-th sample's piece.
    pub fn size(&self, i: usize) -> f64 {
        f64::from(self.sizes[self.pieces[i] as usize])
    }

    /// The root of the share of its piece that lies among `samples`, per sample.
    pub fn shares(&self, samples: &[u32]) -> Vec<f64> {
        let mut pieces: Vec<u32> = samples.iter().map(|&i| self.pieces[i as usize]).collect();
        pieces.sort_unstable();
        let share = |&i: &u32| {
            let piece = self.pieces[i as usize];
            let n =
                pieces.partition_point(|&p| p <= piece) - pieces.partition_point(|&p| p < piece);
            (n as f64 / f64::from(self.sizes[piece as usize])).sqrt()
        };
        samples.iter().map(share).collect()
    }
}

/// A turn about the vertical through the template's pivot, then a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    pub yaw: f64,
    pub shift: [f64; 3],
}

impl Motion {
    pub fn turned(&self, p: [f32; 3]) -> [f64; 3] {
        let (s, c) = self.yaw.sin_cos();
        let [x, y, z] = p.map(f64::from);
        [c * x - s * y, s * x + c * y, z]
    }
}
