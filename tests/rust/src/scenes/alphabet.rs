//! Alphabets by description length.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet::alphabet::{self, Alphabet, AlphabetModel, AlphabetOptions};
use surfabet::{CloudParts, PointCloud, Progress, Viewpoints};
use surfabet_models::Result;

use super::{Scene, SharesVocabulary};

/// A wall with openings of one shape at irregular places, a point every 15 mm, seen from in front.
pub fn windows(seed: u64, n: usize) -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let places: Vec<[f32; 2]> = (0..n)
        .map(|k| [k as f32 * 0.9 + rng.random_range(0.1..0.4), rng.random_range(0.2..0.6)])
        .collect();
    let mut positions = Vec::new();
    for i in 0..n as i32 * 60 + 10 {
        for j in 0..90 {
            let p = [i as f32 * 0.015, j as f32 * 0.015];
            let inside = |w: &[f32; 2]| (0..2).all(|a| (0.0..0.4).contains(&(p[a] - w[a])));
            if !places.iter().any(inside) {
                positions.push([p[0], 3.0, p[1]]);
            }
        }
    }
    let viewpoints =
        Viewpoints { origins: vec![[n as f64 * 0.45, 0.0, 0.7]], index: vec![0; positions.len()] };
    let parts = CloudParts { positions, viewpoints: Some(viewpoints), ..CloudParts::default() };
    PointCloud::from_parts(parts).unwrap().0
}

fn options() -> AlphabetOptions {
    let angular_resolution = Some(0.005_f64.to_degrees());
    AlphabetOptions { angular_resolution, noise: Some(0.0), ..AlphabetOptions::default() }
}

impl Scene for AlphabetModel {
    const ANY_ORDER: bool = true;

    /// A few windows with colour.
    fn cloud() -> PointCloud {
        let mut parts = windows(1, 6).into_parts();
        parts.origin = [10.0, -20.0, 5.0];
        let color = |p: &[f32; 3]| [(p[0] * 30.0) as u8, 120, (p[2] * 100.0) as u8];
        parts.colors = Some(parts.positions.iter().map(color).collect());
        parts.viewpoints.as_mut().unwrap().origins = vec![[13.0, -20.0, 5.7]];
        PointCloud::from_parts(parts).unwrap().0
    }

    fn learn(cloud: &PointCloud, progress: &dyn Progress) -> Result<Self> {
        alphabet::learn(cloud, &options(), progress)
    }

    /// One line per occurrence: word, radius, centre and normal, metres in the world, and colour.
    fn listing(&self) -> String {
        let text = |values: &[f64], digits: usize| {
            values.iter().map(|v| format!("{:.digits$}", v + 0.0)).collect::<Vec<_>>().join(" ")
        };
        let colors = self.colors().unwrap();
        let rows = self.occurrences().zip(colors).map(|(o, color)| {
            let [center, normal] = [text(&o.center, 6), text(&o.rows[2], 3)];
            format!("{} {} {center} {normal} {color:?}\n", o.word, o.radius)
        });
        rows.collect()
    }

    /// In double precision, written to the micrometre and the thousandth: nothing may differ.
    fn tolerance(_: usize, _: f64) -> f64 {
        0.0
    }
}

impl SharesVocabulary for AlphabetModel {
    fn describe(cloud: &PointCloud, alphabet: &Alphabet, progress: &dyn Progress) -> Result<Self> {
        alphabet::describe(cloud, alphabet, &options(), progress)
    }
}
