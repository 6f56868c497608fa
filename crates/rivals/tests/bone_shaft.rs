//! A shaft that leans on the rim of a bore: right force, right torque about the tip, and no cut.

#[path = "../../rigid/tests/common/mod.rs"]
mod common;
use common::{bone, held};
use trepan_bone::BoneVolume;
use trepan_geometry::{Tool, ToolState, Vec3};
use trepan_rigid::{Extent, Method, RigidContact, RigidStep, god_object_sphere};
use trepan_rivals::Family;
use trepan_rivals::rigid::surface_vertices;

const WITH_SHAFT: Method = Method::of(&god_object_sphere::WITH_SHAFT);
const VERTICES: Method = Method::of(&surface_vertices::METHOD);
const BORE_MM: f32 = 4.0;
const SHAFT_MM: f32 = 1.2;

/// Bone under z = 0 with a bore along z.
fn bored() -> BoneVolume {
    bone([44, 44, 36], 0.5, |p| p.z.max(BORE_MM - p.truncate().length()))
}

fn axis(degrees: f32) -> Vec3 {
    Vec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos())
}

/// Tip at 4 mm depth, shaft towards +x, moved `x` off the middle at 20 mm/s.
fn lean(contact: &mut dyn RigidContact, bone: &BoneVolume, x: f32, drilling: bool, ticks: u32) -> (RigidStep, f32) {
    let (mut out, mut removed) = (RigidStep::default(), 0.0);
    contact.reset(held(Vec3::new(0.0, 0.0, -4.0), axis(30.0)));
    for t in 0..ticks {
        let tip = Vec3::new((0.02 * t as f32).min(x), 0.0, -4.0);
        contact.step(bone, &ToolState::at(held(tip, axis(30.0))), drilling, 1.0, &mut out);
        removed += out.removed_mm3;
    }
    (out, removed)
}

/// Height of the rim's contact over the tip along the shaft, and how deep the rim is in the shaft,
/// for a tip at `x`.
fn rim(x: f32) -> (f32, f32) {
    let rim = Vec3::new(BORE_MM - x, 0.0, 4.0);
    let along = rim.dot(axis(30.0));
    (along, SHAFT_MM - (rim - along * axis(30.0)).length())
}

#[test]
fn a_shaft_on_the_rim_of_a_bore_turns_the_tool_about_its_tip() {
    let bone = bored();
    for method in Method::all().into_iter().filter(Method::has_shaft) {
        // The line has no thickness: it meets the rim 1.2 mm later, and with a vertex every 2 mm
        // some way below it.
        let on_the_axis = method.descriptor().extent == Extent::Axis;
        let (x, place, arm) = match on_the_axis {
            true => (0.8 + SHAFT_MM / axis(30.0).z, 1.0, 0.4),
            // A sharp rim is rounded by a quarter of a voxel.
            false if method == WITH_SHAFT => (0.8, 0.13, 0.05),
            // A sum of vertices of which a rim meets one: a hundredth of the force.
            false if method == VERTICES => (0.8, 0.45, 0.15),
            false => (0.8, 0.4, 0.15),
        };
        let (height, depth) = rim(if on_the_axis { 0.8 } else { x });
        let (out, _) = lean(method.build(&Tool::burr(2.0)).as_mut(), &bone, x, false, 120);
        let (name, couple) = (method.name(), out.manifold.couple_mm);
        println!("{name}: depth {} of {depth} mm, couple {couple} for an arm of {height} mm", out.manifold.depth_mm);
        assert!((out.manifold.depth_mm - depth).abs() < place, "{name}: {} mm", out.manifold.depth_mm);
        assert!((couple.y / -height - 1.0).abs() < arm, "{name}: {couple}");
        assert!(couple.x.abs() + couple.z.abs() < 0.1 * height, "{name}: {couple}");
        if method == WITH_SHAFT {
            assert!(out.manifold.normal.dot(axis(30.0)).abs() < 0.05, "{name}: across the shaft");
        }
    }
}

#[test]
fn a_shaft_does_not_cut() {
    for method in Method::all().into_iter().filter(Method::has_shaft) {
        let (bone, name) = (bored(), method.name());
        let before = bone.snapshot();
        let (out, removed) = lean(method.build(&Tool::burr(2.0)).as_mut(), &bone, 1.6, true, 1000);
        assert!(
            (out.manifold.touches() || method.descriptor().extent == Extent::Axis) && removed == 0.0,
            "{name}: {removed} mm³"
        );
        assert!(before == bone.snapshot(), "{name}");
    }
}

#[test]
fn a_turning_hand_does_not_press_the_shaft_through_the_rim() {
    let bone = bored();
    let mut contact = WITH_SHAFT.build(&Tool::burr(2.0));
    let (mut out, mut deepest, mut last, mut worst) = (RigidStep::default(), 0.0f32, Vec3::ZERO, 0.0f32);
    contact.reset(held(Vec3::new(0.0, 0.0, -4.0), Vec3::Z));
    for t in 0..1000 {
        // 45 degrees a second.
        let now = axis(0.045 * t as f32);
        contact.step(&bone, &ToolState::at(held(Vec3::new(0.0, 0.0, -4.0), now)), false, 1.0, &mut out);
        let rim = Vec3::new(BORE_MM, 0.0, 0.0) - contact.proxy().translation;
        deepest = deepest.max(SHAFT_MM - rim.reject_from_normalized(now).length());
        let force = 2.0 * out.manifold.depth_mm * out.manifold.normal;
        (last, worst) = (force, worst.max(force.distance(last)));
    }
    println!("rim in the shaft by {deepest} mm, force change {worst} N/ms, force {last}");
    assert!(deepest < 0.15 && worst < 0.1 && last.length() > 1.0, "{deepest} mm, {worst} N/ms, {last} N");
}
