//! Rows of a picture, shared between threads.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// The columns of some rows of a grid of `width` values a row, each with its number.
pub(crate) fn of<T>(
    grid: &mut [T],
    width: usize,
    rows: Range<usize>,
    columns: Range<usize>,
) -> impl Iterator<Item = (usize, &mut [T])> + Send
where
    T: Send,
{
    let chosen = grid.chunks_exact_mut(width).enumerate().skip(rows.start).take(rows.len());
    chosen.map(move |(y, row)| (y, &mut row[columns.clone()]))
}

/// Does `work` for every row, on some threads; each takes the next row when it has done one.
pub(crate) fn share<'a, T: Send + 'a>(
    threads: usize,
    rows: impl Iterator<Item = (usize, &'a mut [T])> + Send,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let rows = Mutex::new(rows);
    let next = || rows.lock().unwrap_or_else(PoisonError::into_inner).next();
    let turn = || {
        while let Some((y, row)) = next() {
            work(y, row);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(turn);
        }
        turn();
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_chosen_value_is_visited_once_by_any_number_of_threads() {
        for threads in [0, 1, 3, 16] {
            let mut grid = vec![0u32; 7 * 9];
            share(threads, of(&mut grid, 7, 2..6, 1..5), |y, row| row.iter_mut().for_each(|v| *v += 1 + y as u32));
            for (at, value) in grid.iter().enumerate() {
                let (x, y) = (at % 7, at / 7);
                let chosen = (2..6).contains(&y) && (1..5).contains(&x);
                assert_eq!(*value, if chosen { 1 + y as u32 } else { 0 });
            }
        }
    }
}
