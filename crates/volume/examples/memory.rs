//! Measures the memory that importing a CT needs (Linux). `memory make FOLDER` writes a synthetic
//! head of 512x512x300 voxels, `memory read PATH` converts it and prints the peak memory.

use std::path::Path;
use trepan_volume::{
    AIR_HU, Grid, Interpolation, VoxelVolume, bone_isovalue, hounsfield, nifti, read, resample, skull_only,
};

const DIMS: [usize; 3] = [512, 512, 300];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["make", folder] => make(Path::new(folder)),
        ["read", path] => skull(Path::new(path)),
        _ => Err("usage: memory make FOLDER | memory read PATH".into()),
    }
}

fn skull(path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let ct = hounsfield(&read(path)?)?;
    println!("{:?} voxels read: {}", ct.dims, peak());
    let isovalue = bone_isovalue(&ct);
    let mut skull = resample(&ct, &Grid::isotropic_over(&ct, 0.55), Interpolation::Trilinear, AIR_HU);
    drop(ct);
    skull_only(&mut skull, isovalue);
    println!("{:?} voxels of skull over {isovalue} HU: {}", skull.dims, peak());
    Ok(())
}

fn peak() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or("VmHWM: unknown here").into()
}

/// HU of a bony shell around a brain, with the noise of a scanner.
fn hu([i, j, k]: [usize; 3]) -> i16 {
    let p = [(i as f64 - 256.0) / 190.0, (j as f64 - 256.0) / 220.0, (k as f64 - 140.0) / 130.0];
    let noise = (i * 7919 + j * 104_729 + k * 1_299_709) % 41;
    let tissue = match p.iter().map(|x| x * x).sum::<f64>().sqrt() {
        r if r < 0.85 => 35,
        r if r < 0.95 => 1100,
        _ => -1000,
    };
    tissue + noise as i16 - 20
}

fn make(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let mut head = VoxelVolume::isotropic(DIMS, trepan_geometry::Vec3::ZERO, 0.45, 0i16);
    head.world_from_voxel.matrix3.z_axis.z = 1.0;
    let plane = DIMS[0] * DIMS[1];
    for at in 0..head.data.len() {
        head.data[at] = hu([at % DIMS[0], at % plane / DIMS[0], at / plane]);
    }
    std::fs::create_dir_all(folder.join("dicom"))?;
    for (k, slice) in head.data.chunks_exact(plane).enumerate() {
        let mut bytes = [&[0; 128], &b"DICM\x02\0\x10\0UI\x14\x001.2.840.10008.1.2.1\0"[..]].concat();
        let mut add = |group: u16, element: u16, vr: &str, value: &[u8]| {
            bytes.extend([group.to_le_bytes(), element.to_le_bytes()].concat());
            bytes.extend_from_slice(vr.as_bytes());
            bytes.extend((value.len() as u16).to_le_bytes());
            bytes.extend_from_slice(value);
        };
        add(0x20, 0x0e, "UI", b"1.2.3.4 ");
        add(0x20, 0x32, "DS", format!("{:<16}", format!("0\\0\\{k}")).as_bytes());
        add(0x20, 0x37, "DS", b"1\\0\\0\\0\\1\\0 ");
        for (element, value) in [(0x02, 1), (0x10, DIMS[1]), (0x11, DIMS[0])] {
            add(0x28, element, "US", &(value as u16).to_le_bytes());
        }
        add(0x28, 0x30, "DS", b"0.45\\0.45 ");
        for (element, value) in [(0x100, 16u16), (0x101, 16), (0x102, 15), (0x103, 1)] {
            add(0x28, element, "US", &value.to_le_bytes());
        }
        bytes.extend([0xe0, 0x7f, 0x10, 0, b'O', b'W', 0, 0]);
        bytes.extend((2 * plane as u32).to_le_bytes());
        bytes.extend(slice.iter().flat_map(|v| v.to_le_bytes()));
        std::fs::write(folder.join("dicom").join(format!("{k}.dcm")), bytes)?;
    }
    Ok(nifti::write(&folder.join("ct.nii.gz"), &head)?)
}
