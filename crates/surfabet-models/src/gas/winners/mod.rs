//! The two nearest neurons to a signal, exactly, while neurons move, are added and removed (step 3).
//!
//! | file | search |
//! |---|---|
//! | `index` | a k-d tree that follows the neurons |
//! | `brute_force` | the distances to all neurons, to compare with |
//! | `nearby` | lists of those around each neuron, once the neurons stay where they are |

mod brute_force;
mod index;
mod nearby;

pub use brute_force::BruteForce;
pub use index::Index;
pub(super) use nearby::{Groups, Nearby};

/// A neuron found. Orders by distance, then by id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Winner {
    key: u64,
}

impl Winner {
    /// No neuron yet: behind all that there are.
    pub(super) const NONE: Self =
        Self { key: (f32::INFINITY.to_bits() as u64) << 32 | u32::MAX as u64 };

    #[inline(always)]
    fn new(squared_distance: f32, id: u32) -> Self {
        // Non-negative floats order like their bits.
        Self { key: u64::from(squared_distance.to_bits()) << 32 | u64::from(id) }
    }

    /// The neuron.
    #[inline(always)]
    pub fn id(self) -> u32 {
        self.key as u32
    }

    /// Its squared distance to the signal, square metres, as [`KdTree`](surfabet_geom::KdTree) computes it.
    #[inline(always)]
    pub fn squared_distance(self) -> f32 {
        f32::from_bits((self.key >> 32) as u32)
    }
}

/// Winner and second winner so far.
struct Best([Winner; 2]);

impl Best {
    /// Takes a neuron in where it is nearer than the second winner.
    #[inline(always)]
    fn offer(&mut self, winner: Winner) {
        if winner < self.0[1] {
            if winner < self.0[0] {
                self.0 = [winner, self.0[0]];
            } else {
                self.0[1] = winner;
            }
        }
    }

    /// Squared distance of the second winner: nothing farther away matters.
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.0[1].squared_distance()
    }
}

/// A search for winners among neurons with ids below some bound.
pub trait Winners {
    /// A new neuron with an id that is not in use.
    fn insert(&mut self, id: u32, position: [f32; 3]);
    /// Removes a neuron.
    fn remove(&mut self, id: u32);
    /// Moves a neuron.
    fn shift(&mut self, id: u32, position: [f32; 3]);
    /// The two nearest neurons to a finite `query`, of equally near ones those with the smaller ids. There are at
    /// least two.
    fn two_nearest(&self, query: [f32; 3]) -> [Winner; 2];
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[derive(Debug, Clone)]
    enum Change {
        Insert([f32; 3]),
        Remove(usize),
        Shift(usize, [f32; 3]),
        Nudge(usize, [f32; 3]),
    }

    /// Coordinates on a coarse grid tie often; others hardly ever.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![(-2_i8..2).prop_map(f32::from), -5.0_f32..5.0, Just(1e6)]
    }

    fn position() -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(coordinate())
    }

    fn change() -> impl Strategy<Value = Change> {
        let small = prop::array::uniform3(-0.01_f32..0.01);
        prop_oneof![
            4 => position().prop_map(Change::Insert),
            1 => any::<usize>().prop_map(Change::Remove),
            2 => (any::<usize>(), position()).prop_map(|(i, p)| Change::Shift(i, p)),
            3 => (any::<usize>(), small).prop_map(|(i, p)| Change::Nudge(i, p)),
        ]
    }

    fn by_definition(alive: &[(u32, [f32; 3])], query: [f32; 3]) -> Vec<Winner> {
        let mut all: Vec<Winner> = alive
            .iter()
            .map(|&(id, p)| {
                let d: [f32; 3] = std::array::from_fn(|a| p[a] - query[a]);
                Winner::new((d[0] * d[0] + d[1] * d[1]) + d[2] * d[2], id)
            })
            .collect();
        all.sort_unstable();
        all
    }

    proptest! {
        #[test]
        fn both_searches_are_exact_while_neurons_come_go_and_move(
            changes in prop::collection::vec(change(), 1..400),
            queries in prop::collection::vec(position(), 1..20),
        ) {
            let (mut index, mut brute) = (Index::new(), BruteForce::default());
            let mut alive: Vec<(u32, [f32; 3])> = Vec::new();
            let mut free: Vec<u32> = Vec::new();
            let mut used = 0;
            for (step, change) in changes.into_iter().enumerate() {
                match change {
                    Change::Remove(i) if alive.len() > 2 => {
                        let (id, _) = alive.swap_remove(i % alive.len());
                        free.push(id);
                        index.remove(id);
                        brute.remove(id);
                    }
                    Change::Shift(i, _) | Change::Nudge(i, _) if !alive.is_empty() => {
                        let n = alive.len();
                        let (id, p) = &mut alive[i % n];
                        *p = match change {
                            Change::Nudge(_, by) => std::array::from_fn(|a| p[a] + by[a]),
                            Change::Shift(_, to) => to,
                            _ => *p,
                        };
                        index.shift(*id, *p);
                        brute.shift(*id, *p);
                    }
                    Change::Insert(p) => {
                        let id = free.pop().unwrap_or(used);
                        used = used.max(id + 1);
                        alive.push((id, p));
                        index.insert(id, p);
                        brute.insert(id, p);
                    }
                    _ => {}
                }
                if alive.len() >= 2 && step % 8 == 0 {
                    for &q in &queries {
                        let expected = by_definition(&alive, q);
                        prop_assert_eq!(&index.two_nearest(q)[..], &expected[..2]);
                        prop_assert_eq!(&brute.two_nearest(q)[..], &expected[..2]);
                    }
                }
            }
        }
    }

    #[test]
    fn many_neurons_at_one_place_and_in_a_nested_row() {
        let (mut index, mut brute) = (Index::new(), BruteForce::default());
        for id in 0..2000_u32 {
            // A hundred at zero, then ever nearer to it from one side: the deepest tree that medians can give.
            let x = if id < 100 { 0.0 } else { 2.0_f32.powi(-((id % 120) as i32)) };
            let p = [x, 0.0, 0.0];
            index.insert(id, p);
            brute.insert(id, p);
            if id >= 1 {
                for q in [[0.0; 3], [1e-20, 0.0, 0.0], [0.3, 0.1, -0.2]] {
                    assert_eq!(index.two_nearest(q), brute.two_nearest(q), "{id}");
                }
            }
        }
    }
}
