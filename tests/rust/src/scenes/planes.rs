//! Planes.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet::planes::{self, PlaneModel, PlanesOptions};
use surfabet::{CloudParts, PointCloud, Progress, Viewpoints};
use surfabet_models::Result;

use super::Scene;

/// `n` points on the faces of a box of 3 x 2 x 1.5 m seen from within, with 5 mm of noise and a colour per direction.
pub fn room(n: usize, seed: u64) -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = rand_distr::Normal::new(0.0_f32, 0.005).unwrap();
    let size = [3.0_f32, 2.0, 1.5];
    let area = |face: usize| size[(face + 1) % 3] * size[(face + 2) % 3];
    let mut parts = CloudParts::default();
    let mut colors = Vec::new();
    for _ in 0..n {
        // Faces in proportion to their areas.
        let mut at = rng.random_range(0.0..2.0 * (area(0) + area(1) + area(2)));
        let mut face = 0;
        while face < 5 && at > area(face % 3) {
            at -= area(face % 3);
            face += 1;
        }
        let axis = face % 3;
        let mut p: [f32; 3] = std::array::from_fn(|a| rng.random_range(0.0..size[a]));
        p[axis] = if face < 3 { 0.0 } else { size[axis] } + rng.sample(noise);
        parts.positions.push(p);
        colors.push([[200, 60, 40], [40, 180, 60], [60, 60, 200]][axis]);
    }
    parts.colors = Some(colors);
    parts.viewpoints = Some(Viewpoints { origins: vec![[1.5, 1.0, 0.7]], index: vec![0; n] });
    PointCloud::from_parts(parts).unwrap().0
}

impl Scene for PlaneModel {
    const ANY_ORDER: bool = true;

    /// Faces of a box with colours and intensities at an odd place.
    fn cloud() -> PointCloud {
        let mut parts = room(3000, 7).into_parts();
        parts.origin = [10.0, -20.0, 5.0];
        parts.viewpoints.as_mut().unwrap().origins[0] = [11.5, -19.0, 5.7];
        parts.intensities = Some(parts.positions.iter().map(|p| 0.1 * p[0] + p[2]).collect());
        PointCloud::from_parts(parts).unwrap().0
    }

    fn learn(cloud: &PointCloud, progress: &dyn Progress) -> Result<Self> {
        planes::learn(cloud, None, &PlanesOptions::default(), progress)
    }

    /// A line per patch: numbers of tiles and points, standard deviation, side of a tile; then one per corner of its
    /// polygons, in the world (metres), and one per colour.
    fn listing(&self) -> String {
        let patch = |i: usize| {
            let patch = &self.patches()[i];
            let tiles = &patch.tiles;
            let sizes = format!(
                "{} {:.4} {:.7} {:.7}\n",
                tiles.n_supported(),
                self.count(i),
                patch.standard_deviation,
                tiles.edge()
            );
            let corners = self.polygons(i).into_iter().flatten();
            let corners = corners.map(|[x, y, z]| format!("{x:.6} {y:.6} {z:.6}\n"));
            let colors = self.colors(i).into_iter().map(|[r, g, b]| format!("{r} {g} {b}\n"));
            sizes + &corners.chain(colors).collect::<String>()
        };
        (0..self.len()).map(patch).collect()
    }

    /// The last digit that is written may differ.
    fn tolerance(_: usize, value: f64) -> f64 {
        2e-6 * value.abs().max(1.0)
    }
}
