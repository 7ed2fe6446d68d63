//! Parallel loops whose machinery is compiled once.
//!
//! A parallel iterator of rayon brings a copy of its splitting and joining for every loop, which was near a third of all
//! code of the crates above. Here one function hands out numbers of runs to the threads, over `&dyn Fn`, and a loop adds
//! little more than its own body.
//!
//! Items are handed out in runs of neighbours, in ascending order, so that threads even out work of unequal cost. The
//! results stand in the order of the items, and of several errors the one of the first item is given, whatever the number
//! of threads. After an error no more items are begun. A panic of a closure goes on in the caller. Sums of floats are to be
//! made over chunks of fixed size ([`map_chunks`]), added in order.

use std::cmp::Ordering;
use std::convert::Infallible;
use std::ops::Range;
use std::sync::atomic::{self, AtomicUsize};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

/// Runs of items per thread: what one run more costs is below a microsecond, and what the last ones leave to even out is
/// a small part of the whole.
const RUNS_PER_THREAD: usize = 64;

/// Number of runs that `n` items are handed out in.
fn runs_of(n: usize) -> usize {
    match rayon::current_num_threads() {
        1 => n.min(1),
        threads => n.min(threads * RUNS_PER_THREAD),
    }
}

/// Calls `run(0)`, `run(1)`, ..., `run(n - 1)` on all threads, begun in this order; none more once one gave `false`.
fn for_each_run(n: usize, run: &(dyn Fn(usize) -> bool + Sync)) {
    let next = AtomicUsize::new(0);
    let work = |_| {
        loop {
            let i = next.fetch_add(1, atomic::Ordering::Relaxed);
            if i >= n {
                break;
            }
            if !run(i) {
                next.store(n, atomic::Ordering::Relaxed);
            }
        }
    };
    match rayon::current_num_threads().min(n) {
        0 | 1 => work(0),
        threads => (0..threads).into_par_iter().with_max_len(1).for_each(work),
    }
}

/// What a mutex guards. No value here is left half changed by a panic.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn into_inner<T>(mutex: Mutex<T>) -> T {
    mutex.into_inner().unwrap_or_else(PoisonError::into_inner)
}

/// The error of the least number so far.
struct Failure<E>(Mutex<Option<(usize, E)>>);

impl<E> Failure<E> {
    fn none() -> Self {
        Self(Mutex::new(None))
    }

    /// Keeps the error of number `i`, if it is one and the least; true for no error.
    fn note(&self, i: usize, result: Result<(), E>) -> bool {
        let Err(error) = result else { return true };
        let mut least = lock(&self.0);
        if least.as_ref().is_none_or(|(at, _)| i < *at) {
            *least = Some((i, error));
        }
        false
    }

    fn result(self) -> Result<(), E> {
        into_inner(self.0).map_or(Ok(()), |(_, error)| Err(error))
    }
}

/// Adds what comes of a run of items.
type Fill<'a, T, E> = dyn Fn(Range<usize>, &mut Vec<T>) -> Result<(), E> + Sync + 'a;

/// Calls `fill` for runs of `0..n` and joins what it adds, in order.
fn try_fill<T: Send, E: Send>(n: usize, fill: &Fill<'_, T, E>) -> Result<Vec<T>, E> {
    let mut all = Vec::new();
    let n_runs = runs_of(n);
    if n_runs <= 1 {
        return fill(0..n, &mut all).map(|()| all);
    }
    let mut parts: Vec<Mutex<Vec<T>>> = Vec::new();
    parts.resize_with(n_runs, Mutex::default);
    let failure = Failure::none();
    // In 128 bits, where the product of no two lengths overflows.
    let start = |run: usize| (run as u128 * n as u128 / n_runs as u128) as usize;
    for_each_run(n_runs, &|run| {
        let mut part = Vec::new();
        let result = fill(start(run)..start(run + 1), &mut part);
        *lock(&parts[run]) = part;
        failure.note(run, result)
    });
    failure.result()?;
    all.reserve_exact(parts.iter_mut().map(|part| lock(part).len()).sum());
    for part in parts {
        all.append(&mut into_inner(part));
    }
    Ok(all)
}

/// As [`try_fill`], without errors.
fn fill<T: Send>(n: usize, fill: &(dyn Fn(Range<usize>, &mut Vec<T>) + Sync)) -> Vec<T> {
    let Ok(all) = try_fill::<T, Infallible>(n, &|run, part| {
        fill(run, part);
        Ok(())
    });
    all
}

/// Hands out the next of `items` while there are any.
fn try_hand_out<I: Send, E: Send>(
    n: usize,
    items: &mut (dyn Iterator<Item = I> + Send),
    take: &(dyn Fn(usize, I) -> Result<(), E> + Sync),
) -> Result<(), E> {
    let items = Mutex::new(items.enumerate());
    let failure = Failure::none();
    for_each_run(n, &|_| {
        let next = lock(&items).next();
        next.is_some_and(|(i, item)| failure.note(i, take(i, item)))
    });
    failure.result()
}

/// `f` of every item, in order.
pub fn map<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    fill(items.len(), &|run, out| out.extend(items[run].iter().map(&f)))
}

/// `f(0)`, ..., `f(n - 1)`.
pub fn map_range<R: Send>(n: usize, f: impl Fn(usize) -> R + Sync) -> Vec<R> {
    fill(n, &|run, out| out.extend(run.map(&f)))
}

/// As [`map_range`] with memory to work in, made by `scratch` where no thread has any left. It comes as another item left
/// it, and no result may depend on that.
pub fn map_range_with<S: Send, R: Send>(
    n: usize,
    scratch: impl Fn() -> S + Sync,
    f: impl Fn(&mut S, usize) -> R + Sync,
) -> Vec<R> {
    let unused = Mutex::new(Vec::new());
    fill(n, &|run, out| {
        let left = lock(&unused).pop();
        let mut scratch = left.unwrap_or_else(&scratch);
        out.extend(run.map(|i| f(&mut scratch, i)));
        lock(&unused).push(scratch);
    })
}

/// As [`map`], of items that `f` takes over.
pub fn map_owned<T: Send, R: Send>(items: Vec<T>, f: impl Fn(T) -> R + Sync) -> Vec<R> {
    let mut results = Vec::new();
    results.resize_with(items.len(), || None);
    for_each(items.into_iter().zip(&mut results), |_, (item, result)| *result = Some(f(item)));
    results.into_iter().flatten().collect()
}

/// As [`map`].
///
/// # Errors
/// That of the first item that has one.
pub fn try_map<T: Sync, R: Send, E: Send>(
    items: &[T],
    f: impl Fn(&T) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    try_map_range(items.len(), |i| f(&items[i]))
}

/// As [`map_range`].
///
/// # Errors
/// That of the first number that has one.
pub fn try_map_range<R: Send, E: Send>(
    n: usize,
    f: impl Fn(usize) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    try_fill(n, &|run, out| {
        out.reserve(run.len());
        for i in run {
            out.push(f(i)?);
        }
        Ok(())
    })
}

/// As [`map_range_with`].
///
/// # Errors
/// That of the first number that has one.
pub fn try_map_range_with<S: Send, R: Send, E: Send>(
    n: usize,
    scratch: impl Fn() -> S + Sync,
    f: impl Fn(&mut S, usize) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let unused = Mutex::new(Vec::new());
    try_fill(n, &|run, out| {
        let left = lock(&unused).pop();
        let mut scratch = left.unwrap_or_else(&scratch);
        out.reserve(run.len());
        for i in run {
            out.push(f(&mut scratch, i)?);
        }
        lock(&unused).push(scratch);
        Ok(())
    })
}

/// What `add` adds for `0`, ..., `n - 1`, in order: the shape for filters, and for items with any number of results.
pub fn gather<R: Send>(n: usize, add: impl Fn(usize, &mut Vec<R>) + Sync) -> Vec<R> {
    fill(n, &|run, out| run.for_each(|i| add(i, out)))
}

/// `f` of every chunk of `size` items, in order; the last may be shorter.
pub fn map_chunks<T: Sync, R: Send>(
    items: &[T],
    size: usize,
    f: impl Fn(&[T]) -> R + Sync,
) -> Vec<R> {
    map_range(items.len().div_ceil(size), |i| f(chunk(items, size, i)))
}

/// As [`map_chunks`].
///
/// # Errors
/// That of the first chunk that has one.
pub fn try_map_chunks<T: Sync, R: Send, E: Send>(
    items: &[T],
    size: usize,
    f: impl Fn(&[T]) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    try_map_range(items.len().div_ceil(size), |i| f(chunk(items, size, i)))
}

fn chunk<T>(items: &[T], size: usize, i: usize) -> &[T] {
    &items[i * size..items.len().min((i + 1) * size)]
}

/// Changes every item; `f` gets its number too.
pub fn for_each_mut<T: Send>(items: &mut [T], f: impl Fn(usize, &mut T) + Sync) {
    let size = items.len().div_ceil(runs_of(items.len()).max(1)).max(1);
    for_each(items.chunks_mut(size), |run, items| {
        (run * size..).zip(items).for_each(|(i, item)| f(i, item));
    });
}

/// Hands out each of `items`, with its number: chunks that can be written to, alone or beside others (`zip`). An item is
/// to be worth some microseconds.
pub fn for_each<I: Send>(
    mut items: impl ExactSizeIterator<Item = I> + Send,
    f: impl Fn(usize, I) + Sync,
) {
    let Ok(()) = try_hand_out::<I, Infallible>(items.len(), &mut items, &|i, item| {
        f(i, item);
        Ok(())
    });
}

/// As [`for_each`].
///
/// # Errors
/// That of the first item that has one.
pub fn try_for_each<I: Send, E: Send>(
    mut items: impl ExactSizeIterator<Item = I> + Send,
    f: impl Fn(usize, I) -> Result<(), E> + Sync,
) -> Result<(), E> {
    try_hand_out(items.len(), &mut items, &f)
}

/// Sorts keys.
pub fn sort_keys(keys: &mut [u64]) {
    keys.par_sort_unstable();
}

/// Sorts keys that take more than 64 bits.
pub fn sort_wide_keys(keys: &mut [u128]) {
    keys.par_sort_unstable();
}

/// Sorts items by key, those of equal keys by number.
pub fn sort_keyed(items: &mut [(u64, u32)]) {
    items.par_sort_unstable();
}

/// Sorts numbers.
pub fn sort_numbers(numbers: &mut [u32]) {
    numbers.par_sort_unstable();
}

/// Sorts numbers of items by `compare`, which gives equality for none but the same number.
pub fn sort_numbers_by(numbers: &mut [u32], compare: &(dyn Fn(u32, u32) -> Ordering + Sync)) {
    numbers.par_sort_unstable_by(|&a, &b| compare(a, b));
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    /// Counts and pools that meet all cases: nothing, one item, fewer items than runs, more, and runs of unequal length.
    fn everywhere(check: impl Fn(usize) + Sync) {
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for n in [0, 1, 2, 63, 64, 65, 1000, 5 * RUNS_PER_THREAD, 12_345] {
                pool.install(|| check(n));
            }
        }
    }

    fn uneven(i: usize) -> usize {
        (0..i * 7919 % 200).fold(i, |sum, k| sum ^ k.wrapping_mul(sum))
    }

    #[test]
    fn results_stand_in_the_order_of_the_items() {
        everywhere(|n| {
            let numbers: Vec<usize> = (0..n).collect();
            let wanted: Vec<usize> = (0..n).map(uneven).collect();
            assert_eq!(map_range(n, uneven), wanted);
            assert_eq!(map(&numbers, |&i| uneven(i)), wanted);
            assert_eq!(map_owned(numbers.clone(), uneven), wanted);
            assert_eq!(try_map(&numbers, |&i| Ok::<_, ()>(uneven(i))), Ok(wanted.clone()));
            let twice_odd: Vec<usize> =
                (0..n).filter(|i| i % 2 == 1).flat_map(|i| [i, i]).collect();
            let add =
                |i: usize, out: &mut Vec<usize>| out.extend([i, i].iter().filter(|_| i % 2 == 1));
            assert_eq!(gather(n, add), twice_odd);
        });
    }

    #[test]
    fn chunks_are_those_of_the_slice() {
        everywhere(|n| {
            let numbers: Vec<usize> = (0..n).collect();
            for size in [1, 7, 64] {
                let wanted: Vec<Vec<usize>> = numbers.chunks(size).map(<[_]>::to_vec).collect();
                assert_eq!(map_chunks(&numbers, size, <[_]>::to_vec), wanted);
                let found = try_map_chunks(&numbers, size, |chunk| Ok::<_, ()>(chunk.to_vec()));
                assert_eq!(found, Ok(wanted));
            }
        });
    }

    #[test]
    fn every_item_is_changed_once_and_knows_its_number() {
        everywhere(|n| {
            let mut items = vec![1; n];
            for_each_mut(&mut items, |i, item| *item += i);
            let wanted: Vec<usize> = (1..=n).collect();
            assert_eq!(items, wanted);
            let mut copy = vec![0; n];
            for_each(copy.chunks_mut(9).zip(items.chunks(9)), |i, (copy, items)| {
                assert_eq!(items[0], 9 * i + 1);
                copy.copy_from_slice(items);
            });
            assert_eq!(copy, wanted);
        });
    }

    #[test]
    fn the_first_error_is_given_and_later_items_are_not_begun() {
        everywhere(|n| {
            let fails = |i: usize| i % 500 == 499 || i == n / 2;
            let first = (0..n).find(|&i| fails(i));
            let begun = AtomicUsize::new(0);
            let f = |i: usize| {
                begun.fetch_add(1, atomic::Ordering::Relaxed);
                if fails(i) { Err(i) } else { Ok(i) }
            };
            assert_eq!(try_map_range(n, f).err(), first);
            assert_eq!(try_map_range_with(n, || (), |(), i| f(i)).err(), first);
            begun.store(0, atomic::Ordering::Relaxed);
            assert_eq!(try_for_each(0..n, |i, _| f(i).map(|_| ())).err(), first);
            // Those before the first, and at most one more for every thread.
            if let Some(first) = first {
                let begun = begun.into_inner();
                assert!(begun > first && begun <= first + 500 + rayon::current_num_threads());
            }
        });
    }

    #[test]
    fn scratch_is_made_at_most_once_per_thread_and_used_by_one_at_a_time() {
        everywhere(|n| {
            let made = AtomicUsize::new(0);
            let scratch = || {
                made.fetch_add(1, atomic::Ordering::Relaxed);
                Vec::new()
            };
            let found = map_range_with(n, scratch, |scratch, i| {
                scratch.clear();
                scratch.extend(0..i % 50);
                scratch.len()
            });
            assert_eq!(found, (0..n).map(|i| i % 50).collect::<Vec<_>>());
            assert!(made.into_inner() <= rayon::current_num_threads());
        });
    }

    #[test]
    fn loops_nest() {
        everywhere(|n| {
            let n = n.min(200);
            let sums = map_range(n, |i| map_range(i, |j| j).iter().sum::<usize>());
            assert_eq!(sums, (0..n).map(|i| i * i.saturating_sub(1) / 2).collect::<Vec<_>>());
        });
    }

    #[test]
    fn a_panic_goes_on_in_the_caller() {
        everywhere(|n| {
            let panics = AssertUnwindSafe(|| map_range(n, |i| assert!(i != n / 2, "as wanted")));
            assert_eq!(catch_unwind(panics).is_err(), n > 0);
            let items = AssertUnwindSafe(|| for_each(0..n, |i, _| assert!(i != 0, "as wanted")));
            assert_eq!(catch_unwind(items).is_err(), n > 0);
        });
    }

    #[test]
    fn sorted_as_by_the_standard_library() {
        everywhere(|n| {
            let mut keys: Vec<u64> = (0..n).map(|i| uneven(i) as u64).collect();
            let mut items: Vec<(u64, u32)> = keys.iter().map(|k| (k % 10, *k as u32)).collect();
            let mut numbers: Vec<u32> = items.iter().map(|i| i.1).collect();
            let mut wide: Vec<u128> = keys.iter().map(|&k| u128::from(k) << 64).collect();
            let (mut k, mut i, mut u) = (keys.clone(), items.clone(), numbers.clone());
            k.sort_unstable();
            i.sort_unstable();
            u.sort_unstable();
            sort_keys(&mut keys);
            sort_wide_keys(&mut wide);
            assert!(wide.iter().zip(&k).all(|(w, k)| w >> 64 == u128::from(*k)));
            sort_keyed(&mut items);
            sort_numbers(&mut numbers);
            assert_eq!((&keys, &items, &numbers), (&k, &i, &u));
            sort_numbers_by(&mut numbers, &|a, b| b.cmp(&a));
            u.reverse();
            assert_eq!(numbers, u);
        });
    }
}
