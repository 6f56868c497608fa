//! Tests ray-cast bone against closed forms and brute force.

mod scene;

use glam::{DVec3, IVec3, Vec2, Vec3};
use scene::{ISO, alone, bone, device, renderer, volume};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_gpu::Faults;
use trepan_render::{Camera, Frame, Hit, Renderer, SliceLook, View};
use trepan_volume::AIR_HU;

/// A frame with the 3-D view only.
fn plain(camera: Camera) -> Frame<'static> {
    Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) }
}

/// Rays through the pixel centres, row by row.
fn rays(view: &View, [width, height]: [u32; 2]) -> Vec<Vec3> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let at =
        |(x, y)| Vec2::new((x as f32 + 0.5) / width as f32 * 2.0 - 1.0, 1.0 - (y as f32 + 0.5) / height as f32 * 2.0);
    pixels.map(|p| view.ray(at(p))).collect()
}

fn draw(renderer: &mut Renderer, frame: &Frame) -> Vec<Option<Hit>> {
    renderer.draw(frame).expect("the frame is drawn");
    renderer.bone_hits().expect("the hits are read")
}

#[test]
fn a_ball_has_the_silhouette_depth_and_normals_of_a_ball() {
    let Some(gpu) = device() else { return };
    let (radius, distance, size) = (20.0f32, 120.0f32, [96, 96]);
    let bone = bone(56, |p| p.length() - f64::from(radius));
    let mut renderer = renderer(&gpu, &alone(&bone), size);
    for towards_eye in [Vec3::Y, Vec3::new(0.3, -0.8, 0.5), Vec3::Z, Vec3::NEG_X] {
        let camera = Camera { fov_rad: 0.5, ..Camera::viewed_from(Vec3::ZERO, towards_eye, distance) };
        let frame = plain(camera);
        let hits = draw(&mut renderer, &frame);
        let view = renderer.view(&frame);
        let seen = hits.iter().flatten().count() as f32;
        let disc = (radius / distance).asin().tan() / view.half.y * 48.0;
        let expected = std::f32::consts::PI * disc * disc;
        assert!((seen / expected - 1.0).abs() < 0.02, "silhouette {seen} for {expected}");
        let mut errors = Vec::new();
        for (hit, along) in hits.iter().zip(rays(&view, size)).filter_map(|(h, a)| h.map(|h| (h, a))) {
            let middle = -view.eye.dot(along);
            let room = radius * radius - (view.eye + middle * along).length_squared();
            let point = view.eye + hit.distance_mm * along;
            if room > 20.0 {
                errors.push((hit.distance_mm - (middle - room.sqrt())).abs());
                assert!(hit.normal.angle_between(point) < 0.03, "{} at {point}", hit.normal);
            }
        }
        errors.sort_by(f32::total_cmp);
        assert!(errors[errors.len() * 99 / 100] < 0.05, "depth error {}", errors[errors.len() * 99 / 100]);
    }
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn a_wall_of_one_voxel_is_never_lost() {
    let Some(gpu) = device() else { return };
    // Just over the isovalue in one layer: between voxel centres hardly anything is bone.
    for axis in 0..3 {
        let wall = volume(40, |p| if (p[axis] - 0.5).abs() < 0.1 { f64::from(ISO) + 1.0 } else { -1000.0 });
        let bone = Arc::new(BoneVolume::new(&wall, ISO).unwrap());
        let mut renderer = renderer(&gpu, &alone(&bone), [48, 48]);
        let normal = DVec3::AXES[axis].as_vec3();
        for tilt in [Vec3::ZERO, Vec3::new(0.9, 0.4, 0.2), Vec3::new(-0.2, 0.7, -0.8)] {
            let camera = Camera { fov_rad: 0.05, ..Camera::viewed_from(Vec3::ZERO, normal + tilt, 100.0) };
            let frame = plain(camera);
            let hits = draw(&mut renderer, &frame);
            let view = renderer.view(&frame);
            for (hit, along) in hits.iter().zip(rays(&view, [48, 48])) {
                let hit = hit.unwrap_or_else(|| panic!("a ray along {along} went through the wall across axis {axis}"));
                let height = (view.eye + hit.distance_mm * along)[axis] - 0.5;
                assert!(height.abs() < 0.01, "hit {height} mm from the wall");
            }
        }
    }
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn rays_in_the_faces_of_bricks_and_along_the_axes_hit_like_any_other() {
    let Some(gpu) = device() else { return };
    let slab = bone(40, |p| p.y.abs() - 6.25);
    let mut renderer = renderer(&gpu, &alone(&slab), [3, 3]);
    // The middle ray runs along an axis, exactly in a face between bricks: padded voxel 8 lies at
    // -12.5 mm.
    for target in [Vec3::new(-12.5, 0.0, -12.5), Vec3::new(-12.5, 0.0, 0.2), Vec3::new(3.5, 0.0, 3.5), Vec3::ZERO] {
        let camera = Camera { fov_rad: 1e-3, ..Camera::viewed_from(target, Vec3::Y, 100.0) };
        let hits = draw(&mut renderer, &plain(camera));
        assert!(hits.iter().all(|h| h.is_some_and(|h| (h.distance_mm - 93.75).abs() < 0.01)), "{target}: {hits:?}");
    }
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn a_camera_inside_sees_the_far_wall_and_one_in_bone_sees_bone() {
    let Some(gpu) = device() else { return };
    let shell = bone(64, |p| (p.length() - 25.0).abs() - 3.0);
    let mut renderer = renderer(&gpu, &alone(&shell), [32, 24]);
    let hits = draw(&mut renderer, &plain(Camera::viewed_from(Vec3::new(0.0, -10.0, 0.0), Vec3::Y, 10.0)));
    assert!(hits.iter().all(|h| h.is_some_and(|h| (20.0..30.0).contains(&h.distance_mm))));
    let in_bone = draw(&mut renderer, &plain(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 25.0)));
    assert!(in_bone.iter().all(|h| h.is_some_and(|h| h.distance_mm < 0.01 && h.normal.is_normalized())));
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn bone_at_the_border_of_the_scan_has_a_closed_surface() {
    let Some(gpu) = device() else { return };
    let full = Arc::new(BoneVolume::new(&volume(20, |_| 1000.0), ISO).unwrap());
    let mut renderer = renderer(&gpu, &alone(&full), [16, 16]);
    let hits =
        draw(&mut renderer, &plain(Camera { fov_rad: 0.02, ..Camera::viewed_from(Vec3::ZERO, Vec3::NEG_X, 100.0) }));
    // From 1000 HU at -9.5 mm to -1000 HU at -10.5 mm: 400 HU lies at -9.8 mm.
    assert!(
        hits.iter().all(|h| h.is_some_and(|h| (h.distance_mm - 90.2).abs() < 0.02 && h.normal.x < -0.99)),
        "{:?}",
        hits[0]
    );
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn odd_sizes_are_drawn_and_none_is_refused() {
    let Some(gpu) = device() else { return };
    let ball = bone(24, |p| p.length() - 8.0);
    for size in [[1, 1], [33, 17], [1, 50], [201, 99]] {
        let mut renderer = renderer(&gpu, &alone(&ball), size);
        renderer.draw(&Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 60.0))).unwrap();
        let image = renderer.image().unwrap();
        assert_eq!((image.width, image.height, image.rgba.len()), (size[0], size[1], 4 * (size[0] * size[1]) as usize));
        renderer.resize([7, 5]).unwrap();
        renderer.draw(&Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 60.0))).unwrap();
        assert_eq!(renderer.image().unwrap().rgba.len(), 4 * 35);
        assert!(renderer.resize([0, 5]).is_err());
    }
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn a_drilled_voxel_is_seen_in_the_next_picture_and_nothing_else_changes() {
    let Some(gpu) = device() else { return };
    let block = bone(48, |p| p.abs().max_element() - 18.25);
    let size = [64, 64];
    let mut renderer = renderer(&gpu, &alone(&block), size);
    let frame = plain(Camera::viewed_from(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.3), 130.0));
    let before = draw(&mut renderer, &frame);
    assert_eq!(renderer.draw(&frame).unwrap().pixels_cast, 0, "a resting picture casts no ray");
    let hole = Vec3::new(5.5, 17.5, 3.5);
    for n in 0..27 {
        block.set_hu(block.voxel_of(hole) + IVec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1), AIR_HU);
    }
    let report = renderer.draw(&frame).unwrap();
    assert!(
        report.bricks > 0 && report.bricks_left == 0 && report.pixels_cast > 0 && report.pixels_cast < 64 * 64 / 2,
        "{report:?}"
    );
    let after = renderer.bone_hits().unwrap();
    let view = renderer.view(&frame);
    let deeper = before
        .iter()
        .zip(&after)
        .filter(|(b, a)| a.is_none_or(|a| b.is_some_and(|b| a.distance_mm > b.distance_mm + 1.0)) && b.is_some());
    assert!(deeper.count() > 4);
    for ((b, a), along) in before.iter().zip(&after).zip(rays(&view, size)) {
        let Some(b) = b else { continue };
        if (view.eye + b.distance_mm * along).distance(hole) > 8.0 {
            assert_eq!(Some(b.distance_mm), a.map(|a| a.distance_mm));
        }
    }
    let mut anew = scene::renderer(&gpu, &alone(&block), size);
    assert!(
        draw(&mut renderer, &frame) == draw(&mut anew, &frame),
        "a followed picture equals one that is loaded anew"
    );
    assert_eq!(renderer.image().unwrap(), anew.image().unwrap());
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn changes_over_the_limit_come_with_the_next_pictures() {
    let Some(gpu) = device() else { return };
    let block = bone(40, |p| p.abs().max_element() - 16.0);
    let mut renderer = renderer(&gpu, &alone(&block), [24, 24]);
    renderer.bricks_per_frame = 30;
    let frame = plain(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 130.0));
    renderer.draw(&frame).unwrap();
    for at in 0..40 * 40 * 40 {
        block.set_hu(IVec3::new(at % 40, at / 40 % 40, at / 1600), AIR_HU);
    }
    let mut left = 125u32;
    for _ in 0..5 {
        let report = renderer.draw(&frame).unwrap();
        assert_eq!((report.bricks, report.bricks_left), (left.min(30), left.saturating_sub(30)));
        left = report.bricks_left;
    }
    assert!(draw(&mut renderer, &frame).iter().all(Option::is_none), "nothing is left to see");
    assert_eq!(gpu.faults(), Faults::default());
}
