//! Tests cases in which renderers fail: axis-parallel rays, odd camera positions, empty or noisy
//! volumes, degenerate meshes.

mod cube;
mod scene;

use cube::cube;
use glam::Vec3;
use scene::{ISO, alone, bone, device, volume};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_gpu::{Faults, Gpu};
use trepan_mesh::TetMesh;
use trepan_render::{Camera, Casting, Cut, Frame, Hit, ProcessorRenderer, SceneData, SliceLook};
use trepan_volume::{AIR_HU, VoxelVolume};

fn plain(camera: Camera) -> Frame<'static> {
    Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) }
}

/// Hits of skipping rays, of rays that visit every cell, and of the device.
fn hits(gpu: Option<&Gpu>, bone: &Arc<BoneVolume>, frame: &Frame, size: [u32; 2]) -> Vec<Vec<Option<Hit>>> {
    let mut processor = ProcessorRenderer::new(&alone(bone), size).expect("the scene loads");
    let mut all = Vec::new();
    for leap in [true, false] {
        processor.set_casting(Casting { leap, ..Casting::default() });
        processor.draw(frame).expect("drawn");
        all.push(processor.bone_hits());
    }
    if let Some(gpu) = gpu {
        let mut renderer = scene::renderer(gpu, &alone(bone), size);
        renderer.draw(frame).expect("drawn");
        all.push(renderer.bone_hits().expect("hits"));
        assert_eq!(gpu.faults(), Faults::default());
    }
    all
}

/// Number of rays that differ by more than `most_mm`, or hit on one side only.
fn disagree(a: &[Option<Hit>], b: &[Option<Hit>], most_mm: f32) -> usize {
    let far = |(a, b): &(&Option<Hit>, &Option<Hit>)| match (a, b) {
        (Some(a), Some(b)) => (a.distance_mm - b.distance_mm).abs() > most_mm,
        (a, b) => a.is_some() != b.is_some(),
    };
    a.iter().zip(b).filter(far).count()
}

#[test]
fn all_renderers_agree_on_noise_empty_full_and_single_voxels() {
    let gpu = device();
    let mut single = VoxelVolume::isotropic([1, 1, 1], Vec3::ZERO, 1.0, AIR_HU);
    single.data[0] = 1000;
    let mut flat = VoxelVolume::isotropic([37, 1, 19], Vec3::splat(-15.0), 1.0, AIR_HU);
    flat.data.fill(ISO);
    let mut plateau = volume(21, |p| if p.z < 0.0 { f64::from(ISO) } else { -1000.0 });
    plateau.data[0] = 3000;
    let scenes = [
        (
            "noise",
            volume(30, |p| {
                f64::from(fastrand::Rng::with_seed((p.x + 99.0 * p.y + 9801.0 * p.z).to_bits()).i32(-1000..1900))
            }),
        ),
        ("everything", volume(17, |_| 1500.0)),
        ("a plateau at the isovalue", plateau),
        ("a single voxel", single),
        ("one layer", flat),
    ];
    for (name, ct) in scenes {
        let bone = Arc::new(BoneVolume::new(&ct, ISO).expect("there is bone"));
        let middle = bone.bounds().centre();
        let views = [
            (Vec3::X, 60.0),
            (Vec3::NEG_Y, 0.3),
            (Vec3::new(0.4, -0.7, 0.3), 60.0),
            (Vec3::new(1.0, 1e-6, 1e-6), 40.0),
        ];
        for (towards, distance) in views {
            let frame = plain(Camera { fov_rad: 0.4, ..Camera::viewed_from(middle, towards, distance) });
            let all = hits(gpu.as_ref(), &bone, &frame, [25, 17]);
            for other in &all[1..] {
                assert!(disagree(&all[0], other, 0.01) <= 1, "{name} from {towards} at {distance} mm");
            }
        }
    }
    let empty = bone(20, |p| p.length() - 4.0);
    (0..8000).for_each(|at| empty.set_hu(glam::IVec3::new(at % 20, at / 20 % 20, at / 400), AIR_HU));
    let all = hits(gpu.as_ref(), &empty, &plain(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 60.0)), [25, 17]);
    assert!(all.iter().flatten().all(Option::is_none), "no bone is left");
}

#[test]
fn sparse_rays_see_a_smooth_surface_where_it_is_and_every_wall() {
    let ball = bone(64, |p| p.length() - 24.0);
    let wall = volume(40, |p| if (p.z - 0.5).abs() < 0.1 { f64::from(ISO) + 1.0 } else { -1000.0 });
    let wall = Arc::new(BoneVolume::new(&wall, ISO).expect("there is bone"));
    for (bone, fov_rad) in [(ball, 0.6), (wall, 0.1)] {
        for towards in [Vec3::Z, Vec3::new(0.5, 0.3, 0.8)] {
            let frame = plain(Camera { fov_rad, ..Camera::viewed_from(Vec3::ZERO, towards, 120.0) });
            let mut renderer = ProcessorRenderer::new(&alone(&bone), [201, 150]).expect("the scene loads");
            renderer.draw(&frame).expect("drawn");
            let exact = renderer.bone_hits();
            let steps = renderer.steps_per_ray();
            renderer.set_casting(Casting { sparse: true, ..Casting::default() });
            renderer.draw(&frame).expect("drawn");
            let lost = exact.iter().zip(&renderer.bone_hits()).filter(|(a, b)| a.is_some() != b.is_some()).count();
            let far = disagree(&exact, &renderer.bone_hits(), 0.1);
            assert!(lost <= 3 && far * 100 <= exact.len(), "{lost} lost, {far} far off");
            assert!(renderer.steps_per_ray() < 0.7 * steps, "{} of {steps} steps", renderer.steps_per_ray());
        }
    }
}

/// Pixels of the brain on the processor and, if available, on the device. They may differ by at
/// most `most` along the rim.
fn brain_pixels(gpu: Option<&Gpu>, mesh: &TetMesh, now: &[Vec3], cut: Option<Cut>, most: usize) -> usize {
    let data = SceneData { bone: None, brain: Some(mesh), mri: None, tint: None, cortex: None };
    let camera = Camera::viewed_from(Vec3::ZERO, Vec3::new(0.31, 1.0, 0.17), 90.0);
    let frame = Frame { brain_positions: Some(now), cut, ..plain(camera) };
    let red = |rgba: &[u8]| rgba.chunks_exact(4).map(|p| p[0] > p[1].saturating_add(8)).collect::<Vec<_>>();
    let mut processor = ProcessorRenderer::new(&data, [120, 90]).expect("the scene loads");
    processor.draw(&frame).expect("drawn");
    let seen = red(&processor.image().rgba);
    if let Some(gpu) = gpu {
        let mut renderer = scene::renderer(gpu, &data, [120, 90]);
        renderer.draw(&frame).expect("drawn");
        let on_device = red(&renderer.image().expect("picture").rgba);
        let apart = seen.iter().zip(&on_device).filter(|(a, b)| a != b).count();
        assert!(apart <= most, "{apart} pixels differ");
        assert_eq!(gpu.faults(), Faults::default());
    }
    seen.iter().filter(|&&seen| seen).count()
}

/// A block of many tetrahedra.
fn block(edge: usize, r: f32) -> TetMesh {
    let n = edge + 1;
    let at =
        |i: usize| Vec3::new((i % n) as f32, (i / n % n) as f32, (i / (n * n)) as f32) * (2.0 * r / edge as f32) - r;
    let corner = |cell: usize, c: u32| {
        let [x, y, z] = [cell % edge, cell / edge % edge, cell / (edge * edge)];
        ((x + (c & 1) as usize) + n * ((y + (c >> 1 & 1) as usize) + n * (z + (c >> 2) as usize))) as u32
    };
    let split = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
    let tets = (0..edge.pow(3)).flat_map(|cell| split.map(|tet| tet.map(|c| corner(cell, c)))).collect();
    TetMesh { positions: (0..n.pow(3)).map(at).collect(), tets }
}

#[test]
fn no_cracks_between_tetrahedra_in_surface_and_cut() {
    let (gpu, mesh) = (device(), block(7, 12.0));
    let whole = brain_pixels(gpu.as_ref(), &mesh, &mesh.positions, None, 6);
    // Moving interior nodes keeps the silhouette: a crack would show the background.
    let mut random = fastrand::Rng::with_seed(3);
    let mut inner = mesh.positions.clone();
    let shaken = inner.iter_mut().filter(|p| p.abs().max_element() < 11.0);
    shaken.for_each(|p| *p += Vec3::new(random.f32(), random.f32(), random.f32()) - 0.5);
    assert_eq!(brain_pixels(gpu.as_ref(), &mesh, &inner, None, 6), whole);
    // A cut surface that faces the eye fills the outline of the remaining half: as many pixels as a
    // block that ends there.
    let cut = Cut { point: Vec3::ZERO, normal: Vec3::Y, bone: false };
    let mut half = mesh.clone();
    half.positions.iter_mut().for_each(|p| p.y = 0.5 * (p.y - 12.0));
    let ends_there = brain_pixels(gpu.as_ref(), &half, &half.positions, None, 6);
    let face = brain_pixels(gpu.as_ref(), &mesh, &inner, Some(cut), 12);
    assert!(face.abs_diff(ends_there) <= 4, "{face} pixels for {ends_there}");
}

#[test]
fn valid_parts_of_degenerate_meshes_are_drawn() {
    let (gpu, mesh) = (device(), block(4, 12.0));
    let whole = brain_pixels(gpu.as_ref(), &mesh, &mesh.positions, None, 6);
    let cut = Some(Cut { point: Vec3::new(0.0, 3.0, 0.0), normal: Vec3::new(0.2, 1.0, 0.1), bone: false });
    let change = |f: fn(Vec3) -> Vec3| mesh.positions.iter().map(|&p| f(p)).collect::<Vec<_>>();
    let turned_inside_out = change(|p| Vec3::new(-p.x, p.y, p.z));
    assert!(brain_pixels(gpu.as_ref(), &mesh, &turned_inside_out, None, 8) > whole / 2);
    let folded = change(|p| Vec3::new(p.x.abs(), p.y, p.z));
    let slivers = change(|p| Vec3::new(p.x, 1e-5 * p.y, p.z));
    let flat = change(|p| Vec3::new(p.x, 0.0, p.z));
    let point = change(|_| Vec3::ZERO);
    let far = change(|p| p * 1e30);
    let behind = change(|p| p + 89.0 * Vec3::new(0.31, 1.0, 0.17).normalize());
    let mut broken = mesh.positions.clone();
    broken[62] = Vec3::NAN;
    broken[3] = Vec3::INFINITY;
    for (name, now) in [("folded", &folded), ("slivers", &slivers), ("flat", &flat), ("broken", &broken)] {
        let seen = brain_pixels(gpu.as_ref(), &mesh, now, None, 3000);
        assert!(seen > whole / 6, "{name}: {seen} of {whole} pixels");
        brain_pixels(gpu.as_ref(), &mesh, now, cut, 10_800);
    }
    for now in [&point, &far, &behind] {
        brain_pixels(gpu.as_ref(), &mesh, now, None, 10_800);
        brain_pixels(gpu.as_ref(), &mesh, now, cut, 10_800);
    }
    let sound = cube(12.0);
    assert!(brain_pixels(gpu.as_ref(), &sound, &sound.positions, cut, 12) > 1000);
}

#[test]
fn a_picture_of_8192_pixels_is_drawn_or_refused_with_a_reason() {
    let ball = bone(24, |p| p.length() - 8.0);
    let frame = plain(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 60.0));
    for size in [[8192, 16], [16, 8192], [8192, 1]] {
        let mut processor = ProcessorRenderer::new(&alone(&ball), size).expect("the scene loads");
        processor.draw(&frame).expect("drawn");
        let Some(gpu) = device() else { continue };
        let mut renderer = scene::renderer(&gpu, &alone(&ball), size);
        renderer.draw(&frame).expect("drawn");
        assert!(disagree(&processor.bone_hits(), &renderer.bone_hits().expect("hits"), 0.01) <= 131);
        assert!(renderer.resize([100_000, 2]).is_err_and(|why| why.to_string().contains("100000")));
        renderer.draw(&frame).expect("the last size still serves");
    }
}
