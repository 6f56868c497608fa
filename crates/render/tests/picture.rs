//! Tests brain, tool and slices in the finished picture.

mod cube;
mod scene;

use cube::cube;
use glam::{DAffine3, DVec3, Vec3};
use scene::{alone, bone, device, renderer};
use trepan_geometry::{Pose, Quat, Tool};
use trepan_gpu::Faults;
use trepan_render::{Camera, Frame, Image, Layout, RenderError, Renderer, SceneData, SliceLook};
use trepan_volume::VoxelVolume;

fn plain(camera: Camera) -> Frame<'static> {
    Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) }
}

fn picture(renderer: &mut Renderer, frame: &Frame) -> Image {
    renderer.draw(frame).expect("the frame is drawn");
    renderer.image().expect("the picture is read")
}

/// How much redder than green a pixel is; larger for the brain and its outline than for bone and
/// steel.
fn redness(image: &Image, x: u32, y: u32) -> i32 {
    let [r, g, _, _] = image.pixel(x, y);
    i32::from(r) - i32::from(g)
}

#[test]
fn the_brain_is_seen_where_it_is_and_hidden_by_bone() {
    let Some(gpu) = device() else { return };
    let lid = bone(48, |p| (p - DVec3::new(0.0, 0.0, 18.0)).abs().max_element() - 4.0);
    let mesh = cube(8.0);
    assert!((0..5).all(|t| mesh.volume_mm3(t) > 0.0));
    let data = SceneData { bone: Some(lid), brain: Some(&mesh), mri: None, tint: None, cortex: None };
    let mut renderer = renderer(&gpu, &data, [64, 64]);
    let front = plain(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 120.0));
    let at_rest = picture(&mut renderer, &front);
    assert!(redness(&at_rest, 32, 32) > 30 && redness(&at_rest, 4, 32) < 10, "{:?}", at_rest.pixel(32, 32));
    let moved: Vec<Vec3> = mesh.positions.iter().map(|&p| p + 25.0 * Vec3::X).collect();
    let aside = picture(&mut renderer, &Frame { brain_positions: Some(&moved), ..front });
    // Seen from the front, +x, the patient's right, is on the left.
    assert!(redness(&aside, 32, 32) < 10 && redness(&aside, 11, 32) > 30, "{:?}", aside.pixel(11, 32));
    let above = plain(Camera::viewed_from(Vec3::ZERO, Vec3::Z, 120.0));
    let (hidden, shown) =
        (picture(&mut renderer, &above), picture(&mut renderer, &Frame { show_bone: false, ..above }));
    assert!(
        redness(&shown, 32, 32) > redness(&hidden, 32, 32) + 20,
        "{:?} {:?}",
        shown.pixel(32, 32),
        hidden.pixel(32, 32)
    );
    assert_eq!(picture(&mut renderer, &Frame { show_brain: false, ..front }).pixel(32, 40), at_rest.pixel(2, 40));
    let few = renderer.draw(&Frame { brain_positions: Some(&moved[1..]), ..front });
    assert_eq!(few.unwrap_err(), RenderError::Nodes { wanted: 8, given: 7 });
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn the_tool_is_where_its_pose_says_and_throws_a_shadow() {
    let Some(gpu) = device() else { return };
    let slab = bone(64, |p| (p.y + 20.0).abs() - 6.0);
    let mut renderer = renderer(&gpu, &alone(&slab), [96, 96]);
    let frame = plain(Camera { fov_rad: 0.3, ..Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0) });
    let without = picture(&mut renderer, &frame);
    let along_the_sight = Pose::from_parts(Vec3::ZERO, Quat::from_rotation_arc(Vec3::Z, Vec3::NEG_Y));
    let tool = Tool::probe(5.0);
    let with = picture(&mut renderer, &Frame { tool: Some(tool), world_from_tool: along_the_sight, ..frame });
    let changed: Vec<(i64, i64)> = (0..96 * 96i64)
        .map(|n| (n % 96, n / 96))
        .filter(|&(x, y)| with.pixel(x as u32, y as u32) != without.pixel(x as u32, y as u32))
        .collect();
    let radius = (5.0f32 / 200.0).asin().tan() / 0.15f32.tan() * 48.0;
    let on_ball = |&(x, y): &(i64, i64)| (x as f32 + 0.5 - 48.0).hypot(y as f32 + 0.5 - 48.0) < radius;
    let ball = changed.iter().filter(|p| on_ball(p)).count();
    let wanted = (0..96 * 96i64).filter(|n| on_ball(&(n % 96, n / 96))).count();
    assert!(ball.abs_diff(wanted) < 4, "{ball} pixels of {wanted} in a radius of {radius}");
    let shadow: Vec<_> = changed.iter().filter(|p| !on_ball(p)).collect();
    let darker = shadow
        .iter()
        .filter(|p| with.pixel(p.0 as u32, p.1 as u32)[0] < without.pixel(p.0 as u32, p.1 as u32)[0])
        .count();
    assert!(shadow.len() > 50 && darker == shadow.len(), "{darker} of {}", shadow.len());
    // The lamp is at the upper left, so the shadow falls to the lower right.
    let mean = |f: fn(&&(i64, i64)) -> i64| shadow.iter().copied().map(|p| f(&p)).sum::<i64>() / shadow.len() as i64;
    assert!(mean(|p| p.0) > 48 && mean(|p| p.1) > 48);
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn slices_have_the_patients_right_on_the_left_and_show_density_and_signal() {
    let Some(gpu) = device() else { return };
    // Bone at the patient's right, front and top.
    let lump = bone(60, |p| (p - DVec3::new(15.0, 15.0, 15.0)).length() - 9.0);
    let affine = DAffine3::from_scale_rotation_translation(
        DVec3::new(-4.0, 4.0, 4.0),
        glam::DQuat::IDENTITY,
        DVec3::new(28.0, -28.0, -28.0),
    );
    let mut mri = VoxelVolume::filled([15, 15, 15], affine, 10.0f32);
    for at in 0..mri.data.len() {
        let centre = mri.centre_of([at % 15, at / 15 % 15, at / 225]);
        if (centre - DVec3::new(-15.0, 15.0, 15.0)).length() < 9.0 {
            mri.data[at] = 200.0;
        }
    }
    let data = SceneData { bone: Some(lump), brain: None, mri: Some(&mri), tint: None, cortex: None };
    let mut renderer = renderer(&gpu, &data, [200, 150]);
    let tip = Pose::from_translation(Vec3::new(15.0, 15.0, 15.0));
    let frame = Frame { world_from_tool: tip, ..Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0)) };
    let image = picture(&mut renderer, &frame);
    let slices = Layout::of(200, 150, true).slices.unwrap();
    let grey = |slice: usize, right: f32, down: f32| {
        let [x, y, w, h] = slices[slice];
        i32::from(image.pixel(x + (right * w as f32) as u32, y + (down * h as f32) as u32)[0])
    };
    for (slice, name) in [(0, "axial"), (1, "coronal")] {
        assert!(grey(slice, 0.27, 0.27) > 90, "{name}: bone at the upper left, {}", grey(slice, 0.27, 0.27));
        assert!(grey(slice, 0.74, 0.27) > 150, "{name}: signal at the upper right, {}", grey(slice, 0.74, 0.27));
        assert!(grey(slice, 0.27, 0.74) < 40 && grey(slice, 0.74, 0.74) < 40, "{name}: nothing below");
    }
    assert!(grey(2, 0.27, 0.27) > 90 && grey(2, 0.74, 0.27) < 40, "sagittal: the front is on the left");
    let ct_only = Frame { slices: SliceLook { mri_share: 0.0, ..SliceLook::default() }, ..frame };
    let image = picture(&mut renderer, &ct_only);
    let [x, y, w, h] = slices[0];
    assert!(image.pixel(x + w * 74 / 100, y + h * 27 / 100)[0] < 40);
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn the_outline_of_the_moved_brain_is_in_the_slices() {
    let Some(gpu) = device() else { return };
    let ball = bone(60, |p| p.length() - 2.0);
    let mesh = cube(12.0);
    let mut renderer = Renderer::new(
        &gpu,
        &SceneData { bone: Some(ball), brain: Some(&mesh), mri: None, tint: None, cortex: None },
        [400, 300],
    )
    .unwrap();
    let frame = Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0));
    let red = |image: &Image| {
        let [x, y, w, h] = Layout::of(400, 300, true).slices.unwrap()[0];
        let pixels = (0..w * h).map(|n| (x + n % w, y + n / w)).filter(|&(x, y)| redness(image, x, y) > 60);
        let columns: Vec<u32> = pixels.map(|(px, _)| px - x).collect();
        (columns.iter().copied().min().unwrap(), columns.iter().copied().max().unwrap(), columns.len())
    };
    let (left, right, count) = red(&picture(&mut renderer, &frame));
    // 60 mm and a margin of 4 percent fill 100 pixels: the square from -12 to 12 mm spans 39 of
    // them.
    assert!(
        (29..=33).contains(&left) && (67..=71).contains(&right) && (120..200).contains(&count),
        "{left} {right} {count}"
    );
    let moved: Vec<Vec3> = mesh.positions.iter().map(|&p| p + 6.0 * Vec3::NEG_X).collect();
    let (moved_left, moved_right, _) = red(&picture(&mut renderer, &Frame { brain_positions: Some(&moved), ..frame }));
    assert!(
        (9..=11).contains(&(moved_left - left)) && (9..=11).contains(&(moved_right - right)),
        "{moved_left} {moved_right}"
    );
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn the_same_frame_gives_the_same_bytes() {
    let Some(gpu) = device() else { return };
    let ball = bone(40, |p| p.length() - 12.0);
    let mesh = cube(9.0);
    let data = SceneData { bone: Some(ball), brain: Some(&mesh), mri: None, tint: None, cortex: None };
    let frame = Frame {
        tool: Some(Tool::burr(3.0)),
        ..Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::new(1.0, 2.0, 1.0), 90.0))
    };
    let draw = || picture(&mut renderer(&gpu, &data, [160, 120]), &frame);
    assert_eq!(draw(), draw());
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn a_finished_picture_says_what_the_device_took() {
    let Some(gpu) = device() else { return };
    let ball = bone(40, |p| p.length() - 12.0);
    let data = SceneData { bone: Some(ball), brain: None, mri: None, tint: None, cortex: None };
    let mut renderer = renderer(&gpu, &data, [320, 240]);
    assert_eq!(renderer.took_s(), 0.0);
    picture(&mut renderer, &Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::ONE, 90.0)));
    assert!(renderer.took_s() > 0.0);
}

#[test]
fn a_coarser_view_looks_like_the_fine_one_and_leaves_the_slices_alone() {
    let Some(gpu) = device() else { return };
    let ball = bone(40, |p| p.length() - 12.0);
    let mut renderer = renderer(&gpu, &alone(&ball), [240, 180]);
    let frame = Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::new(1.0, 2.0, 1.0), 90.0));
    let fine = picture(&mut renderer, &frame);
    renderer.set_detail(0.5).expect("half the detail");
    let coarse = picture(&mut renderer, &frame);
    let [_, _, width, height] = renderer.layout().view;
    assert_eq!(renderer.view_size(), [width / 2, height / 2]);
    let difference = |x: u32, y: u32| i32::from(fine.pixel(x, y)[1]).abs_diff(i32::from(coarse.pixel(x, y)[1]));
    let mean = |columns: std::ops::Range<u32>| {
        let count = columns.len() as u32 * 180;
        columns.flat_map(|x| (0..180).map(move |y| (x, y))).map(|(x, y)| difference(x, y)).sum::<u32>() as f32
            / count as f32
    };
    assert!((0.05..4.0).contains(&mean(0..width)), "mean difference {}", mean(0..width));
    assert_eq!(mean(width..240), 0.0);
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn the_mri_moves_with_the_brain_in_the_slices() {
    let Some(gpu) = device() else { return };
    let speck = bone(60, |p| (p - DVec3::splat(28.0)).length() - 1.5);
    let mesh = cube(20.0);
    let mut mri = VoxelVolume::isotropic([60; 3], Vec3::splat(-29.5), 1.0, 20.0f32);
    for at in 0..mri.data.len() {
        if mri.centre_of([at % 60, at / 60 % 60, at / 3600]).distance(DVec3::new(8.0, 0.0, 0.0)) < 7.0 {
            mri.data[at] = 200.0;
        }
    }
    let data = SceneData { bone: Some(speck), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let mut renderer = renderer(&gpu, &data, [400, 300]);
    let frame = Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0));
    // The middle column of the bright ball in the axial slice of 100 pixels for 59 mm and a margin
    // of 4 percent.
    let bright = |image: &Image| {
        let [x, y, w, h] = Layout::of(400, 300, true).slices.unwrap()[0];
        let pixels = (0..w * h).map(|n| (n % w, n / w)).filter(|&(px, py)| {
            let [r, g, b, _] = image.pixel(x + px, y + py);
            r > 120 && r == g && g == b
        });
        let columns: Vec<u32> = pixels.map(|(px, _)| px).collect();
        assert!((280..520).contains(&columns.len()), "{} bright pixels", columns.len());
        columns.iter().sum::<u32>() as f32 / columns.len() as f32 + 0.5
    };
    let column = |x_mm: f32| 50.0 - x_mm / (29.5 * 1.04) * 50.0;
    let rest = bright(&picture(&mut renderer, &frame));
    assert!((rest - column(8.0)).abs() < 1.5, "{rest} for {}", column(8.0));
    let moved: Vec<Vec3> = mesh.positions.iter().map(|&p| p + Vec3::new(-6.0, 0.0, 0.0)).collect();
    let moved = bright(&picture(&mut renderer, &Frame { brain_positions: Some(&moved), ..frame }));
    assert!((moved - column(2.0)).abs() < 1.5, "{moved} for {}", column(2.0));
    assert_eq!(gpu.faults(), Faults::default());
}
