//! Which occurrences may come within epsilon of each other, and which of them goes first.

use surfabet_base::parallel;
use surfabet_geom::KdTree;

use crate::bic_alphabet::constants::FEATURES_PER_SEARCH;
use crate::bic_alphabet::pose::{BicPose, Frame};
use crate::error::Result;

/// Places of occurrences, by their turn, and the neighbours of each.
#[derive(Debug, Clone)]
pub(in crate::bic_alphabet) struct Neighbors {
    /// Places by turn.
    pub(super) order: Vec<u32>,
    /// Turn by place.
    pub(super) turns: Vec<u32>,
    starts: Vec<usize>,
    /// Of each place the neighbours that go before it, then those after it.
    neighbors: Vec<u32>,
    /// Where those after it start.
    middles: Vec<usize>,
}

impl Neighbors {
    /// The neighbours of each place: those whose points, all within `radius` of their middles, may lie within `epsilon` of
    /// each other.
    pub fn new(poses: &[BicPose], frames: &[Frame], radius: f32, epsilon: f32) -> Result<Self> {
        let order = order(poses);
        let mut turns = vec![0; poses.len()];
        for (turn, &place) in (0..).zip(&order) {
            turns[place as usize] = turn;
        }
        let middles: Vec<[f32; 3]> = frames.iter().map(|f| f.origin).collect();
        let tree = KdTree::new(&middles)?;
        let reach = 2.0 * radius + epsilon;
        let lists: Vec<Vec<(Vec<u32>, usize)>> =
            parallel::map_range(poses.len().div_ceil(FEATURES_PER_SEARCH), |chunk| {
                let from = chunk * FEATURES_PER_SEARCH;
                let mut near = Vec::new();
                let until = (from + FEATURES_PER_SEARCH).min(poses.len());
                let one = |place: usize| {
                    tree.within(middles[place], reach, &mut near);
                    let mut list: Vec<u32> = near
                        .iter()
                        .map(|n| n.index() as u32)
                        .filter(|&n| n as usize != place)
                        .collect();
                    list.sort_unstable_by_key(|&n| turns[n as usize]);
                    let before = list.partition_point(|&n| turns[n as usize] < turns[place]);
                    (list, before)
                };
                (from..until).map(one).collect()
            });
        let (mut starts, mut found, mut split) = (vec![0], Vec::new(), Vec::new());
        for (list, before) in lists.into_iter().flatten() {
            split.push(found.len() + before);
            found.extend(list);
            starts.push(found.len());
        }
        Ok(Self { order, turns, starts, neighbors: found, middles: split })
    }

    /// Neighbours that go before a place.
    pub(super) fn before(&self, place: u32) -> &[u32] {
        let at = place as usize;
        &self.neighbors[self.starts[at]..self.middles[at]]
    }

    /// Neighbours that go after a place.
    pub(super) fn after(&self, place: u32) -> &[u32] {
        let at = place as usize;
        &self.neighbors[self.middles[at]..self.starts[at + 1]]
    }
}

/// Places in the order in which they are thinned.
pub(super) fn order(poses: &[BicPose]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..poses.len() as u32).collect();
    order.sort_by_cached_key(|&place| (poses[place as usize].precedence(), place));
    order
}
