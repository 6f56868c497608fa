//! What is looked at: a made-up shell, the skulls of the thesis, a brain that moves.

use glam::{DVec3, Vec3};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_mesh::{TetMesh, lattice};
use trepan_render::{Camera, Frame, SliceLook};
use trepan_volume::{
    AIR_HU, Grid, Interpolation, VoxelVolume, bone_isovalue, hounsfield, largest_component, read, resample, skull_only,
};

/// Where bone begins in what is made up, HU.
pub const ISO: i16 = 400;

/// Table 3.2 of the thesis: dimensions and voxel edge, mm.
pub const SKULLS: [(&str, [usize; 3], f32); 5] = [
    ("Skull1", [143, 135, 95], 1.5),
    ("Skull2", [171, 162, 114], 1.25),
    ("Skull3", [213, 202, 142], 1.0),
    ("Skull4", [284, 269, 189], 0.75),
    ("Skull5", [425, 403, 283], 0.5),
];

/// The 3-D view alone.
pub fn frame(target: Vec3, towards_eye: Vec3, distance_mm: f32, fov_rad: f32) -> Frame<'static> {
    let camera = Camera { fov_rad, ..Camera::viewed_from(target, towards_eye, distance_mm) };
    Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) }
}

/// A shell of bone with waves on it and a drilled hole with sharp edges.
pub fn head(edge: usize) -> Arc<BoneVolume> {
    let half = 0.5 * (edge as f64 - 1.0);
    let mut ct = VoxelVolume::isotropic([edge; 3], Vec3::splat(-half as f32), 1.0, AIR_HU);
    for at in 0..ct.data.len() {
        let p = ct.centre_of([at % edge, at / edge % edge, at / (edge * edge)]);
        let depth = (p.length() - 0.8 * half - (0.3 * p.x).sin() * (0.3 * p.z).cos()).abs();
        let drilled = (p - DVec3::new(0.1, 0.7, 0.4) * half).length() < 0.15 * half;
        ct.data[at] = if drilled { AIR_HU } else { (400.0 + 250.0 * (3.0 - depth)).clamp(-1000.0, 1400.0) as i16 };
    }
    Arc::new(BoneVolume::new(&ct, ISO).expect("the scene has bone"))
}

/// A skull of the thesis: the upper part of the built-in CT, resampled.
pub fn skull(dims: [usize; 3], voxel_mm: f32) -> Arc<BoneVolume> {
    let ct = read(&trepan_fixtures::case_head().ct).expect("the built-in CT is there");
    let mut ct = hounsfield(&ct).expect("the built-in CT is in HU");
    let isovalue = bone_isovalue(&ct);
    skull_only(&mut ct, isovalue);
    let (low, high) = ct.world_corners();
    let size = f64::from(voxel_mm) * DVec3::from(dims.map(|n| n as f64));
    let origin = (0.5 * (low + high) - 0.5 * size).with_z(high.z - size.z) + 0.5 * f64::from(voxel_mm);
    let grid = Grid::of(&VoxelVolume::isotropic([0; 3], origin.as_vec3(), voxel_mm, 0u8));
    let ct = resample(&ct, &Grid { dims, ..grid }, Interpolation::Trilinear, AIR_HU);
    Arc::new(BoneVolume::new(&ct, isovalue).expect("the skull is bone"))
}

/// The built-in brain in about so many tetrahedra, and its MRI.
pub fn brain(tets: usize) -> (TetMesh, VoxelVolume<f32>) {
    let case = trepan_fixtures::case_head();
    let labels = read(&case.labels).expect("the built-in labels are there");
    let mask = largest_component(&labels.map(|label| u8::from(label > 0.5)));
    let config = lattice::Config { target_tets: tets, ..lattice::Config::default() };
    let mesh = lattice::tetrahedra(&mask, &config).expect("the mask can be filled");
    (mesh, read(&case.mri).expect("the built-in MRI is there"))
}

/// The brain as it sways, by a few mm.
pub fn swaying(mesh: &TetMesh, turn: usize) -> Vec<Vec3> {
    let wave = |p: Vec3| (0.05 * p.x + 0.9 * turn as f32).sin();
    mesh.positions.iter().map(|&p| p + Vec3::new(0.5, 1.0, -2.0) * wave(p)).collect()
}
