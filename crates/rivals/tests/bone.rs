//! What every method must keep, whatever its accuracy.

#[path = "../../rigid/tests/common/mod.rs"]
mod common;
use common::{at, bone, directions, held, walk};
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Quat, Tool, ToolState, Vec3};
use trepan_rigid::removal::{Pressed, RemovalLaw};
use trepan_rigid::{Extent, Method, RigidContact, RigidStep};
use trepan_rivals::Family;
use trepan_rivals::rigid::{centre_line, exposed_faces, mesh_shell, pointshell, thesis, voxel_sum};

const THESIS: [Method; 2] = [Method::of(&thesis::METHOD), Method::of(&thesis::AS_PRINTED)];
/// Methods that take voxels which the tool's surface goes through, whole: half the diagonal of a
/// voxel further than the tool goes.
const BY_VOXELS: [Method; 4] =
    [THESIS[0], THESIS[1], Method::of(&exposed_faces::METHOD), Method::of(&voxel_sum::METHOD)];
/// Methods that do not take a whole voxel away within the stroke of the test.
const SLOW: [Method; 3] =
    [Method::of(&pointshell::AVERAGE), Method::of(&pointshell::SUM), Method::of(&centre_line::METHOD)];

fn half_space(n: Vec3) -> BoneVolume {
    bone([28, 28, 28], 0.5, |p| p.dot(n))
}

fn built(method: &Method, tool: &Tool, start: Vec3) -> Box<dyn RigidContact> {
    let mut contact = method.build(tool);
    contact.reset(held(start, start.normalize_or(Vec3::Z)));
    contact
}

/// How deep a burr of `radius` sits in before the method feels it: the line approximation has no
/// thickness.
fn sinks(method: &Method, radius: f32) -> f32 {
    if method.descriptor().extent == Extent::Axis { radius } else { 0.0 }
}

/// The same box, hence the same address, holds one bone after another.
#[test]
fn a_new_bone_in_an_old_ones_place_is_not_taken_for_it() {
    for method in Method::all() {
        let mut bone = Box::new(half_space(Vec3::Z));
        let (mut contact, mut out) = (built(&method, &Tool::burr(2.0), 4.0 * Vec3::Z), RigidStep::default());
        let touching = at(Vec3::Z * (1.5 - sinks(&method, 2.0)));
        contact.step(&bone, &touching, false, 1.0, &mut out);
        assert!(out.manifold.depth_mm > 0.0, "{}", method.name());
        *bone = common::bone([28, 28, 28], 0.5, |p| p.z + 1.0);
        (0..20).for_each(|_| contact.step(&bone, &touching, false, 1.0, &mut out));
        assert_eq!(out.manifold.depth_mm, 0.0, "{}", method.name());
    }
}

#[test]
fn names_are_unique_and_found_again() {
    for method in Method::all() {
        assert_eq!(Method::named(method.name()), Some(method));
    }
    assert_eq!(Method::named("no such method"), None);
    assert!(Method::all().contains(&Method::RECOMMENDED));
}

#[test]
fn free_space_gives_nothing_and_the_proxy_is_the_tool() {
    for method in Method::all() {
        let mut contact = built(&method, &Tool::burr(2.0), Vec3::Z * 6.0);
        let out = walk(contact.as_mut(), &half_space(Vec3::Z), Vec3::Z * 6.0, Vec3::new(2.0, 1.0, 3.0), 0.1);
        assert!(!out.manifold.touches() && out.manifold.contacts().is_empty(), "{}", method.name());
        assert_eq!(contact.proxy().translation, Vec3::new(2.0, 1.0, 3.0), "{}", method.name());
    }
}

#[test]
fn a_half_space_pushes_out_along_its_normal() {
    for method in Method::all() {
        for n in directions(12) {
            let mut contact = built(&method, &Tool::burr(2.0), n * 4.0);
            let sunk = sinks(&method, 2.0);
            let out = walk(contact.as_mut(), &half_space(n), n * 4.0, n * (1.5 - sunk), 0.05);
            let angle = out.manifold.normal.dot(n).min(1.0).acos().to_degrees();
            assert!(out.manifold.touches() && angle < 20.0, "{} at {n}: {angle} degrees", method.name());
            let lifted = contact.proxy().translation.dot(n) + sunk;
            assert!((1.2..2.8).contains(&lifted), "{} at {n}: proxy at {lifted} mm", method.name());
        }
    }
}

#[test]
fn a_wall_holds_a_slow_tool() {
    for method in Method::all().into_iter().filter(Method::has_proxy) {
        let wall = bone([28, 28, 28], 0.5, |p| p.z.abs() - 0.6);
        let mut contact = built(&method, &Tool::burr(2.0), Vec3::Z * 4.0);
        let out = walk(contact.as_mut(), &wall, Vec3::Z * 4.0, Vec3::Z * -4.0, 0.05);
        assert!(
            out.manifold.touches() && contact.proxy().translation.z + sinks(&method, 2.0) > 1.0,
            "{}",
            method.name()
        );
    }
}

#[test]
fn the_same_path_gives_the_same_bytes() {
    for method in Method::all() {
        let run = || {
            let bone = half_space(Vec3::Z);
            let mut contact = built(&method, &Tool::burr(2.0), Vec3::Z * 3.0);
            let mut out = RigidStep::default();
            let mut all = Vec::new();
            for t in 0..60 {
                let p = Vec3::new(0.02 * t as f32, 0.3, 2.3 - 0.02 * t as f32);
                contact.step(&bone, &at(p), true, 1.0, &mut out);
                all.push(format!("{:?} {:?}", out, contact.proxy()));
            }
            (all, bone.snapshot().data)
        };
        assert!(run() == run(), "{}", method.name());
    }
}

/// Distance of a point from a segment.
fn distance(p: Vec3, (from, to): (Vec3, Vec3)) -> f32 {
    let way = to - from;
    let share = ((p - from).dot(way) / way.length_squared().max(1e-12)).clamp(0.0, 1.0);
    p.distance(from + share * way)
}

#[test]
fn drilling_removes_bone_and_only_where_the_burr_has_been() {
    for method in Method::all() {
        let bone = half_space(Vec3::Z);
        let before = bone.snapshot();
        let mut contact = built(&method, &Tool::burr(2.0), Vec3::Z * 3.0);
        let mut out = RigidStep::default();
        let mut strokes = Vec::new();
        let mut removed = 0.0;
        for t in 0..80 {
            let p = Vec3::new(0.01 * t as f32, 0.0, 2.2 - sinks(&method, 2.0) - 0.01 * t as f32);
            contact.step(&bone, &at(p), true, 10.0, &mut out);
            strokes.push((contact.proxy().translation, p));
            removed += out.removed_mm3;
        }
        let after = bone.snapshot();
        let mut lost = 0;
        for (i, (from, to)) in before.data.iter().zip(&after.data).enumerate() {
            assert!(to <= from, "{} adds bone", method.name());
            if *from >= common::ISO && *to < common::ISO {
                lost += 1;
                let voxel = [i % 28, i / 28 % 28, i / 784];
                let centre = after.centre_of(voxel).as_vec3();
                let reach = 2.001 + if BY_VOXELS.contains(&method) { 0.5 * 0.87 } else { 0.0 };
                assert!(strokes.iter().any(|&s| distance(centre, s) < reach), "{} at {centre}", method.name());
            }
        }
        assert!(lost > 0 || THESIS.contains(&method) || SLOW.contains(&method), "{} removed nothing", method.name());
        // The per-tick law, and the small depths of an average, are too slow to reach the isovalue
        // within this stroke.
        let slow = [THESIS[1], SLOW[0]].contains(&method);
        assert!(removed > 0.0 || slow, "{} counted nothing", method.name());
        assert!(before != after, "{} cut nothing", method.name());
    }
}

#[test]
fn a_probe_and_a_lifted_pedal_never_cut() {
    for method in Method::all() {
        for (tool, drilling) in [(Tool::probe(2.0), true), (Tool::burr(2.0), false)] {
            let bone = half_space(Vec3::Z);
            let before = bone.snapshot();
            let mut contact = built(&method, &tool, Vec3::Z * 3.0);
            let mut out = RigidStep::default();
            for _ in 0..20 {
                contact.step(&bone, &at(Vec3::Z), drilling, 1.0, &mut out);
                assert_eq!(out.removed_mm3, 0.0);
            }
            assert!(before == bone.snapshot(), "{}", method.name());
        }
    }
}

#[test]
fn poses_that_are_not_numbers_are_counted_and_change_nothing() {
    for method in Method::all() {
        let bone = half_space(Vec3::Z);
        let mut contact = built(&method, &Tool::burr(2.0), Vec3::Z * 3.0);
        walk(contact.as_mut(), &bone, Vec3::Z * 3.0, Vec3::Z * 1.8, 0.1);
        let proxy = contact.proxy();
        let mut out = RigidStep::default();
        let bad = [
            Pose::from_translation(Vec3::new(0.0, f32::NAN, 0.0)),
            Pose::from_translation(Vec3::splat(f32::INFINITY)),
            Pose::from_parts(Vec3::Z, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        ];
        for pose in bad {
            contact.step(&bone, &ToolState::at(pose), true, 1.0, &mut out);
            assert!(!out.manifold.touches() && out.fallbacks == 1 && contact.proxy() == proxy, "{}", method.name());
        }
        for dt in [0.0, -1.0, f32::NAN, f32::INFINITY, 1000.0] {
            contact.step(&bone, &at(Vec3::Z * 1.8), true, dt, &mut out);
            assert!(out.manifold.is_finite() && out.removed_mm3.is_finite(), "{}", method.name());
        }
    }
}

#[test]
fn teleports_and_the_ends_of_the_world_are_survived() {
    for method in Method::all() {
        let bone = half_space(Vec3::Z);
        let mut contact = built(&method, &Tool::burr(2.0), Vec3::Z * 3.0);
        let mut out = RigidStep::default();
        let places = [Vec3::Z * -5.0, Vec3::X * 1e5, Vec3::splat(-30.0), Vec3::Z * 3.0, Vec3::splat(7.0), Vec3::ZERO];
        for p in places.into_iter().cycle().take(18) {
            contact.step(&bone, &at(p), true, 1.0, &mut out);
            assert!(out.manifold.is_finite() && contact.proxy().translation.is_finite(), "{}", method.name());
        }
    }
}

#[test]
fn another_bone_is_noticed_without_being_told() {
    for method in Method::all() {
        let (low, high) = (half_space(Vec3::Z), bone([28, 28, 28], 0.5, |p| p.z - 0.6));
        let press = |contact: &mut dyn RigidContact, bone: &BoneVolume| {
            walk(contact, bone, Vec3::Z * 4.0, Vec3::Z * 1.9, 0.05).manifold.depth_mm
        };
        let mut contact = built(&method, &Tool::burr(2.0), Vec3::Z * 4.0);
        press(contact.as_mut(), &low);
        walk(contact.as_mut(), &low, Vec3::Z * 1.9, Vec3::Z * 4.0, 0.05);
        let truth = press(built(&method, &Tool::burr(2.0), Vec3::Z * 4.0).as_mut(), &high);
        let found = press(contact.as_mut(), &high);
        assert!((found - truth).abs() < 0.01, "{}: {found} mm, not {truth} mm", method.name());
    }
}

#[test]
fn what_others_change_and_an_undone_stroke_are_noticed() {
    for method in Method::all() {
        let (bone, name, start) = (half_space(Vec3::Z), method.name(), Vec3::Z * 4.0);
        let end = Vec3::Z * (1.9 - sinks(&method, 2.0));
        let touched = |contact: &mut dyn RigidContact| {
            let depth = walk(contact, &bone, start, end, 0.05).manifold.depth_mm;
            walk(contact, &bone, end, start, 0.05);
            depth
        };
        let mut contact = built(&method, &Tool::burr(2.0), start);
        let before = touched(contact.as_mut());
        bone.begin_stroke();
        (0..28 * 28 * 28).for_each(|at| {
            let voxel = [at % 28, at / 28 % 28, at / 784];
            if voxel[2] > 9 {
                bone.set_hu(voxel.into(), trepan_volume::AIR_HU);
            }
        });
        assert_eq!(touched(contact.as_mut()), 0.0, "{name} feels what is gone");
        assert!(matches!(bone.undo_stroke(), trepan_bone::Undone::Bricks(_)));
        assert_eq!(touched(contact.as_mut()), before, "{name} misses what came back");
    }
}

#[test]
fn a_tool_in_a_slot_a_pit_or_bone_has_a_finite_answer() {
    let scenes: [fn(Vec3) -> f32; 4] = [
        |p| 2.0 - p.x.abs(),
        |p| 1.6 - p.x.abs(),
        |p| (2.0 - p.truncate().length()).min(p.z + 4.0),
        |p| p.abs().max_element() - 7.0,
    ];
    for method in Method::all() {
        for distance in scenes {
            let bone = bone([28, 28, 28], 0.5, distance);
            let mut contact = built(&method, &Tool::burr(2.0), Vec3::ZERO);
            let mut out = RigidStep::default();
            for t in 0..40 {
                let p = Vec3::new(0.5 * (t as f32 * 0.3).sin(), 0.2, 0.05 * t as f32);
                contact.step(&bone, &at(p), t > 20, 1.0, &mut out);
                assert!(out.manifold.is_finite() && contact.proxy().translation.is_finite(), "{}", method.name());
                assert!(out.manifold.depth_mm < 10.0, "{}", method.name());
            }
        }
    }
}

#[test]
fn a_tool_of_any_shape_is_pushed_and_turned_where_its_mesh_touches() {
    // A plate of 8 x 2 x 1 mm from its middle: over the edge of the bone only one half touches.
    let corner =
        |n: u32| Vec3::new(if n & 1 == 0 { -4.0 } else { 4.0 }, (n >> 1 & 1) as f32 * 2.0 - 1.0, (n >> 2) as f32);
    let positions: Vec<Vec3> = (0..8).map(corner).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let shell = mesh_shell::of_mesh(&positions, &triangles, 0.4).unwrap();
    let tool = Tool::probe(1.0);
    let mut contact = pointshell::with_shell(&tool, shell, &Default::default());
    let bone = bone([40, 28, 28], 0.5, |p| p.z.max(-p.x));
    let out = walk(contact.as_mut(), &bone, Vec3::Z * 2.0, Vec3::Z * -0.45, 0.05);
    assert!(out.manifold.normal.z > 0.9 && out.manifold.touches(), "{:?}", out.manifold.normal);
    let arm = out.manifold.couple_mm;
    assert!((-2.6..-1.4).contains(&arm.y) && arm.x.abs() < 0.5, "a force 2 mm towards +x: {arm}");
}

/// For a tick, pressed along the tool's axis.
fn pressed(radius_mm: f32, depth_mm: f32) -> Pressed {
    Pressed { radius_mm, depth_mm, cosine: 1.0, dt_ms: 1.0 }
}

#[test]
fn what_rivals_wear_off_by_voxels_is_what_their_load_earns() {
    for method in ["exposed-faces", "voxel-sum"].map(|name| Method::named(name).expect("a method")) {
        let bone = bone([36, 36, 36], 0.5, |p| p.z);
        let mut contact = method.build(&Tool::burr(3.0));
        contact.reset(Pose::from_translation(Vec3::Z * 3.0));
        let (mut out, mut removed, mut earned, mut height) = (RigidStep::default(), 0.0, 0.0, 3.0);
        for _ in 0..4000 {
            contact.step(&bone, &at(Vec3::Z * height), true, 1.0, &mut out);
            // A hand that presses with 1.2 N.
            height += (2.0 * out.manifold.depth_mm * out.manifold.normal.z - 1.2) / 20.0;
            earned += RemovalLaw::RATE.volume_mm3(&pressed(3.0, out.manifold.depth_mm));
            removed += out.removed_mm3;
        }
        println!("{}: {removed} of {earned} mm³", method.name());
        assert!(earned > 5.0 && (removed / earned - 1.0).abs() < 0.25, "{}: {removed} of {earned}", method.name());
    }
}
