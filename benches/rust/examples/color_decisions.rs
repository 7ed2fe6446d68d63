//! Writes the decisions of the colours and scalars of models of `learn_patches`, each with the inputs of its estimate, for
//! benches/papers/color_estimates.py: `color_decisions MODEL.sfb DECISIONS`, in pairs.

use std::error::Error;

use surfabet_codec::{Container, Limits, read};
use surfabet_models::patches::{PatchModel, field_decisions};

/// The decisions of one file.
fn decisions(file: &[u8]) -> Result<Vec<u8>, Box<dyn Error + Send + Sync>> {
    let limits = Limits::default();
    read::<PatchModel>(&Container::parse(file, &limits)?, &limits, None)?;
    Ok(field_decisions())
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    // Decisions are recorded by thread.
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    for pair in paths.chunks_exact(2) {
        let file = std::fs::read(&pair[0])?;
        std::fs::write(&pair[1], one.install(|| decisions(&file))?)?;
    }
    Ok(())
}
