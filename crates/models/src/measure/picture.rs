//! Measures the error of pictures of the skull with fewer rays or pixels, against every ray of the
//! full picture.

use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_budget::{Picture, Scene};
use trepan_geometry::Vec3;
use trepan_patient::progress::Stopwatch;
use trepan_render::{Camera, Casting, Frame, Image, ProcessorRenderer, RenderError, SceneData, SliceLook};

/// Resolutions along an edge, as shares of the full picture's.
const DETAILS: [f64; 9] = [0.25, 0.3, 0.35, 0.42, 0.5, 0.6, 0.7, 0.85, 1.0];
/// Field of view, rad.
const FOV_RAD: f32 = 0.6;

/// All choices for the picture.
pub fn choices() -> Vec<Picture> {
    [true, false].iter().flat_map(|&sparse| DETAILS.map(|detail| Picture { sparse, detail })).collect()
}

/// Measured error and time of a choice.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Root-mean-square error of all colours, percent of white.
    pub error_percent: f64,
    /// Time of the picture, µs.
    pub us: f64,
}

/// Every ray of the full picture: the truth.
const EXACT: Picture = Picture { sparse: false, detail: 1.0 };

/// A view of a skull.
#[derive(Clone, Debug)]
pub struct View {
    /// Bone that is drawn.
    pub bone: Arc<BoneVolume>,
    /// Source of the number of pixels and the height of the view.
    pub scene: Scene,
    /// Point at which the camera looks.
    pub target: Vec3,
    /// Direction from there to the camera.
    pub eye: Vec3,
}

impl View {
    /// Root-mean-square colour error over all views, percent of white, of each choice in the order
    /// given.
    ///
    /// # Errors
    /// If the picture has no pixels or too many.
    pub fn measure_all(views: &[Self], choices: &[Picture], threads: usize) -> Result<Vec<f64>, RenderError> {
        let mut squares = vec![0.0; choices.len()];
        for view in views {
            let found = view.measure(choices, threads)?;
            squares.iter_mut().zip(found).for_each(|(sum, found)| *sum += found.error_percent.powi(2));
        }
        Ok(squares.into_iter().map(|sum| (sum / views.len().max(1) as f64).sqrt()).collect())
    }

    /// Draws each choice once with so many threads, and measures it; in the order given.
    ///
    /// # Errors
    /// If the picture has no pixels or too many.
    pub fn measure(&self, choices: &[Picture], threads: usize) -> Result<Vec<Measurement>, RenderError> {
        let full = self.scene.picture_pixels;
        let data = SceneData { bone: Some(Arc::clone(&self.bone)), brain: None, mri: None, tint: None, cortex: None };
        let mut renderer = ProcessorRenderer::new(&data, full)?;
        renderer.threads = threads;
        let distance = 0.5 * self.scene.view_mm as f32 / (0.5 * FOV_RAD).tan();
        let camera = Camera { fov_rad: FOV_RAD, ..Camera::viewed_from(self.target, self.eye, distance) };
        let frame = Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) };
        let (truth, exact_us) = draw(&mut renderer, &frame, full, &EXACT)?;
        let one = |choice: &Picture| {
            if *choice == EXACT {
                return Ok(Measurement { error_percent: 0.0, us: exact_us });
            }
            let (image, us) = draw(&mut renderer, &frame, full, choice)?;
            Ok(Measurement { error_percent: image.enlarged(full).error_percent(&truth), us })
        };
        choices.iter().map(one).collect()
    }
}

/// Draws a picture from scratch; returns it and its time, µs.
fn draw(
    renderer: &mut ProcessorRenderer,
    frame: &Frame,
    full: [u32; 2],
    choice: &Picture,
) -> Result<(Image, f64), RenderError> {
    let size = full.map(|n| ((f64::from(n) * choice.detail).round() as u32).max(1));
    renderer.resize(size)?;
    renderer.set_casting(Casting { sparse: choice.sparse, ..Casting::default() });
    let clock = Stopwatch::start();
    renderer.draw(frame)?;
    Ok((renderer.image().clone(), 1e3 * clock.now_ms()))
}
