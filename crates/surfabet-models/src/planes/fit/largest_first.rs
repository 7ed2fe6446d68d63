//! Patches in parallel where a few hold most of the points.

use std::cmp::Reverse;

use surfabet_base::parallel;

/// `f` of every item, in their order; in parallel those of the largest `size` are begun first, so that at the end no thread works on
/// a wall while the others wait.
pub(super) fn largest_first<T: Send, R: Send>(
    items: impl IntoIterator<Item = T>,
    size: impl Fn(&T) -> usize,
    f: impl Fn(T) -> R + Sync,
) -> Vec<R> {
    let mut items: Vec<(usize, T)> = items.into_iter().enumerate().collect();
    items.sort_by_key(|(_, item)| Reverse(size(item)));
    let mut results = parallel::map_owned(items, |(number, item)| (number, f(item)));
    results.sort_unstable_by_key(|(number, _)| *number);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_the_order_of_their_items() {
        let sizes = [3, 9, 1, 9, 0, 4];
        assert_eq!(largest_first(sizes, |&size| size, |size| 10 * size), [30, 90, 10, 90, 0, 40]);
        assert_eq!(largest_first([0; 0], |&size| size, |size| size), [0; 0]);
    }
}
