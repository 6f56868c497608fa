//! Tests paint, overlay, cut and stereo on the device and the processor.

mod cube;
mod scene;
mod similar;

use cube::cube;
use glam::{DVec3, Vec3};
use scene::{bone, device};
use similar::similarity;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Quat, Tool};
use trepan_gpu::Faults;
use trepan_mesh::TetMesh;
use trepan_render::{
    Camera, Cut, Frame, Image, Leaves, Overlay, Paint, ProcessorRenderer, RenderError, SceneData, SliceLook, Stereo,
    StereoLook,
};
use trepan_volume::VoxelVolume;

const SIZE: [u32; 2] = [320, 240];

/// Blue paint where y is over `from`.
fn blue(from: f32, version: u64) -> Paint {
    let dims = [16, 16, 16];
    let texel = |at: usize| [0, 0, 255, if at / 16 % 16 * 4 >= (32.0 + from) as usize { 255 } else { 0 }];
    let rgba = (0..4096).map(texel).collect();
    Paint { origin: Vec3::splat(-32.0), spacing_mm: Vec3::splat(4.0), dims, rgba, version }
}

/// Radius of the bright ball in the MRI, mm.
const BRIGHT_MM: f32 = 11.0;

/// An MRI with a bright ball.
fn ball(centre: DVec3) -> VoxelVolume<f32> {
    let mut mri = VoxelVolume::isotropic([40; 3], Vec3::splat(-39.0), 2.0, 30.0f32);
    for at in 0..mri.data.len() {
        if mri.centre_of([at % 40, at / 40 % 40, at / 1600]).distance(centre) < f64::from(BRIGHT_MM) {
            mri.data[at] = 200.0;
        }
    }
    mri
}

fn plain(towards_eye: Vec3) -> Frame<'static> {
    let slices = SliceLook { shown: false, ..SliceLook::default() };
    Frame { slices, ..Frame::of(Camera::viewed_from(Vec3::ZERO, towards_eye, 130.0)) }
}

fn count(image: &Image, is: impl Fn([i32; 3]) -> bool) -> usize {
    image.rgba.chunks_exact(4).filter(|p| is([p[0].into(), p[1].into(), p[2].into()])).count()
}

fn is_white([r, g, b, _]: [u8; 4]) -> bool {
    r > 150 && r == g && g == b
}

fn blueish([r, _, b]: [i32; 3]) -> bool {
    b > r + 40
}

/// Blood of 0 to 2 mm on the nodes of the cube, and burns.
const STAINS: [u8; 8] = [0, 20, 60, 200, 255, 0, 255, 10];

/// A sheet over the cube with one corner lifted, where it was and where it is.
const SHEET: [[Vec3; 4]; 2] = [
    [Vec3::new(-6.0, 13.0, -6.0), Vec3::new(-6.0, 13.0, 6.0), Vec3::new(6.0, 13.0, 6.0), Vec3::new(6.0, 13.0, -6.0)],
    [Vec3::new(-6.0, 13.0, -6.0), Vec3::new(-6.0, 13.0, 6.0), Vec3::new(1.0, 18.0, 1.0), Vec3::new(6.0, 13.0, -6.0)],
];

/// Every look, alone and all together.
fn frames<'a>(paint: &'a Paint, markers: &'a [Vec3]) -> Vec<(&'static str, Frame<'a>)> {
    let pose = Pose::from_parts(
        Vec3::new(-3.0, 27.0, 9.0),
        Quat::from_rotation_arc(Vec3::Z, Vec3::new(0.5, 0.6, 0.6).normalize()),
    );
    let aside = Pose { translation: pose.translation + 14.0 * Vec3::X, ..pose };
    let base = Frame { tool: Some(Tool::burr(3.0)), world_from_tool: pose, ..plain(Vec3::new(-0.3, 1.0, 0.35)) };
    let overlay = Overlay {
        force: Some([pose.translation, Vec3::new(-18.0, 38.0, 12.0)]),
        ghost: Some((Tool::probe(2.0), aside)),
        markers,
    };
    let cut = Some(Cut { point: Vec3::new(0.0, 0.0, 2.0), normal: Vec3::new(0.1, 0.9, 0.5), bone: false });
    let open = cut.map(|cut| Cut { bone: true, ..cut });
    let dura = Some(Leaves { rest: &SHEET[0], places: &SHEET[1], triangles: &[[0, 1, 2], [0, 2, 3]] });
    let stereo = |look| Some(Stereo { look, eye_distance_mm: 5.0 });
    let all = Frame { bone_paint: Some(paint), brain_paint: Some(paint), overlay, cut: open, ..base };
    vec![
        ("nothing", base),
        ("paint", Frame { bone_paint: Some(paint), brain_paint: Some(paint), ..base }),
        ("overlay", Frame { overlay, ..base }),
        ("cut", Frame { cut, show_bone: false, ..base }),
        ("cut with bone", Frame { cut: open, ..base }),
        ("drilling", Frame { drilling: true, ..base }),
        ("tube and mill", Frame { tool: Some(Tool::aspirator()), second: Some((Tool::craniotome(), aside)), ..base }),
        ("tines", Frame { tool: Some(Tool::bipolar()), ..base }),
        (
            "perforator and blade",
            Frame { tool: Some(Tool::perforator()), second: Some((Tool::spatula(), aside)), ..base },
        ),
        ("scalpel and probe", Frame { tool: Some(Tool::scalpel()), second: Some((Tool::probe(2.0), aside)), ..base }),
        ("blood and a burn", Frame { brain_stains: Some(&STAINS), show_bone: false, ..base }),
        ("dura", Frame { dura, show_bone: false, ..base }),
        ("both eyes", Frame { stereo: stereo(StereoLook::SideBySide), ..all }),
        ("anaglyph", Frame { stereo: stereo(StereoLook::Anaglyph), ..all }),
        ("all with slices", Frame { slices: SliceLook::default(), ..all }),
        (
            "window of the MRI",
            Frame { slices: SliceLook { mri_level: 0.2, mri_width: 0.4, ..SliceLook::default() }, ..all },
        ),
        ("nothing again", base),
    ]
}

/// A skull with a hole, with a brain and its MRI.
fn head() -> (Arc<BoneVolume>, TetMesh, VoxelVolume<f32>) {
    let hole = DVec3::new(-6.0, 22.0, 6.0);
    let shell = bone(64, |p| ((p.length() - 24.0).abs() - 3.0).max(9.0 - (p - hole).length()));
    (shell, cube(12.0), ball(DVec3::new(3.0, 4.0, 0.0)))
}

/// A stored picture. With `TREPAN_GOLDEN=write` in the environment the picture is stored first:
/// inspect it before committing.
fn golden(name: &str, image: &Image) -> Image {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{name}.png"));
    if std::env::var_os("TREPAN_GOLDEN").is_some_and(|v| v == "write") {
        image.write_png(&path).expect("the picture is stored");
    }
    let file = std::io::BufReader::new(std::fs::File::open(&path).expect("the picture is there"));
    let mut reader = png::Decoder::new(file).read_info().expect("it is a PNG");
    let (width, height) = (reader.info().width, reader.info().height);
    let mut rgba = vec![0; (4 * width * height) as usize];
    reader.next_frame(&mut rgba).expect("it is whole");
    Image { width, height, rgba }
}

/// Root mean square difference of all bytes, of 255.
fn rms(a: &Image, b: &Image) -> f64 {
    let squares = a.rgba.iter().zip(&b.rgba).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2));
    (squares.sum::<f64>() / a.rgba.len() as f64).sqrt()
}

#[test]
fn pictures_are_the_stored_ones_by_all_that_draw() {
    let (shell, mesh, mri) = head();
    let data = SceneData { bone: Some(shell), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let size = [160, 120];
    let mut on_processor = ProcessorRenderer::new(&data, size).expect("the scene loads");
    let mut on_device = device().map(|gpu| scene::renderer(&gpu, &data, size));
    let (paint, markers) = (blue(4.0, 1), [Vec3::new(10.0, 24.0, -6.0), Vec3::new(0.0, 0.0, 0.0)]);
    for (name, frame) in frames(&paint, &markers).into_iter().take(14) {
        on_processor.draw(&frame).expect("drawn");
        let mut images = vec![on_processor.image().clone()];
        images.extend(on_device.as_mut().map(|device| {
            device.draw(&frame).expect("drawn");
            device.image().expect("picture")
        }));
        for image in &images {
            let golden = golden(&name.replace(' ', "-"), image);
            assert_eq!([golden.width, golden.height], size);
            let (index, rms) = (similarity(&golden, image), rms(&golden, image));
            assert!(index > 0.99 && rms < 3.0, "{name}: similarity {index}, rms {rms} of 255");
        }
    }
}

#[test]
fn every_look_is_the_same_on_device_and_processor() {
    let Some(gpu) = device() else { return };
    let (shell, mesh, mri) = head();
    let data = SceneData { bone: Some(shell), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let mut on_device = scene::renderer(&gpu, &data, SIZE);
    let mut on_processor = ProcessorRenderer::new(&data, SIZE).expect("the scene loads");
    let moved: Vec<Vec3> = mesh.positions.iter().map(|&p| 0.95 * p + Vec3::new(1.0, 2.0, -1.0)).collect();
    let (paint, markers) = (blue(4.0, 1), [Vec3::new(10.0, 24.0, -6.0), Vec3::new(0.0, 0.0, 0.0)]);
    let mut before: Option<Image> = None;
    for (name, frame) in frames(&paint, &markers) {
        let frame = Frame { brain_positions: Some(&moved), ..frame };
        let reports = (on_device.draw(&frame).expect("drawn"), on_processor.draw(&frame).expect("drawn"));
        assert_eq!(reports.0, reports.1, "{name}");
        let (device, processor) = (on_device.image().expect("picture"), on_processor.image());
        let index = similarity(&device, processor);
        if let Some(folder) = std::env::var_os("TREPAN_PICTURES") {
            let path = |by| std::path::Path::new(&folder).join(format!("{name}-{by}.png"));
            device.write_png(&path("device")).expect("written");
            processor.write_png(&path("processor")).expect("written");
        }
        assert!(index > 0.99, "{name}: similarity {index}");
        match &before {
            None => before = Some(device),
            Some(before) if name == "nothing again" => assert_eq!(before, &device, "no look leaves a trace"),
            Some(before) => assert_ne!(before, &device, "{name} changes the picture"),
        }
    }
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn paint_lies_on_its_part_of_the_bone_follows_its_version_and_is_refused_where_it_is_no_box() {
    let Some(gpu) = device() else { return };
    let shell = bone(64, |p| p.length() - 24.0);
    let mut renderer = scene::renderer(&gpu, &scene::alone(&shell), SIZE);
    let mut painted = |paint: Option<&Paint>| {
        renderer.draw(&Frame { bone_paint: paint, ..plain(Vec3::X) }).expect("drawn");
        count(&renderer.image().expect("picture"), blueish)
    };
    let ball = painted(Some(&blue(-32.0, 0)));
    let half = painted(Some(&blue(0.0, 1)));
    assert!(ball > 5000 && (half as f64 / ball as f64 - 0.5).abs() < 0.1, "{half} of {ball}");
    assert_eq!(
        painted(Some(&Paint { rgba: vec![[0; 4]; 4096], ..blue(0.0, 1) })),
        half,
        "the version says that nothing changed"
    );
    assert_eq!(painted(None), 0);
    assert_eq!(painted(Some(&Paint { rgba: vec![[0; 4]; 4096], ..blue(0.0, 2) })), 0);
    let wrong = Paint { dims: [9; 3], ..blue(0.0, 3) };
    let frame = Frame { bone_paint: Some(&wrong), ..plain(Vec3::X) };
    assert!(matches!(renderer.draw(&frame), Err(RenderError::Paint { given: 4096, .. })));
    let mut processor = ProcessorRenderer::new(&scene::alone(&shell), SIZE).expect("the scene loads");
    assert!(matches!(processor.draw(&frame), Err(RenderError::Paint { given: 4096, .. })));
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn a_cut_brain_shows_its_mri_in_the_plane_and_moves_it_with_the_tissue() {
    let (mesh, mri) = (cube(20.0), ball(DVec3::new(6.0, 0.0, 0.0)));
    let data = SceneData { bone: None, brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let mut renderer = ProcessorRenderer::new(&data, SIZE).expect("the scene loads");
    let cut = Cut { point: Vec3::ZERO, normal: Vec3::Y, bone: false };
    let frame = Frame { cut: Some(cut), ..plain(Vec3::Y) };
    // Seen from the front, +x, the patient's right, is on the left.
    let mut bright = |frame: &Frame| {
        renderer.draw(frame).expect("drawn");
        let image = renderer.image();
        let pixels = (0..SIZE[0] * SIZE[1]).map(|n| (n % SIZE[0], n / SIZE[0]));
        let columns: Vec<u32> = pixels.filter(|&(x, y)| is_white(image.pixel(x, y))).map(|p| p.0).collect();
        (columns.iter().sum::<u32>() as f32 / columns.len().max(1) as f32 + 0.5, columns.len())
    };
    let pixels_per_mm = 120.0 / (130.0 * 0.3f32.tan());
    let (middle, area) = bright(&frame);
    let disc = std::f32::consts::PI * (BRIGHT_MM * pixels_per_mm).powi(2);
    assert!((middle - (160.0 - 6.0 * pixels_per_mm)).abs() < 1.5, "{middle}");
    assert!((area as f32 / disc - 1.0).abs() < 0.1, "{area} of {disc}");
    let moved: Vec<Vec3> = mesh.positions.iter().map(|&p| p + Vec3::new(-5.0, 3.0, 0.0)).collect();
    let (middle, _) = bright(&Frame { brain_positions: Some(&moved), ..frame });
    assert!((middle - (160.0 - 1.0 * pixels_per_mm)).abs() < 1.5, "{middle}");
    assert_eq!(bright(&Frame { cut: None, ..frame }).1, 0, "uncut, the ball is hidden");
    let narrow = SliceLook { mri_level: 0.1, mri_width: 0.1, ..frame.slices };
    let (_, white) = bright(&Frame { slices: narrow, ..frame });
    assert!(white as f32 > 2.0 * area as f32, "what is dark around the ball is white too: {white} of {area}");
}

#[test]
fn bone_under_a_cut_is_hit_in_the_plane_and_over_it_there_is_none() {
    let Some(gpu) = device() else { return };
    let block = bone(48, |p| p.abs().max_element() - 16.25);
    let mut device = scene::renderer(&gpu, &scene::alone(&block), [48, 36]);
    let mut processor = ProcessorRenderer::new(&scene::alone(&block), [48, 36]).expect("the scene loads");
    for (point, towards) in [
        (Vec3::ZERO, Vec3::Y),
        (Vec3::new(0.0, 7.3, 0.0), Vec3::new(0.3, 1.0, 0.2)),
        (Vec3::new(0.0, -40.0, 0.0), Vec3::Y),
    ] {
        let normal = Vec3::new(0.1, 1.0, -0.2).normalize();
        let camera = Camera { fov_rad: 0.1, ..Camera::viewed_from(point.max(Vec3::splat(-9.0)), towards, 120.0) };
        let frame = Frame { cut: Some(Cut { point, normal, bone: true }), camera, ..plain(towards) };
        device.draw(&frame).expect("drawn");
        processor.draw(&frame).expect("drawn");
        let view = processor.view(&frame);
        for hits in [device.bone_hits().expect("hits"), processor.bone_hits()] {
            let inside = |n: usize| {
                glam::Vec2::new((n % 48) as f32 + 0.5, (n / 48) as f32 + 0.5) / glam::Vec2::new(24.0, -18.0)
                    - glam::Vec2::new(1.0, -1.0)
            };
            for (n, hit) in hits.into_iter().enumerate() {
                let Some(hit) = hit else {
                    assert!(point.y < -16.0);
                    continue;
                };
                let at = view.eye + hit.distance_mm * view.ray(inside(n));
                assert!((at - point).dot(normal).abs() < 0.01 && hit.normal.distance(normal) < 1e-3, "{hit:?}");
            }
        }
    }
    assert_eq!(gpu.faults(), Faults::default());
}

/// Rays along a cut end at the plane: following them to the end of their brick would hit removed
/// bone.
#[test]
fn bone_seen_along_a_cut_has_no_hit_over_it() {
    let Some(gpu) = device() else { return };
    let ball = bone(48, |p| p.length() - 17.0);
    let mut device = scene::renderer(&gpu, &scene::alone(&ball), [96, 72]);
    let mut processor = ProcessorRenderer::new(&scene::alone(&ball), [96, 72]).expect("the scene loads");
    let (point, normal) = (Vec3::new(0.0, 0.0, 6.3), Vec3::Z);
    for towards in [Vec3::new(1.0, 0.2, -0.03), Vec3::new(1.0, 0.2, 0.0), Vec3::new(0.5, -1.0, -0.2)] {
        let camera = Camera { fov_rad: 0.35, ..Camera::viewed_from(Vec3::Z * 4.0, towards, 120.0) };
        let frame = Frame { cut: Some(Cut { point, normal, bone: true }), camera, ..plain(towards) };
        device.draw(&frame).expect("drawn");
        processor.draw(&frame).expect("drawn");
        let view = processor.view(&frame);
        for hits in [device.bone_hits().expect("hits"), processor.bone_hits()] {
            let heights: Vec<f32> = hits
                .into_iter()
                .enumerate()
                .filter_map(|(n, hit)| {
                    let pixel = glam::Vec2::new((n % 96) as f32 + 0.5, (n / 96) as f32 + 0.5);
                    let inside = pixel / glam::Vec2::new(48.0, -36.0) - glam::Vec2::new(1.0, -1.0);
                    Some((view.eye + hit?.distance_mm * view.ray(inside) - point).dot(normal))
                })
                .collect();
            let highest = heights.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            assert!(heights.len() > 1000 && highest < 0.01, "{highest} mm over the cut, {} hits", heights.len());
        }
    }
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn bone_and_brain_cut_by_one_plane_do_not_show_through_each_other() {
    let block = bone(48, |p| p.abs().max_element() - 16.25);
    let (mesh, mri) = (cube(12.0), ball(DVec3::ZERO));
    let data = SceneData { bone: Some(block), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let mut processor = ProcessorRenderer::new(&data, SIZE).expect("the scene loads");
    let gpu = device();
    let mut on_device = gpu.as_ref().map(|gpu| scene::renderer(gpu, &data, SIZE));
    let normal = Vec3::new(0.1, 1.0, -0.2).normalize();
    for towards in [normal, Vec3::new(0.3, 1.0, 0.2), Vec3::new(-0.8, 0.5, 0.4)] {
        let cut = Some(Cut { point: Vec3::new(0.3, 0.7, 0.0), normal, bone: true });
        let frame = Frame { cut, ..plain(towards) };
        processor.draw(&frame).expect("drawn");
        let mut images = vec![processor.image().clone()];
        if let Some(device) = &mut on_device {
            device.draw(&frame).expect("drawn");
            images.push(device.image().expect("picture"));
        }
        for image in images {
            // The MRI is grey, bone and background are not.
            let grey = count(&image, |[r, g, b]| r == g && g == b && r > 0);
            assert!(count(&image, |[r, _, b]| r > b + 20) > 2000, "there is bone");
            assert_eq!(grey, 0, "seen from {towards}");
        }
        let alone = Frame { show_bone: false, ..frame };
        processor.draw(&alone).expect("drawn");
        assert!(count(processor.image(), |[r, g, b]| r == g && g == b && r > 0) > 1000, "the cut brain is grey");
    }
}

#[test]
fn markers_are_discs_where_they_are_and_faint_behind_bone() {
    let Some(gpu) = device() else { return };
    let slab = bone(48, |p| (p.y + 10.0).abs() - 4.0);
    let mut renderer = scene::renderer(&gpu, &scene::alone(&slab), SIZE);
    let mut pink = |marker: Vec3| {
        let frame = Frame { overlay: Overlay { markers: &[marker], ..Overlay::default() }, ..plain(Vec3::Y) };
        renderer.draw(&frame).expect("drawn");
        count(&renderer.image().expect("picture"), |[r, g, b]| r > g + 60 && b > g + 40)
    };
    let radius = (1.0f32 / 125.0).asin().tan() / 0.3f32.tan() * 120.0;
    let (seen, disc) = (pink(Vec3::new(0.0, 5.0, 0.0)), std::f32::consts::PI * radius * radius);
    // The side away from the lamp is darker than the threshold.
    assert!((0.6 * disc..disc + 6.0).contains(&(seen as f32)), "{seen} for {disc}");
    assert_eq!(pink(Vec3::new(0.0, -20.0, 0.0)), 0);
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn the_eyes_of_a_pair_see_the_target_without_parallax_and_what_is_nearer_crossed() {
    let dot = |at: Vec3| bone(48, move |p| (p - at.as_dvec3()).length() - 2.0);
    let eye_distance_mm = 6.0;
    let stereo = Some(Stereo { look: StereoLook::SideBySide, eye_distance_mm });
    for depth in [0.0f32, 16.0, -16.0] {
        let dot = dot(depth * Vec3::Y);
        let mut renderer = ProcessorRenderer::new(&scene::alone(&dot), SIZE).expect("the scene loads");
        renderer.draw(&Frame { stereo, ..plain(Vec3::Y) }).expect("drawn");
        let image = renderer.image();
        let middle = |half: u32| {
            let columns = (0..240)
                .flat_map(|y| (0..160).map(move |x| (x, y)))
                .filter(|&(x, y)| image.pixel(160 * half + x, y)[0] > 115);
            let columns: Vec<u32> = columns.map(|p| p.0).collect();
            columns.iter().sum::<u32>() as f32 / columns.len() as f32
        };
        let parallax = middle(0) - middle(1);
        let pixels_per_mm = 120.0 / 0.3f32.tan() / (130.0 - depth);
        let wanted = eye_distance_mm * depth / 130.0 * pixels_per_mm;
        assert!((parallax - wanted).abs() < 0.6, "{parallax} for {wanted} at {depth}");
    }
}
