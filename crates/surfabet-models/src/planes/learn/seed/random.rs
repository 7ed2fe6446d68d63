//! Patches anywhere, as the paper starts (section III).

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::planes::constants::{RANDOM_SIDE, RANDOM_TILES};
use crate::planes::patch::{Frame, Patch};
use crate::planes::points::Points;
use crate::planes::tiles::Tiles;

/// `n` squares at points of the cloud, of half its extent, turned at random.
pub(in crate::planes) fn random(points: &Points, n: usize, random_state: u64) -> Vec<Patch> {
    let mut rng = ChaCha8Rng::seed_from_u64(random_state);
    let side = RANDOM_SIDE * points.extent().max(points.cell);
    (0..n)
        .map(|_| {
            let center = points.positions[rng.random_range(0..points.len())].map(f64::from);
            let frame = Frame::with_normal(center, direction(&mut rng));
            let mut tiles = Tiles::new([-0.5 * side; 2], [side; 2], side / RANDOM_TILES);
            tiles.support(vec![true; tiles.supported().len()]);
            Patch::bare(frame, tiles)
        })
        .collect()
}

/// A unit vector, uniform over the sphere.
fn direction(rng: &mut impl Rng) -> [f64; 3] {
    let z: f64 = rng.random_range(-1.0..=1.0);
    let angle = rng.random_range(0.0..std::f64::consts::TAU);
    let r = (1.0 - z * z).sqrt();
    [r * angle.cos(), r * angle.sin(), z]
}
