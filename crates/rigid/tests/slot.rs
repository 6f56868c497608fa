//! A slot exactly as wide as the ball, and the oracle where it once fell through.

mod common;
use common::{at, bone, directions};
use trepan_geometry::{Pose, Tool, Vec3};
use trepan_rigid::brute;
use trepan_rigid::{Method, RigidStep};

const RADIUS_MM: f32 = 3.0;

/// Moves down the middle of the slot, then against one wall and along it, at 50 mm/s. Gives how far
/// the proxy is behind the hand across the wall's normal at most, mm, and the largest change of
/// what lifts it while it goes along the wall, mm.
fn along_a_slot(axis: Vec3) -> (f32, f32) {
    let across = axis.any_orthonormal_vector();
    let along = axis.cross(across);
    let middle = Vec3::new(0.11, -0.19, 0.07);
    let bone = bone([56; 3], 0.5, |p| {
        (RADIUS_MM - (p - middle).dot(across).abs()).max((p - middle).dot(axis)).clamp(-2.0, 2.0)
    });
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(RADIUS_MM));
    contact.reset(Pose::from_translation(middle + axis));
    let (mut out, mut last, mut lag, mut change) = (RigidStep::default(), Vec3::ZERO, 0.0f32, 0.0f32);
    for tick in 0..190 {
        let deep = 0.05 * tick.min(72) as f32 - 1.0;
        let device = middle + across * (deep - 2.0).max(0.0) - axis * deep + along * 0.05 * (tick.max(72) - 72) as f32;
        contact.step(&bone, &at(device), false, 1.0, &mut out);
        let lift = out.manifold.depth_mm * out.manifold.normal;
        lag = lag.max(lift.reject_from(across).length());
        if tick > 72 {
            change = change.max(lift.distance(last));
        }
        last = lift;
    }
    (lag, change)
}

#[test]
fn a_ball_slides_along_a_slot_of_its_own_width() {
    for axis in directions(8) {
        let (lag, change) = along_a_slot(axis);
        println!("{axis}: {lag} mm behind, {change} mm/ms");
        assert!(lag < 0.25 && change < 0.09, "{axis}: {lag} mm behind, {change} mm/ms");
    }
}

#[test]
fn the_oracle_stays_on_a_sphere() {
    const SPHERE_MM: f32 = 6.0;
    let bone = bone([48; 3], 0.5, |p| p.length() - SPHERE_MM);
    let mut contact = Method::of(&brute::METHOD).build(&Tool::burr(RADIUS_MM));
    let mut out = RigidStep::default();
    for tick in 0..60 {
        let turn = 0.01 * tick as f32;
        let up = Vec3::new(0.36 * turn.cos(), 0.8 * turn.sin(), 1.0).normalize();
        let pressed = (0.05 * tick as f32 - 1.0).min(0.6);
        contact.step(&bone, &at((SPHERE_MM + RADIUS_MM - pressed) * up), false, 1.0, &mut out);
        assert!((out.manifold.depth_mm - pressed.max(0.0)).abs() < 0.03, "{tick}: {}", out.manifold.depth_mm);
        assert!(pressed < 0.3 || out.manifold.normal.angle_between(up).to_degrees() < 4.0, "{tick}");
    }
}
