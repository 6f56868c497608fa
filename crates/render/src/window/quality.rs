//! Adapts the picture's resolution to the frame time: coarser when it is too long, finer when there
//! is time.

/// Selectable fractions of the 3-D view's pixels along an edge.
const DETAILS: [f32; 5] = [1.0, 0.75, 0.55, 0.4, 0.3];

/// Frame time above which the picture is too slow, s.
const SLOW_S: f64 = 0.110;

/// Frame time below which a finer picture is possible (at about twice the cost), s.
const FAST_S: f64 = 0.045;

/// Consecutive slow pictures before the picture gets coarser.
const PATIENCE_SLOW: u32 = 3;

/// Consecutive fast pictures before the picture gets finer.
const PATIENCE_FAST: u32 = 25;

/// The current resolution level.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Quality {
    step: usize,
    slow: u32,
    fast: u32,
}

impl Quality {
    /// Starts at the coarser of `detail` and the default: the finest level on a graphics card, the
    /// middle on a software driver.
    pub fn new(software: bool, detail: f32) -> Self {
        let wanted = DETAILS.iter().position(|&d| d <= detail).unwrap_or(DETAILS.len() - 1);
        Self { step: wanted.max(if software { 2 } else { 0 }), ..Self::default() }
    }

    /// Processes the time between two pictures.
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

    /// Fraction of the 3-D view's pixels along an edge.
    pub fn detail(&self) -> f32 {
        DETAILS[self.step]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Detail after some pictures, with a frame time of `full` seconds at the finest and
    /// proportional to the pixels.
    fn settled(full: f64, pictures: u32) -> f32 {
        let mut quality = Quality::new(false, 1.0);
        for _ in 0..pictures {
            quality.note(full * f64::from(quality.detail().powi(2)));
        }
        quality.detail()
    }

    #[test]
    fn quality_converges_to_the_frame_time() {
        assert_eq!(settled(0.02, 500), 1.0);
        assert_eq!(settled(0.15, 500), 0.75);
        assert_eq!(settled(0.5, 500), 0.4);
        assert_eq!(settled(50.0, 500), 0.3);
    }

    #[test]
    fn it_starts_at_the_given_detail() {
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
