//! Things sorted into groups.

/// Members of groups, group after group.
#[derive(Debug, Clone)]
pub(crate) struct Groups {
    /// Members of group i are `members[starts[i]..starts[i + 1]]`.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Groups {
    /// No groups yet, with room for as many and all their members.
    pub fn with_capacity(groups: usize, members: usize) -> Self {
        let mut starts = Vec::with_capacity(groups + 1);
        starts.push(0);
        Self { starts, members: Vec::with_capacity(members) }
    }

    /// Adds groups of these sizes, which make up `members`.
    pub fn extend(
        &mut self,
        sizes: impl IntoIterator<Item = usize>,
        members: impl IntoIterator<Item = u32>,
    ) {
        let mut end = self.members.len();
        self.members.extend(members);
        self.starts.extend(sizes.into_iter().map(|size| {
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
