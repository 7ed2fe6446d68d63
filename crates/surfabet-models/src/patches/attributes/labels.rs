//! Labels, such as classes of points: a symbol per cell, given the labels of the cells around it that come before.

use surfabet_entropy::{Bit, Coder, Symbols};
use surfabet_geom::morton::{MortonMap, step};

use super::cells::index;

/// Most different labels.
pub const MAX_LABELS: usize = 256;

/// Classes of a number of votes.
const VOTES: usize = 12;

/// Labels of the cells around the surface.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) struct LabelField {
    /// The different labels, growing.
    pub values: Vec<i64>,
    /// Number of each cell's label in `values`.
    pub labels: Vec<u8>,
}

impl LabelField {
    /// Writes or prices the labels of the sorted `cells`.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: &[u64]) -> Result<(), C::Error> {
        code_labels(coder, cells, self.values.len(), Some(&self.labels)).map(|_| ())
    }

    /// Reads the labels that [`LabelField::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder, also for a list of labels that no model has.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: &[u64],
        values: Vec<i64>,
    ) -> Result<Self, C::Error> {
        if !are_labels(&values) {
            return Err(coder.corrupt(format!("{} labels, not growing", values.len())));
        }
        let labels = code_labels(coder, cells, values.len(), None)?;
        Ok(Self { values, labels })
    }
}

/// True for 1 to 256 growing labels.
pub(in crate::patches) fn are_labels(values: &[i64]) -> bool {
    (1..=MAX_LABELS).contains(&values.len()) && values.is_sorted_by(|a, b| a < b)
}

/// Adaptive models of labels.
struct LabelModels {
    /// Is the label the one with most votes? By its votes, then those of all others.
    is_first: Vec<Bit>,
    /// Else, is it the one with the next most? By its votes.
    is_second: [Bit; VOTES],
    /// Else the label, by the one with most votes.
    others: Vec<Symbols>,
}

impl LabelModels {
    /// For numbers of labels below `n`, which is 2 to 256.
    fn new(n: usize) -> Self {
        Self {
            is_first: vec![Bit::with_memory(Bit::MAX_MEMORY); VOTES * VOTES],
            is_second: [Bit::new(); VOTES],
            others: (0..n).map_while(|_| Symbols::new(n as u32).ok()).collect(),
        }
    }
}

/// Writes, reads or prices the numbers of the labels of the sorted `cells`, all below `n_labels`, 1 to 256.
fn code_labels<C: Coder>(
    coder: &mut C,
    cells: &[u64],
    n_labels: usize,
    given: Option<&[u8]>,
) -> Result<Vec<u8>, C::Error> {
    if n_labels == 1 {
        return Ok(vec![0; cells.len()]);
    }
    let places = index(cells);
    let mut models = LabelModels::new(n_labels);
    let mut labels: Vec<u8> = Vec::with_capacity(cells.len());
    let mut votes = vec![0_u32; n_labels];
    for (i, &key) in cells.iter().enumerate() {
        votes.fill(0);
        count_votes(&places, key, &labels, &mut votes);
        let ranking = Ranking::new(&votes, labels.last().copied().unwrap_or(0));
        let wanted = given.map_or(0, |labels| labels[i]);
        labels.push(code_label(coder, &mut models, &ranking, wanted)?);
    }
    Ok(labels)
}

/// Adds the votes of the cells before the one of `key` that share a face (2) or an edge (1) with it. Cells are in the order
/// of their keys, so those before it are those with labels.
fn count_votes(places: &MortonMap<u32>, key: u64, labels: &[u8], votes: &mut [u32]) {
    let mut count = |near: u64, weight: u32| {
        let before = if near < key { places.get(&near) } else { None };
        if let Some(&label) = before.and_then(|&i| labels.get(i as usize)) {
            votes[usize::from(label)] += weight;
        }
    };
    for axis in 0..3 {
        for up in [false, true] {
            let face = step(key, axis, up);
            count(face, 2);
            for across in [false, true] {
                count(step(face, (axis + 1) % 3, across), 1);
            }
        }
    }
}

/// The labels that are expected of a cell.
struct Ranking {
    /// The label with most votes, of equals the first; without votes that of the cell before.
    first: u8,
    /// Its votes and those of all others.
    votes: [usize; 2],
    /// The label with the next most, and its votes; `None` where all agree.
    second: Option<(u8, usize)>,
}

impl Ranking {
    fn new(votes: &[u32], before: u8) -> Self {
        let total: u32 = votes.iter().sum();
        let most = |but: Option<u8>| {
            let of = (0_u8..=u8::MAX).zip(votes).filter(|&(label, &n)| n > 0 && Some(label) != but);
            of.max_by_key(|&(label, &n)| (n, std::cmp::Reverse(label)))
        };
        let Some((first, &n)) = most(None) else {
            return Self { first: before, votes: [0; 2], second: None };
        };
        let second = most(Some(first)).map(|(label, &n)| (label, n as usize));
        Self { first, votes: [n as usize, (total - n) as usize], second }
    }
}

/// Writes, reads or prices a label.
fn code_label<C: Coder>(
    coder: &mut C,
    models: &mut LabelModels,
    ranking: &Ranking,
    wanted: u8,
) -> Result<u8, C::Error> {
    let [own, others] = ranking.votes.map(|n| n.min(VOTES - 1));
    if coder.bit(&mut models.is_first[own * VOTES + others], wanted == ranking.first)? {
        return Ok(ranking.first);
    }
    if let Some((second, n)) = ranking.second
        && coder.bit(&mut models.is_second[n.min(VOTES - 1)], wanted == second)?
    {
        return Ok(second);
    }
    let model = &mut models.others[usize::from(ranking.first)];
    // Below the number of labels, at most 256.
    Ok(coder.symbol(model, u32::from(wanted))? as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patches::attributes::cells::cell_key;
    use proptest::prelude::*;
    use surfabet_entropy::Price;

    /// Bits that the labels take.
    fn price(cells: &[u64], n: usize, labels: &[u8]) -> f64 {
        let mut price = Price::default();
        let Ok(again) = code_labels(&mut price, cells, n, Some(labels));
        assert_eq!(again, labels);
        price.bits
    }

    proptest! {
        #[test]
        fn ranking_is_by_votes_then_by_number(votes in prop::collection::vec(0_u32..4, 2..6)) {
            let ranking = Ranking::new(&votes, 1);
            let mut order: Vec<usize> = (0..votes.len()).filter(|&i| votes[i] > 0).collect();
            order.sort_by_key(|&i| (std::cmp::Reverse(votes[i]), i));
            let first = order.first().map_or(1, |&i| i);
            prop_assert_eq!(usize::from(ranking.first), first);
            let second = order.get(1).map(|&i| (i as u8, votes[i] as usize));
            prop_assert_eq!(ranking.second, second);
            let total = votes.iter().sum::<u32>() as usize;
            prop_assert_eq!(ranking.votes.iter().sum::<usize>(), total);
        }
    }

    #[test]
    fn only_cells_before_vote_by_face_and_edge() {
        let key = |x, y, z| cell_key([x, y, z]);
        // Faces below along each axis, an edge, a corner, and a face above.
        let mut cells: Vec<u64> =
            [(0, 1, 1), (1, 0, 1), (0, 0, 1), (0, 0, 0), (1, 1, 1), (2, 1, 1)]
                .map(|(x, y, z)| key(x, y, z))
                .into();
        cells.sort_unstable();
        let places = index(&cells);
        let at = places[&key(1, 1, 1)] as usize;
        let label = |(x, y, z)| places[&key(x, y, z)] as u8;
        // Every cell has a label of its own.
        let labels: Vec<u8> = (0..at as u8).collect();
        let mut votes = vec![0; cells.len()];
        count_votes(&places, key(1, 1, 1), &labels, &mut votes);
        let mut expected = vec![0; cells.len()];
        for (cell, n) in [((0, 1, 1), 2), ((1, 0, 1), 2), ((0, 0, 1), 1)] {
            expected[usize::from(label(cell))] = n;
        }
        assert_eq!(votes, expected);
    }

    #[test]
    fn areas_take_hardly_more_than_their_borders() {
        // A square of 64 x 64 cells in two halves.
        let mut cells: Vec<u64> = (0..4096).map(|i| cell_key([i % 64, i / 64, 0])).collect();
        cells.sort_unstable();
        let label = |key: &u64| u8::from(surfabet_geom::cells::of_key(*key)[0] >= 32);
        let halves: Vec<u8> = cells.iter().map(label).collect();
        let one: Vec<u8> = vec![1; cells.len()];
        assert_eq!(price(&cells, 1, &vec![0; cells.len()]), 0.0);
        assert!(price(&cells, 3, &one) < 40.0);
        assert!(price(&cells, 3, &halves) < 40.0 + 64.0 * 4.0);
    }

    #[test]
    fn labels_are_growing_and_at_most_256() {
        assert!(are_labels(&[-3]) && are_labels(&[-3, 0, 7]));
        assert!(!are_labels(&[]) && !are_labels(&[1, 1]) && !are_labels(&[2, 1]));
        assert!(are_labels(&(0..256).collect::<Vec<i64>>()));
        assert!(!are_labels(&(0..257).collect::<Vec<i64>>()));
    }
}
