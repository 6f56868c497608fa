//! Picture quality that follows the time a picture takes: coarser when the hand waits for the eye,
//! finer when there is time.

/// Shares of the 3-D view's pixels along an edge.
const DETAILS: [f32; 5] = [1.0, 0.75, 0.55, 0.4, 0.3];

/// A picture slower than this is too slow, s.
const SLOW_S: f64 = 0.110;

/// A picture faster than this leaves room for a finer one (which costs about twice as much), s.
const FAST_S: f64 = 0.045;

/// Pictures in a row that must be too slow before the picture gets coarser.
const PATIENCE_SLOW: u32 = 3;

/// Pictures in a row that must be fast before the picture gets finer.
const PATIENCE_FAST: u32 = 25;

/// How fine the picture is.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Quality {
    step: usize,
    slow: u32,
    fast: u32,
}

impl Quality {
    /// Starts at the coarser of a detail and the finest on a graphics card, the middle on a
    /// software driver.
    pub fn new(software: bool, detail: f32) -> Self {
        let wanted = DETAILS.iter().position(|&d| d <= detail).unwrap_or(DETAILS.len() - 1);
        Self { step: wanted.max(if software { 2 } else { 0 }), ..Self::default() }
    }

    /// Takes note of the time from picture to picture.
    pub fn note(&mut self, seconds: f64) {
        self.slow = if seconds > SLOW_S { self.slow + 1 } else { 0 };
        self.fast = if seconds < FAST_S { self.fast + 1 } else { 0 };
        let step = match () {
            () if self.slow >= PATIENCE_SLOW => (self.step + 1).min(DETAILS.len() - 1),
            () if self.fast >= PATIENCE_FAST => self.step.saturating_sub(1),
            () => return,
        };
        *self = Self { step, ..Self::default() };
    }

    /// Share of the 3-D view's pixels along an edge.
    pub fn detail(&self) -> f32 {
        DETAILS[self.step]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Detail after some pictures whose time is `full` seconds at the finest and falls with the
    /// number of pixels.
    fn settled(full: f64, pictures: u32) -> f32 {
        let mut quality = Quality::new(false, 1.0);
        for _ in 0..pictures {
            quality.note(full * f64::from(quality.detail().powi(2)));
        }
        quality.detail()
    }

    #[test]
    fn quality_settles_where_the_time_fits() {
        assert_eq!(settled(0.02, 500), 1.0);
        assert_eq!(settled(0.15, 500), 0.75);
        assert_eq!(settled(0.5, 500), 0.4);
        assert_eq!(settled(50.0, 500), 0.3);
    }

    #[test]
    fn it_starts_where_it_is_told() {
        let starts = [(false, 1.0), (true, 1.0), (false, 0.5), (true, 0.35), (false, 0.1)]
            .map(|(s, d)| Quality::new(s, d).detail());
        assert_eq!(starts, [1.0, 0.55, 0.4, 0.3, 0.3]);
    }

    #[test]
    fn one_slow_picture_changes_nothing_and_rest_brings_the_finest_back() {
        let mut quality = Quality::new(true, 1.0);
        let start = quality.detail();
        quality.note(1.0);
        quality.note(0.08);
        quality.note(1.0);
        assert_eq!(quality.detail(), start);
        (0..200).for_each(|_| quality.note(0.033));
        assert_eq!(quality.detail(), 1.0);
    }
}
