//! Divides the picture into the 3-D view and the slices.
//!
//! ```text
//! ┌──────────────┬─────────┐
//! │              │ axial   │
//! │              ├─────────┤
//! │   3-D view   │ coronal │
//! │              ├─────────┤
//! │              │ sagittal│
//! └──────────────┴─────────┘
//! ```

/// Rectangles `[x, y, width, height]` in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The 3-D view.
    pub view: [u32; 4],
    /// Axial, coronal and sagittal slice; `None` if there is no room.
    pub slices: Option<[[u32; 4]; 3]>,
}

/// Smallest width and height of a picture with slices, pixels.
const SMALLEST_WITH_SLICES: u32 = 96;

impl Layout {
    /// Size of the picture whose 3-D view has so many pixels, with slices beside it.
    pub fn around([width, height]: [u32; 2]) -> [u32; 2] {
        // With the column at most two fifths of the picture, the view has at least three.
        [width + (height / 3).min(width * 2 / 3), height]
    }

    /// Rectangle of all slices.
    pub fn column(&self) -> Option<[u32; 4]> {
        let [first, _, last] = self.slices?;
        Some([first[0], first[1], first[2], last[1] + last[3] - first[1]])
    }

    /// Divides a picture.
    pub fn of(width: u32, height: u32, slices: bool) -> Self {
        let whole = Self { view: [0, 0, width, height], slices: None };
        if !slices || width < SMALLEST_WITH_SLICES || height < SMALLEST_WITH_SLICES {
            return whole;
        }
        let column = (height / 3).min(width * 2 / 5);
        let left = width - column;
        let row = |n: u32| height * n / 3;
        let slice = |n: u32| [left, row(n), column, row(n + 1) - row(n)];
        Self { view: [0, 0, left, height], slices: Some([slice(0), slice(1), slice(2)]) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_tile_the_picture() {
        for (width, height) in [(640, 480), (1680, 1050), (97, 400), (8192, 96), (1280, 721)] {
            let layout = Layout::of(width, height, true);
            let slices = layout.slices.unwrap();
            let area = |r: [u32; 4]| u64::from(r[2]) * u64::from(r[3]);
            let sum = area(layout.view) + slices.map(area).iter().sum::<u64>();
            assert_eq!(sum, u64::from(width) * u64::from(height));
            assert!(slices.iter().all(|s| s[0] == layout.view[2] && s[2] > 0 && s[3] > 0));
        }
        for view in [[640, 480], [1000, 1050], [97, 400], [8192, 96]] {
            let [width, height] = Layout::around(view);
            let layout = Layout::of(width, height, true);
            assert!(layout.view[2].abs_diff(view[0]) <= 1 && layout.view[3] == view[1], "{view:?}: {layout:?}");
            assert_eq!(layout.column(), Some([layout.view[2], 0, width - layout.view[2], height]));
        }
        assert_eq!(Layout::of(33, 17, true).slices, None);
        assert_eq!(Layout::of(640, 480, false).view, [0, 0, 640, 480]);
    }
}
