//! Distributes the rows of a picture over threads.

use super::tiles::Tiles;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// The columns of some rows of a grid of `width` values a row, each with its index.
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

/// Runs `work` for every row on several threads; each takes the next row when it is free.
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

/// Fills a grid from `exact` values at every second column and row, interpolating the others with
/// `between`.
/// Where `between` returns nothing, `exact` is called with the surrounding values. Only marked
/// tiles are filled.
pub(crate) fn sparsely<T: Copy + Send + Sync>(
    threads: usize,
    grid: &mut [T],
    width: usize,
    tiles: &Tiles,
    exact: impl Fn([usize; 2], &[T]) -> T + Sync,
    between: impl Fn([usize; 2], &[T]) -> Option<T> + Sync,
) {
    let height = grid.len() / width;
    let rows = grid.chunks_exact_mut(width).enumerate();
    let (mut first, second): (Vec<_>, Vec<_>) = rows.partition(|(y, _)| y % 2 == 0 || y + 1 == height);
    let fill = |at, around: &[T]| between(at, around).unwrap_or_else(|| exact(at, around));
    share(threads, first.iter_mut().map(|(y, row)| (*y, &mut **row)), |y, row| {
        // Spans begin at even columns; the first of the next one may be needed before its turn.
        tiles.spans(y).for_each(|span| span.step_by(2).for_each(|x| row[x] = exact([x, y], &[])));
        for x in tiles.spans(y).flat_map(|span| span.skip(1).step_by(2)) {
            row[x] =
                if x + 1 < width && y % 2 == 0 { fill([x, y], &[row[x - 1], row[x + 1]]) } else { exact([x, y], &[]) };
        }
    });
    let first: Vec<&[T]> = first.into_iter().map(|(_, row)| &*row).collect();
    share(threads, second.into_iter(), |y, row| {
        let [above, below] = [first[y / 2], first[y / 2 + 1]];
        for x in tiles.spans(y).flatten() {
            row[x] = match x % 2 {
                0 => fill([x, y], &[above[x], below[x]]),
                _ if x + 1 == width => exact([x, y], &[]),
                _ => fill([x, y], &[above[x - 1], above[x + 1], below[x - 1], below[x + 1]]),
            };
        }
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

    #[test]
    fn a_plane_is_filled_exactly_from_a_quarter_of_its_values() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        for (width, height) in [(1, 1), (2, 2), (7, 5), (8, 6), (9, 1), (1, 4)] {
            let asked = AtomicUsize::new(0);
            let plane = |[x, y]: [usize; 2]| {
                asked.fetch_add(1, Ordering::Relaxed);
                (3 * x + 5 * y) as f32
            };
            let mean = |_, around: &[f32]| Some(around.iter().sum::<f32>() / around.len() as f32);
            let mut tiles = Tiles::of([width, height]);
            tiles.fill(true);
            let mut grid = vec![-1.0; width * height];
            sparsely(2, &mut grid, width, &tiles, |at, _| plane(at), mean);
            assert!(grid.iter().enumerate().all(|(at, &v)| v == plane([at % width, at / width])), "{width}x{height}");
            // A quarter, and the last row and column where their number is even.
            let few = width.div_ceil(2) * height.div_ceil(2) + width + height;
            assert!(asked.load(Ordering::Relaxed) - width * height <= few, "{width}x{height}");
            let mut exact = vec![-1.0; width * height];
            sparsely(3, &mut exact, width, &tiles, |at, _| plane(at), |_, _| None);
            assert_eq!(exact, grid);
        }
    }
}
