//! Compares speed and pictures of device and processor: `compare [CT [WIDTH HEIGHT]]`.

use glam::Vec3;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use trepan_bone::BoneVolume;
use trepan_gpu::{Gpu, Prefer};
use trepan_render::{Camera, Casting, Frame, Hit, Painter, ProcessorRenderer, Renderer, SceneData};
use trepan_volume::{AIR_HU, Grid, Interpolation, VoxelVolume, resample};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let ct = arguments.first().map_or_else(|| Ok(made_up()), |path| from_file(Path::new(path)))?;
    let number = |at: usize, default| arguments.get(at).map_or(Ok(default), |a| a.parse());
    let size = [number(1, 640)?, number(2, 480)?];
    let bone = Arc::new(BoneVolume::new(&ct, 400)?);
    let (middle, data) = (bone.bounds().centre(), SceneData { bone: Some(bone), ..SceneData::default() });
    let views = [Vec3::Y, Vec3::new(0.7, 0.6, 0.9), Vec3::X, Vec3::new(-0.5, 1.0, 0.2)];
    let frames = views.map(|v| Frame::of(Camera::viewed_from(middle, v, 450.0)));
    let mut processor = ProcessorRenderer::new(&data, size)?;
    let mut hits = Vec::new();
    for frame in &frames {
        let start = Instant::now();
        let report = processor.draw(frame)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        println!("processor, {} threads: {ms:7.1} ms for {} rays", processor.threads, report.pixels_cast);
        hits.push(processor.bone_hits());
    }
    processor.set_casting(Casting { sparse: true, ..Casting::default() });
    for (frame, exact) in frames.iter().zip(&hits) {
        let start = Instant::now();
        processor.draw(frame)?;
        let (ms, away) = (start.elapsed().as_secs_f64() * 1e3, apart(&processor.bone_hits(), exact));
        println!("processor, sparsely: {ms:7.1} ms; {away}");
    }
    match Gpu::open(Prefer::Hardware) {
        Err(why) => println!("{}", Painter::on(Err(why), &data, size)?.notice().unwrap_or_default()),
        Ok(gpu) => {
            let mut renderer = Renderer::new(&gpu, &data, size)?;
            renderer.draw(&Frame::of(Camera::viewed_from(middle, Vec3::Z, 450.0)))?;
            gpu.wait()?;
            for (frame, by_processor) in frames.iter().zip(&hits) {
                let start = Instant::now();
                renderer.draw(frame)?;
                gpu.wait()?;
                let ms = start.elapsed().as_secs_f64() * 1e3;
                println!("{}: {ms:7.1} ms; {}", gpu.name(), apart(&renderer.bone_hits()?, by_processor));
            }
        }
    }
    Ok(())
}

/// The difference between two sets of hits, as text.
fn apart(a: &[Option<Hit>], b: &[Option<Hit>]) -> String {
    let both = a.iter().zip(b).filter_map(|(a, b)| Some((a.as_ref()?.distance_mm - b.as_ref()?.distance_mm).abs()));
    let mut depths: Vec<f32> = both.collect();
    depths.sort_by(f32::total_cmp);
    let lost = a.iter().zip(b).filter(|(a, b)| a.is_some() != b.is_some()).count();
    let p99 = depths.get(depths.len() * 99 / 100).copied().unwrap_or_default();
    format!("depth differs by {p99:.5} mm (p99), {lost} hits on one side only")
}

fn from_file(path: &Path) -> Result<VoxelVolume<i16>, Box<dyn std::error::Error>> {
    let ct = trepan_volume::read(path)?;
    let fine = resample(&ct, &Grid::isotropic_over(&ct, 1.0), Interpolation::Trilinear, f32::from(AIR_HU));
    Ok(fine.map(|v| v as i16))
}

/// A synthetic shell of bone with waves on it.
fn made_up() -> VoxelVolume<i16> {
    let mut ct = VoxelVolume::isotropic([160; 3], Vec3::splat(-79.5), 1.0, AIR_HU);
    for at in 0..ct.data.len() {
        let p = Vec3::new((at % 160) as f32, (at / 160 % 160) as f32, (at / 25600) as f32) - 79.5;
        let depth = (p.length() - 65.0 - (0.3 * p.x).sin() * (0.3 * p.z).cos()).abs();
        ct.data[at] = (400.0 + 250.0 * (4.0 - depth)).clamp(-1000.0, 1400.0) as i16;
    }
    ct
}
