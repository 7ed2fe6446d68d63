//! Sparse-coded surface patches.

use surfabet::hscsm::{self, HscsmDictionary, HscsmModel, HscsmOptions};
use surfabet::{CloudParts, DecodeOptions, PointCloud, Progress, Silent};
use surfabet_models::Result;

use super::{Scene, SharesVocabulary};

fn options() -> HscsmOptions {
    HscsmOptions {
        resolution: Some(0.02),
        patch_pixels: 6,
        depth_atoms: Some(4),
        color_atoms: Some(4),
        iterations: 2,
        ..HscsmOptions::default()
    }
}

impl Scene for HscsmModel {
    const ANY_ORDER: bool = false;

    /// A striped dome of 0.3 m: a few patches with depth and colour codes.
    fn cloud() -> PointCloud {
        let mut parts = CloudParts { origin: [10.0, -20.0, 5.0], ..CloudParts::default() };
        let mut colors = Vec::new();
        for i in 0..900 {
            let (x, y) = ((i % 30) as f32 * 0.01, (i / 30) as f32 * 0.01);
            let (dx, dy) = (x - 0.15, y - 0.15);
            parts.positions.push([x, y, -4.0 * (dx * dx + dy * dy)]);
            let stripe = i % 30 / 3 % 2 == 0;
            colors.push(if stripe { [220, 40, 30] } else { [20, 90, 200] });
        }
        parts.colors = Some(colors);
        PointCloud::from_parts(parts).unwrap().0
    }

    fn learn(cloud: &PointCloud, progress: &dyn Progress) -> Result<Self> {
        hscsm::learn(cloud, &options(), progress)
    }

    /// One line per point at 4 cm: position in the world, metres, and colour.
    fn listing(&self) -> String {
        let options = DecodeOptions { resolution: Some(0.04), ..DecodeOptions::default() };
        let cloud = self.decode(options, &Silent).unwrap();
        let colors = cloud.colors().unwrap();
        let line = |i: usize| {
            let ([x, y, z], [r, g, b]) = (cloud.world(i), colors[i]);
            format!("{x:.7} {y:.7} {z:.7} {r} {g} {b}\n")
        };
        (0..cloud.len()).map(line).collect()
    }

    /// The last step of a position in single precision may differ; a colour may round the other way.
    fn tolerance(column: usize, _: f64) -> f64 {
        if column < 3 { 1e-6 } else { 1.0 }
    }
}

impl SharesVocabulary for HscsmModel {
    fn describe(
        cloud: &PointCloud,
        dictionary: &HscsmDictionary,
        progress: &dyn Progress,
    ) -> Result<Self> {
        hscsm::describe(cloud, &options(), dictionary, progress)
    }
}
