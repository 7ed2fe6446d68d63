//! Points that no patch is near enough to: cells of a cubic grid, said as an octree.

use surfabet_entropy::{Cells, Coder, Octree};
use surfabet_geom::morton;

/// Heights of the octree with models of their own.
const HEIGHTS: u32 = 4;

/// Adaptive models of the points.
#[derive(Debug, Clone)]
pub(in crate::patches) struct PointModels(Octree);

impl Default for PointModels {
    fn default() -> Self {
        Self(Octree::new(HEIGHTS))
    }
}

/// Writes, reads or prices sorted, different keys of cells.
///
/// # Errors
/// Whatever the coder finds wrong, which includes more than `max_points` of them.
pub(in crate::patches) fn code_points<C: Coder>(
    coder: &mut C,
    models: &mut PointModels,
    keys: &[u64],
    max_points: usize,
) -> Result<Vec<u64>, C::Error> {
    let mut found = Vec::with_capacity(keys.len());
    if coder.bypass(u64::from(!keys.is_empty()), 1)? != 0 {
        let mut cells = Cells::new(keys, morton::BITS, max_points);
        while let Some(cell) = cells.next(coder, &mut models.0)? {
            found.push(morton::encode(cell.at.map(u64::from)));
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use surfabet_entropy::Price;

    proptest! {
        #[test]
        fn every_key_is_walked(keys in prop::collection::btree_set(0_u64..1 << 63, 0..50)) {
            let keys: Vec<u64> = keys.into_iter().collect();
            let mut price = Price::default();
            let Ok(found) = code_points(&mut price, &mut PointModels::default(), &keys, usize::MAX);
            prop_assert_eq!(found, keys);
        }
    }
}
