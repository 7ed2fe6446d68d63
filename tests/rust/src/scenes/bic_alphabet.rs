//! Alphabets by the Bayesian information criterion.

use surfabet::bic_alphabet::{self, BicAlphabet, BicAlphabetModel, BicAlphabetOptions};
use surfabet::{CloudParts, DecodeOptions, PointCloud, Progress, Silent, Upright, Viewpoints};
use surfabet_models::Result;

use super::{Scene, SharesVocabulary};

/// A step of 0.5 m with a dent.
pub fn step() -> PointCloud {
    let mut parts = CloudParts { origin: [10.0, -20.0, 5.0], ..CloudParts::default() };
    for i in 0..900 {
        let (x, y) = ((i % 30) as f32 * 0.017, (i / 30) as f32 * 0.017);
        let dent = 0.04 * (-((x - 0.2).powi(2) + (y - 0.3).powi(2)) / 0.004).exp();
        parts.positions.push(if i % 3 == 0 { [x, 0.0, y] } else { [x, y, -dent] });
    }
    let index = vec![0; parts.positions.len()];
    parts.viewpoints = Some(Viewpoints { origins: vec![[10.3, -19.4, 6.5]], index });
    PointCloud::from_parts(parts).unwrap().0
}

fn options() -> BicAlphabetOptions {
    BicAlphabetOptions {
        radius: Some(0.1),
        upright: Upright::WorldX,
        iterations: 20,
        ..BicAlphabetOptions::default()
    }
}

impl Scene for BicAlphabetModel {
    const ANY_ORDER: bool = true;

    fn cloud() -> PointCloud {
        step()
    }

    fn learn(cloud: &PointCloud, progress: &dyn Progress) -> Result<Self> {
        bic_alphabet::learn(cloud, &options(), progress)
    }

    /// One line per decoded point: position in the world, metres.
    fn listing(&self) -> String {
        let cloud = self.decode(DecodeOptions::default(), &Silent).unwrap();
        let line = |i: usize| {
            let [x, y, z] = cloud.world(i);
            format!("{x:.7} {y:.7} {z:.7}\n")
        };
        (0..cloud.len()).map(line).collect()
    }

    /// The last step of a position in single precision may differ.
    fn tolerance(_: usize, _: f64) -> f64 {
        1e-6
    }
}

impl SharesVocabulary for BicAlphabetModel {
    fn describe(
        cloud: &PointCloud,
        alphabet: &BicAlphabet,
        progress: &dyn Progress,
    ) -> Result<Self> {
        alphabet.describe(cloud, &options(), progress)
    }
}
