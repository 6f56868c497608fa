//! How near the recommended method comes to scenes with a known answer.

mod common;
use common::{at, bone, directions, scanned, walk};
use trepan_geometry::{Pose, Tool, Vec3};
use trepan_rigid::{Method, RigidStep};

#[test]
fn planes_in_every_orientation_give_depth_and_normal() {
    for blur in [1.0, 2.0, 0.01] {
        let (mut depth, mut angle) = (0.0f32, 0.0f32);
        for n in directions(200) {
            let bone = scanned([32, 32, 32], 0.5, |p| (p.dot(n) - 0.13) / 0.5, blur);
            let mut contact = Method::RECOMMENDED.build(&Tool::burr(2.0));
            contact.reset(Pose::from_translation(n * 3.0));
            let out = walk(contact.as_mut(), &bone, n * 3.0, n * 1.63, 0.05);
            depth = depth.max((out.manifold.depth_mm - 0.5).abs() / 0.5);
            angle = angle.max(out.manifold.normal.dot(n).min(1.0).acos().to_degrees());
        }
        println!("blur {blur}: depth {depth} voxel, normal {angle} degrees");
        assert!(blur < 1.0 || depth < 0.05 && angle < 2.0, "blur {blur}: depth {depth} voxel, normal {angle} degrees");
    }
}

#[test]
fn sliding_at_50_mm_a_second_changes_the_force_by_less_than_0_1_newton_a_ms() {
    let mut worst = 0.0f32;
    for (n, across) in directions(40).into_iter().map(|n| (n, n.any_orthonormal_vector())) {
        let bone = bone([40, 40, 40], 0.5, |p| p.dot(n));
        let mut contact = Method::RECOMMENDED.build(&Tool::burr(3.0));
        let mut out = RigidStep::default();
        let start = n * 2.5 - across * 3.0;
        contact.reset(Pose::from_translation(start + n));
        let mut last = None;
        for t in 0..120 {
            contact.step(&bone, &at(start + across * 0.05 * t as f32), false, 1.0, &mut out);
            let force = 2.0 * out.manifold.depth_mm * out.manifold.normal;
            if let Some(last) = last.replace(force).filter(|_| t > 1) {
                worst = worst.max(force.distance(last));
            }
        }
    }
    println!("force change {worst} N/ms");
    assert!(worst < 0.1, "{worst} N/ms");
}

#[test]
fn a_ball_on_a_ball_feels_the_line_between_the_centres() {
    let bone = bone([48, 48, 48], 0.5, |p| p.length() - 8.0);
    let (mut depths, mut angles) = (vec![], vec![]);
    for n in directions(100) {
        let mut contact = Method::RECOMMENDED.build(&Tool::burr(2.0));
        let out = walk(contact.as_mut(), &bone, n * 11.0, n * 9.6, 0.05);
        depths.push((out.manifold.depth_mm - 0.4).abs() / 0.5);
        angles.push(out.manifold.normal.dot(n).min(1.0).acos().to_degrees());
    }
    depths.sort_by(f32::total_cmp);
    angles.sort_by(f32::total_cmp);
    println!("depth p95 {} voxel, normal p95 {}", depths[95], angles[95]);
    assert!(depths[95] < 0.1 && angles[95] < 5.0, "depth p95 {} voxel, normal p95 {}", depths[95], angles[95]);
}

#[test]
fn a_tool_that_slides_on_planes_feels_their_normal() {
    let (mut angles, mut depths) = (vec![], vec![]);
    for n in directions(100) {
        let across = n.any_orthonormal_vector();
        let bone = bone([24, 24, 24], 1.0, |p| (p - Vec3::new(0.21, -0.37, 0.13)).dot(n));
        let mut contact = Method::RECOMMENDED.build(&Tool::burr(3.0));
        let mut out = RigidStep::default();
        contact.reset(Pose::from_translation(n * 5.0));
        walk(contact.as_mut(), &bone, n * 5.0, n * 2.4, 0.05);
        for t in 0..80 {
            let p = Vec3::new(0.21, -0.37, 0.13) + n * 2.4 + across * 0.05 * t as f32;
            contact.step(&bone, &at(p), false, 1.0, &mut out);
            angles.push(out.manifold.normal.dot(n).min(1.0).acos().to_degrees());
            depths.push((out.manifold.depth_mm - 0.6).abs());
        }
    }
    let p95 = |values: &mut Vec<f32>| {
        values.sort_by(f32::total_cmp);
        values[values.len() * 95 / 100]
    };
    let (angle, depth) = (p95(&mut angles), p95(&mut depths));
    println!("normal p95 {angle} max {} degrees, depth p95 {depth} voxel", angles[angles.len() - 1]);
    assert!(angle < 2.0 && depth < 0.05, "normal {angle} degrees, depth {depth} voxel");
}
