//! Growing neural gas.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet::gas::{self, GasModel, GasOptions};
use surfabet::{CloudParts, DecodeOptions, PointCloud, Progress, Silent, Viewpoints};
use surfabet_models::Result;

use super::Scene;

/// `n` points on a sphere of radius 1 with colours by hemisphere, seen from its centre or with nothing known of the
/// side.
pub fn sphere(n: usize, seen: bool, seed: u64) -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut parts = CloudParts::default();
    let mut colors = Vec::new();
    while parts.positions.len() < n {
        let p: [f32; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let r = p.iter().map(|c| c * c).sum::<f32>().sqrt();
        if r > 0.1 && r < 1.0 {
            let p = p.map(|c| c / r);
            parts.positions.push(p);
            colors.push(if p[2] > 0.0 { [240, 40, 40] } else { [20, 60, 220] });
        }
    }
    parts.colors = Some(colors);
    if seen {
        parts.viewpoints = Some(Viewpoints { origins: vec![[0.0; 3]], index: vec![0; n] });
    }
    PointCloud::from_parts(parts).unwrap().0
}

impl Scene for GasModel {
    const ANY_ORDER: bool = false;

    /// A sphere with colours and intensities at an odd place, and a few points apart from it.
    fn cloud() -> PointCloud {
        let mut parts = sphere(2000, true, 14).into_parts();
        parts.origin = [10.0, -20.0, 5.0];
        parts.intensities = Some(parts.positions.iter().map(|p| 50.0 + 30.0 * p[1]).collect());
        parts.positions.iter_mut().step_by(5).for_each(|p| p[0] += 10.0);
        PointCloud::from_parts(parts).unwrap().0
    }

    fn learn(cloud: &PointCloud, progress: &dyn Progress) -> Result<Self> {
        let options =
            GasOptions { n_neurons: Some(60), patterns: Some(100), ..GasOptions::default() };
        gas::learn(cloud, &options, progress)
    }

    /// A line per neuron, position in the world (metres), normal, colour and sizes; then one per edge.
    fn listing(&self) -> String {
        let cloud = self.decode(DecodeOptions::default(), &Silent).unwrap();
        let colors = self.colors().unwrap();
        let neuron = |i: usize| {
            let ([x, y, z], [u, v, w], [r, g, b]) = (cloud.world(i), self.normal(i), colors[i]);
            let (count, radius, thickness) = (self.count(i), self.radius(i), self.thickness(i));
            format!(
                "{x:.7} {y:.7} {z:.7} {u:.6} {v:.6} {w:.6} {r} {g} {b} {count:.4} {radius:.7} {thickness:.7}\n"
            )
        };
        let edges = self.edges().iter().map(|[a, b]| format!("{a} {b}\n"));
        (0..self.len()).map(neuron).chain(edges).collect()
    }

    /// The last digit that is written may differ.
    fn tolerance(_: usize, value: f64) -> f64 {
        1e-6 * value.abs().max(1.0)
    }
}
