//! Saws a ring through a plate of bone, finds the piece that comes free, and undoes the stroke.

use glam::{IVec3, Vec3};
use trepan_bone::{BoneVolume, Piece};
use trepan_volume::{AIR_HU, VoxelVolume};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (n, thick) = (64, 6);
    let plate = VoxelVolume::isotropic([n, n, thick], Vec3::ZERO, 0.5, 1200);
    let bone = BoneVolume::new(&plate, 400)?;
    let whole = Piece::all(&bone);
    bone.begin_stroke();
    for at in 0..n * n * thick {
        let voxel = IVec3::from([at % n, at / n % n, at / (n * n)].map(|i| i as i32));
        let from_middle = (bone.centre_of(voxel) - bone.bounds().centre()).truncate().length();
        if (from_middle - 10.0).abs() < 0.75 {
            bone.set_hu(voxel, AIR_HU);
        }
    }
    bone.end_stroke();
    for piece in Piece::cut_off(&whole, &Piece::all(&bone)) {
        println!("free: {:.1} mm3", piece.voxels as f32 * bone.voxel_mm3());
    }
    println!("undone: {:?}, pieces now: {}", bone.undo_stroke(), Piece::all(&bone).len());
    Ok(())
}
