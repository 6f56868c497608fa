//! Tests the processor's pictures against closed forms and against the device's.

mod cube;
mod scene;
mod similar;

use cube::cube;
use glam::{DVec3, IVec3, Vec3};
use scene::{alone, bone, device};
use similar::similarity;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Quat, Tool};
use trepan_gpu::{Faults, GpuError};
use trepan_mesh::TetMesh;
use trepan_render::{
    Camera, Casting, Cut, Frame, Image, Overlay, Painter, ProcessorRenderer, RenderError, SceneData, SliceLook, Stereo,
    StereoLook,
};
use trepan_volume::{AIR_HU, VoxelVolume};

/// A shell with a hole that shows the brain in it, and a burr at the hole.
fn head() -> (Arc<BoneVolume>, TetMesh, VoxelVolume<f32>, Frame<'static>) {
    let hole = DVec3::new(-6.0, 22.0, 6.0);
    let shell = bone(64, |p| {
        let shell = (p.length() - 24.0).abs() - 3.0;
        shell.max(9.0 - (p - hole).length())
    });
    let mut mri = VoxelVolume::isotropic([32; 3], Vec3::splat(-31.0), 2.0, 0.0f32);
    for at in 0..mri.data.len() {
        mri.data[at] = (at % 32 * 3 + at / 32 % 32 * 2) as f32;
    }
    let towards = Vec3::new(-0.3, 1.0, 0.35);
    let world_from_tool = Pose::from_parts(
        Vec3::new(-3.0, 27.0, 9.0),
        Quat::from_rotation_arc(Vec3::Z, Vec3::new(0.5, 0.6, 0.6).normalize()),
    );
    let frame = Frame {
        tool: Some(Tool::burr(3.0)),
        world_from_tool,
        second: Some((Tool::probe(1.5), Pose::from_parts(Vec3::new(8.0, 27.0, 4.0), world_from_tool.rotation))),
        turn_rad: 0.3,
        ..Frame::of(Camera::viewed_from(Vec3::ZERO, towards, 130.0))
    };
    (shell, cube(12.0), mri, frame)
}

#[test]
fn the_processor_draws_the_devices_picture() {
    let Some(gpu) = device() else { return };
    let (shell, mesh, mri, frame) = head();
    // Blue on one side of the head.
    let tint: Vec<[u8; 3]> = (0..mri.data.len()).map(|at| [0, 0, if at % 32 < 16 { 255 } else { 0 }]).collect();
    let data =
        SceneData { bone: Some(shell.clone()), brain: Some(&mesh), mri: Some(&mri), tint: Some(&tint), cortex: None };
    let size = [320, 240];
    let mut on_device = scene::renderer(&gpu, &data, size);
    let mut on_processor = ProcessorRenderer::new(&data, size).expect("the scene loads");
    let moved: Vec<Vec3> = mesh.positions.iter().map(|&p| 0.9 * p + Vec3::new(2.0, 3.0, -1.0)).collect();
    for step in 0..3 {
        if step == 1 {
            let near = shell.voxel_of(frame.world_from_tool.translation - 4.0 * Vec3::Y);
            (0..343).for_each(|n| shell.set_hu(near + IVec3::new(n % 7 - 3, n / 7 % 7 - 3, n / 49 - 3), AIR_HU));
        }
        let frame = Frame { brain_positions: (step == 2).then_some(&moved[..]), ..frame };
        let reports = (on_device.draw(&frame).expect("drawn"), on_processor.draw(&frame).expect("drawn"));
        assert_eq!(reports.0, reports.1);
        let (device, processor) = (on_device.bone_hits().expect("hits"), on_processor.bone_hits());
        let differ = device.iter().zip(&processor).filter(|(d, p)| match (d, p) {
            (Some(d), Some(p)) => {
                (d.distance_mm - p.distance_mm).abs() > 0.01 || d.normal.angle_between(p.normal) > 0.01
            }
            (None, None) => false,
            _ => true,
        });
        let differ = differ.count();
        assert!(differ * 1000 <= device.len(), "{differ} of {} rays differ in step {step}", device.len());
        let (device, processor) = (on_device.image().expect("picture"), on_processor.image());
        let index = similarity(&device, processor);
        assert!(index > 0.99, "similarity {index} in step {step}");
        let bluish = |image: &Image| image.rgba.chunks_exact(4).filter(|p| p[2] > p[0].saturating_add(40)).count();
        let (device, processor) = (bluish(&device), bluish(processor));
        assert!(device > 500 && device.abs_diff(processor) * 50 < device, "{device} and {processor} pixels are tinted");
    }
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn a_ball_drawn_by_the_processor_is_a_ball() {
    let ball = bone(56, |p| p.length() - 20.0);
    let data = alone(&ball);
    let mut renderer = ProcessorRenderer::new(&data, [90, 60]).expect("the scene loads");
    let frame = Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::X, 120.0));
    renderer.draw(&frame).expect("drawn");
    let view = renderer.view(&frame);
    let disc = (20.0f32 / 120.0).asin().tan() / view.half.y * 30.0;
    let seen = renderer.bone_hits().iter().flatten().count() as f32;
    assert!((seen / (std::f32::consts::PI * disc * disc) - 1.0).abs() < 0.03, "{seen} pixels");
    let nearest = renderer.bone_hits().iter().flatten().map(|h| h.distance_mm).fold(f32::MAX, f32::min);
    assert!((nearest - 100.0).abs() < 0.05, "{nearest}");
}

/// Empty-space skipping, per ray or as a beam for a tile, misses none of a few isolated voxels.
/// They are seen from all sides, from far away, from the border and from among them.
#[test]
fn empty_space_skipping_changes_no_hit() {
    let mut random = fastrand::Rng::with_seed(4);
    let dims = [90, 71, 63];
    let mut ct = VoxelVolume::isotropic(dims, Vec3::new(-40.0, 3.0, 7.0), 1.0, AIR_HU);
    for _ in 0..12 {
        let low = dims.map(|n| random.usize(0..n - 3));
        for n in 0..27 {
            let at = ct.index([low[0] + n % 3, low[1] + n / 3 % 3, low[2] + n / 9]);
            ct.data[at] = 900;
        }
    }
    let bone = Arc::new(BoneVolume::new(&ct, 400).unwrap());
    let mut renderer = ProcessorRenderer::new(&alone(&bone), [52, 39]).unwrap();
    let mut met = 0;
    for n in 0..60 {
        let towards = Vec3::new(random.f32() - 0.5, random.f32() - 0.5, random.f32() - 0.5);
        let camera = Camera::viewed_from(bone.bounds().centre(), towards, [15.0, 60.0, 160.0][n % 3]);
        let mut frame = Frame::of(camera);
        frame.slices.shown = false;
        let mut hits = [true, false].map(|leap| {
            renderer.set_casting(Casting { leap, ..Casting::default() });
            renderer.draw(&frame).unwrap();
            renderer.bone_hits()
        });
        let [leapt, walked] = &mut hits;
        met += walked.iter().flatten().count();
        for (a, b) in leapt.iter().zip(walked.iter()) {
            let far = a.map_or(f32::INFINITY, |hit| hit.distance_mm) - b.map_or(f32::INFINITY, |hit| hit.distance_mm);
            assert!(a.is_some() == b.is_some() && (a.is_none() || far.abs() < 1e-3), "{a:?} is not {b:?}");
        }
    }
    assert!(met > 500, "{met}");
}

#[test]
fn threads_and_incremental_updates_do_not_change_the_picture() {
    let (shell, mesh, mri, frame) = head();
    let data = SceneData { bone: Some(shell.clone()), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let mut one = ProcessorRenderer::new(&data, [160, 120]).expect("the scene loads");
    one.threads = 1;
    one.draw(&frame).expect("drawn");
    shell.set_hu(shell.voxel_of(Vec3::new(0.0, 26.0, -3.0)), AIR_HU);
    let partial = one.draw(&frame).expect("drawn");
    assert!(partial.bricks == 1 && partial.pixels_cast < 160 * 60, "{partial:?}");
    one.draw(&frame).expect("drawn");
    let mut anew = ProcessorRenderer::new(&data, [160, 120]).expect("the scene loads");
    anew.threads = 5;
    anew.draw(&frame).expect("drawn");
    assert_eq!(one.image(), anew.image());
}

/// Pictures of a brain without some tetrahedra, by renderers of all of it and of what is left.
#[test]
fn a_resected_brain_is_drawn_as_what_is_left_of_it() {
    let (shell, mesh, mri, frame) = head();
    let scene =
        |mesh| SceneData { bone: Some(shell.clone()), brain: Some(mesh), mri: Some(&mri), tint: None, cortex: None };
    let moved: Vec<Vec3> = mesh.positions.iter().map(|&p| 0.9 * p + Vec3::new(2.0, 3.0, -1.0)).collect();
    let cut = Some(Cut { point: Vec3::ZERO, normal: Vec3::X, bone: false });
    let frame = Frame { brain_positions: Some(&moved), show_bone: false, cut, ..frame };
    let gpu = device();
    let pictures = |data: &SceneData, gone: &[Option<&[bool]>]| -> Vec<[Image; 2]> {
        let mut processor = ProcessorRenderer::new(data, [160, 120]).expect("the scene loads");
        let mut device = gpu.as_ref().map(|gpu| scene::renderer(gpu, data, [160, 120]));
        let draw = |brain_gone: &Option<&[bool]>| {
            let frame = Frame { brain_gone: *brain_gone, ..frame };
            processor.draw(&frame).expect("drawn");
            let on_device = device.as_mut().map(|device| {
                device.draw(&frame).expect("drawn");
                device.image().expect("the picture is read")
            });
            [processor.image().clone(), on_device.unwrap_or_else(|| processor.image().clone())]
        };
        gone.iter().map(draw).collect()
    };
    let gone = [true, false, false, false, true];
    let shown = pictures(&scene(&mesh), &[None, Some(&gone), Some(&[true; 5]), Some(&[false; 5])]);
    let left = TetMesh { positions: mesh.positions.clone(), tets: mesh.tets[1..4].to_vec() };
    assert_eq!(shown[1], pictures(&scene(&left), &[None])[0]);
    assert_eq!(shown[0], shown[3], "all of it is back");
    assert!(shown[0] != shown[1] && shown[1] != shown[2]);
}

#[test]
fn bad_sizes_and_brains_are_refused_and_odd_sizes_drawn() {
    let (shell, mesh, _, frame) = head();
    let data = SceneData { bone: Some(shell), brain: Some(&mesh), mri: None, tint: None, cortex: None };
    assert_eq!(ProcessorRenderer::new(&data, [0, 4]).unwrap_err(), RenderError::Size(0, 4));
    for size in [[1, 1], [33, 17], [5, 130]] {
        let mut renderer = ProcessorRenderer::new(&data, size).expect("the scene loads");
        renderer.draw(&frame).expect("drawn");
        assert_eq!(renderer.image().rgba.len(), 4 * (size[0] * size[1]) as usize);
        let few = Frame { brain_positions: Some(&[Vec3::ZERO]), ..frame };
        assert_eq!(renderer.draw(&few).unwrap_err(), RenderError::Nodes { wanted: 8, given: 1 });
    }
}

#[test]
fn without_a_device_the_processor_draws_and_says_why() {
    let (shell, mesh, mri, frame) = head();
    let data = SceneData { bone: Some(shell), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let mut painter = Painter::on(Err(GpuError::NoAdapter), &data, [120, 100]).expect("the scene loads");
    assert!(painter.notice().is_some_and(|n| n.contains("mesa-vulkan-drivers")), "{:?}", painter.notice());
    assert!(painter.name().contains("processor"));
    let (image, report) = painter.picture(&frame).expect("drawn");
    assert_eq!(([image.width, image.height], report.pixels_cast), ([120, 100], (120 - 33) * 100));
    painter.fit([120, 100], 0.25).expect("a quarter of the detail");
    let (image, _) = painter.picture(&frame).expect("drawn");
    assert_eq!([image.width, image.height], [120, 100]);
    assert!(painter.renderer().is_none() && painter.into_renderer().is_err());
}

#[test]
fn with_less_detail_the_view_is_enlarged_and_slices_stay_sharp() {
    let (shell, mesh, mri, frame) = head();
    let data = SceneData { bone: Some(shell), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let mut renderer = ProcessorRenderer::new(&data, [240, 200]).expect("the scene loads");
    renderer.draw(&frame).expect("drawn");
    let (full, layout) = (renderer.image().clone(), renderer.layout());
    renderer.set_detail(0.5).expect("half the detail");
    assert_eq!(renderer.draw(&frame).expect("drawn").pixels_cast * 4, layout.view[2] * layout.view[3]);
    let coarse = renderer.image().clone();
    let same = |part: [u32; 4]| {
        let [x, y, w, h] = part;
        let alike = |&(x, y): &(u32, u32)| full.pixel(x, y) == coarse.pixel(x, y);
        (y..y + h).flat_map(|y| (x..x + w).map(move |x| (x, y))).filter(alike).count() == (w * h) as usize
    };
    assert!(layout.slices.expect("there is room").into_iter().all(same) && !same(layout.view));
    assert!(similarity(&full, &coarse) > 0.9);
}

#[test]
fn slices_are_drawn_in_turn() {
    let (shell, mesh, mri, frame) = head();
    let data = SceneData { bone: Some(shell), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let mut renderer = ProcessorRenderer::new(&data, [240, 200]).expect("the scene loads");
    renderer.slices_per_frame = 1;
    renderer.draw(&frame).expect("drawn");
    let moved = Frame { world_from_tool: Pose::from_translation(Vec3::new(3.0, 90.0, 2.0)), ..frame };
    let parts = renderer.layout().slices.expect("there is room");
    let part = |image: &Image, [x, y, w, h]: [u32; 4]| -> Vec<_> {
        (y..y + h).flat_map(|y| (x..x + w).map(move |x| (x, y))).map(|(x, y)| image.pixel(x, y)).collect()
    };
    let mut drawn = [0; 3];
    for _ in 0..3 {
        let before = renderer.image().clone();
        renderer.draw(&moved).expect("drawn");
        for (count, &place) in drawn.iter_mut().zip(&parts) {
            *count += usize::from(part(&before, place) != part(renderer.image(), place));
        }
    }
    assert_eq!(drawn, [1; 3]);
    let mut all = ProcessorRenderer::new(&data, [240, 200]).expect("the scene loads");
    all.draw(&moved).expect("drawn");
    assert!(parts.iter().all(|&place| part(all.image(), place) == part(renderer.image(), place)));
}

#[test]
fn a_lost_device_leaves_the_picture_to_the_processor() {
    let Some(gpu) = device() else { return };
    let (shell, mesh, mri, frame) = head();
    let data = SceneData { bone: Some(shell), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let mut painter = Painter::on(Ok(gpu.clone()), &data, [160, 120]).expect("the scene loads");
    let (before, _) = painter.picture(&frame).expect("drawn");
    assert_eq!(painter.notice(), None);
    gpu.device().destroy();
    let (after, _) = painter.picture(&frame).expect("drawn in spite of the loss");
    assert!(painter.notice().is_some_and(|n| n.contains("does not answer")), "{:?}", painter.notice());
    assert!(similarity(&before, &after) > 0.99);
}

#[test]
fn a_brain_and_its_mri_need_no_ct() {
    let mesh = cube(20.0);
    let mut mri = VoxelVolume::isotropic([60; 3], Vec3::splat(-29.5), 1.0, 20.0f32);
    for at in 0..mri.data.len() {
        if mri.centre_of([at % 60, at / 60 % 60, at / 3600]).length() < 7.0 {
            mri.data[at] = 200.0;
        }
    }
    let data = SceneData { bone: None, brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let size = [400, 300];
    let mut processor = ProcessorRenderer::new(&data, size).expect("a scene without a CT loads");
    let camera = Camera::viewed_from(Vec3::ZERO, Vec3::new(0.5, 1.0, 0.4), 200.0);
    // With the tool far outside the scanned box the slices stay at the camera's target.
    let world_from_tool = Pose::from_translation(Vec3::new(0.0, 90.0, 0.0));
    let slices = SliceLook { half_height_mm: Some(30.0), ..SliceLook::default() };
    let frame = Frame { tool: Some(Tool::probe(3.0)), world_from_tool, slices, ..Frame::of(camera) };
    let report = processor.draw(&frame).expect("drawn");
    assert_eq!((report.pixels_cast, report.bricks), (0, 0));
    assert!(processor.bone_hits().iter().all(Option::is_none));
    let image = processor.image().clone();
    let [r, g, _, _] = image.pixel(150, 150);
    assert!(r > g + 30, "the brain is in the middle of the 3-D view: {:?}", image.pixel(150, 150));
    for [x, y, w, h] in processor.layout().slices.expect("there is room for slices") {
        let (ball, brain) = (image.pixel(x + w / 2 + 6, y + h / 2 + 6), image.pixel(x + 3 * w / 4, y + 3 * h / 4));
        assert!(ball[0] > 240 && (15..60).contains(&brain[0]) && brain[0] == brain[2], "{ball:?} and {brain:?}");
    }
    let alone = SceneData { bone: None, brain: None, mri: None, tint: None, cortex: None };
    ProcessorRenderer::new(&alone, size).expect("an empty scene loads").draw(&frame).expect("drawn");
    let Some(gpu) = device() else { return };
    let mut renderer = scene::renderer(&gpu, &data, size);
    assert_eq!(renderer.draw(&frame).expect("drawn").pixels_cast, 0);
    let index = similarity(&renderer.image().expect("picture"), &image);
    assert!(index > 0.99, "similarity {index}");
    scene::renderer(&gpu, &alone, size).draw(&frame).expect("an empty scene is drawn");
    assert_eq!(gpu.faults(), Faults::default());
}

/// The mean of 4 x 4 pixels.
fn quartered(image: &Image) -> Image {
    let [width, height] = [image.width / 4, image.height / 4];
    let mean = |x: u32, y: u32, c: usize| {
        let sum: u32 = (0..16).map(|n| u32::from(image.pixel(4 * x + n % 4, 4 * y + n / 4)[c])).sum();
        ((sum + 8) / 16) as u8
    };
    let rgba = (0..width * height).flat_map(|n| [0, 1, 2, 3].map(|c| mean(n % width, n / width, c))).collect();
    Image { width, height, rgba }
}

#[test]
fn edges_at_rest_are_those_of_a_picture_with_sixteen_samples_a_pixel() {
    let (shell, mesh, mri, frame) = head();
    let data = SceneData { bone: Some(shell.clone()), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let overlay = Overlay {
        force: Some([frame.world_from_tool.translation, Vec3::new(-18.0, 38.0, 12.0)]),
        ..Overlay::default()
    };
    let frame = Frame { overlay, slices: SliceLook { shown: false, ..frame.slices }, ..frame };
    let mut fine = ProcessorRenderer::new(&data, [640, 480]).expect("the scene loads");
    fine.draw(&frame).expect("drawn");
    let reference = quartered(fine.image());
    let mut renderer = ProcessorRenderer::new(&data, [160, 120]).expect("the scene loads");
    renderer.draw(&frame).expect("drawn");
    let sharp = renderer.image().error_percent(&reference);
    let hits = renderer.bone_hits();
    let samples = (0..99).take_while(|_| renderer.refine(&frame)).count();
    let smooth = renderer.image().error_percent(&reference);
    println!("error against 16 samples: {sharp:.2} %, smoothed {smooth:.2} %");
    assert_eq!(samples, 16);
    assert!(smooth < 0.5 && sharp > 2.0 * smooth, "{sharp} %, smoothed {smooth} %");
    if let Some(gpu) = device() {
        let mut on_device = scene::renderer(&gpu, &data, [160, 120]);
        on_device.draw(&frame).expect("drawn");
        let samples = (0..99).take_while(|_| on_device.refine(&frame).expect("drawn")).count();
        let smooth = on_device.image().expect("read").error_percent(&reference);
        println!("on the device {smooth:.2} %");
        assert!(samples == 16 && smooth < 0.5, "{samples} samples, {smooth} %");
        on_device.draw(&frame).expect("drawn");
        assert!(on_device.image().expect("read").error_percent(&reference) > 2.0 * smooth, "a new picture begins anew");
    }
    // What was smoothed is not taken for a surface.
    assert_eq!(renderer.bone_hits(), hits);
    let moved = Frame { camera: Camera { azimuth_rad: frame.camera.azimuth_rad + 0.1, ..frame.camera }, ..frame };
    renderer.draw(&moved).expect("drawn");
    renderer.draw(&frame).expect("drawn");
    assert_eq!(renderer.image().error_percent(&reference), sharp, "a new picture begins anew");
    let both = Frame { stereo: Some(Stereo { look: StereoLook::SideBySide, eye_distance_mm: 5.0 }), ..frame };
    renderer.draw(&both).expect("drawn");
    assert!(!renderer.refine(&both));
}

#[test]
fn a_change_of_the_bone_makes_the_picture_stale_until_it_is_drawn() {
    let (shell, _, _, frame) = head();
    let mut renderer = ProcessorRenderer::new(&alone(&shell), [40, 30]).expect("the scene loads");
    renderer.draw(&frame).expect("drawn");
    assert!(!renderer.is_stale());
    shell.set_hu(shell.voxel_of(Vec3::new(0.0, 24.0, 0.0)), AIR_HU);
    assert!(renderer.is_stale() && renderer.is_stale());
    renderer.draw(&frame).expect("drawn");
    assert!(!renderer.is_stale());
}
