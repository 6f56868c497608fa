//! A fine cortex over coarse tetrahedra: what is seen does not depend on them.

use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Tool};
use trepan_gpu::adapter_for_tests as device;
use trepan_mesh::{TetMesh, TriMesh, lattice, surface_nets};
use trepan_render::{
    Camera, Casting, Cortex, Cut, Frame, Image, Overlay, ProcessorRenderer, Renderer, SceneData, SliceLook,
};
use trepan_volume::VoxelVolume;

const SIZE: [u32; 2] = [320, 240];
/// From the middle towards the eye.
const EYE: Vec3 = Vec3::new(1.0, 0.6, 0.4);

/// How far a place is in tissue, mm: a ball with furrows.
fn tissue(p: Vec3) -> f32 {
    let furrow = 3.0 * (0.45 * p.y).sin().abs().powi(8);
    24.0 - furrow - p.length()
}

/// The cortex with its depths, and two meshes of the ball without furrows.
fn brain() -> (TriMesh, Vec<f32>, [TetMesh; 2]) {
    let mut values = VoxelVolume::filled([56; 3], DAffine3::from_translation(DVec3::splat(-27.5)), 0.0f32);
    for at in 0..values.data.len() {
        values.data[at] = tissue(values.centre_of([at % 56, at / 56 % 56, at / 3136]).as_vec3());
    }
    let surface = surface_nets(&values, 0.0).largest_part();
    let depths = surface.positions.iter().map(|p| (24.0 - p.length()).max(0.0)).collect();
    let mut mask = values.map(|_| 0u8);
    for at in 0..mask.data.len() {
        let place = mask.centre_of([at % 56, at / 56 % 56, at / 3136]);
        mask.data[at] = u8::from(place.length() < 24.0);
    }
    let mesh = |target_tets| {
        lattice::tetrahedra(&mask, &lattice::Config { target_tets, ..Default::default() }).expect("a ball has a mesh")
    };
    (surface, depths, [mesh(600), mesh(4000)])
}

fn frame<'a>() -> Frame<'a> {
    let slices = SliceLook { half_height_mm: Some(30.0), ..SliceLook::default() };
    Frame { slices, ..Frame::of(Camera::viewed_from(Vec3::ZERO, EYE, 110.0)) }
}

/// Share of the pixels that differ by more than a tenth of white.
fn apart(a: &Image, b: &Image) -> f64 {
    let far = a.rgba.chunks(4).zip(b.rgba.chunks(4)).filter(|(a, b)| (0..3).any(|k| a[k].abs_diff(b[k]) > 25)).count();
    far as f64 / (a.rgba.len() / 4) as f64
}

#[test]
fn the_tetrahedra_change_the_motion_and_not_the_look() {
    let (surface, depth_mm, meshes) = brain();
    let cortex = Some(Cortex { surface: &surface, depth_mm: &depth_mm });
    let draw = |mesh: &TetMesh, cortex, squeeze: f32| {
        let data = SceneData { bone: None, brain: Some(mesh), mri: None, tint: None, cortex };
        let mut renderer = ProcessorRenderer::new(&data, SIZE).expect("the scene loads");
        let moved: Vec<Vec3> = mesh.positions.iter().map(|p| *p * Vec3::new(1.0, squeeze, 1.0)).collect();
        renderer.draw(&Frame { brain_positions: Some(&moved), ..frame() }).expect("drawn");
        renderer.image().clone()
    };
    for squeeze in [1.0, 0.8] {
        let [draft, fine] = meshes.each_ref().map(|mesh| draw(mesh, cortex, squeeze));
        assert!(apart(&draft, &fine) < 0.002, "{}", apart(&draft, &fine));
        let [draft, fine] = meshes.each_ref().map(|mesh| draw(mesh, None, squeeze));
        assert!(apart(&draft, &fine) > 0.005, "without a cortex they do differ");
    }
}

#[test]
fn device_and_processor_draw_the_same_cortex_also_where_tetrahedra_are_gone() {
    let Some(gpu) = device() else { return };
    let (surface, depth_mm, [mesh, _]) = brain();
    let cortex = Some(Cortex { surface: &surface, depth_mm: &depth_mm });
    let data = SceneData { bone: None, brain: Some(&mesh), mri: None, tint: None, cortex };
    let mut on_device = Renderer::new(&gpu, &data, SIZE).expect("the scene loads");
    let mut on_processor = ProcessorRenderer::new(&data, SIZE).expect("the scene loads");
    let middle = |tet: &[u32; 4]| tet.iter().map(|n| mesh.positions[*n as usize]).sum::<Vec3>() / 4.0;
    let gone: Vec<bool> = mesh.tets.iter().map(|tet| middle(tet).distance(Vec3::new(16.0, 12.0, 6.0)) < 12.0).collect();
    let mut images = Vec::new();
    let cut = Some(Cut { point: 14.0 * EYE.normalize(), normal: EYE, bone: false });
    for (brain_gone, cut) in [(None, None), (Some(&gone[..]), None), (None, None), (None, cut), (Some(&gone[..]), cut)]
    {
        let frame = Frame { brain_gone, cut, ..frame() };
        on_device.draw(&frame).expect("drawn");
        on_processor.draw(&frame).expect("drawn");
        let (device, processor) = (on_device.image().expect("picture"), on_processor.image());
        assert!(apart(&device, processor) < 0.01, "{}", apart(&device, processor));
        images.push(processor.clone());
    }
    assert_eq!(images[0], images[2], "what is back looks as before");
    assert!(apart(&images[0], &images[1]) > 0.03);
    assert!(apart(&images[0], &images[3]) > 0.03);
}

#[test]
fn a_section_shows_tissue_and_not_what_is_between_its_folds() {
    let (surface, depth_mm, [mesh, _]) = brain();
    let cortex = Some(Cortex { surface: &surface, depth_mm: &depth_mm });
    let up = EYE.normalize();
    let cut = Some(Cut { point: 20.0 * up, normal: EYE, bone: false });
    // Without an MRI the section has one colour, which no lit surface has.
    let flat = |image: &Image| {
        let mut counts = std::collections::BTreeMap::new();
        image.rgba.chunks(4).for_each(|pixel| *counts.entry(pixel.to_vec()).or_insert(0u32) += 1);
        let red = counts.into_iter().filter(|(pixel, _)| pixel[0] > pixel[2]);
        f64::from(red.map(|(_, count)| count).max().unwrap_or(0))
    };
    let [shown, whole] = [cortex, None].map(|cortex| {
        let data = SceneData { brain: Some(&mesh), cortex, ..SceneData::default() };
        let mut renderer = ProcessorRenderer::new(&data, SIZE).expect("the scene loads");
        renderer.draw(&Frame { cut, ..frame() }).expect("drawn");
        flat(renderer.image())
    });
    let (x, y) = up.any_orthonormal_pair();
    let grid = || (0..160 * 160).map(|n| 0.2 * ((n % 160) as f32 - 79.5) * x + 0.2 * ((n / 160) as f32 - 79.5) * y);
    let [tissue, ball] = [tissue as fn(Vec3) -> f32, |p: Vec3| 24.0 - p.length()]
        .map(|of| grid().filter(|p| of(20.0 * up + *p) > 0.0).count() as f64);
    assert!(tissue < 0.93 * ball, "the furrows are wide enough to be seen: {tissue} of {ball}");
    assert!((shown / whole - tissue / ball).abs() < 0.03, "{shown} of {whole}, {tissue} of {ball}");
}

#[test]
fn a_cortex_of_which_most_is_interpolated_looks_the_same() {
    let (surface, depth_mm, [mesh, _]) = brain();
    let cortex = Some(Cortex { surface: &surface, depth_mm: &depth_mm });
    let data = SceneData { bone: None, brain: Some(&mesh), mri: None, tint: None, cortex };
    let [exact, sparse] = [false, true].map(|sparse| {
        let mut renderer = ProcessorRenderer::new(&data, SIZE).expect("the scene loads");
        renderer.set_casting(Casting { sparse, ..Casting::default() });
        renderer.draw(&frame()).expect("drawn");
        renderer.image().clone()
    });
    let pixels = || exact.rgba.chunks(4).zip(sparse.rgba.chunks(4));
    let most = |(a, b): (&[u8], &[u8])| (0..3).map(|k| a[k].abs_diff(b[k])).max().unwrap_or(0);
    let over = |least: u8| pixels().filter(|pair| most(*pair) > least).count();
    assert!(over(0) * 20 > pixels().count(), "{} pixels were interpolated: it tests nothing", over(0));
    // 99 % differ by no more than a screen shows, one in ten thousand clearly.
    let are_few = over(3) * 100 < pixels().count() && over(40) * 10_000 < pixels().count();
    assert!(are_few, "{} and {} are off", over(3), over(40));
}

/// The brain pressed in around a place, by so much there and not at all beyond 12 mm.
fn pressed(mesh: &TetMesh, at: Vec3, mm: f32) -> Vec<Vec3> {
    let share = |p: &Vec3| f32::from(u8::from(p.distance(at) < 12.0));
    mesh.positions.iter().map(|p| *p - share(p) * mm * EYE.normalize()).collect()
}

#[test]
fn a_picture_drawn_on_from_the_last_is_the_one_drawn_anew() {
    let (surface, depth_mm, [mesh, _]) = brain();
    // A shell that hides a part, and whose shadow and the tools' fall on the rest.
    let mut hu = VoxelVolume::isotropic([64; 3], Vec3::splat(-31.5), 1.0, 0i16);
    for at in 0..hu.data.len() {
        let p = hu.centre_of([at % 64, at / 64 % 64, at / 4096]);
        hu.data[at] = (400.0 - 250.0 * ((p.length() - 28.0).abs() - 1.5).max(6.0 - p.y)).clamp(-1000.0, 1400.0) as i16;
    }
    let bone = Arc::new(BoneVolume::new(&hu, 400).expect("the shell is bone"));
    let cortex = Some(Cortex { surface: &surface, depth_mm: &depth_mm });
    let data = SceneData { bone: Some(bone), brain: Some(&mesh), mri: None, tint: None, cortex };
    for (sparse, detail) in [(false, 1.0), (true, 0.5)] {
        let open = || {
            let mut renderer = ProcessorRenderer::new(&data, SIZE).expect("the scene loads");
            renderer.set_casting(Casting { sparse, ..Casting::default() });
            renderer.set_detail(detail).expect("a share of the pixels");
            renderer
        };
        let mut renderer = open();
        let (top, aside) = (25.0 * EYE.normalize(), Vec3::new(18.0, -12.0, 8.0));
        let at = |place: Vec3| Pose { translation: place, ..frame().world_from_tool };
        let probe = Frame { tool: Some(Tool::probe(2.0)), ..frame() };
        let arrow = Overlay { force: Some([aside, 1.6 * aside]), ..Overlay::default() };
        let bled: Vec<u8> = mesh.positions.iter().map(|p| if p.distance(aside) < 12.0 { 90 } else { 0 }).collect();
        let steps = [
            (Frame { world_from_tool: at(1.4 * top), ..probe }, 0.0),
            (Frame { world_from_tool: at(top), ..probe }, 2.0),
            (Frame { world_from_tool: at(0.9 * top), overlay: arrow, ..probe }, 4.0),
            (Frame { world_from_tool: at(0.9 * top), brain_stains: Some(&bled), ..probe }, 4.0),
            (Frame { world_from_tool: at(1.3 * aside), drilling: true, tool: Some(Tool::burr(3.0)), ..probe }, 0.0),
            (Frame { second: Some((Tool::spatula(), at(1.2 * top))), ..frame() }, 3.0),
            (frame(), 0.0),
        ];
        let mut before: Option<Image> = None;
        for (n, (step, mm)) in steps.iter().enumerate() {
            let positions = pressed(&mesh, top, *mm);
            let step = Frame { brain_positions: Some(&positions), ..*step };
            renderer.draw(&step).expect("drawn");
            let mut anew = open();
            anew.draw(&step).expect("drawn");
            assert!(renderer.image() == anew.image(), "{n}: {} of the pixels", apart(renderer.image(), anew.image()));
            let changes = before.replace(anew.image().clone()).is_none_or(|before| before != *anew.image());
            assert!(changes, "{n} changes nothing: it tests nothing");
        }
        // All of it moves: what was seen before is drawn again too.
        let moved: Vec<Vec3> = mesh.positions.iter().map(|p| *p + Vec3::new(4.0, -3.0, 2.0)).collect();
        let step = Frame { brain_positions: Some(&moved), ..frame() };
        let mut anew = open();
        renderer.draw(&step).expect("drawn");
        anew.draw(&step).expect("drawn");
        assert!(renderer.image() == anew.image(), "{} of the pixels", apart(renderer.image(), anew.image()));
        // Nodes that creep stay until they moved by 0.03 mm: a quarter of a pixel here.
        for n in 1..40 {
            let crept: Vec<Vec3> = mesh.positions.iter().map(|p| *p + 0.0019 * n as f32 * Vec3::Z).collect();
            let step = Frame { brain_positions: Some(&crept), ..frame() };
            renderer.draw(&step).expect("drawn");
            let mut anew = open();
            anew.draw(&step).expect("drawn");
            assert!(apart(renderer.image(), anew.image()) < 0.002, "{n}: {}", apart(renderer.image(), anew.image()));
        }
    }
}
