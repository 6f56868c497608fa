use super::*;
use crate::Recipe;
use crate::anatomy::{cropped, make_skull};
use std::path::Path;
use trepan_volume::{bone_isovalue, hounsfield, largest_component, read};

const N: usize = 96;

fn recipe() -> Recipe {
    Recipe { spacing_mm: REFERENCE_MM, ..Recipe::default() }
}

/// Spherical head whose density depends on radius and direction; brain within 78 mm.
fn head(hu: impl Fn(f32, Vec3) -> f32) -> (VoxelVolume<i16>, VoxelVolume<u8>) {
    let mut ct = VoxelVolume::isotropic([N; 3], Vec3::splat(-95.0), 2.0, -1000i16);
    let mut mask = ct.map(|_| 0u8);
    for at in 0..ct.data.len() {
        let place = ct.centre_of([at % N, at / N % N, at / (N * N)]).as_vec3();
        let r = place.length();
        ct.data[at] = hu(r, place / r.max(1.0)).clamp(-1000.0, 1400.0) as i16;
        mask.data[at] = u8::from(r < 78.0);
    }
    (ct, mask)
}

/// Density of a spherical wall of bone that begins at 80 mm and has this thickness.
fn wall(r: f32, thick_mm: f32) -> f32 {
    400.0 + 300.0 * (0.5 * thick_mm - (r - 80.0 - 0.5 * thick_mm).abs())
}

fn opened(
    ct: &VoxelVolume<i16>,
    mask: Option<&VoxelVolume<u8>>,
    requested: Option<[f32; 3]>,
) -> Result<Opening, PatientError> {
    Opening::of_patient(&BoneVolume::new(ct, 400).unwrap(), mask.map(Inside::of).as_ref(), requested)
}

#[test]
fn a_round_head_is_entered_along_its_radius() {
    let (ct, mask) = head(|r, _| wall(r, 6.0));
    let site = Site::from(opened(&ct, Some(&mask), None).unwrap());
    assert!((site.entry.length() - 86.0).abs() < 0.5, "{site:?}");
    assert!((site.bone_mm - 6.0).abs() < 0.8 && (site.brain_mm - 8.0).abs() < 0.8, "{site:?}");
    assert!(site.inward.dot(-site.entry.normalize()) > 0.999);
    assert!(site.entry.x > 0.0 && site.entry.z > 0.0);
}

#[test]
fn an_opening_is_found_or_placed_on_request_or_refused() {
    let (ct, _) = head(|r, _| wall(r, 6.0));
    let found = opened(&ct, None, None).unwrap();
    assert!((found.bone_mm - 6.0).abs() < 0.8, "{found:?}");
    let requested = opened(&ct, None, Some([-120.0, 0.0, 0.0])).unwrap();
    assert!(
        Vec3::from(requested.inward).dot(Vec3::X) > 0.999 && (requested.entry_mm[0] + 86.0).abs() < 1.0,
        "{requested:?}"
    );
    let refused = |requested| opened(&ct, None, Some(requested)).unwrap_err().to_string();
    let inside = refused([-40.0, 0.0, 0.0]);
    assert!(inside.contains("46 mm inside") && inside.contains("-86,0,0"), "{inside}");
    let far = refused([0.0, 0.0, 1000.0]);
    assert!(far.contains("914 mm away") && far.contains("outside the skull"), "{far}");
    let mut bowl = ct.clone();
    bowl.data[N * N * 40..].fill(-1000);
    let fault = opened(&bowl, None, Some([0.0, 0.0, 120.0])).unwrap_err().to_string();
    assert!(fault.contains("--opening") && fault.contains("outside the skull"), "{fault}");
}

#[test]
fn thin_bone_air_and_deep_brain_are_avoided() {
    // Right front: thin bone except for a small spot. Left front: a sinus. Right back remains.
    let bone = |r: f32, d: Vec3| match (d.x > 0.0, d.y > -0.1) {
        (true, true) => wall(r, if d.distance(Vec3::new(0.7, 0.3, 0.65)) < 0.03 { 6.0 } else { 1.5 }),
        (false, true) if (82.0..84.5).contains(&r) => -900.0,
        (false, true) => wall(r, 7.0),
        (true, false) => wall(r, 7.0),
        (false, false) => wall(r, 14.0),
    };
    let (ct, mask) = head(bone);
    let found = opened(&ct, Some(&mask), None).unwrap();
    assert!(found.entry_mm[0] > 10.0 && found.entry_mm[1] < -10.0, "{found:?}");
    let (thick, _) = head(|r, _| wall(r, 14.0));
    let fault = opened(&thick, Some(&mask), None).unwrap_err().to_string();
    assert!(fault.contains("3 to 12 mm") && fault.contains("--opening X,Y,Z"), "{fault}");
    let small = mask.map(|_| 0u8);
    let mut small = small;
    (0..small.data.len()).for_each(|at| {
        let r = small.centre_of([at % N, at / N % N, at / (N * N)]).length();
        small.data[at] = u8::from(r < 65.0);
    });
    let (even, _) = head(|r, _| wall(r, 6.0));
    let fault = opened(&even, Some(&small), None).unwrap_err().to_string();
    assert!(fault.contains("brain at most 8 mm"), "{fault}");
}

#[test]
fn bone_lost_on_a_coarse_grid_is_an_error() {
    let (ct, mask) = head(|r, _| wall(r, 6.0));
    let opening = opened(&ct, Some(&mask), None).unwrap();
    let mut gone = ct;
    gone.data[..N * N * 50].fill(900);
    gone.data[N * N * 50..].fill(-1000);
    let fault = opening.on(&BoneVolume::new(&gone, 400).unwrap(), true).unwrap_err().to_string();
    assert!(fault.contains("--spacing-mm"), "{fault}");
}

#[test]
fn a_brain_without_skull_is_touched_at_its_surface() {
    let (_, mask) = head(|r, _| wall(r, 6.0));
    let site = bare_brain(&DistanceField::of_mask(&mask), Vec3::ZERO, None).unwrap();
    assert!((site.entry.length() - 78.0).abs() < 1.5, "{site:?}");
}

/// Openings of a patient on the skull of each preset, and of a voxel size between them.
fn on_every_preset(ct: &Path, brain: &Path, requested: Option<[f32; 3]>) -> Vec<Opening> {
    let ct = hounsfield(&read(ct).unwrap()).unwrap();
    let classes = cropped(&largest_component(&read(brain).unwrap().map(|v| u8::from(v != 0.0)))).unwrap();
    let isovalue = bone_isovalue(&ct);
    let on = |spacing_mm| {
        let recipe = Recipe { spacing_mm, opening: requested, ..recipe() };
        let (skull, _) = make_skull(&ct, &recipe, isovalue).unwrap();
        Opening::planned(&ct, &bone_of(skull, isovalue).unwrap(), isovalue, Some(&classes), &recipe).unwrap()
    };
    [0.5, 0.75, 1.0, 1.5].map(on).to_vec()
}

#[test]
fn the_opening_does_not_depend_on_the_voxel_size() {
    let built_in = trepan_case_head();
    let second = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/head-second");
    let mut heads = vec![(built_in[0].clone(), built_in[1].clone())];
    if second.is_dir() {
        heads.push((second.join("ct/ct_head_hu.nii.gz"), second.join("mri/brainmask_in_ct_grid.nii.gz")));
    } else {
        println!("{} is not there: the built-in head alone", second.display());
    }
    for (ct, brain) in heads {
        for requested in [None, Some([60.0, 30.0, 110.0])] {
            let all = on_every_preset(&ct, &brain, requested);
            println!("{}: {all:#?}", ct.display());
            for one in &all {
                let apart = Vec3::from(one.entry_mm).distance(Vec3::from(all[0].entry_mm));
                assert!(apart < 1.0 && one.inward == all[0].inward, "{apart} mm: {all:#?}");
                assert!((one.bone_mm - all[0].bone_mm).abs() < 1.5 && one.brain().distance(all[0].brain()) < 0.01);
                assert!(one.brain_mm > one.bone_mm, "{one:?}");
            }
            let plausible = (3.0..=12.0).contains(&all[0].bone_mm) && all[0].brain_mm - all[0].bone_mm <= 8.0;
            assert!(requested.is_some() || plausible, "{all:?}");
        }
    }
}

fn trepan_case_head() -> [std::path::PathBuf; 2] {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/case-head");
    ["ct_hu.nii.gz", "brain_mask.nii.gz"].map(|name| folder.join(name))
}
