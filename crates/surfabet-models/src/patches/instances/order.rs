//! The order of sources: what comes first is coded, what comes later may be the same again.

/// A direction that nothing in a scene follows.
const DIRECTION: [f32; 3] = [1.0, 0.618, 0.237];

/// Where a position comes in the order of sources.
pub(in crate::patches) fn place_in_order(p: [f32; 3]) -> f32 {
    (0..3).map(|a| DIRECTION[a] * p[a]).sum()
}
