//! Picture: the skull from the opening, with fewer rays or fewer pixels, against every ray of the full picture.

use super::case::Case;
use super::scene::Situation;
use crate::suites::render::likeness::{enlarged, error_percent};
use std::time::Instant;
use trepan_budget::Picture;
use trepan_render::{Camera, Casting, Frame, Image, ProcessorRenderer, SceneData, SliceLook};

/// Shares of the pixels along an edge.
const DETAILS: [f64; 9] = [0.25, 0.3, 0.35, 0.42, 0.5, 0.6, 0.7, 0.85, 1.0];
/// Opening angle of the view, rad.
const FOV_RAD: f32 = 0.6;

/// Every choice.
pub fn choices() -> Vec<Picture> {
    [true, false].iter().flat_map(|&sparse| DETAILS.map(|detail| Picture { sparse, detail })).collect()
}

/// What a choice came to.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Root mean square of all colours, percent of white.
    pub error_percent: f64,
    /// Time of a picture on one thread, least of those drawn, µs.
    pub us: f64,
}

/// Every choice, in the order given, each drawn so many times.
pub fn measure(case: &Case, situation: &Situation, choices: &[Picture], times: usize) -> Vec<Found> {
    let full = situation.scene.picture_pixels;
    let data = SceneData { bone: Some(case.bone.clone()), brain: None, mri: None, tint: None };
    let mut renderer = ProcessorRenderer::new(&data, full).expect("the scene loads");
    renderer.threads = 1;
    let eye = situation.towards + situation.tilt;
    let distance = 0.5 * situation.scene.view_mm as f32 / (0.5 * FOV_RAD).tan();
    let camera = Camera { fov_rad: FOV_RAD, ..Camera::viewed_from(situation.bone_site, eye, distance) };
    let frame = Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) };
    let truth = draw(&mut renderer, &frame, full, &Picture { sparse: false, detail: 1.0 }).0;
    let mut found = vec![Found { error_percent: f64::NAN, us: f64::INFINITY }; choices.len()];
    for _ in 0..times {
        for (choice, found) in choices.iter().zip(&mut found) {
            let (image, us) = draw(&mut renderer, &frame, full, choice);
            *found = Found { error_percent: error_percent(&enlarged(&image, full), &truth), us: found.us.min(us) };
        }
    }
    found
}

/// A picture, cast anew, and its time, µs.
fn draw(renderer: &mut ProcessorRenderer, frame: &Frame, full: [u32; 2], choice: &Picture) -> (Image, f64) {
    let size = full.map(|n| ((f64::from(n) * choice.detail).round() as u32).max(1));
    renderer.resize(size).expect("the size is allowed");
    renderer.set_casting(Casting { sparse: choice.sparse, ..Casting::default() });
    let start = Instant::now();
    renderer.draw(frame).expect("drawn");
    (renderer.image().clone(), start.elapsed().as_secs_f64() * 1e6)
}
