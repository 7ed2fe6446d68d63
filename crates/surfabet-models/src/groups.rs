//! Things sorted into groups.

/// Members of groups, group after group.
#[derive(Debug, Clone)]
pub(crate) struct Groups {
    /// Members of group i are `members[starts[i]..starts[i + 1]]`.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Groups {
    /// No groups yet, with room for members.
    pub fn with_capacity(members: usize) -> Self {
        Self { starts: vec![0], members: Vec::with_capacity(members) }
    }

    /// Adds groups of these sizes, which make up `members`.
    pub fn extend(&mut self, sizes: &[usize], members: impl IntoIterator<Item = u32>) {
        let mut end = self.members.len();
        self.members.extend(members);
        self.starts.extend(sizes.iter().map(|size| {
            end += size;
            end as u32
        }));
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Members of group `i`.
    pub fn of(&self, i: usize) -> &[u32] {
        &self.members[self.starts[i] as usize..self.starts[i + 1] as usize]
    }
}
