//! Learns a model of the corner of a room by each method and writes the files: `every_method OUT_DIR`.
//!
//! `scripts/check_portable.sh` compares the files of builds for different processors.

use std::path::Path;

use surfabet::{
    AlphabetOptions, BicAlphabetOptions, CloudParts, GasOptions, HscsmOptions, Model,
    PatchesOptions, PlanesOptions, PointCloud, Silent, Viewpoints, alphabet, bic_alphabet, gas,
    geom, hscsm, patches, planes,
};

/// Edge of the corner, metres.
const SIZE: f64 = 1.5;
/// Spacing of the points, metres.
const SPACING: f64 = 0.0125;

/// A number from -1 to 1 for every seed (SplitMix64).
fn noise(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A floor and two walls with 3 mm of noise, on each of them nine humps that recur, striped in colour.
fn corner() -> Result<PointCloud, geom::Error> {
    let mut parts = CloudParts::default();
    let mut colors = Vec::new();
    let steps = (SIZE / SPACING) as u64;
    for i in 0..3 * steps * steps {
        let (side, cell) = (i / (steps * steps), i % (steps * steps));
        let u = (cell % steps) as f64 * SPACING + 0.004 * noise(4 * i);
        let v = (cell / steps) as f64 * SPACING + 0.004 * noise(4 * i + 1);
        let from_hump = |t: f64| (t.rem_euclid(0.5) - 0.25) / 0.12;
        let away = from_hump(u).powi(2) + from_hump(v).powi(2);
        let height = 0.05 * (1.0 - away).max(0.0) + 0.003 * noise(4 * i + 2);
        let [u, v, height] = [u, v, height].map(|c| c as f32);
        parts.positions.push(match side {
            0 => [u, v, height],
            1 => [height, u, v],
            _ => [u, height, v],
        });
        let shade = (20.0 * noise(4 * i + 3)) as i16;
        let stripe =
            if ((cell % steps) / 16).is_multiple_of(2) { [200, 90, 60] } else { [60, 110, 180] };
        colors.push(stripe.map(|c: i16| (c + shade) as u8));
    }
    parts.colors = Some(colors);
    let index = vec![0; parts.positions.len()];
    parts.viewpoints = Some(Viewpoints { origins: vec![[SIZE; 3]], index });
    Ok(PointCloud::from_parts(parts)?.0)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let directory = std::env::args().nth(1).ok_or("usage: every_method OUT_DIR")?;
    let directory = Path::new(&directory);
    std::fs::create_dir_all(directory)?;
    let cloud = corner()?;
    let save = |name: &str, model: Model| model.save(directory.join(name));

    let gas_options = GasOptions { n_neurons: Some(2000), ..GasOptions::default() };
    let bic_options = BicAlphabetOptions { radius: Some(0.3), ..BicAlphabetOptions::default() };
    save("patches.sfb", patches::learn(&cloud, &PatchesOptions::default(), &Silent)?.into())?;
    save("hscsm.sfb", hscsm::learn(&cloud, &HscsmOptions::default(), &Silent)?.into())?;
    save("alphabet.sfb", alphabet::learn(&cloud, &AlphabetOptions::default(), &Silent)?.into())?;
    save("bic_alphabet.sfb", bic_alphabet::learn(&cloud, &bic_options, &Silent)?.into())?;
    save("planes.sfb", planes::learn(&cloud, None, &PlanesOptions::default(), &Silent)?.into())?;
    save("gas.sfb", gas::learn(&cloud, &gas_options, &Silent)?.into())?;
    Ok(())
}
