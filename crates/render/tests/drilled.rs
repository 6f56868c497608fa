//! Tests bores of 1.5 and 3 mm in voxels of 1 mm against their closed form.

mod scene;
mod similar;

use glam::{IVec3, Vec2, Vec3};
use scene::{alone, bone, device};
use similar::similarity;
use std::sync::Arc;
use trepan_bone::{BoneVolume, CUT_STEPS, CUT_SURFACE};
use trepan_gpu::Faults;
use trepan_render::{Camera, Frame, Hit, Image, ProcessorRenderer, SliceLook, View};

const SIZE: [u32; 2] = [200, 160];
/// Half the thickness of the plate, mm.
const HALF_MM: f32 = 2.6;
/// Ends and radii of the bores, mm: two through the plate and one that ends in it.
const BORES: [(Vec3, Vec3, f32); 3] = [
    (Vec3::new(-2.3, 0.2, -6.0), Vec3::new(-2.3, 0.2, 6.0), 1.5),
    (Vec3::new(1.9, 1.3, -6.0), Vec3::new(2.6, 1.0, 6.0), 0.75),
    (Vec3::new(1.2, -2.1, 1.2), Vec3::new(1.9, -1.8, 6.0), 1.5),
];

/// How deep a place lies in the bores, mm.
fn deep(p: Vec3) -> f32 {
    let one = |(a, b, r): (Vec3, Vec3, f32)| {
        let share = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        r - p.distance(a.lerp(b, share))
    };
    BORES.map(one).into_iter().fold(f32::MIN, f32::max)
}

fn plate() -> Arc<BoneVolume> {
    bone(24, |p| 3.0 * (p.z.abs() - f64::from(HALF_MM)))
}

/// Cuts the bores, or takes the cut back.
fn bore(bone: &BoneVolume, cut: bool) {
    let mut writer = bone.cut_writer();
    let last = IVec3::splat(23 * bone.cut_nodes());
    for node in
        (0..=last.z).flat_map(|z| (0..=last.y).flat_map(move |y| (0..=last.x).map(move |x| IVec3::new(x, y, z))))
    {
        let depth = deep(bone.origin() + bone.node_mm() * node.as_vec3()) / bone.node_mm();
        if depth > -3.0 {
            let value = CUT_SURFACE + (depth.min(3.0) * CUT_STEPS).round() as i16;
            assert!(writer.set(node, if cut { value } else { 0 }));
        }
    }
}

/// The 3-D view through the microscope, `wide` mm across.
fn zoom(wide: f32) -> Frame<'static> {
    let (target, towards_eye) = (Vec3::new(0.0, -0.2, HALF_MM), Vec3::new(0.25, 0.5, 1.0));
    let camera = Camera { fov_rad: wide / 250.0, ..Camera::viewed_from(target, towards_eye, 250.0) };
    Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) }
}

/// Hits of the closed form, by small steps.
fn truth(view: &View) -> Vec<Option<Hit>> {
    let outside = |p: Vec3| (p.z.abs() - HALF_MM).max(deep(p));
    let [width, height] = SIZE.map(|n| n as f32);
    let pixels = (0..SIZE[0] * SIZE[1]).map(|n| Vec2::new((n % SIZE[0]) as f32 + 0.5, (n / SIZE[0]) as f32 + 0.5));
    let ray = |p: Vec2| view.ray(Vec2::new(2.0 * p.x / width - 1.0, 1.0 - 2.0 * p.y / height));
    let hit = |along: Vec3| {
        let at = |t: f32| view.eye + t * along;
        let over = (HALF_MM - view.eye.z) / along.z;
        let first = (0..1600).map(|n| over + 0.005 * n as f32).find(|&t| outside(at(t)) < 1e-4)?;
        let normal = Vec3::AXES.map(|axis| outside(at(first) + 0.002 * axis) - outside(at(first) - 0.002 * axis));
        Some(Hit { distance_mm: first, normal: Vec3::from(normal).normalize() })
    };
    pixels.map(ray).map(hit).collect()
}

/// The surface alone, lit from the left.
fn lit(hits: &[Option<Hit>]) -> Image {
    let light = Vec3::new(-0.5, 0.3, 0.8).normalize();
    let grey = |hit: &Option<Hit>| hit.map_or(0, |hit| (40.0 + 200.0 * hit.normal.dot(light).max(0.0)) as u8);
    let rgba = hits.iter().map(grey).flat_map(|v| [v, v, v, 255]).collect();
    Image { width: SIZE[0], height: SIZE[1], rgba }
}

#[test]
fn a_bore_has_the_rim_depth_and_normals_of_its_closed_form() {
    let bone = plate();
    bore(&bone, true);
    for wide in [6.0, 12.0] {
        let frame = zoom(wide);
        let mut processor = ProcessorRenderer::new(&alone(&bone), SIZE).unwrap();
        processor.draw(&frame).unwrap();
        let (hits, truth) = (processor.bone_hits(), truth(&processor.view(&frame)));
        let lost = hits.iter().zip(&truth).filter(|(a, b)| a.is_some() != b.is_some()).count();
        assert!(lost < hits.len() / 1000, "{lost} of {} hits on one side only", hits.len());
        let both = || hits.iter().zip(&truth).filter_map(|(a, b)| Some((a.as_ref()?, b.as_ref()?)));
        let mut errors: Vec<f32> = both().map(|(a, b)| (a.distance_mm - b.distance_mm).abs()).collect();
        let mut angles: Vec<f32> = both().map(|(a, b)| a.normal.angle_between(b.normal)).collect();
        [&mut errors, &mut angles].into_iter().for_each(|list| list.sort_by(f32::total_cmp));
        let p95 = |list: &[f32]| list[list.len() * 95 / 100];
        assert!(p95(&errors) < 0.04 && p95(&angles) < 0.06, "{} mm, {} rad", p95(&errors), p95(&angles));
        let like = similarity(&lit(&hits), &lit(&truth));
        assert!(like > 0.99, "{wide} mm: similarity {like}");
        println!("{wide} mm: {} mm, {} rad, SSIM {like}", p95(&errors), p95(&angles));
        let Some(gpu) = device() else { continue };
        let mut renderer = scene::renderer(&gpu, &alone(&bone), SIZE);
        renderer.draw(&frame).unwrap();
        let like = similarity(&renderer.image().unwrap(), processor.image());
        assert!(like > 0.99, "device and processor: similarity {like}");
        let on_device = renderer.bone_hits().unwrap();
        let apart = |(a, b): (&Option<Hit>, &Option<Hit>)| match (a, b) {
            (Some(a), Some(b)) => (a.distance_mm - b.distance_mm).abs() > 0.002,
            (a, b) => a.is_some() != b.is_some(),
        };
        let apart = on_device.iter().zip(&hits).filter(|pair| apart(*pair)).count();
        assert!(apart < hits.len() / 1000, "{apart} hits apart");
        assert_eq!(gpu.faults(), Faults::default());
    }
}

#[test]
fn a_bore_is_in_the_next_picture_and_gone_once_it_is_undone() {
    let (bone, frame) = (plate(), Frame { slices: SliceLook::default(), ..zoom(20.0) });
    let anew = || {
        let mut anew = ProcessorRenderer::new(&alone(&bone), SIZE).unwrap();
        anew.draw(&frame).unwrap();
        anew.image().clone()
    };
    let mut processor = ProcessorRenderer::new(&alone(&bone), SIZE).unwrap();
    let device = device();
    let mut on_device = device.as_ref().map(|gpu| scene::renderer(gpu, &alone(&bone), SIZE));
    let mut pictures = Vec::new();
    for cut in [None, Some(true), Some(false)] {
        cut.into_iter().for_each(|cut| bore(&bone, cut));
        // The second picture casts the rest of the rays.
        for _ in 0..2 {
            processor.draw(&frame).unwrap();
        }
        assert!(*processor.image() == anew(), "{cut:?}: a followed picture equals one that is loaded anew");
        if let (Some(gpu), Some(renderer)) = (&device, &mut on_device) {
            renderer.draw(&frame).unwrap();
            renderer.draw(&frame).unwrap();
            let mut anew = scene::renderer(gpu, &alone(&bone), SIZE);
            anew.draw(&frame).unwrap();
            assert!(renderer.image().unwrap() == anew.image().unwrap(), "{cut:?} on the device");
            let like = similarity(&renderer.image().unwrap(), processor.image());
            assert!(like > 0.99, "{cut:?}: device and processor: similarity {like}");
        }
        pictures.push(processor.image().clone());
    }
    assert!(pictures[0] == pictures[2], "all is back");
    assert!(similarity(&pictures[0], &pictures[1]) < 0.99, "the bore is seen");
}
