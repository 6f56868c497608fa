//! A burr in its own bore: drilled in, the pedal let go, and drawn straight out.

mod common;
use common::{ISO, directions};
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::{Method, RigidStep};
use trepan_volume::VoxelVolume;

const STIFFNESS: f32 = 2.0;
const BONE_MM: f32 = 6.0;
const RADIUS_MM: f32 = 3.0;

/// A skull bone as a CT of 1 mm voxels shows it, blurred by the scanner. It has hard tables 1.5 mm
/// thick, a light and uneven middle.
fn skull(inward: Vec3) -> BoneVolume {
    const N: usize = 40;
    let origin = Vec3::splat(-0.5 * (N as f32 - 1.0)) + Vec3::new(0.21, -0.37, 0.13);
    let mut ct = VoxelVolume::isotropic([N; 3], origin, 1.0, 0i16);
    let edge = |depth: f32, at: f32| 1.0 / (1.0 + (-(depth - at) / 0.35).exp());
    for at in 0..ct.data.len() {
        let p = ct.centre_of([at % N, at / N % N, at / (N * N)]).as_vec3();
        let depth = p.dot(inward);
        let solid = edge(depth, 0.0) - edge(depth, BONE_MM);
        let middle = edge(depth, 1.5) - edge(depth, BONE_MM - 1.5);
        let grain = 120.0 * ((1.9 * p.x + 0.7 * p.y).sin() + (1.3 * p.z - 2.1 * p.y).cos());
        ct.data[at] = (-50.0 + solid * 1700.0 - middle * (700.0 + grain)) as i16;
    }
    BoneVolume::new(&ct, ISO).expect("there is bone")
}

/// From 0 to 1 with the smooth speed of a reaching hand: at most 15/8 of the mean.
fn reach(t: f32) -> f32 {
    t * t * t * (10.0 + t * (6.0 * t - 15.0))
}

/// The hand's depth along the bore, mm, and whether the pedal is down.
fn hand(tick: usize, deepest: f32) -> Option<(f32, bool)> {
    const DRILL: usize = 6000;
    const CLEAN: usize = 3000;
    const RETREAT: usize = 2900;
    let way_out = 43.0 + deepest;
    match tick {
        0..DRILL => Some((-4.0 + (deepest + 4.0) * reach(tick as f32 / DRILL as f32), true)),
        _ if tick < DRILL + CLEAN => Some((deepest, true)),
        _ if tick < DRILL + CLEAN + RETREAT => {
            Some((deepest - way_out * reach((tick - DRILL - CLEAN) as f32 / RETREAT as f32), false))
        }
        _ => None,
    }
}

#[derive(Default, Debug)]
struct Worst {
    /// Change of force in a tick while drilling, and afterwards, N.
    drilling: f32,
    after: f32,
    /// How far the proxy came to be ahead of a hand on its way out, mm.
    ahead: f32,
    /// Force that holds the hand back on its way out, N.
    drag: f32,
    deepest: f32,
}

fn operate(inward: Vec3, deepest: f32, law: RemovalLaw) -> Worst {
    let bone = skull(inward);
    let mut contact = Method::RECOMMENDED.with_removal(law).build(&Tool::burr(RADIUS_MM));
    let mut out = RigidStep::default();
    let (mut worst, mut last, mut lead) = (Worst::default(), Vec3::ZERO, f32::MAX);
    contact.reset(Pose::from_translation(-4.0 * inward));
    for tick in 0.. {
        let Some((depth, pedal)) = hand(tick, deepest) else { break };
        let device = depth * inward;
        contact.step(&bone, &ToolState::at(Pose::from_translation(device)), pedal, 1.0, &mut out);
        let force = STIFFNESS * out.manifold.depth_mm * out.manifold.normal;
        let change = force.distance(last);
        last = force;
        worst.deepest = worst.deepest.max(contact.proxy().translation.dot(inward));
        if pedal {
            worst.drilling = worst.drilling.max(change);
            continue;
        }
        worst.after = worst.after.max(change);
        // A hand that presses starts behind the proxy; from there the lead may only shrink.
        let now = (device - contact.proxy().translation).dot(inward).max(0.0);
        worst.ahead = worst.ahead.max(now - lead);
        lead = lead.min(now);
        worst.drag = worst.drag.max(force.dot(inward));
    }
    worst
}

#[test]
fn letting_the_pedal_go_and_drawing_the_burr_out_of_its_bore_is_smooth() {
    let mut axes = directions(5);
    axes.extend([Vec3::NEG_Z, Vec3::new(-0.36, -0.48, -0.8)]);
    for inward in axes {
        for deepest in [2.5, 6.75] {
            // Edges that rub leave what a hand does not press enough for.
            for (law, left_mm) in [(RemovalLaw::CONSTANT_ENERGY, 0.05), (RemovalLaw::RATE, 0.35)] {
                let worst = operate(inward, deepest, law);
                println!("inward {inward} to {deepest}: {worst:?}");
                assert!(worst.after <= 0.1, "inward {inward} to {deepest} mm: {worst:?}");
                assert!(worst.ahead <= 0.02, "inward {inward} to {deepest} mm: {worst:?}");
                assert!(worst.drag <= 0.5, "inward {inward} to {deepest} mm: {worst:?}");
                assert!(worst.deepest > deepest - left_mm, "inward {inward} to {deepest} mm: {worst:?}");
                assert!(worst.drilling <= 0.1, "inward {inward} to {deepest} mm: {worst:?}");
            }
        }
    }
}

/// Drills with a hand that leans on its drill by 1.5 N/mm and falls through. Gives the force that
/// holds the burr back on its way out, the pedal up, N.
fn fall_through(inward: Vec3, drill_ms: usize) -> f32 {
    const DEEPEST: f32 = 6.5;
    let bone = skull(inward);
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(RADIUS_MM));
    let mut out = RigidStep::default();
    // Depth, mm, and speed, mm/ms, of a hand of 250 g, with 8 N s/m of damping.
    let (mut depth, mut speed, mut drag) = (-4.0f32, 0.0f32, 0.0f32);
    contact.reset(Pose::from_translation(depth * inward));
    for tick in 0..drill_ms + 3000 {
        let pedal = tick < drill_ms + 300;
        let meant = match pedal {
            true => -4.0 + (DEEPEST + 4.0) * reach((tick as f32 / drill_ms as f32).min(1.0)),
            false => DEEPEST - 0.01 * (tick - drill_ms - 300) as f32,
        };
        contact.step(&bone, &ToolState::at(Pose::from_translation(depth * inward)), pedal, 1.0, &mut out);
        let force_n = (STIFFNESS * out.manifold.depth_mm).min(3.3) * out.manifold.normal.dot(inward);
        let push_n = 1.5 * (meant - depth) - 8.0 * speed + force_n;
        speed += push_n / 250.0;
        depth += speed;
        if !pedal {
            drag = drag.max(force_n);
        }
    }
    drag
}

#[test]
fn a_burr_that_fell_through_comes_out_again() {
    let mut axes = directions(5);
    axes.extend([Vec3::NEG_Z, Vec3::new(-0.36, -0.48, -0.8)]);
    for inward in axes {
        for drill_ms in [1500, 3000, 4500] {
            let drag = fall_through(inward, drill_ms);
            println!("inward {inward} in {drill_ms} ms: {drag}");
            assert!(drag < 1.0, "inward {inward} in {drill_ms} ms: {drag} N");
        }
    }
}

/// A CT that ends at the bone's surface, on the border of a brick: a head that the scanner cut off.
#[test]
fn a_burr_drills_on_through_bone_at_the_end_of_the_ct() {
    for (voxel_mm, edge) in [(0.5, 48), (1.0, 24), (0.5, 45)] {
        let half_mm = 0.5 * edge as f32 * voxel_mm;
        let corner = Vec3::splat(0.5 * voxel_mm - half_mm);
        let bone = BoneVolume::new(&VoxelVolume::isotropic([edge; 3], corner, voxel_mm, 1500i16), ISO).unwrap();
        let mut contact = Method::RECOMMENDED.with_removal(RemovalLaw::CONSTANT_ENERGY).build(&Tool::burr(RADIUS_MM));
        let device = |ms: usize| Vec3::Z * (half_mm + RADIUS_MM - 1e-3 * ms as f32);
        contact.reset(Pose::from_translation(device(0)));
        let mut out = RigidStep::default();
        for ms in 0..4000 {
            contact.step(&bone, &ToolState::at(Pose::from_translation(device(ms))), true, 1.0, &mut out);
        }
        let depth_mm = out.manifold.depth_mm;
        assert!(depth_mm < 1.0, "in voxels of {voxel_mm} mm the burr is {depth_mm} mm behind");
    }
}
