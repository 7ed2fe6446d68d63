//! Disjoint sets as a forest: every member points towards the one that stands for its set.

/// The member that stands for the set of `i`; halves the way there.
pub fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}
