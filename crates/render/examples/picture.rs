//! Draws a drilled skull to a PNG: `picture OUT.png [CT [BRAIN_MASK [MRI]]]`, NIfTI files; without
//! a CT, a synthetic one.

use glam::{DAffine3, Vec3};
use std::path::Path;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Quat, Tool};
use trepan_gpu::{Gpu, Prefer};
use trepan_mesh::lattice;
use trepan_render::{Camera, Frame, Renderer, SceneData};
use trepan_volume::{AIR_HU, Grid, Interpolation, VoxelVolume, resample};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = arguments.first().map_or("skull.png", String::as_str);
    let ct = arguments.get(1).map_or_else(|| Ok(made_up()), |path| from_file(Path::new(path)))?;
    let read = |at: usize| arguments.get(at).map(|path| trepan_volume::read(Path::new(path))).transpose();
    let config = lattice::Config { target_tets: 20_000, ..Default::default() };
    let brain = read(2)?.map(|mask| lattice::tetrahedra(&mask.map(|v| u8::from(v > 0.5)), &config)).transpose()?;
    let mri = read(3)?;

    let bone = Arc::new(BoneVolume::new(&ct, 400)?);
    let bounds = bone.bounds();
    let gpu = Gpu::open(Prefer::Hardware)?;
    let data = SceneData { bone: Some(bone.clone()), brain: brain.as_ref(), mri: mri.as_ref(), ..Default::default() };
    let mut renderer = Renderer::new(&gpu, &data, [960, 720])?;
    let towards_eye = Vec3::new(0.7, 0.6, 0.9);
    let camera = Camera::viewed_from(bounds.centre() + 25.0 * Vec3::Z, towards_eye, 1.5 * bounds.size().max_element());
    let entry = drill(&bone, towards_eye.normalize(), 14.0);
    let world_from_tool =
        Pose::from_parts(entry + 8.0 * Vec3::Z, Quat::from_rotation_arc(Vec3::Z, Vec3::new(0.5, 0.2, 0.8).normalize()));
    let frame = Frame { tool: Some(Tool::burr(4.0)), world_from_tool, ..Frame::of(camera) };
    for picture in 0..3 {
        let start = std::time::Instant::now();
        let report = renderer.draw(&frame)?;
        let image = renderer.image()?;
        println!("picture {picture}: {:.0} ms, {report:?}", start.elapsed().as_secs_f64() * 1e3);
        renderer.pass_times()?.iter().for_each(|p| println!("  {:8} {:8.0} µs", p.name, p.us));
        image.write_png(Path::new(out))?;
    }
    println!("{} on {}: {out}", if gpu.faults().count == 0 { "drawn" } else { "drawn with faults" }, gpu.name());
    Ok(())
}

/// Removes a ball of bone where the ray from outside hits the skull; returns its centre.
fn drill(bone: &BoneVolume, outwards: Vec3, radius_mm: f32) -> Vec3 {
    let middle = bone.bounds().centre() + 10.0 * Vec3::Z;
    let way = (0..4000).map(|i| middle + outwards * (200.0 - 0.1 * i as f32));
    let entry = way.into_iter().find(|&p| bone.is_bone(bone.voxel_of(p))).unwrap_or(middle);
    let reach = (radius_mm / bone.spacing_mm()).ceil() as i32;
    for n in 0..(2 * reach + 1).pow(3) {
        let offset =
            glam::IVec3::new(n % (2 * reach + 1), n / (2 * reach + 1) % (2 * reach + 1), n / (2 * reach + 1).pow(2))
                - reach;
        let voxel = bone.voxel_of(entry) + offset;
        if bone.centre_of(voxel).distance(entry) < radius_mm {
            bone.set_hu(voxel, AIR_HU);
        }
    }
    entry
}

fn from_file(path: &Path) -> Result<VoxelVolume<i16>, Box<dyn std::error::Error>> {
    let ct = trepan_volume::read(path)?;
    let fine = resample(&ct, &Grid::isotropic_over(&ct, 1.0), Interpolation::Trilinear, f32::from(AIR_HU));
    Ok(fine.map(|v| v as i16))
}

/// A synthetic shell of bone, 7 mm thick.
fn made_up() -> VoxelVolume<i16> {
    let mut ct = VoxelVolume::isotropic([120, 140, 120], Vec3::new(-89.25, -104.25, -89.25), 1.5, AIR_HU);
    let world_from_voxel: DAffine3 = ct.world_from_voxel;
    for at in 0..ct.data.len() {
        let voxel = glam::DVec3::new((at % 120) as f64, (at / 120 % 140) as f64, (at / 16800) as f64);
        let depth = 80.0 - (world_from_voxel.transform_point3(voxel) / glam::DVec3::new(0.9, 1.15, 0.9)).length();
        ct.data[at] = (400.0 + 300.0 * (3.5 - (depth - 3.5).abs())).clamp(-1000.0, 1400.0) as i16;
    }
    ct
}
