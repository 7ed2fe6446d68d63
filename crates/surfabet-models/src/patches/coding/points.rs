//! Points that no patch is near enough to: cells of a cubic grid, said as an octree.

use surfabet_entropy::{Bit, Coder};

/// Bits of a cell coordinate.
const BITS: u32 = 21;

/// Heights above the leaves with models of their own.
const HEIGHTS: usize = 4;

/// Adaptive models of the octree: by height, child and number of occupied children before it.
#[derive(Debug, Clone)]
pub(in crate::patches) struct PointModels(Vec<Bit>);

impl Default for PointModels {
    fn default() -> Self {
        Self(vec![Bit::new(); HEIGHTS * 64])
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
        let mut octree = Octree { coder, models, found: &mut found, max_points };
        octree.cell(keys, 0, BITS)?;
    }
    Ok(found)
}

struct Octree<'a, C> {
    coder: &'a mut C,
    models: &'a mut PointModels,
    found: &'a mut Vec<u64>,
    max_points: usize,
}

impl<C: Coder> Octree<'_, C> {
    fn cell(&mut self, keys: &[u64], prefix: u64, height: u32) -> Result<(), C::Error> {
        if height == 0 {
            if self.found.len() == self.max_points {
                return Err(self.coder.corrupt(format!("more than {} points", self.max_points)));
            }
            self.found.push(prefix);
            return Ok(());
        }
        let (mut rest, mut occupied) = (keys, 0);
        for child in 0..8_usize {
            let at = prefix << 3 | child as u64;
            let here = rest.partition_point(|&k| k >> (3 * (height - 1)) <= at);
            let certain = child == 7 && occupied == 0;
            let context = (height as usize).min(HEIGHTS) - 1;
            let model = &mut self.models.0[context * 64 + child * 8 + occupied];
            if certain || self.coder.bit(model, here > 0)? {
                occupied += 1;
                self.cell(&rest[..here], at, height - 1)?;
            }
            rest = &rest[here..];
        }
        Ok(())
    }
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
