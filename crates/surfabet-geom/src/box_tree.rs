//! A tree of boxes over things that lie in order: each box above the leaves is the union of two below.
//!
//! The tree has no links: level by level, box `i` stands above the boxes `2 i` and `2 i + 1`, so it covers a run of
//! leaves. How tight the boxes are is up to the order of the leaves: a space-filling curve, or [`arrange`].
//!
//! What a box holds beside its corners is up to the caller ([`Union`]): the largest reach of what lies in it, or the
//! best distance so far.

use std::ops::Range;

use surfabet_base::parallel;

use crate::boxes::Aabb;

/// Up to this number of points a run is arranged without forking.
const FORK_ABOVE: usize = 4096;

/// What two boxes below make the box above them.
pub trait Union: Copy {
    /// The box around both.
    #[must_use]
    fn union(self, other: Self) -> Self;
}

impl Union for Aabb {
    #[inline]
    fn union(self, other: Self) -> Self {
        Self::union(self, other)
    }
}

/// A tree over leaves in order.
#[derive(Debug, Clone)]
pub struct BoxTree<B> {
    /// All boxes: the leaves, then the level above them, and so on up to the root.
    boxes: Vec<B>,
    /// Where each level starts.
    levels: Vec<Range<usize>>,
}

impl<B: Union> BoxTree<B> {
    /// The tree over `leaves`, of which there may be none.
    pub fn new(leaves: Vec<B>) -> Self {
        let mut boxes = leaves;
        let mut below = 0..boxes.len();
        let mut levels = vec![below.clone()];
        while below.len() > 1 {
            let start = boxes.len();
            for i in below.clone().step_by(2) {
                let pair = if i + 1 < below.end { boxes[i].union(boxes[i + 1]) } else { boxes[i] };
                boxes.push(pair);
            }
            below = start..boxes.len();
            levels.push(below.clone());
        }
        Self { boxes, levels }
    }

    /// The leaves.
    pub fn leaves(&self) -> &[B] {
        &self.boxes[self.levels[0].clone()]
    }

    /// The box around all leaves; `None` without leaves.
    pub fn root(&self) -> Option<&B> {
        self.boxes.last()
    }

    /// Appends the leaves that `hits` lets pass, and all boxes around them, in order.
    ///
    /// When what `hits` a box also hits every box around it, these are all the leaves that it lets pass.
    pub fn leaves_where(&self, hits: impl Fn(&B) -> bool, found: &mut Vec<u32>) {
        if self.boxes.is_empty() {
            return;
        }
        // One box waits per level, and levels are fewer than bits of a number.
        let mut stack = [(0_u32, 0_u32); usize::BITS as usize + 1];
        stack[0] = (self.levels.len() as u32 - 1, 0);
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (level, i) = stack[waiting];
            if !hits(&self.boxes[self.levels[level as usize].start + i as usize]) {
                continue;
            }
            if level == 0 {
                found.push(i);
                continue;
            }
            let second = 2 * i + 1;
            if (second as usize) < self.levels[level as usize - 1].len() {
                stack[waiting] = (level - 1, second);
                waiting += 1;
            }
            stack[waiting] = (level - 1, 2 * i);
            waiting += 1;
        }
    }

    /// Changes leaves: `enters` is asked of each box and the run of leaves below it, from the root, and lets pass what
    /// may change; `change` is called with each leaf reached; the boxes above follow by [`Union`].
    pub fn update(
        &mut self,
        mut enters: impl FnMut(&B, Range<usize>) -> bool,
        mut change: impl FnMut(usize, &mut B),
    ) {
        if !self.boxes.is_empty() {
            self.update_below(self.levels.len() - 1, 0, &mut enters, &mut change);
        }
    }

    /// As deep as there are levels.
    fn update_below(
        &mut self,
        level: usize,
        i: usize,
        enters: &mut impl FnMut(&B, Range<usize>) -> bool,
        change: &mut impl FnMut(usize, &mut B),
    ) {
        let at = self.levels[level].start + i;
        let end = ((i + 1) << level).min(self.levels[0].len());
        if !enters(&self.boxes[at], i << level..end) {
            return;
        }
        if level == 0 {
            change(i, &mut self.boxes[at]);
            return;
        }
        let (first, second) = (2 * i, 2 * i + 1);
        let below = self.levels[level - 1].clone();
        self.update_below(level - 1, first, enters, change);
        self.boxes[at] = if second < below.len() {
            self.update_below(level - 1, second, enters, change);
            self.boxes[below.start + first].union(self.boxes[below.start + second])
        } else {
            self.boxes[below.start + first]
        };
    }
}

/// Brings the numbers of points that lie together together, so that runs of `leaf` of them, at least one, make a good
/// [`BoxTree`]: halves the points across the longest side of their box, where the tree does.
///
/// The order follows from the points alone, whatever the number of threads.
pub fn arrange(order: &mut [u32], positions: &[[f32; 3]], leaf: usize) {
    let n_leaves = order.len().div_ceil(leaf);
    if n_leaves <= 1 {
        return;
    }
    let position = |i: &u32| positions[*i as usize];
    let bounds = order.iter().map(position).fold(Aabb::EMPTY, |b, p| b.union(Aabb::point(p)));
    let axis = bounds.longest_axis();
    // The first child of the root stands above the largest power of two of leaves that leaves some for the second.
    let middle = n_leaves.next_power_of_two() / 2 * leaf;
    order.select_nth_unstable_by(middle, |i, j| {
        position(i)[axis].total_cmp(&position(j)[axis]).then(i.cmp(j))
    });
    let fork = order.len() > FORK_ABOVE;
    let (left, right) = order.split_at_mut(middle);
    if fork {
        rayon::join(|| arrange(left, positions, leaf), || arrange(right, positions, leaf));
    } else {
        arrange(left, positions, leaf);
        arrange(right, positions, leaf);
    }
}

/// The boxes of runs of `leaf` points, at least one.
pub fn boxes_of(positions: &[[f32; 3]], leaf: usize) -> Vec<Aabb> {
    let of = |run: &[[f32; 3]]| run.iter().fold(Aabb::EMPTY, |b, &p| b.union(Aabb::point(p)));
    parallel::map_chunks(positions, leaf, of)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::vector::squared_distance;

    fn any_points(most: usize) -> impl Strategy<Value = Vec<[f32; 3]>> {
        let coordinate = || prop_oneof![(-3_i8..3).prop_map(f32::from), -5.0_f32..5.0];
        prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..most)
    }

    /// A box with the largest of some numbers.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct Best {
        aabb: Aabb,
        best: u32,
    }

    impl Union for Best {
        fn union(self, other: Self) -> Self {
            Self { aabb: self.aabb.union(other.aabb), best: self.best.max(other.best) }
        }
    }

    proptest! {
        #[test]
        fn finds_what_brute_force_finds(
            points in any_points(300), query in prop::array::uniform3(-6.0_f32..6.0),
            radius in 0.0_f32..4.0, leaf in 1_usize..9,
        ) {
            let mut order: Vec<u32> = (0..points.len() as u32).collect();
            arrange(&mut order, &points, leaf);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            prop_assert_eq!(sorted, (0..points.len() as u32).collect::<Vec<_>>());
            let arranged: Vec<[f32; 3]> = order.iter().map(|&i| points[i as usize]).collect();
            let tree = BoxTree::new(boxes_of(&arranged, leaf));
            let near = |b: &Aabb| b.squared_distance(query) <= radius * radius;
            let mut found = vec![7];
            tree.leaves_where(near, &mut found);
            let mut expected = vec![7];
            let n_leaves = points.len().div_ceil(leaf) as u32;
            expected.extend((0..n_leaves).filter(|&i| near(&tree.leaves()[i as usize])));
            prop_assert_eq!(&found, &expected);
            // Every point within the radius is in a leaf found.
            for (i, &p) in arranged.iter().enumerate() {
                if squared_distance(p, query) <= radius * radius {
                    prop_assert!(found[1..].contains(&((i / leaf) as u32)));
                }
            }
            prop_assert_eq!(tree.root().copied(), Aabb::of(points.iter().copied()));
        }

        #[test]
        fn boxes_above_follow_changed_leaves(
            points in any_points(200),
            changes in prop::collection::vec((any::<prop::sample::Index>(), 0_u32..1000), 0..20),
        ) {
            let leaves = |best: &[u32]| -> Vec<Best> {
                let one = |(p, &best): (&[f32; 3], &u32)| Best { aabb: Aabb::point(*p), best };
                points.iter().zip(best).map(one).collect()
            };
            let mut best = vec![0; points.len()];
            let mut tree = BoxTree::new(leaves(&best));
            for (at, value) in changes {
                if points.is_empty() {
                    break;
                }
                let at = at.index(points.len());
                best[at] = value;
                let mut changed = Vec::new();
                tree.update(
                    |_, run| run.contains(&at),
                    |i, leaf| {
                        leaf.best = value;
                        changed.push(i);
                    },
                );
                prop_assert_eq!(changed, [at]);
            }
            prop_assert_eq!(&tree.boxes, &BoxTree::new(leaves(&best)).boxes);
            prop_assert_eq!(tree.root().map(|b| b.best), best.iter().copied().max());
        }
    }

    #[test]
    fn runs_of_leaves_are_those_below_a_box() {
        let mut tree = BoxTree::new(vec![Aabb::point([0.0; 3]); 11]);
        let mut runs = Vec::new();
        tree.update(
            |_, run| {
                runs.push(run);
                true
            },
            |_, _| {},
        );
        assert_eq!(runs[..5], [0..11, 0..8, 0..4, 0..2, 0..1]);
        assert_eq!(runs.iter().filter(|r| r.len() == 1).count(), 12);
        assert_eq!(runs[runs.len() - 1], 10..11);
    }

    #[test]
    fn the_order_does_not_depend_on_the_number_of_threads() {
        let points: Vec<[f32; 3]> = (0..20_000_u32)
            .map(|i| [(i * 7919 % 101) as f32, (i * 104_729 % 97) as f32, (i % 13) as f32])
            .collect();
        let order = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut order: Vec<u32> = (0..points.len() as u32).collect();
            pool.install(|| arrange(&mut order, &points, 8));
            order
        };
        let alone = order(1);
        assert_eq!(alone, order(2));
        assert_eq!(alone, order(8));
    }
}
