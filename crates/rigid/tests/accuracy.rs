//! How near the recommended method comes to scenes with a known answer.

mod common;
use common::{at, bone, directions, scanned, walk};
use trepan_geometry::{Pose, Tool};
use trepan_rigid::{Method, RigidStep};

#[test]
fn planes_in_every_orientation_give_depth_and_normal() {
    for blur in [1.0, 2.0] {
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
        assert!(depth < 0.05 && angle < 2.0, "blur {blur}: depth {depth} voxel, normal {angle} degrees");
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
