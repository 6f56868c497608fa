//! Where methods fail: thin walls at speed, and agreement with the oracle on rough bone.

mod common;
use common::{at, bone, scanned};
use trepan_geometry::{Pose, Tool, Vec3};
use trepan_rigid::brute;
use trepan_rigid::{Method, RigidStep};

/// Whether a ball driven through a wall of `voxels` thickness at `mm_per_tick`, `degrees` off its
/// normal, comes out on the far side.
fn tunnels(method: &Method, radius: f32, voxels: f32, mm_per_tick: f32, degrees: f32, n: Vec3) -> bool {
    let wall = scanned([48, 48, 48], 0.5, |p| (p.dot(n).abs() / 0.5 - 0.5 * voxels).max(-0.4), 1.0);
    let way = (-n * degrees.to_radians().cos() + n.any_orthonormal_vector() * degrees.to_radians().sin()).normalize();
    let mut contact = method.build(&Tool::burr(radius));
    let start = -way * 6.0;
    contact.reset(Pose::from_translation(start));
    let mut out = RigidStep::default();
    for t in 0..=(12.0 / mm_per_tick) as u32 {
        contact.step(&wall, &at(start + way * mm_per_tick * t as f32), false, 1.0, &mut out);
    }
    contact.proxy().translation.dot(n) < 0.0
}

#[test]
fn the_recommended_method_never_tunnels() {
    let tilted = Vec3::new(0.36, 0.48, 0.8);
    for radius in [0.5, 1.0, 3.0] {
        for voxels in [1.0, 2.0, 3.0, 5.0] {
            for speed in [0.05, 0.5, 2.0, 12.0] {
                for degrees in [0.0, 30.0, 54.7] {
                    for n in [Vec3::Z, tilted, Vec3::splat(1.0).normalize()] {
                        let through = tunnels(&Method::RECOMMENDED, radius, voxels, speed, degrees, n);
                        assert!(!through, "radius {radius} wall {voxels} speed {speed} angle {degrees} normal {n}");
                    }
                }
            }
        }
    }
}

/// A cheap noise in -1..1 without a seed to forget.
fn noise(p: Vec3) -> f32 {
    (3.1 * p.x + 1.7 * p.y).sin() * (2.3 * p.y - 1.1 * p.z).cos() + 0.3 * (5.0 * p.z + 4.1 * p.x).sin()
}

#[test]
fn on_rough_bone_it_agrees_with_the_oracle() {
    let rough = |p: Vec3| p.z + 0.4 * noise(0.6 * p);
    // Triangles cut the ridges off, in voxels of half the size by a quarter of it.
    let (bone, finer) = (bone([40; 3], 0.5, rough), bone([80; 3], 0.25, rough));
    let oracle = Method::of(&brute::METHOD);
    let (mut ours, mut truth) = (Method::RECOMMENDED.build(&Tool::burr(2.0)), oracle.build(&Tool::burr(2.0)));
    let (mut a, mut b) = (RigidStep::default(), RigidStep::default());
    let mut errors = Vec::new();
    for t in 0..60 {
        let x = 0.1 * t as f32 - 3.0;
        let p = Vec3::new(x, 0.7 * x.sin(), if t == 0 { 4.0 } else { 1.9 });
        ours.step(&bone, &at(p), false, 1.0, &mut a);
        truth.step(&finer, &at(p), false, 1.0, &mut b);
        errors.push(ours.proxy().translation.distance(truth.proxy().translation) / 0.5);
    }
    errors.sort_by(f32::total_cmp);
    println!("proxy off by p50 {} p95 {} max {} voxel", errors[30], errors[57], errors[59]);
    assert!(errors[30] < 0.1 && errors[57] < 0.2, "{errors:?}");
}

#[test]
fn twenty_thousand_ticks_of_nonsense_stay_within_the_world() {
    let bone = bone([24, 24, 24], 0.5, |p| p.length() - 4.0);
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(1.0));
    let mut out = RigidStep::default();
    let mut p = Vec3::Z * 6.0;
    for t in 0..20_000u32 {
        let h = t.wrapping_mul(0x9E37_79B1) ^ (t << 7);
        let kick = Vec3::new((h & 255) as f32, (h >> 8 & 255) as f32, (h >> 16 & 255) as f32) / 127.5 - 1.0;
        p = if h % 997 == 0 { kick * 9.0 } else { (p + 0.1 * kick).clamp_length_max(9.0) };
        contact.step(&bone, &at(p), h & 1 == 0, 1.0, &mut out);
        assert!(out.manifold.is_finite() && out.removed_mm3 >= 0.0);
        assert!(contact.proxy().translation.length() < 20.0);
    }
}

#[test]
fn a_ball_that_starts_in_bone_is_let_out() {
    let bone = bone([28, 28, 28], 0.5, |p| p.abs().max_element() - 5.0);
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(2.0));
    contact.reset(Pose::IDENTITY);
    let mut out = RigidStep::default();
    for t in 0..600 {
        contact.step(&bone, &at(Vec3::Z * 0.02 * t as f32), false, 1.0, &mut out);
    }
    assert!(!out.manifold.touches(), "depth {} mm", out.manifold.depth_mm);
}

#[test]
fn a_burr_comes_out_of_its_own_bore() {
    let bone = bone([28, 28, 32], 0.5, |p| p.z - 3.0);
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(2.0));
    contact.reset(Pose::from_translation(Vec3::Z * 5.0));
    let mut out = RigidStep::default();
    for _ in 0..4000 {
        let device = contact.proxy().translation - Vec3::Z * 0.75;
        contact.step(&bone, &at(device), true, 1.0, &mut out);
    }
    let deep = contact.proxy().translation;
    assert!(deep.z < 2.0, "the bore is deeper than the burr: {deep}");
    let mut worst = 0.0f32;
    for t in 0..500 {
        contact.step(&bone, &at(deep + Vec3::Z * 0.02 * t as f32), false, 1.0, &mut out);
        worst = worst.max(out.manifold.depth_mm);
    }
    println!("bore to {deep}, drag {worst} mm");
    assert!(!out.manifold.touches() && worst < 0.5, "drag of {worst} mm on the way out");
}

#[test]
fn places_where_no_head_is_are_air() {
    let wall = scanned([24, 24, 24], 0.5, |p| p.z, 1.0);
    for far in [1e6, 1e9, 3e9, 1e20, f32::MAX] {
        for way in [Vec3::X, Vec3::NEG_Z, Vec3::ONE] {
            let mut contact = Method::RECOMMENDED.build(&Tool::burr(3.0));
            contact.reset(Pose::from_translation(far * way));
            let mut out = RigidStep::default();
            for drilling in [false, true] {
                contact.step(&wall, &at(far * way), drilling, 1.0, &mut out);
                assert!(!out.manifold.touches() && out.removed_mm3 == 0.0, "{far} {way}");
            }
        }
    }
}
