use super::*;
use crate::removal::{Pressed, RemovalLaw};
use glam::DVec3;
use std::f64::consts::PI;

const R: f64 = 3.0;
const OBLIQUE: DVec3 = DVec3::new(0.36, 0.48, 0.8);

fn solid(distance: impl Fn(DVec3) -> f64 + Send + Sync + 'static) -> Bone {
    Bone::new(ClosedForm { distance, hu: |_| 1500.0 })
}

/// A plane, a ball's outside and the inside of a hollow: all know the nearest free place.
#[test]
fn a_pressed_ball_is_held_where_closed_forms_say() {
    let outside = 12.0 * OBLIQUE;
    type ClosedForm = fn(DVec3) -> DVec3;
    let cases: [(Bone, ClosedForm); 3] = [
        (solid(|p| p.dot(OBLIQUE)), |p| p + (R - p.dot(OBLIQUE)).max(0.0) * OBLIQUE),
        (solid(|p| p.length() - 8.0), |p| p.normalize() * p.length().max(8.0 + R)),
        (solid(|p| 16.0 - p.length()), |p| p.clamp_length_max(16.0 - R)),
    ];
    for (case, (bone, held)) in cases.iter().enumerate() {
        let mut ball = Ball::new(R as f32, outside);
        let aside = OBLIQUE.any_orthonormal_vector();
        let way = |t: f64| match case {
            2 => outside + t * (2.0 * OBLIQUE + 0.7 * aside),
            0 => outside - t * 9.6 * OBLIQUE + (t - 1.0).max(0.0) * (5.0 * aside + 9.6 * OBLIQUE),
            _ => outside - t.min(1.0) * 1.7 * OBLIQUE + (t - 1.0).max(0.0) * 5.0 * aside,
        };
        for tick in 0..=100 {
            let device = way(0.02 * f64::from(tick));
            let lifted = ball.follow(bone, device);
            let off = (device + lifted).distance(held(device));
            assert!(off < 1e-4, "case {case} tick {tick}: {off} mm");
        }
    }
}

/// A bore fed at 1 mm/s: steady depth by the law, and the volume of the cylinder.
#[test]
fn a_bore_goes_as_deep_and_takes_as_much_as_the_law_says() {
    let mut bone = solid(|p| p.dot(OBLIQUE));
    let mut ball = Ball::new(R as f32, (R + 0.01) * OBLIQUE);
    let law = RemovalLaw::RATE;
    let (mut removed, mut at) = (0.0, Vec::new());
    for tick in 0..6000 {
        let device = (R + 0.01 - 2e-3 * f64::from(tick)) * OBLIQUE;
        let lifted = ball.follow(&bone, device);
        assert!(lifted.reject_from(OBLIQUE).length() < 1e-4, "tick {tick}: {lifted}");
        removed += ball.drill(&mut bone, (device, OBLIQUE), &law, 2.0);
        at.push((lifted.dot(OBLIQUE), removed, ball.centre().dot(OBLIQUE)));
    }
    let wanted = PI * R * R * 1e-3;
    let law_at = |depth_mm: f32| Pressed { radius_mm: R as f32, depth_mm, cosine: 1.0, dt_ms: 1.0 };
    let steady = (0..4000).map(|n| 5e-4 * n as f32).find(|d| f64::from(law.volume_mm3(&law_at(*d))) > wanted);
    let (early, late) = (at[5500], at[5999]);
    assert!((late.0 - f64::from(steady.unwrap())).abs() < 0.005, "{} {steady:?}", late.0);
    let volume = (late.1 - early.1) / (PI * R * R * (early.2 - late.2));
    assert!((volume - 1.0).abs() < 0.003, "{volume}");
    let whole = removed / (PI * R * R * (R - late.2) - PI * R * R * R / 3.0);
    assert!((whole - 1.0).abs() < 0.003, "{whole}");
    // A smaller ball in the bore.
    let mut probe = Ball::new(2.0, 6.0 * OBLIQUE);
    let (aside, bottom) = (OBLIQUE.any_orthonormal_vector(), late.2);
    for tick in 0..=100 {
        probe.follow(&bone, (6.0 - 0.01 * f64::from(tick) * (6.0 - bottom)) * OBLIQUE);
    }
    let off = |ball: &Ball, held: DVec3| assert!(ball.centre().distance(held) < 2e-4, "{} {held}", ball.centre());
    off(&probe, bottom * OBLIQUE);
    probe.follow(&bone, (bottom - 1.6) * OBLIQUE);
    off(&probe, (bottom - 1.0) * OBLIQUE);
    probe.follow(&bone, (bottom + 0.5) * OBLIQUE + 1.7 * aside);
    off(&probe, (bottom + 0.5) * OBLIQUE + aside);
}

/// The spline through a ball's distance, on an oblique grid of other spacings.
#[test]
fn a_scan_holds_a_ball_between_its_voxels() {
    let turn = glam::DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 0.9, 2.0),
        glam::DQuat::from_rotation_y(0.4),
        DVec3::new(-26.9, -15.75, -13.6),
    );
    let mut ct = trepan_volume::VoxelVolume::filled([40, 36, 24], turn, 0i16);
    for at in 0..ct.data.len() {
        let place = ct.centre_of([at % 40, at / 40 % 36, at / 1440]);
        ct.data[at] = (400.0 + 200.0 * (12.0 - place.length())).round().clamp(-3000.0, 3000.0) as i16;
    }
    let scan = Scan::around(&ct, 400, DVec3::ZERO, 16.0);
    for n in 1..300 {
        let direction = DVec3::new(n as f64 * 0.37, n as f64 * 0.71, n as f64 * 0.13).map(f64::sin).normalize();
        let off_mm = scan.within(12.0 * direction).abs() / 200.0;
        assert!(off_mm < 0.01, "{direction}: {off_mm} mm");
    }
}

/// A CT of a linear density holds a plane exactly, whatever its grid.
#[test]
fn a_scan_of_a_plane_is_exact_on_any_grid() {
    let turn = glam::DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 0.9, 2.0),
        glam::DQuat::from_rotation_y(0.4),
        DVec3::new(-15.0, -14.0, -16.0),
    );
    let mut ct = trepan_volume::VoxelVolume::filled([40, 36, 22], turn, 0i16);
    for at in 0..ct.data.len() {
        let place = ct.centre_of([at % 40, at / 40 % 36, at / 1440]);
        ct.data[at] = (400.0 - 200.0 * place.dot(OBLIQUE)).round().clamp(-3000.0, 3000.0) as i16;
    }
    let bone = Bone::new(Scan::around(&ct, 400, DVec3::ZERO, 9.0));
    let mut ball = Ball::new(R as f32, 5.0 * OBLIQUE);
    let lifted = ball.follow(&bone, 2.5 * OBLIQUE);
    assert!((lifted.length() - 0.5).abs() < 5e-3 && lifted.angle_between(OBLIQUE) < 0.01, "{lifted}");
}

/// A burr leaves its own bore as fast as the hand draws it.
#[test]
fn a_burr_comes_out_of_its_bore() {
    let mut bone = solid(|p| p.dot(OBLIQUE));
    let mut ball = Ball::new(R as f32, 3.5 * OBLIQUE);
    for tick in 0..1500 {
        let device = (3.5 - 4e-3 * f64::from(tick)) * OBLIQUE;
        ball.follow(&bone, device);
        ball.drill(&mut bone, (device, OBLIQUE), &RemovalLaw::RATE, 4.0);
    }
    for tick in 0..60 {
        // Poses are f32: a hand's noise is some nanometres.
        let noise = 5e-6 * OBLIQUE.any_orthonormal_vector() * f64::from(tick % 3 - 1);
        let device = (0.2 * f64::from(tick) - 2.0) * OBLIQUE + noise;
        let lifted = ball.follow(&bone, device);
        assert!(lifted.length() < 1e-3 || lifted.dot(OBLIQUE) > 0.0, "tick {tick}: {lifted}");
    }
}
