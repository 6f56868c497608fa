//! Tests of heads made from the built-in base: map, ground truth and scan.

use super::base::BaseHead;
use super::head::Head;
use super::recipe::{HeadRecipe, Spacing, TumourRecipe};
use super::warp::Warp;
use glam::DVec3;
use std::sync::LazyLock;
use trepan_volume::{Grid, Interpolation, VoxelVolume, nifti, resample};

/// Lowest bone value in the tests, HU: far above the noise.
const BONE_HU: i16 = 300;

static BASE: LazyLock<BaseHead> = LazyLock::new(|| BaseHead::built_in().expect("the built-in head is whole"));

/// Head on coarse voxels, without noise that could be taken for bone.
fn coarse(recipe: HeadRecipe) -> Head {
    let spacing = Spacing { pixel_mm: 1.5, slice_mm: 2.0 };
    Head::make(&HeadRecipe { ct_spacing: spacing, mri_spacing: spacing, ct_noise_hu: 5.0, ..recipe }, &BASE)
}

fn mild() -> HeadRecipe {
    HeadRecipe::mild(1, 1)
}

fn ml<T: Copy>(volume: &VoxelVolume<T>, kind: impl Fn(T) -> bool) -> f64 {
    1e-3 * volume.voxel_mm3() * volume.data.iter().filter(|v| kind(**v)).count() as f64
}

/// CT on the MRI's grid.
fn ct_there(head: &Head) -> VoxelVolume<i16> {
    resample(&head.ct, &Grid::of(&head.mri), Interpolation::Trilinear, -1000)
}

fn share_of_brain_in_bone(head: &Head) -> f64 {
    let ct = ct_there(head);
    let both = ct.data.iter().zip(&head.brain.data).filter(|(hu, brain)| **hu >= BONE_HU && **brain != 0).count();
    both as f64 / head.brain.data.iter().filter(|v| **v != 0).count() as f64
}

/// Mean of the MRI where a mask is set.
fn mean(mri: &VoxelVolume<f32>, mask: impl Fn(usize) -> bool) -> f64 {
    let inside: Vec<f64> = (0..mri.data.len()).filter(|at| mask(*at)).map(|at| f64::from(mri.data[at])).collect();
    inside.iter().sum::<f64>() / inside.len() as f64
}

#[test]
fn the_map_does_not_fold_and_keeps_the_requested_share() {
    let mut kept = 0.0;
    for seed in 0..5 {
        let warp = Warp::new(&HeadRecipe::drawn(seed, 1), &BASE);
        assert!(warp.least_jacobian() > 0.0, "head {seed}");
        kept += warp.share / 5.0;
        // Inverse and forward map: no two places of the base are one of the head.
        let place = BASE.anatomy.middle + DVec3::new(20.0, -30.0, 25.0);
        let back = warp.place(warp.nearest_to(place)).base.as_dvec3();
        assert!(back.distance(place) < 0.1, "head {seed}: {:.3} mm", back.distance(place));
    }
    assert!(kept > 0.9, "only {kept:.2} of the displacements are kept on average");
    // A map that folds is detected and weakened.
    let wild = Warp::new(&HeadRecipe { warp_mm: 60.0, ..mild() }, &BASE);
    assert!(wild.share < 0.9 && wild.least_jacobian() > 0.0);
}

#[test]
fn one_recipe_gives_one_head() {
    let recipe = HeadRecipe { tumour: Some(TUMOUR), fillings: 2, clips: 1, ..HeadRecipe::drawn(5, 1) };
    let threads = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    let (one, other) = (threads(1).install(|| coarse(recipe.clone())), threads(3).install(|| coarse(recipe.clone())));
    assert!(one.ct == other.ct && one.brain == other.brain && one.tumour == other.tumour);
    assert!(one.mri.data.iter().zip(&other.mri.data).all(|(a, b)| a.to_bits() == b.to_bits()));
    let next = coarse(HeadRecipe { seed: 6, ..recipe });
    assert!(next.ct.dims != one.ct.dims || next.ct.data != one.ct.data);
}

#[test]
fn the_brain_stays_inside_the_skull() {
    let bare = HeadRecipe { fillings: 0, clips: 0, tumour: None, ..HeadRecipe::drawn(0, 1) };
    let thick = HeadRecipe { skull_thickness: 1.6, ..mild() };
    let thin = HeadRecipe { skull_thickness: 0.6, ..mild() };
    for recipe in [mild(), thick, thin, bare.clone(), HeadRecipe { seed: 9, tilt_degrees: 20.0, ..bare }] {
        let head = coarse(recipe);
        let (share, line) = (share_of_brain_in_bone(&head), head.recipe.describe());
        assert!(share < 0.02, "{:.1} % of the brain is bone: {line}", 100.0 * share);
        let brain = ml(&head.brain, |v| v != 0);
        assert!((800.0..2000.0).contains(&brain), "{brain:.0} ml: {line}");
        let bone = ml(&head.ct, |hu| hu >= BONE_HU);
        assert!((300.0..1600.0).contains(&bone), "{bone:.0} ml of bone: {line}");
    }
}

#[test]
fn size_and_thickness_are_as_requested() {
    let (plain, brain) = (coarse(mild()), |head: &Head| ml(&head.brain, |v| v != 0));
    let large = coarse(HeadRecipe { scale: [1.1, 1.1, 1.1], ..mild() });
    let grown = 1.1f64.powi(3) / mild().scale.iter().product::<f64>();
    assert!((brain(&large) / brain(&plain) / grown - 1.0).abs() < 0.02);
    let bone = |thickness| ml(&coarse(HeadRecipe { skull_thickness: thickness, ..mild() }).ct, |hu| hu >= BONE_HU);
    let (thin, usual, thick) = (bone(0.6), bone(1.0), bone(1.6));
    // Jaw and skull base, about half of all bone, do not change.
    assert!(thin < 0.9 * usual && thick > 1.15 * usual, "{thin:.0}, {usual:.0}, {thick:.0} ml");
}

#[test]
fn atrophy_leaves_water_where_brain_was() {
    let (plain, ill) = (coarse(mild()), coarse(HeadRecipe { atrophy_mm: 4.0, ..mild() }));
    assert_eq!(plain.brain.dims, ill.brain.dims);
    let gone = |at: usize| plain.brain.data[at] != 0 && ill.brain.data[at] == 0;
    let lost = 1.0 - ml(&ill.brain, |v| v != 0) / ml(&plain.brain, |v| v != 0);
    assert!((0.1..0.35).contains(&lost), "{lost:.2} of the brain is gone");
    let (before, after) = (mean(&plain.mri, gone), mean(&ill.mri, gone));
    assert!(after < 0.8 * before, "MRI {after:.0} after {before:.0}");
}

#[test]
fn ventricles_grow_and_shrink() {
    let of = |by: f64| coarse(HeadRecipe { ventricles_mm: by, ..mild() });
    let (small, usual, large) = (of(-2.0), of(0.0), of(6.0));
    let dark = |head: &Head| {
        let deep = trepan_volume::DistanceField::of_mask(&head.brain);
        let fluid = 1.3 * BASE.anatomy.fluid;
        let there = |at: &usize| deep.values().data[*at] < -20.0 && head.mri.data[*at] < fluid;
        (0..head.mri.data.len()).filter(there).count() as f64
    };
    let (small, usual, large) = (dark(&small), dark(&usual), dark(&large));
    assert!(small < 0.9 * usual && large > 1.5 * usual, "{small}, {usual}, {large} dark voxels deep inside");
}

#[test]
fn voxels_and_tilt_are_as_requested() {
    let recipe = HeadRecipe {
        ct_spacing: Spacing { pixel_mm: 1.1, slice_mm: 2.5 },
        tilt_degrees: 15.0,
        mri_spacing: Spacing { pixel_mm: 1.2, slice_mm: 3.0 },
        mri_slice_axis: 0,
        ..mild()
    };
    let head = Head::make(&recipe, &BASE);
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} instead of {b}");
    let [ct, mri] = [head.ct.spacing_mm(), head.mri.spacing_mm()];
    for (found, asked) in [(ct.x, 1.1), (ct.y, 1.1), (ct.z, 2.5), (mri.x, 1.2), (mri.z, 3.0)] {
        near(found, asked);
    }
    let axes = head.ct.world_from_voxel.matrix3;
    let normal = axes.x_axis.cross(axes.y_axis).normalize();
    near(normal.dot(axes.z_axis.normalize()).acos().to_degrees(), 15.0);
    near(head.mri.world_from_voxel.matrix3.z_axis.normalize().x, 1.0);
    // The tilt is in the affine, not in the patient.
    let straight = Head::make(&HeadRecipe { tilt_degrees: 0.0, ..recipe }, &BASE);
    let differing =
        ct_there(&head).data.iter().zip(&ct_there(&straight).data).filter(|(a, b)| a.abs_diff(**b) > 400).count();
    assert!((differing as f64) < 0.03 * head.mri.data.len() as f64, "{differing} of {}", head.mri.data.len());
}

#[test]
fn noise_metal_and_bias_are_visible() {
    let noisy = Head::make(&HeadRecipe { ct_noise_hu: 40.0, ..coarse(mild()).recipe }, &BASE);
    let plain = coarse(mild());
    let off: Vec<f64> = noisy.ct.data.iter().zip(&plain.ct.data).map(|(a, b)| f64::from(a - b)).collect();
    // Air at the lower end of the range clips some of the noise.
    let deviation = (off.iter().map(|v| v * v).sum::<f64>() / off.len() as f64).sqrt();
    assert!((25.0..45.0).contains(&deviation), "{deviation:.1} HU");
    let metal = coarse(HeadRecipe { fillings: 3, clips: 1, ..mild() });
    assert!(metal.ct.data.iter().filter(|hu| **hu >= 3000).count() > 10);
    let streaks = metal.ct.data.iter().zip(&plain.ct.data).filter(|(a, b)| a.abs_diff(**b) > 100).count();
    assert!(streaks > 1000, "{streaks} voxels");
    let biased = coarse(HeadRecipe { mri_bias: 0.4, ..mild() });
    let ratios = biased.mri.data.iter().zip(&plain.mri.data).filter(|(_, b)| **b > 10.0).map(|(a, b)| a / b);
    let (low, high) = ratios.fold((f32::MAX, 0f32), |(low, high), v| (low.min(v), high.max(v)));
    assert!(low >= 0.599 && high <= 1.401 && high - low > 0.2, "{low} to {high}");
}

const TUMOUR: TumourRecipe = TumourRecipe { radii_mm: [12.0, 15.0, 10.0], brightness: 1.6 };

#[test]
fn a_tumour_lies_in_the_brain_and_is_visible() {
    for (seed, brightness) in [(1, 1.6), (2, 0.4)] {
        let recipe = HeadRecipe { seed, tumour: Some(TumourRecipe { brightness, ..TUMOUR }), ..mild() };
        let head = coarse(recipe);
        let labels = head.tumour.as_ref().expect("a tumour was asked for");
        assert_eq!((labels.dims, labels.world_from_voxel), (head.mri.dims, head.mri.world_from_voxel));
        assert!(labels.data.iter().zip(&head.brain.data).all(|(tumour, brain)| *tumour == 0 || *brain != 0));
        let (found, whole) = (ml(labels, |v| v != 0), 4.0 / 3.0 * core::f64::consts::PI * 12.0 * 15.0 * 10.0 * 1e-3);
        assert!((0.85..1.05).contains(&(found / whole)), "{found:.1} of {whole:.1} ml lie in the brain");
        let inside = mean(&head.mri, |at| labels.data[at] != 0) / f64::from(BASE.anatomy.tissue);
        assert!((inside - brightness).abs() < 0.1, "{inside:.2} times the brain's grey");
    }
}

#[test]
fn recipes_vary_fit_a_line_and_round_trip_through_json() {
    let run = HeadRecipe::of_run(1, 1000, 2);
    assert_eq!(run[0], HeadRecipe::mild(1, 2));
    let share = |on: &dyn Fn(&HeadRecipe) -> bool| run.iter().filter(|r| on(r)).count() as f64 / 1000.0;
    let shares = [
        share(&|r| r.base == 1),
        share(&|r| r.warp_mm > 2.0),
        share(&|r| r.skull_thickness != 1.0),
        share(&|r| r.tilt_degrees > 0.0),
        share(&|r| r.ventricles_mm != 0.0),
        share(&|r| r.atrophy_mm > 0.0),
        share(&|r| r.mri_bias > 0.0),
        share(&|r| r.fillings + r.clips > 0),
    ];
    assert!(shares.iter().all(|s| (0.38..0.72).contains(s)), "{shares:?}");
    let ill = share(&|r| r.tumour.is_some());
    assert!((0.28..0.39).contains(&ill), "{ill} have a tumour");
    for recipe in &run {
        let line = recipe.describe();
        assert!(!line.contains('\n') && line.chars().count() <= 260, "{line}");
        let json = serde_json::to_string(recipe).unwrap();
        assert_eq!(*recipe, serde_json::from_str::<HeadRecipe>(&json).unwrap());
    }
}

#[test]
fn a_written_head_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let head = coarse(HeadRecipe { tilt_degrees: 12.0, tumour: Some(TUMOUR), ..mild() });
    let files = head.write(&folder.path().join("head")).unwrap();
    let ct = nifti::read(&files.ct).unwrap();
    assert_eq!(ct.data, head.ct.map(f32::from).data);
    assert!(ct.world_from_voxel.abs_diff_eq(head.ct.world_from_voxel, 1e-4));
    assert_eq!(nifti::read(&files.mri).unwrap().data, head.mri.data);
    assert_eq!(nifti::read(&files.tumour.unwrap()).unwrap().dims, head.mri.dims);
}
