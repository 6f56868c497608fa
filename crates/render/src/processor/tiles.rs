//! The tiles of a view that are to be drawn anew.

use glam::Vec2;
use std::ops::Range;

/// Pixels along an edge of a tile; even, so that sparse rays lie alike in all.
pub(crate) const EDGE: usize = 16;

/// Tiles from which on a second thread is worth its start, numerical.
const WORTH: usize = 32;

/// A mark for each tile of a view.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tiles {
    size: [usize; 2],
    columns: usize,
    stale: Vec<bool>,
}

impl Tiles {
    /// All tiles of a view of so many pixels, none marked.
    pub fn of([width, height]: [usize; 2]) -> Self {
        let [columns, lines] = [width, height].map(|n| n.div_ceil(EDGE));
        Self { size: [width, height], columns, stale: vec![false; columns * lines] }
    }

    /// Marks all or none.
    pub fn fill(&mut self, stale: bool) {
        self.stale.fill(stale);
    }

    /// Tiles in a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Whether each tile is marked, row by row.
    pub fn marks(&self) -> &[bool] {
        &self.stale
    }

    /// The tiles that a box of pixels meets; none by what is no number.
    fn meeting(&self, low: Vec2, high: Vec2) -> [Range<usize>; 2] {
        [0, 1].map(|n| {
            let is_number = low[n] <= high[n];
            let (low, high) = (low[n].max(0.0), high[n].min(self.size[n] as f32));
            if is_number && low < high { low as usize / EDGE..(high.ceil() as usize).div_ceil(EDGE) } else { 0..0 }
        })
    }

    /// Marks the tiles that a box of pixels meets.
    pub fn mark(&mut self, low: Vec2, high: Vec2) {
        let [columns, lines] = self.meeting(low, high);
        for line in lines {
            self.stale[self.columns * line..][columns.clone()].fill(true);
        }
    }

    /// Marks the tiles that a rectangle of pixels meets: first and end.
    pub fn mark_rectangle(&mut self, [left, top, right, bottom]: [usize; 4]) {
        self.mark(Vec2::new(left as f32, top as f32), Vec2::new(right as f32, bottom as f32));
    }

    /// Marks a tile by its number.
    pub fn mark_tile(&mut self, n: usize) {
        self.stale[n] = true;
    }

    /// Marks what is marked in others of this view.
    pub fn join(&mut self, others: &Self) {
        self.stale.iter_mut().zip(&others.stale).for_each(|(stale, other)| *stale |= other);
    }

    /// Whether a box of pixels meets a marked tile.
    pub fn meet(&self, low: Vec2, high: Vec2) -> bool {
        let [columns, mut lines] = self.meeting(low, high);
        lines.any(|line| self.stale[self.columns * line..][columns.clone()].contains(&true))
    }

    /// How many of some threads the marked tiles are worth.
    pub fn threads(&self, threads: usize) -> usize {
        let marked = self.stale.iter().filter(|stale| **stale).count();
        if marked < WORTH { 1 } else { threads }
    }

    /// Whether the tile of a pixel is marked.
    pub fn holds(&self, [x, y]: [usize; 2]) -> bool {
        self.stale[x / EDGE + self.columns * (y / EDGE)]
    }

    /// Marks also the neighbours to the left and above, whose last pixels are interpolated.
    pub fn grow(&mut self) {
        for n in 0..self.stale.len() {
            let (right, below) = ((n + 1) % self.columns != 0, n + self.columns < self.stale.len());
            let at = |n: usize| self.stale[n];
            self.stale[n] |=
                right && at(n + 1) || below && at(n + self.columns) || right && below && at(n + 1 + self.columns);
        }
    }

    /// The columns of a row of pixels in marked tiles.
    pub fn spans(&self, y: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let row = &self.stale[self.columns * (y / EDGE)..][..self.columns];
        let mut at = 0;
        std::iter::from_fn(move || {
            let first = at + row[at..].iter().position(|stale| *stale)?;
            at = row[first..].iter().position(|stale| !stale).map_or(self.columns, |many| first + many);
            Some(EDGE * first..(EDGE * at).min(self.size[0]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_hold_the_marked_boxes_and_whole_tiles_only() {
        let mut tiles = Tiles::of([100, 40]);
        tiles.mark(Vec2::new(15.5, 3.0), Vec2::new(33.0, 17.0));
        tiles.mark_rectangle([90, 39, 120, 99]);
        tiles.mark(Vec2::new(-9.0, 0.0), Vec2::new(-1.0, 40.0));
        tiles.mark(Vec2::NAN, Vec2::NAN);
        assert!(tiles.spans(0).flatten().eq(0..48));
        assert!(tiles.spans(16).flatten().eq(0..48));
        assert!(tiles.spans(39).flatten().eq(80..100));
        assert!(tiles.meet(Vec2::new(47.0, 31.0), Vec2::new(80.0, 33.0)));
        assert!(!tiles.meet(Vec2::new(48.0, 0.0), Vec2::new(100.0, 32.0)));
        tiles.grow();
        assert_eq!(tiles.spans(20).collect::<Vec<_>>(), [0..48, 64..100]);
        tiles.fill(true);
        assert!(tiles.spans(33).flatten().eq(0..100));
    }
}
