//! Work that several threads share and that any item may refuse.

use rayon::prelude::*;

/// Does the work for every item, in parallel; the results in the order of the items.
///
/// Rayon's own collection of results stops at the error that comes first in time, so which of
/// two errors a user reads would depend on the machine. Here it is that of the first item.
///
/// # Errors
/// What `work` says of the first item that it refuses.
pub fn try_map<I, T, E>(
    items: I,
    work: impl Fn(I::Item) -> Result<T, E> + Sync + Send,
) -> Result<Vec<T>, E>
where
    I: IntoParallelIterator<Iter: IndexedParallelIterator>,
    T: Send,
    E: Send,
{
    let results: Vec<Result<T, E>> = items.into_par_iter().map(work).collect();
    results.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn the_error_is_that_of_the_first_item_however_long_it_takes() {
        let refused = try_map(0..4_usize, |item| {
            if item == 1 {
                std::thread::sleep(Duration::from_millis(20));
            }
            if item == 0 { Ok(item) } else { Err(item) }
        });
        assert_eq!(refused, Err(1));
    }

    #[test]
    fn results_keep_the_order_of_the_items() {
        let doubled: Result<Vec<usize>, ()> = try_map(0..100_usize, |item| Ok(2 * item));
        assert_eq!(doubled, Ok((0..100).map(|item| 2 * item).collect()));
    }
}
