//! Which patches are left out, each with one of the motions.

use std::collections::BTreeMap;

use super::fit::{Prices, RepeatedPatch};
use crate::patches::constants::{INSTANCE_BITS, LEAST_OF_BEST, REMOVAL_ROUNDS, RUN_BITS};

/// Patches that are left out, by motion.
pub(super) struct Assigned {
    /// The motion that stands for each patch, and one more; 0 where it stays.
    pub of_leaves: Vec<u16>,
    /// The patches that each motion gives again, growing; empty where a motion is not used.
    pub sources: Vec<Vec<u32>>,
    /// Bits that are won in all.
    pub gain: f32,
}

/// What can be done without, and how.
struct Possible<'a> {
    prices: &'a Prices<'a>,
    /// Patches in the order of sources, each with the motions that may stand for it.
    of_leaves: Vec<(u32, Vec<(usize, &'a RepeatedPatch)>)>,
    /// Bits that each motion wins alone.
    totals: Vec<f32>,
}

/// Leaves patches out one after another in the order of sources; `fits` are those of each motion. What a patch is described by
/// comes before it, and stays.
///
/// A motion may win little and take away what a larger one needs. So each is tried to do without, those that win least first.
pub(super) fn assign(prices: &Prices<'_>, fits: &[Vec<RepeatedPatch>]) -> Assigned {
    let mut of_leaves: BTreeMap<u32, Vec<(usize, &RepeatedPatch)>> = BTreeMap::new();
    for (motion, of_motion) in fits.iter().enumerate() {
        for fit in of_motion {
            of_leaves.entry(fit.leaf).or_default().push((motion, fit));
        }
    }
    let mut of_leaves: Vec<_> = of_leaves.into_iter().collect();
    let order = |leaf: u32| prices.order[leaf as usize];
    of_leaves.sort_by(|a, b| order(a.0).total_cmp(&order(b.0)).then(a.0.cmp(&b.0)));
    let total = |of_motion: &Vec<RepeatedPatch>| of_motion.iter().map(|fit| fit.gain).sum();
    let totals: Vec<f32> = fits.iter().map(total).collect();
    let mut used: Vec<bool> = totals.iter().map(|&total| total > INSTANCE_BITS).collect();
    let possible = Possible { prices, of_leaves, totals };
    let mut best = possible.with(&used);
    let mut by_total: Vec<usize> = (0..used.len()).collect();
    by_total.sort_by(|&a, &b| possible.totals[a].total_cmp(&possible.totals[b]).then(b.cmp(&a)));
    for _ in 0..REMOVAL_ROUNDS {
        let before = best.gain;
        for &motion in &by_total {
            if !used[motion] {
                continue;
            }
            used[motion] = false;
            // What is not used is no loss.
            let is_used = !best.sources[motion].is_empty();
            let without = if is_used { possible.with(&used) } else { continue };
            match without.gain >= best.gain {
                true => best = without,
                false => used[motion] = true,
            }
        }
        if best.gain <= before {
            break;
        }
    }
    best
}

impl Possible<'_> {
    /// What is left out with these motions.
    fn with(&self, used: &[bool]) -> Assigned {
        let mut of_leaves = vec![0_u16; self.prices.bits.len()];
        let mut sources = vec![Vec::new(); used.len()];
        let mut gain = 0.0;
        for (leaf, fits) in &self.of_leaves {
            let before = self.prices.order[*leaf as usize];
            let is_there =
                |&s: &u32| of_leaves[s as usize] == 0 && self.prices.order[s as usize] < before;
            let possible = || {
                let of_leaf = fits.iter().filter(|(motion, _)| used[*motion]);
                of_leaf.filter(|(_, fit)| fit.sources.iter().all(is_there))
            };
            let most = possible().map(|(_, fit)| fit.gain).fold(0.0, f32::max);
            let good = possible().filter(|(_, fit)| fit.gain >= LEAST_OF_BEST * most);
            let total = |motion: usize| self.totals[motion];
            let best = good.max_by(|a, b| total(a.0).total_cmp(&total(b.0)).then(b.0.cmp(&a.0)));
            if let Some(&(motion, fit)) = best {
                gain += fit.gain;
                sources[motion].extend(&fit.sources);
                of_leaves[*leaf as usize] = motion as u16 + 1;
            }
        }
        for of_motion in &mut sources {
            of_motion.sort_unstable();
            of_motion.dedup();
            gain -= bits_of_instance(of_motion);
        }
        Assigned { of_leaves, sources, gain }
    }
}

/// Bits of an instance of some patches, about.
fn bits_of_instance(patches: &[u32]) -> f32 {
    match patches.is_empty() {
        true => 0.0,
        false => {
            let runs = patches.chunk_by(|a, b| a + 1 == *b).count();
            INSTANCE_BITS + RUN_BITS * runs as f32
        }
    }
}
