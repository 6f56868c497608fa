//! Segments the brain of a synthetic head: ellipsoids with a foramen, a neck, air in the orbits and
//! a scalp as bright as fat.

use glam::{DAffine3, DVec3};
use std::path::Path;
use trepan_geometry::Vec3;
use trepan_volume::{
    BrainConfig, MaskError, VoxelVolume, brain_by_mri, brain_fit, brain_mask, check_brain_mask, find_brain, flatness,
    hounsfield, leans, read, stray_bone,
};

/// Half axes of the brain, mm.
const BRAIN: Vec3 = Vec3::new(62.0, 80.0, 58.0);

/// Signed distance to an ellipsoid `margin` mm larger than the brain, accurate near it.
fn beyond(p: Vec3, margin: f32) -> f32 {
    let axes = BRAIN + margin;
    let k = (p / axes).length();
    k * (k - 1.0) / (p / (axes * axes)).length().max(1e-6)
}

/// The tissue at a point: CT in HU, T1 grey value, whether it is brain or CSF.
fn tissue(p: Vec3) -> (i16, f32, bool) {
    let canal = (p.x * p.x + (p.y + 20.0).powi(2)).sqrt();
    let neck = (p.x * p.x / 2500.0 + (p.y + 20.0).powi(2) / 2500.0) < 1.0 && p.z < -50.0;
    if beyond(p, 0.0) < 0.0 {
        let white = beyond(p, -12.0) < 0.0;
        let ventricle = (p / Vec3::new(8.0, 20.0, 9.0)).length() < 1.0;
        return (
            35,
            if ventricle {
                25.0
            } else if white {
                105.0
            } else {
                72.0
            },
            true,
        );
    }
    match beyond(p, 0.0) {
        d if d < 3.0 => (10, 25.0, true),
        d if d < 10.0 && p.z < -40.0 && canal < 14.0 => (20, 30.0, false),
        d if (5.0..8.0).contains(&d) => (900, 50.0, false),
        d if d < 10.0 => (1100, 8.0, false),
        d if d < 16.0 => (-60, 180.0, false),
        _ if neck && canal < 14.0 => (30, 70.0, false),
        _ if neck && canal < 20.0 => (900, 8.0, false),
        _ if neck => (50, 75.0, false),
        _ => (-1000, 0.0, false),
    }
}

fn head() -> (VoxelVolume<i16>, VoxelVolume<f32>, VoxelVolume<u8>) {
    let (dims, origin) = ([80, 99, 94], Vec3::new(-79.0, -98.0, -108.0));
    let mut ct = VoxelVolume::isotropic(dims, origin, 2.0, -1000i16);
    let (mut mri, mut brain) = (ct.map(f32::from), ct.map(|_| 0u8));
    for at in 0..ct.data.len() {
        let p = ct.centre_of([at % 80, at / 80 % 99, at / 7920]).as_vec3();
        let (hu, grey, inside) = tissue(p);
        (ct.data[at], mri.data[at], brain.data[at]) = (hu, grey + 2.0 * (at as f32 * 12.9898).sin(), u8::from(inside));
    }
    (ct, mri, brain)
}

fn dice(a: &VoxelVolume<u8>, b: &VoxelVolume<u8>) -> f64 {
    let both = a.data.iter().zip(&b.data).filter(|&(&a, &b)| a & b == 1).count();
    let each = a.data.iter().chain(&b.data).filter(|&&v| v == 1).count();
    2.0 * both as f64 / each as f64
}

#[test]
fn the_brain_is_found_with_and_without_the_ct() {
    let (ct, mri, brain) = head();
    let config = BrainConfig { work_mm: 2.0, ..BrainConfig::default() };
    for (skull, least) in [(Some(&ct), 0.985), (None, 0.96)] {
        let mask = brain_mask(&mri, skull, &config).unwrap();
        let dice = dice(&mask, &brain);
        assert!(dice > least, "Dice {dice} with a CT: {}", skull.is_some());
        let in_bone = mask.data.iter().zip(&ct.data).filter(|&(&m, &hu)| m == 1 && hu >= 300).count();
        assert!(skull.is_none() || in_bone == 0, "{in_bone} voxels in bone");
    }
}

#[test]
fn the_built_in_head_agrees_with_an_independent_mask() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/case-head");
    let file = |name: &str| read(&folder.join(name)).unwrap();
    let (mri, other) = (file("mri_t1.nii.gz"), file("brain_mask.nii.gz").map(|v| u8::from(v != 0.0)));
    let ct = hounsfield(&file("ct_hu.nii.gz")).unwrap();
    for (skull, least) in [(Some(&ct), 0.97), (None, 0.96)] {
        let found = find_brain(&mri, skull, &BrainConfig::default()).unwrap();
        let dice = dice(&found.mask, &other);
        assert!(dice > least, "Dice {dice} with a CT: {}", skull.is_some());
        assert!(!found.confidence.is_doubtful(), "{}", found.confidence);
    }
}

#[test]
fn a_doubtful_brain_has_low_confidence() {
    let (ct, mri, _) = head();
    let config = BrainConfig { work_mm: 2.0, ..BrainConfig::default() };
    for skull in [Some(&ct), None] {
        let found = find_brain(&mri, skull, &config).unwrap().confidence;
        assert!(found.value > 0.8 && !found.is_doubtful(), "{found}");
        assert_eq!(found.inside.is_some(), skull.is_some());
    }
    // On the upper right there is no dark layer between brain and scalp: the mask leaks to the
    // scalp.
    let mut leaking = mri.clone();
    for at in 0..mri.data.len() {
        let p = mri.centre_of([at % 80, at / 80 % 99, at / 7920]).as_vec3();
        if p.x > 0.0 && p.z > -30.0 && (0.0..10.0).contains(&beyond(p, 0.0)) {
            leaking.data[at] = if beyond(p, 0.0) < 7.0 { 75.0 } else { 180.0 };
        }
    }
    let found = find_brain(&leaking, None, &config).unwrap();
    assert!(found.confidence.is_doubtful() && found.confidence.border < 0.6, "{}", found.confidence);
    // A small brain is returned too, but an implausible one is rejected.
    let larger = BrainConfig { least_ml: 1800.0, ..config.clone() };
    let found = find_brain(&mri, None, &larger).unwrap().confidence;
    assert!(found.is_doubtful() && found.volume < 0.6, "{found}");
    assert!(found.to_string().contains("ml, confidence 0."), "{found}");
    let far_larger = BrainConfig { least_ml: 3000.0, greatest_ml: 4000.0, ..config };
    assert!(matches!(find_brain(&mri, None, &far_larger), Err(MaskError::Volume { .. })));
}

#[test]
fn images_without_a_head_are_rejected() {
    let (ct, mut mri, brain) = head();
    let config = BrainConfig { work_mm: 4.0, ..BrainConfig::default() };
    let empty = mri.map(|_| 0.0);
    assert!(matches!(brain_mask(&empty, None, &config), Err(MaskError::Empty(_))));
    assert!(matches!(brain_mask(&empty, Some(&ct), &config), Err(MaskError::Empty(_))));
    assert!(matches!(brain_mask(&mri, Some(&ct.map(|_| -1000)), &config), Err(MaskError::Empty(_))));
    let mut far = ct.clone();
    far.world_from_voxel.translation.x += 900.0;
    assert!(matches!(brain_mask(&mri, Some(&far), &config), Err(MaskError::Apart(_))));
    for wrong in [0.0, -1.0, f32::NAN, 99.0] {
        let config = BrainConfig { work_mm: wrong, ..config.clone() };
        assert!(matches!(brain_mask(&mri, None, &config), Err(MaskError::Work(_))));
    }
    mri.data[77] = f32::NAN;
    assert_eq!(brain_mask(&mri, None, &config), Err(MaskError::NotANumber { count: 1 }));
    mri.data[77] = 0.0;
    mri.world_from_voxel.matrix3 *= 0.5;
    let small = brain_mask(&mri, None, &config).unwrap_err();
    assert!(matches!(small, MaskError::Empty(_) | MaskError::Volume { .. }), "{small}");

    assert_eq!(check_brain_mask(&brain, &config), Ok(()));
    let mut two = brain.clone();
    two.data[..2000].fill(1);
    assert!(matches!(check_brain_mask(&two, &config), Err(MaskError::Pieces { pieces: 2, .. })));
    let tiny = VoxelVolume::isotropic([9, 9, 9], Vec3::ZERO, 1.0, 1u8);
    assert!(
        check_brain_mask(&tiny, &config).unwrap_err().to_string().contains("holds 1 ml, an adult brain 900 to 1900 ml")
    );
}

/// The head's MRI, with `change` of each grey value by whether it is brain.
fn changed(change: impl Fn(f32, bool) -> f32) -> (VoxelVolume<i16>, VoxelVolume<f32>, VoxelVolume<u8>) {
    let (ct, mut mri, brain) = head();
    mri.data.iter_mut().zip(&brain.data).for_each(|(v, &inside)| *v = change(*v, inside == 1));
    (ct, mri, brain)
}

/// A grid's voxels whose centre passes keep their value; others get `outside`.
fn kept<T: Copy>(image: &VoxelVolume<T>, outside: T, keeps: impl Fn(Vec3) -> bool) -> VoxelVolume<T> {
    let mut out = image.clone();
    for at in 0..out.data.len() {
        if !keeps(out.centre_of([at % 80, at / 80 % 99, at / 7920]).as_vec3()) {
            out.data[at] = outside;
        }
    }
    out
}

/// The lower slices of a volume, up to a height in mm, or the upper ones.
fn slices<T: Copy>(image: &VoxelVolume<T>, keeps: impl Fn(f32) -> bool) -> VoxelVolume<T> {
    let layers: Vec<usize> = (0..94).filter(|&k| keeps(image.centre_of([0, 0, k]).z as f32)).collect();
    let data = layers.iter().flat_map(|k| image.data[7920 * k..7920 * (k + 1)].to_vec()).collect();
    let start = DAffine3::from_translation(DVec3::Z * layers[0] as f64);
    VoxelVolume { dims: [80, 99, layers.len()], data, world_from_voxel: image.world_from_voxel * start }
}

#[test]
fn a_z_scored_mri_gives_the_brain_of_the_plain_one() {
    let config = BrainConfig { work_mm: 2.0, ..BrainConfig::default() };
    let (ct, mri, brain) = changed(|v, _| (v - 80.0) / 25.0);
    for (skull, least) in [(Some(&ct), 0.985), (None, 0.96)] {
        let dice = dice(&brain_mask(&mri, skull, &config).unwrap(), &brain);
        assert!(dice > least, "Dice {dice} with a CT: {}", skull.is_some());
    }
}

#[test]
fn a_stripped_mri_is_its_own_mask_and_is_checked_by_it() {
    for zero in [0.0, -60.0] {
        let (ct, mut mri, brain) = changed(|v, inside| if inside { (v + zero).max(zero + 1.0) } else { 0.0 });
        let found = find_brain(&mri, Some(&ct), &BrainConfig::default()).unwrap();
        assert!(found.is_stripped && dice(&found.mask, &brain) > 0.97, "{}", dice(&found.mask, &brain));
        let fit = |mri: &VoxelVolume<f32>| {
            let alone = brain_by_mri(mri).unwrap().unwrap();
            brain_fit(&alone, mri, &ct, 300).unwrap().unwrap()
        };
        assert!(fit(&mri).outside_share < 0.01 && fit(&mri).hidden.space_share < 0.02, "{:?}", fit(&mri));
        mri.world_from_voxel = DAffine3::from_translation(DVec3::new(20.0, 15.0, -15.0)) * mri.world_from_voxel;
        assert!(fit(&mri).outside_share > 0.1, "{:?}", fit(&mri));
    }
    let (_, mri, _) = head();
    assert!(!find_brain(&mri, None, &BrainConfig::default()).unwrap().is_stripped);
}

#[test]
fn what_an_image_hides_of_the_head_is_measured() {
    let (ct, mri, brain) = head();
    let hidden = |mri: &VoxelVolume<f32>, ct: &VoxelVolume<i16>| {
        let in_skull = || find_brain(mri, Some(ct), &BrainConfig::default()).unwrap().mask;
        let alone = brain_by_mri(mri).unwrap().unwrap_or_else(in_skull);
        brain_fit(&alone, mri, ct, 300).unwrap().unwrap().hidden
    };
    let whole = hidden(&mri, &ct);
    assert!(whole.space_share < 0.02 && whole.brain_share < 0.02 && !whole.cuts_skull(), "{whole:?}");
    let under = |p: Vec3| p.z < 35.0;
    let above = brain
        .data
        .iter()
        .enumerate()
        .filter(|&(at, &v)| v == 1 && !under(ct.centre_of([at % 80, at / 80 % 99, at / 7920]).as_vec3()));
    let share = above.count() as f64 / brain.data.iter().filter(|&&v| v == 1).count() as f64;
    for cut in [slices(&mri, |z| z < 35.0), kept(&mri, 0.0, under)] {
        let hidden = hidden(&cut, &ct);
        assert!((hidden.space_share - share).abs() < 0.04, "{hidden:?}, {share}");
    }
    let vault = hidden(&mri, &slices(&ct, |z| z > -20.0));
    assert!(vault.brain_share > 0.2, "{vault:?}");
    let narrow = hidden(&mri, &kept(&ct, -1000, |p| p.x * p.x + p.y * p.y < 68.0 * 68.0));
    assert!(narrow.cuts_skull() && narrow.brain_share > 0.05, "{narrow:?}");
}

#[test]
fn bone_inside_the_brain_and_metal_around_it_are_measured() {
    let (ct, _, brain) = head();
    let none = stray_bone(&brain, &ct, 300).unwrap();
    assert_eq!((none.inside_ml, none.frame_ml), (0.0, 0.0));
    let lead = |p: Vec3| (p.x - 20.0).abs() < 3.0 && p.y.abs() < 3.0 && p.z > -10.0 && p.z < 45.0;
    let electrode = kept(&ct, 3000, |p| !lead(p));
    let holed = kept(&brain, 0, |p| !lead(p));
    let found = stray_bone(&holed, &electrode, 300).unwrap();
    assert!(found.inside_ml > 0.8 && found.metal_ml == found.inside_ml, "{found:?}");
    let frame = kept(&ct, 3000, |p| p.x < 76.0 || p.z.abs() > 10.0);
    assert!(stray_bone(&brain, &frame, 300).unwrap().frame_ml > 1.0);
}

#[test]
fn a_head_that_does_not_lie_upright_is_noticed() {
    let (_, _, mut brain) = head();
    assert!(!leans(&brain));
    let upright = brain.world_from_voxel;
    for (turn, noticed) in [
        (DAffine3::from_rotation_x(15.0_f64.to_radians()), false),
        (DAffine3::from_rotation_x(90.0_f64.to_radians()), true),
        (DAffine3::from_rotation_z(90.0_f64.to_radians()), true),
    ] {
        brain.world_from_voxel = turn * upright;
        assert_eq!(leans(&brain), noticed, "{turn:?}");
    }
}

#[test]
fn a_label_volume_is_flat_and_an_mri_is_not() {
    let (_, mri, brain) = head();
    assert!(flatness(&mri).0 < 0.2, "{:?}", flatness(&mri));
    let (flat, ml) = flatness(&brain.map(f32::from));
    assert!(flat > 0.9 && (1000.0..1700.0).contains(&ml), "{flat} {ml}");
}
