//! Tests how smooth a ball looks that was scanned as a head is.

use glam::{DAffine3, DVec3, Vec2, Vec3};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_gpu::adapter_for_tests;
use trepan_render::{Camera, Frame, Hit, ProcessorRenderer, Renderer, SceneData, SliceLook, View};
use trepan_volume::{AIR_HU, Grid, Interpolation, VoxelVolume, resample};

/// Voxel edges of the built-in head's CT, mm.
const VOXEL_MM: DVec3 = DVec3::new(1.0, 1.0, 2.0);
/// HU of soft tissue and of bone.
const HU: [f64; 2] = [40.0, 1400.0];
const ISO: i16 = 400;
const SIZE: [u32; 2] = [160, 160];

/// A ball of bone in soft tissue as a scanner sees it: each voxel is the mean over its box, in
/// whole HU.
fn scanned(radius_mm: f64) -> VoxelVolume<i16> {
    const PARTS: i32 = 6;
    let count = ((2.0 * radius_mm + 16.0) / VOXEL_MM).ceil();
    let first = DVec3::new(0.13, 0.31, 0.37) - 0.5 * (count - 1.0) * VOXEL_MM;
    let world_from_voxel = DAffine3::from_translation(first) * DAffine3::from_scale(VOXEL_MM);
    let dims = count.to_array().map(|n| n as usize);
    let mut ct = VoxelVolume::filled(dims, world_from_voxel, 0i16);
    let part = |n: i32| (f64::from(n % PARTS) + 0.5) / f64::from(PARTS) - 0.5;
    for at in 0..ct.data.len() {
        let centre = ct.centre_of([at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])]);
        let inside = |n: &i32| {
            let offset = DVec3::new(part(*n), part(n / PARTS), part(n / PARTS / PARTS));
            (centre + VOXEL_MM * offset).length() < radius_mm
        };
        let share = match centre.length() - radius_mm {
            away if away.abs() > 2.0 => f64::from(u8::from(away < 0.0)),
            _ => (0..PARTS.pow(3)).filter(inside).count() as f64 / f64::from(PARTS.pow(3)),
        };
        ct.data[at] = (HU[0] + (HU[1] - HU[0]) * share).round() as i16;
    }
    ct
}

/// Root mean square angle between normals and those of the ball, degrees.
fn deviation(hits: &[Option<Hit>], view: &View) -> f32 {
    let centre = |n: usize, of: u32| (n as f32 + 0.5) / of as f32 * 2.0 - 1.0;
    let (mut sum, mut count) = (0.0, 0);
    for (n, hit) in hits.iter().enumerate().filter_map(|(n, hit)| Some((n, (*hit)?))) {
        let [x, y] = [n % SIZE[0] as usize, n / SIZE[0] as usize];
        let along = view.ray(Vec2::new(centre(x, SIZE[0]), -centre(y, SIZE[1])));
        let point = (view.eye + hit.distance_mm * along).normalize();
        // Not at the rim, where a pixel sees several degrees at once.
        if along.dot(point) < -0.3 {
            sum += hit.normal.angle_between(point).to_degrees().powi(2);
            count += 1;
        }
    }
    assert!(count > 10_000, "the ball fills the picture: {count}");
    (sum / count as f32).sqrt()
}

#[test]
fn a_scanned_ball_is_smooth_on_processor_and_device() {
    let gpu = adapter_for_tests();
    for (radius, spacing) in [(20.0, 0.5), (20.0, 0.75), (20.0, 1.0), (70.0, 1.0)] {
        let ct = scanned(radius);
        let fine = resample(&ct, &Grid::isotropic_over(&ct, spacing), Interpolation::Cubic, AIR_HU);
        let bone = Arc::new(BoneVolume::new(&fine, ISO).unwrap());
        let data = SceneData { bone: Some(bone), brain: None, mri: None, tint: None, cortex: None };
        let towards_eye = Vec3::new(0.5, 0.7, 0.6);
        let camera = Camera { fov_rad: 0.4, ..Camera::viewed_from(Vec3::ZERO, towards_eye, 5.2 * radius as f32) };
        let frame = Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) };
        let mut processor = ProcessorRenderer::new(&data, SIZE).unwrap();
        processor.draw(&frame).unwrap();
        let by_processor = deviation(&processor.bone_hits(), &processor.view(&frame));
        println!("radius {radius} mm, voxels of {spacing} mm: {by_processor:.2} degrees");
        assert!(by_processor < 1.2, "{by_processor} degrees at {radius}, {spacing} mm");
        if let Some(gpu) = &gpu {
            let mut device = Renderer::new(gpu, &data, SIZE).unwrap();
            device.draw(&frame).unwrap();
            let by_device = deviation(&device.bone_hits().unwrap(), &device.view(&frame));
            assert!((by_device - by_processor).abs() < 0.02, "{by_device} and {by_processor} degrees");
        }
    }
}
