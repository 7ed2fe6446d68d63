//! Patches that are no surface: through the middle of clutter, across a corner, along something bent.

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::e_step::NONE;
use crate::error::Result;
use crate::planes::constants::LEAST_BEND_NOISE;
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// The conditions under which a patch is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Surfaces {
    /// Least share of the points around it that support it.
    pub min_purity: f64,
    /// Least share of its rectangle that supported tiles cover.
    pub min_fill: f64,
    /// Largest ratio of the standard deviation of its points about its plane to that about their tiles' means.
    pub max_bend: f64,
    /// Number of points from which a patch is kept without the other conditions.
    pub large: usize,
}

/// The patches that are surfaces, in their order:
///
/// ```text
/// own >= min_purity all,  area >= min_fill width height,  deviation <= max_bend noise
/// ```
///
/// Before and behind a surface is empty space. A plane through a heap of things, which has points everywhere, has many
/// that support it by chance; but as many others are next to it. So patches are tested from the one with most points
/// down: `own` are the points over its supported tiles, up to the grid size before and behind them, that support it, and
/// `all` those that support no patch that was kept. Points seen from the other side do not count.
pub(super) fn surfaces(
    points: &Points,
    patches: Vec<Patch>,
    grid_size: f64,
    wanted: Surfaces,
    progress: &dyn Progress,
) -> Result<Vec<Patch>> {
    let mut of = vec![NONE; points.len()];
    for (j, patch) in patches.iter().enumerate() {
        patch.whole.iter().for_each(|&i| of[i as usize] = j as u32);
    }
    let around = parallel::try_map(&patches, |patch| -> Result<Vec<(u32, u32)>> {
        progress.check()?;
        Ok(around(points, patch, grid_size, &of))
    })?;
    let mut order: Vec<usize> = (0..patches.len()).collect();
    order.sort_by_key(|&j| (std::cmp::Reverse(patches[j].n_supporting()), j));
    let mut kept = vec![false; patches.len()];
    for j in order {
        let patch = &patches[j];
        let [x, y] = patch.tiles.size();
        let filled = patch.tiles.area() >= wanted.min_fill * x * y;
        let noise = patch.noise.max(LEAST_BEND_NOISE * grid_size);
        let bent = patch.standard_deviation > wanted.max_bend * noise;
        let others = around[j].iter().filter(|(k, _)| *k == NONE || !kept[*k as usize]);
        let all: u32 = others.map(|(_, n)| n).sum();
        let own: u32 = around[j].iter().filter(|(k, _)| *k == j as u32).map(|(_, n)| n).sum();
        let pure = f64::from(own) >= wanted.min_purity * f64::from(all);
        kept[j] = patch.n_supporting() >= wanted.large || (filled && pure && !bent);
    }
    Ok(patches.into_iter().zip(kept).filter_map(|(patch, kept)| kept.then_some(patch)).collect())
}

/// The patches that the points over supported tiles support, up to `depth` before and behind them, with the number of
/// points of each.
fn around(points: &Points, patch: &Patch, depth: f64, of: &[u32]) -> Vec<(u32, u32)> {
    let over = |i: &usize| {
        let [x, y, z] = patch.frame.local(points.positions[*i]);
        z.abs() <= depth
            && patch.tiles.tile_at([x, y]).is_some_and(|t| patch.tiles.supported()[t])
            && !points.facing.as_ref().is_some_and(|f| patch.turned_away(f[*i]))
    };
    let blocks = patch.blocks(points, depth);
    let near = blocks.into_iter().flat_map(|b| points.block(b as usize).filter(over));
    let mut labels: Vec<u32> = near.map(|i| of[i]).collect();
    labels.sort_unstable();
    labels.chunk_by(|a, b| a == b).map(|run| (run[0], run.len() as u32)).collect()
}
