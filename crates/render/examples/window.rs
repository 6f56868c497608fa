//! A ball of bone to drill with the mouse in a window: `window [SECONDS]`; without a display it says so.

use glam::{DVec3, IVec3, Vec3};
use std::sync::Arc;
use trepan_geometry::{Pose, Quat, Tool};
use trepan_gpu::{Gpu, Prefer};
use trepan_render::window::{self, Panel, Session, Start, WindowInput};
use trepan_render::{Camera, Frame, Renderer, SceneData};
use trepan_volume::{AIR_HU, BoneVolume, VoxelVolume};

/// Takes away what the burr touches while the pedal is down.
struct Drill {
    bone: Arc<BoneVolume>,
    tool: Tool,
    world_from_tool: Pose,
    drilling: bool,
    seconds: f64,
    removed: u32,
    until: f64,
}

impl Session for Drill {
    fn update(&mut self, input: &WindowInput) -> Panel {
        (self.world_from_tool, self.drilling, self.seconds) = (input.world_from_tool, input.pedal, input.seconds);
        let tip = self.world_from_tool.translation;
        let touched = self.touched(tip);
        if self.drilling {
            touched.iter().for_each(|&voxel| self.bone.set_hu(voxel, AIR_HU));
            self.removed += touched.len() as u32;
        }
        let deep = tip.length() < 28.0;
        Panel {
            phase: "Practice".into(),
            hint: "Drill into the ball.".into(),
            tool: format!("burr {:.0} mm", 2.0 * self.tool.tip_radius_mm),
            drilling: self.drilling,
            force_n: touched.len() as f32 * 0.01,
            force_limit_n: 3.3,
            values: vec![("bone removed".into(), format!("{:.0} mm³", self.removed as f32 * self.bone.voxel_mm3()))],
            warnings: if deep { vec!["The burr is deeper than 12 mm".into()] } else { Vec::new() },
            finished: self.seconds > self.until,
            leash: None,
        }
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        let turn_rad = if self.drilling { self.seconds as f32 * 40.0 } else { 0.0 };
        Frame {
            tool: Some(self.tool),
            world_from_tool: self.world_from_tool,
            turn_rad,
            drilling: self.drilling,
            ..Frame::of(camera)
        }
    }
}

impl Drill {
    fn touched(&self, tip: Vec3) -> Vec<IVec3> {
        let voxels =
            (0..17i32.pow(3)).map(|n| self.bone.voxel_of(tip) + IVec3::new(n % 17 - 8, n / 17 % 17 - 8, n / 289 - 8));
        voxels
            .filter(|&v| self.bone.is_bone(v) && self.bone.centre_of(v).distance(tip) < self.tool.tip_radius_mm)
            .collect()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let until = std::env::args().nth(1).map_or(Ok(f64::INFINITY), |a| a.parse())?;
    let mut ball = VoxelVolume::isotropic([96; 3], Vec3::splat(-47.5), 1.0, AIR_HU);
    for at in 0..ball.data.len() {
        let centre: DVec3 = ball.centre_of([at % 96, at / 96 % 96, at / 9216]);
        ball.data[at] = (400.0 + 300.0 * (40.0 - centre.length())).clamp(-1000.0, 1400.0) as i16;
    }
    let bone = Arc::new(BoneVolume::new(&ball, 400)?);
    let renderer = Renderer::new(
        &Gpu::open(Prefer::Hardware)?,
        &SceneData { bone: Some(bone.clone()), brain: None, mri: None },
        [640, 480],
    )?;
    let world_from_tool = Pose::from_parts(
        Vec3::new(0.0, 38.0, 12.0),
        Quat::from_rotation_arc(Vec3::Z, Vec3::new(0.4, 0.8, 0.5).normalize()),
    );
    let start = Start::with(Camera::viewed_from(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.4), 200.0), world_from_tool);
    let drill =
        Drill { bone, tool: Tool::burr(4.0), world_from_tool, drilling: false, seconds: 0.0, removed: 0, until };
    let closed = window::run("Trepan", renderer, drill, start);
    println!("{:?}; {} voxels removed in {:.1} s", closed.result, closed.session.removed, closed.session.seconds);
    Ok(closed.result?)
}
