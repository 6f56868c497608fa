//! A ball of bone to drill with the mouse in a window: `window [SECONDS [processor]]`.

use glam::{DVec3, IVec3, Vec3};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Quat, Tool};
use trepan_gpu::{Gpu, GpuError, Prefer};
use trepan_render::{Camera, Frame, Image, Painter, SceneData};
use trepan_volume::{AIR_HU, VoxelVolume};
use trepan_window::{Capture, Panel, Session, Start, WindowInput, run};

/// Removes the voxels that the burr touches while the pedal is down.
struct Drill {
    bone: Arc<BoneVolume>,
    world_from_tool: Pose,
    seconds: f64,
    removed: usize,
    until: f64,
}

const RADIUS_MM: f32 = 4.0;

impl Session for Drill {
    fn update(&mut self, input: &WindowInput) -> Panel {
        (self.world_from_tool, self.seconds) = (input.world_from_tool, input.seconds);
        let tip = self.world_from_tool.translation;
        let touched = touched(&self.bone, tip);
        if input.pedal {
            touched.iter().for_each(|&voxel| self.bone.set_hu(voxel, AIR_HU));
            self.removed += touched.len();
        }
        Panel {
            phase: "Practice".into(),
            drilling: input.pedal,
            force_n: touched.len() as f32 * 0.01,
            values: vec![("bone removed".into(), format!("{} mm³", self.removed))],
            warnings: (tip.length() < 28.0).then(|| "The burr is deeper than 12 mm".into()).into_iter().collect(),
            finished: self.seconds > self.until,
            ..Panel::default()
        }
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        let (tool, turn_rad) = (Some(Tool::burr(RADIUS_MM)), 40.0 * self.seconds as f32);
        Frame { tool, world_from_tool: self.world_from_tool, turn_rad, ..Frame::of(camera) }
    }

    fn capture(&mut self, _: Capture, picture: Image) {
        println!("{:?}", picture.write_png("window.png".as_ref()));
    }
}

fn touched(bone: &BoneVolume, tip: Vec3) -> Vec<IVec3> {
    let near = (0..17i32.pow(3)).map(|n| bone.voxel_of(tip) + IVec3::new(n % 17 - 8, n / 17 % 17 - 8, n / 289 - 8));
    near.filter(|&v| bone.is_bone(v) && bone.centre_of(v).distance(tip) < RADIUS_MM).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let until = std::env::args().nth(1).map_or(Ok(f64::INFINITY), |a| a.parse())?;
    let mut ball = VoxelVolume::isotropic([96; 3], Vec3::splat(-47.5), 1.0, AIR_HU);
    for at in 0..ball.data.len() {
        let centre: DVec3 = ball.centre_of([at % 96, at / 96 % 96, at / 9216]);
        ball.data[at] = (400.0 + 300.0 * (40.0 - centre.length())).clamp(-1000.0, 1400.0) as i16;
    }
    let bone = Arc::new(BoneVolume::new(&ball, 400)?);
    let data = SceneData { bone: Some(bone.clone()), brain: None, mri: None, tint: None, cortex: None };
    let device = if std::env::args().nth(2).is_some_and(|a| a == "processor") {
        Err(GpuError::NoAdapter)
    } else {
        Gpu::open(Prefer::Hardware)
    };
    let painter = Painter::on(device, &data, [640, 480])?;
    let rotation = Quat::from_rotation_arc(Vec3::Z, Vec3::new(0.4, 0.8, 0.5).normalize());
    let world_from_tool = Pose::from_parts(Vec3::new(0.0, 38.0, 12.0), rotation);
    let camera = Camera::viewed_from(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.4), 200.0);
    let drill = Drill { bone, world_from_tool, seconds: 0.0, removed: 0, until };
    let closed = run("Trepan", painter, drill, Start::with(camera, world_from_tool));
    println!("{} drew for {:.1} s: {:?}", closed.renderer.name(), closed.session.seconds, closed.result);
    Ok(closed.result?)
}
