//! Rendering: accuracy of rays against a brute-force f64 march, bores, GPU against CPU, effect of
//! empty-space skipping, sparse rays, step and resolution, failures.

pub mod accuracy;
mod bores;
mod cortex;
pub mod faults;
mod likeness;
mod models;
mod rest;
pub mod rivals;
pub mod scenes;
pub mod speed;

use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::Findings;
use trepan_gpu::{Gpu, Prefer};
use trepan_render::{Casting, Frame, Hit, Image, ProcessorRenderer, Renderer, SceneData, View};

/// Step of the reference along a ray, voxels.
const FINE_VOXEL: f64 = 1.0 / 16.0;

/// Where the ray of each pixel met bone.
pub type Hits = Vec<Option<Hit>>;

/// Renderer: GPU or CPU.
pub enum By {
    /// The CPU.
    Processor(Box<ProcessorRenderer>),
    /// The GPU.
    Device(Box<Renderer>),
}

/// Settings of the 3-D view.
#[derive(Clone, Copy)]
pub struct Setting {
    /// Name.
    pub name: &'static str,
    /// How rays are cast.
    pub casting: Casting,
    /// Fraction of the pixels along an edge.
    pub detail: f32,
}

/// Setting of still pictures.
pub const EXACT: Setting =
    Setting { name: "exact", casting: Casting { leap: true, step_voxel: None, sparse: false }, detail: 1.0 };

/// Setting of the CPU while the camera moves.
pub const SPARSE: Setting =
    Setting { name: "sparse rays", casting: Casting { sparse: true, ..EXACT.casting }, ..EXACT };

/// Lists the parts: accuracy on small pictures, speed on large ones, models and failures.
pub fn parts(_: Scope) -> Vec<Part> {
    type Subject = fn(Scope, Option<&Gpu>, &mut Findings);
    let all: [(&str, Subject); 9] = [
        ("depth", accuracy::depth),
        ("walls", |_, gpu, found| accuracy::walls(gpu, found)),
        ("bores", bores::run),
        ("edits", |_, gpu, found| accuracy::edits(gpu, found)),
        ("faults", |_, gpu, found| faults::run(gpu, found)),
        ("speed", speed::run),
        ("models", models::run),
        ("rest", |scope, _, found| rest::run(scope, found)),
        ("cortex", |scope, _, found| cortex::run(scope, found)),
    ];
    // Without a driver only the processor's rows are made.
    let drawn = |(name, subject): (&str, Subject)| {
        Part::new(name, move |scope, found| subject(scope, Gpu::open(Prefer::Hardware).ok().as_ref(), found))
    };
    all.map(drawn).into()
}

impl By {
    /// The CPU renderer, and the GPU one if there is a device.
    pub fn all(bone: &Arc<BoneVolume>, gpu: Option<&Gpu>, size: [u32; 2]) -> Vec<Self> {
        Self::of(&SceneData { bone: Some(bone.clone()), brain: None, mri: None, tint: None, cortex: None }, gpu, size)
    }

    fn of(data: &SceneData, gpu: Option<&Gpu>, size: [u32; 2]) -> Vec<Self> {
        let processor = ProcessorRenderer::new(data, size).expect("the scene loads");
        let device = gpu.map(|gpu| Self::Device(Box::new(Renderer::new(gpu, data, size).expect("the scene loads"))));
        [Some(Self::Processor(Box::new(processor))), device].into_iter().flatten().collect()
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Processor(_) => "processor",
            Self::Device(_) => "device",
        }
    }

    fn machine(&self) -> String {
        match self {
            Self::Processor(p) => format!("{} threads", p.threads),
            Self::Device(r) => r.gpu().name(),
        }
    }

    /// Applies a setting and invalidates the last picture.
    pub fn set(&mut self, setting: &Setting, size: [u32; 2]) {
        match self {
            Self::Processor(p) => {
                p.resize(size.map(|n| (n as f32 * setting.detail).round() as u32)).expect("the size is allowed");
                p.set_casting(setting.casting);
            }
            Self::Device(r) => {
                r.set_detail(setting.detail).expect("the size is allowed");
                r.set_leaping(setting.casting.leap);
            }
        }
    }

    /// Draws a frame and waits for it.
    pub fn draw(&mut self, frame: &Frame) {
        match self {
            Self::Processor(p) => drop(p.draw(frame).expect("drawn")),
            Self::Device(r) => {
                r.draw(frame).expect("drawn");
                r.gpu().wait().expect("the device answers");
            }
        }
    }

    /// Where the rays of the last picture met bone.
    pub fn hits(&self) -> Hits {
        match self {
            Self::Processor(p) => p.bone_hits(),
            Self::Device(r) => r.bone_hits().expect("the hits are read"),
        }
    }

    fn image(&self) -> Image {
        match self {
            Self::Processor(p) => p.image().clone(),
            Self::Device(r) => r.image().expect("the picture is read"),
        }
    }

    /// The view by which it draws a frame.
    pub fn view(&self, frame: &Frame) -> View {
        match self {
            Self::Processor(p) => p.view(frame),
            Self::Device(r) => r.view(frame),
        }
    }
}
