//! Trepan's crates as a Python module: arrays in, arrays out, errors as exceptions.
//!
//! # Practice
//! The module is `trepan._trepan`; the package around it is in `python/trepan`. A call that
//! computes lets other Python threads run, and a panic in it becomes a `TrepanError`. What a crate
//! returns becomes an array without a copy; what it takes is copied once, since the crates own
//! their data. Volumes have the shape (i, j, k) with i fastest in memory, as in `nibabel`.

mod arrays;
mod bone;
mod errors;
mod mesh;
mod recording;
mod soft;
mod tissue;
mod tool;
mod volume;

use pyo3::prelude::*;

/// Trepan's crates in Rust; use them through the package `trepan`.
#[pymodule]
mod _trepan {
    #[pymodule_export]
    use crate::bone::{BoneVolume, RigidContact, RigidPath, RigidStep};
    #[pymodule_export]
    use crate::errors::{_panic, TrepanError};
    #[pymodule_export]
    use crate::mesh::{
        boundary, import_mesh, import_surface, isosurface, quality, split_box, tetrahedra, voxel_size, write_mesh,
        write_surface,
    };
    #[pymodule_export]
    use crate::recording::Recording;
    #[pymodule_export]
    use crate::soft::{Loads, Material, StepReport, Tled};
    #[pymodule_export]
    use crate::tissue::{TissueCollision, TissueStep};
    #[pymodule_export]
    use crate::tool::Tool;
    #[pymodule_export]
    use crate::volume::{
        bone_isovalue, distance_field, hounsfield, import_volume, isotropic_over, resample, skull_only, write_volume,
    };

    #[pymodule_export]
    const AIR_HU: i16 = trepan_volume::AIR_HU;
}
