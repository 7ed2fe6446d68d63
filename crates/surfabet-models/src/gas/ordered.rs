//! Points in the order of a space-filling curve: neighbours in the list are near each other, so that what was found for
//! one helps the next and stays in the cache.

use surfabet_base::parallel;
use surfabet_geom::morton;

/// Cells along the longest side of the box around the points, as a power of two: three such numbers and the number of a
/// point fit into 64 bits.
const CELL_BITS: u32 = 10;

/// Points along a space-filling curve.
#[derive(Debug, Clone, Default)]
pub(super) struct Ordered {
    /// Positions, metres.
    pub points: Vec<[f32; 3]>,
    /// The place of each in the input.
    pub source: Vec<u32>,
}

impl Ordered {
    /// `points`, fewer than 2^32, by the Morton code of their cells, in the same cell as they came.
    pub fn new(points: &[[f32; 3]]) -> Self {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for p in points {
            low = std::array::from_fn(|a| low[a].min(p[a]));
            high = std::array::from_fn(|a| high[a].max(p[a]));
        }
        let side = (0..3).map(|a| high[a] - low[a]).fold(0.0, f32::max);
        let cells = (1_u32 << CELL_BITS) as f32;
        let key = |i: usize| {
            let p = points[i];
            let cell = std::array::from_fn(|a| {
                let share = (p[a] - low[a]) / side * cells;
                // All at one place: not a number, which becomes cell zero.
                (share as u64).min((1 << CELL_BITS) - 1)
            });
            morton::encode(cell) << 32 | i as u64
        };
        let mut keys: Vec<u64> = parallel::map_range(points.len(), key);
        parallel::sort_keys(&mut keys);
        let source: Vec<u32> = parallel::map(&keys, |&key| key as u32);
        let points = parallel::map(&source, |&i| points[i as usize]);
        Self { points, source }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Every `step`-th of the points.
    pub fn thinned(&self, step: usize) -> Vec<[f32; 3]> {
        self.points.iter().step_by(step).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn path_length(points: &[[f32; 3]]) -> f64 {
        points.windows(2).map(|w| super::super::distance(w[0], w[1])).sum()
    }

    proptest! {
        #[test]
        fn every_point_is_there_once(
            points in prop::collection::vec(prop::array::uniform3(-1e3_f32..1e3), 0..300),
        ) {
            let ordered = Ordered::new(&points);
            let mut seen = ordered.source.clone();
            seen.sort_unstable();
            prop_assert_eq!(seen, (0..points.len() as u32).collect::<Vec<_>>());
            for (p, &i) in ordered.points.iter().zip(&ordered.source) {
                prop_assert_eq!(*p, points[i as usize]);
            }
            prop_assert_eq!(ordered.thinned(1), ordered.points);
        }
    }

    #[test]
    fn the_way_through_the_points_is_short() {
        let points: Vec<[f32; 3]> = (0..4096_u32)
            .map(|i| i.wrapping_mul(2_654_435_761) % 4096)
            .map(|i| [(i % 64) as f32, (i / 64) as f32, 0.0])
            .collect();
        // A Morton curve through a square of n points is below 2 n steps long; in this order it was far longer.
        assert!(path_length(&points) > 40_000.0);
        assert!(path_length(&Ordered::new(&points).points) < 8192.0);
    }

    #[test]
    fn points_at_one_place_stay_as_they_came() {
        assert_eq!(Ordered::new(&[[5.0; 3]; 4]).source, [0, 1, 2, 3]);
        assert_eq!(Ordered::new(&[]).len(), 0);
    }
}
