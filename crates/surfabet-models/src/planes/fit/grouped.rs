//! Values by number: which points a patch has, which patches a point or a block.

/// The values of each number, in the order in which they were given (counting sort).
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Grouped<T> {
    /// First value of each number, and the end.
    starts: Vec<usize>,
    values: Vec<T>,
}

impl<T: Copy + Default> Grouped<T> {
    /// Values of the numbers below `n`; `all` gives numbers with values, twice in the same order.
    pub fn new<I: Iterator<Item = (u32, T)>>(n: usize, all: impl Fn() -> I) -> Self {
        let mut starts = vec![0; n + 1];
        for (number, _) in all() {
            starts[number as usize + 1] += 1;
        }
        for i in 0..n {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut values = vec![T::default(); starts[n]];
        for (number, value) in all() {
            values[next[number as usize]] = value;
            next[number as usize] += 1;
        }
        Self { starts, values }
    }

    /// The values of a number.
    pub fn of(&self, number: usize) -> &[T] {
        &self.values[self.starts[number]..self.starts[number + 1]]
    }
}
