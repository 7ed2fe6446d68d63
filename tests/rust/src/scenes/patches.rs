//! Patches on a lattice.

use surfabet::patches::{self, PatchModel, PatchesOptions};
use surfabet::{CloudParts, DecodeOptions, PointCloud, Progress, Silent};
use surfabet_models::Result;

use super::Scene;

impl Scene for PatchModel {
    const ANY_ORDER: bool = false;

    /// A bumpy square of 0.3 m with colours, intensities, labels and times, and a stray point.
    fn cloud() -> PointCloud {
        let mut parts = CloudParts { origin: [10.0, -20.0, 5.0], ..CloudParts::default() };
        let (mut colors, mut intensities) = (Vec::new(), Vec::new());
        let (mut labels, mut times) = (Vec::new(), Vec::new());
        for i in 0..3600 {
            let (x, y) = ((i % 60) as f32 * 0.005, (i / 60) as f32 * 0.005);
            parts.positions.push([x, y, 0.02 * (20.0 * x).sin() * (15.0 * y).cos()]);
            colors.push(if i % 60 / 15 % 2 == 0 { [220, 40, 30] } else { [20, 90, 200] });
            intensities.push(if i % 60 < 30 { 100.0 } else { 100.0 + 5.0 * x });
            labels.push(if i / 60 < 20 { 2_u8 } else { 6 });
            times.push(3e8 + f64::from(i));
        }
        // Too few and too near to be worth a patch, too far for the bound.
        parts.positions.push([0.1, 0.1, 0.05]);
        colors.push([1, 2, 3]);
        intensities.push(250.0);
        labels.push(18);
        times.push(3e8);
        parts.colors = Some(colors);
        parts.intensities = Some(intensities);
        parts.extra = vec![
            ("classification".to_owned(), labels.into()),
            ("gps_time".to_owned(), times.into()),
        ];
        PointCloud::from_parts(parts).unwrap().0
    }

    fn learn(cloud: &PointCloud, progress: &dyn Progress) -> Result<Self> {
        let names = ["colors", "intensities", "classification", "gps_time"];
        let options = PatchesOptions {
            max_error: Some(0.01),
            max_error_forward: Some(0.03),
            color_step: 20,
            attributes: Some(names.map(str::to_owned).into()),
            ..PatchesOptions::default()
        };
        patches::learn(cloud, &options, progress)
    }

    /// One line per point as measured, at 1 cm: position in the world, metres, and colour.
    fn listing(&self) -> String {
        let options =
            DecodeOptions { resolution: Some(0.01), as_measured: true, ..DecodeOptions::default() };
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
