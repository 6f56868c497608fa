//! The cortex that is seen: against the MRI's own isosurface, over coarse and fine tetrahedra, and
//! what it costs to draw.
//!
//! # Practice
//! Truth is the exact distance to where the grid's edges cross the level. It is asked where the MRI
//! decides: half a millimetre and more below the mask. The brain sways and the camera moves while
//! pictures are timed, by the processor, without slices and with every pixel.

use super::scenes::swaying;
use glam::Vec3;
use std::time::Instant;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_geometry::quantile;
use trepan_mesh::{TetMesh, lattice};
use trepan_patient::Cortex as Seen;
use trepan_render::{Camera, Cortex, Frame, Image, ProcessorRenderer, SceneData, SliceLook};
use trepan_trials_scenes::population::{BaseHead, base_heads};
use trepan_volume::{DistanceField, grey_level};

/// Depth below the mask from which the MRI decides, mm.
const BELOW_MM: f32 = 0.5;
/// Tetrahedra of `draft` and `fine`.
const SIZES: [usize; 2] = [3_000, 12_000];
/// The window's picture.
const SIZE: [u32; 2] = [1280, 800];

/// The built-in head and, if it is there, the second.
pub fn run(scope: Scope, findings: &mut Findings) {
    let heads = base_heads().expect("the built-in head is there");
    for head in heads.iter().take(scope.pick(1, 2)) {
        judge(head, scope, findings);
    }
}

fn judge(head: &BaseHead, scope: Scope, findings: &mut Findings) {
    let field = DistanceField::of_mask(&head.brain);
    let start = Instant::now();
    let seen = Seen::of(&head.mri, &head.brain, &field);
    let made_s = start.elapsed().as_secs_f64();
    let level = grey_level(&head.mri, &head.brain).expect("the MRI shows tissue");
    let truth = DistanceField::of_level(&head.mri, level);
    let decided = seen.surface.positions.iter().zip(&seen.depth_mm).filter(|(_, mm)| **mm > BELOW_MM);
    let mut off: Vec<f64> = decided.map(|(p, _)| f64::from(truth.sample(*p).abs())).collect();
    let judged = off.len() as f64 / seen.surface.positions.len() as f64;
    let [p50_mm, p95_mm] = [0.5, 0.95].map(|share| quantile(&mut off, share));
    let cortex = Some(Cortex { surface: &seen.surface, depth_mm: &seen.depth_mm });
    let meshes = SIZES.map(|target_tets| {
        let config = lattice::Config { target_tets, ..lattice::Config::default() };
        lattice::tetrahedra(&head.brain, &config).expect("the brain has a mesh")
    });
    let middle = seen.surface.bounds().centre();
    let [draft, fine] = meshes.each_ref().map(|mesh| View::of(mesh, cortex, middle).outline());
    let pixels = draft.iter().filter(|is| **is).count();
    let differ = draft.iter().zip(&fine).filter(|(a, b)| a != b).count() as f64 / pixels as f64;
    let name = head.name;
    let mut row = Row::new(name, "cortex")
        .metric("vertices", seen.surface.positions.len() as f64)
        .metric("triangles", seen.surface.triangles.len() as f64)
        .metric("made_s", made_s)
        .metric("judged_share", judged)
        .metric("off_p50_mm", p50_mm)
        .metric("off_p95_mm", p95_mm)
        .metric("outlines_differ_percent", 100.0 * differ);
    for (with, cortex) in [("with_ms", cortex), ("without_ms", None)] {
        let mut drawn = View::of(&meshes[1], cortex, middle);
        let sways: Vec<Vec<Vec3>> = (0..4).map(|turn| swaying(&meshes[1], turn)).collect();
        drawn.draw(1, Some(&sways[1]), None);
        let times = Samples::of(scope.pick(4, 20), |turn| drawn.draw(turn, Some(&sways[turn % 4]), None));
        row = row.metric(with, 1e-3 * times.quantile(0.5));
    }
    // One more tetrahedron is gone in each picture.
    let mut drawn = View::of(&meshes[1], cortex, middle);
    let mut gone = vec![false; meshes[1].tets.len()];
    let times = Samples::of(scope.pick(4, 20), |turn| {
        gone[turn] = true;
        drawn.draw(turn, None, Some(&gone));
    });
    row = row.metric("resected_ms", 1e-3 * times.quantile(0.5));
    findings.rows.push(row);
    findings.gates.extend([
        Gate::at_most(format!("{name}: cortex against the MRI's isosurface, p95 mm"), p95_mm, 0.5),
        Gate::at_most(format!("{name}: outline with draft and with fine, percent that differ"), 100.0 * differ, 1.0),
    ]);
}

/// A brain before the camera.
struct View {
    renderer: ProcessorRenderer,
    middle: Vec3,
}

impl View {
    fn of(mesh: &TetMesh, cortex: Option<Cortex>, middle: Vec3) -> Self {
        let data = SceneData { bone: None, brain: Some(mesh), mri: None, tint: None, cortex };
        let renderer = ProcessorRenderer::new(&data, SIZE).expect("the scene loads");
        Self { renderer, middle }
    }

    fn draw(&mut self, turn: usize, brain_positions: Option<&[Vec3]>, brain_gone: Option<&[bool]>) {
        let towards = Vec3::new(0.5 + 0.02 * (turn % 2) as f32, 1.0, 0.45);
        let camera = Camera::viewed_from(self.middle, towards, 300.0);
        let slices = SliceLook { shown: false, ..SliceLook::default() };
        self.renderer.draw(&Frame { brain_positions, brain_gone, slices, ..Frame::of(camera) }).expect("drawn");
    }

    /// Whether each pixel shows the brain, at rest.
    fn outline(&mut self) -> Vec<bool> {
        self.draw(0, None, None);
        let Image { rgba, .. } = self.renderer.image();
        // The background is blue, the brain is red.
        rgba.chunks(4).map(|pixel| pixel[0] > pixel[2]).collect()
    }
}
