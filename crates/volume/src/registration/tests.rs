use super::*;
use trepan_geometry::Vec3;

/// An asymmetric head phantom: skull, brain, two ventricles and a jaw, in one of two modalities.
fn tissue(p: DVec3, ct: bool) -> f32 {
    let ball = |centre: DVec3, axes: DVec3| ((p - centre) / axes).length();
    let (skin, skull, brain) = ([0.0, 180.0], [900.0, 10.0], [35.0, 100.0]);
    let pick = |v: [f32; 2]| v[usize::from(!ct)];
    let head = ball(DVec3::ZERO, DVec3::new(70.0, 90.0, 75.0));
    let ventricles = [
        ball(DVec3::new(12.0, 10.0, 5.0), DVec3::new(10.0, 28.0, 12.0)),
        ball(DVec3::new(-16.0, -20.0, 12.0), DVec3::new(9.0, 20.0, 8.0)),
    ];
    if ventricles.iter().any(|inside| *inside < 1.0) {
        pick([8.0, 30.0])
    } else if head < 0.82 {
        pick(brain)
    } else if head < 0.92 {
        pick(skull)
    } else if head < 1.0 {
        pick(skin)
    } else if ball(DVec3::new(5.0, 55.0, -60.0), DVec3::new(30.0, 25.0, 25.0)) < 1.0 {
        pick(skull)
    } else {
        pick([-1000.0, 0.0])
    }
}

fn image(ct: bool, spacing: f32, fixed_from_moving: DAffine3) -> VoxelVolume<f32> {
    let dims = [200, 240, 210].map(|n| (n as f32 / spacing) as usize);
    let mut image = VoxelVolume::isotropic(dims, Vec3::new(-100.0, -120.0, -105.0), spacing, 0f32);
    for at in 0..image.data.len() {
        let p = image.centre_of([at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])]);
        image.data[at] = tissue(fixed_from_moving.transform_point3(p), ct) + 5.0 * (at as f32 * 12.9898).sin();
    }
    image
}

fn config() -> RegistrationConfig {
    RegistrationConfig { work_mm: 2.0, points: 60_000, ..RegistrationConfig::default() }
}

#[test]
fn a_moved_head_in_another_modality_is_found_with_the_same_bytes_on_any_threads() {
    let truth = DAffine3::from_rotation_translation(
        DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 15f64.to_radians()),
        DVec3::new(18.0, -12.0, 15.0),
    );
    let (ct, mri) = (image(true, 4.0, DAffine3::IDENTITY), image(false, 3.6, truth));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| register(&ct, &mri, &config()).unwrap())
    };
    let found = with(2);
    assert_eq!(found, with(1));
    let error = found.fixed_from_moving * truth.inverse();
    // Half a voxel of 4 mm, at the centre and at the skin.
    let turn = DQuat::from_mat3(&error.matrix3).to_scaled_axis().length().to_degrees();
    assert!(turn < 2.0 && error.translation.length() < 1.0, "{turn}° {}: {found:?}", error.translation);
    assert!(found.metric > found.start_metric && found.overlap_share > 0.6, "{found:?}");
}

#[test]
fn undetermined_poses_are_rejected() {
    let ct = image(true, 8.0, DAffine3::IDENTITY);
    let mut noise = ct.clone();
    noise.data.iter_mut().enumerate().for_each(|(at, v)| *v = ((at as f32) * 78.233).sin().fract() * 100.0);
    let refused = register(&ct, &noise, &config());
    assert!(matches!(refused, Err(RegistrationError::Doubtful { .. })), "{refused:?}");
    let ball = |v: &VoxelVolume<f32>| {
        let mut v = v.clone();
        for at in 0..v.data.len() {
            let p = v.centre_of([at % v.dims[0], at / v.dims[0] % v.dims[1], at / (v.dims[0] * v.dims[1])]);
            v.data[at] = (70.0 - p.length()).clamp(0.0, 30.0) as f32;
        }
        v
    };
    let (one, other) = (image(true, 4.0, DAffine3::IDENTITY), image(true, 3.3, DAffine3::IDENTITY));
    let refused = register(&ball(&one), &ball(&other), &config());
    assert!(matches!(refused, Err(RegistrationError::Doubtful { .. })), "{refused:?}");
    let flat = ct.map(|_| 3.0);
    assert_eq!(register(&ct, &flat, &config()), Err(RegistrationError::Flat { image: "moving" }));
    assert_eq!(register(&ct.map(|_| f32::NAN), &ct, &config()), Err(RegistrationError::Flat { image: "fixed" }));
    let wrong = RegistrationConfig { work_mm: f64::NAN, ..config() };
    assert!(matches!(register(&ct, &ct, &wrong), Err(RegistrationError::Config { field: "work_mm", .. })));
}
