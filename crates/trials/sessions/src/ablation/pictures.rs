//! Pictures of the opening during a run, as a session without a window draws them.

use crate::scripted::LookInput;
use anyhow::{Result, anyhow};
use trepan_render::{Frame, Image, Painter, RenderError, SceneData, SliceLook};

/// Size of a picture, pixels.
const SIZE: [u32; 2] = [480, 300];
/// Turn of the burr while it cuts, rad per ms.
const TURN: f32 = 0.7;

/// Pictures of a run by the processor's renderer: the same on every machine. They show bone, brain
/// and tool, without slices and without the arrow of the force.
pub struct Pictures {
    every_ms: u64,
    painter: Option<Painter>,
    taken: Result<Vec<Image>, RenderError>,
}

impl Pictures {
    /// One picture in so many ms of the operation.
    pub fn every(every_ms: u64) -> Self {
        Self { every_ms, painter: None, taken: Ok(Vec::new()) }
    }

    /// Takes a picture if one is due.
    pub fn watch(&mut self, shown: &LookInput<'_>) {
        if !shown.ms.is_multiple_of(self.every_ms) {
            return;
        }
        match (self.draw(shown), &mut self.taken) {
            (Ok(image), Ok(taken)) => taken.push(image),
            (Err(fault), taken @ Ok(_)) => *taken = Err(fault),
            (_, Err(_)) => {}
        }
    }

    fn draw(&mut self, shown: &LookInput<'_>) -> Result<Image, RenderError> {
        let scene = shown.session.scene();
        let brain = scene.brain.as_ref();
        let painter = match &mut self.painter {
            Some(painter) => painter,
            none => none.insert(Painter::by_processor(
                &SceneData {
                    bone: scene.bone.clone(),
                    brain: brain.map(|brain| &brain.mesh),
                    mri: brain.map(|brain| &brain.mri),
                    tint: brain.and_then(|brain| brain.tint.as_deref()),
                    cortex: None,
                },
                SIZE,
            )?),
        };
        let frame = Frame {
            tool: Some(shown.sample.tool),
            world_from_tool: shown.sample.state.world_from_tool,
            turn_rad: if shown.sample.drilling { shown.ms as f32 * TURN } else { 0.0 },
            drilling: shown.sample.drilling,
            brain_positions: Some(shown.positions),
            slices: SliceLook { shown: false, ..SliceLook::default() },
            ..Frame::of(shown.session.camera())
        };
        Ok(painter.picture(&frame)?.0)
    }

    /// The pictures; the fault of one that failed.
    pub fn taken(self) -> Result<Vec<Image>> {
        self.taken.map_err(|fault| anyhow!("a picture failed: {fault}"))
    }
}

/// Root mean square difference of all colours over pairs of pictures, percent of white; not a
/// number where the pictures do not pair.
pub fn difference_percent(of: &[Image], usual: &[Image]) -> f64 {
    if of.len() != usual.len() || of.is_empty() {
        return f64::NAN;
    }
    let squares: f64 = of.iter().zip(usual).map(|(a, b)| a.error_percent(b).powi(2)).sum();
    (squares / of.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_the_root_mean_square_over_the_pictures() {
        let of = |grey: u8| Image { width: 2, height: 2, rgba: [grey, grey, grey, 255].repeat(4) };
        let percent = difference_percent(&[of(51), of(0)], &[of(0), of(0)]);
        assert!((percent - 20.0 / 2.0f64.sqrt()).abs() < 1e-9, "{percent}");
        assert_eq!(difference_percent(&[of(7)], &[of(7)]), 0.0);
        assert!(difference_percent(&[of(7)], &[of(7), of(7)]).is_nan() && difference_percent(&[], &[]).is_nan());
    }
}
