//! A voxel grid with its pose in the patient: the common form of all images.

use glam::{DAffine3, DVec3};
use trepan_geometry::{Aabb, Vec3};

/// Samples on a regular grid, x fastest, with the affine from voxel indices to patient RAS+ mm.
///
/// Voxel `(i, j, k)` has its **centre** at `world_from_voxel · (i, j, k)`; the affine may be
/// oblique, anisotropic or mirrored. Invariant: `data.len() = dims.x · dims.y · dims.z`, and the
/// affine is finite and invertible (readers reject others).
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelVolume<T> {
    /// Voxels along i, j, k.
    pub dims: [usize; 3],
    /// Samples, `data[i + dims[0] * (j + dims[1] * k)]`.
    pub data: Vec<T>,
    /// Transform from voxel indices to RAS+ mm.
    pub world_from_voxel: DAffine3,
}

impl<T: Copy> VoxelVolume<T> {
    /// A volume filled with one value.
    pub fn filled(dims: [usize; 3], world_from_voxel: DAffine3, value: T) -> Self {
        Self { dims, data: vec![value; dims.iter().product()], world_from_voxel }
    }

    /// An axis-aligned isotropic volume with voxel (0, 0, 0) centred at `origin`.
    pub fn isotropic(dims: [usize; 3], origin: Vec3, spacing_mm: f32, value: T) -> Self {
        let affine =
            DAffine3::from_translation(origin.as_dvec3()) * DAffine3::from_scale(DVec3::splat(spacing_mm.into()));
        Self::filled(dims, affine, value)
    }

    /// Index of a voxel in `data`.
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.dims[0] * (j + self.dims[1] * k)
    }

    /// The sample of a voxel; `None` outside.
    pub fn get(&self, voxel: [usize; 3]) -> Option<T> {
        voxel.iter().zip(self.dims).all(|(&v, n)| v < n).then(|| self.data[self.index(voxel)])
    }

    /// Lowest and highest voxel of the box around all samples of a kind; `None` if there are none.
    pub fn box_where(&self, is: impl Fn(&T) -> bool) -> Option<[[usize; 3]; 2]> {
        let [nx, ny, _] = self.dims;
        let ends = |(row, samples): (usize, &[T])| {
            let (y, z) = (row % ny, row / ny);
            Some([[samples.iter().position(&is)?, y, z], [samples.iter().rposition(&is)?, y, z]])
        };
        let join = |[a, b]: [[usize; 3]; 2], [c, d]: [[usize; 3]; 2]| {
            [core::array::from_fn(|axis| a[axis].min(c[axis])), core::array::from_fn(|axis| b[axis].max(d[axis]))]
        };
        self.data.chunks_exact(nx.max(1)).enumerate().filter_map(ends).reduce(join)
    }

    /// Keeps the voxels of a box only, where they are in the world: `dims` of them from `low` on.
    /// Needs no further memory and gives back what is not used.
    ///
    /// # Panics
    /// If the box is not inside.
    pub fn crop(&mut self, low: [usize; 3], dims: [usize; 3]) {
        assert!((0..3).all(|axis| low[axis] + dims[axis] <= self.dims[axis]), "{low:?} and {dims:?} lie beyond");
        let [nx, ny, nz] = dims;
        for row in 0..ny * nz {
            let from = self.index([low[0], low[1] + row % ny, low[2] + row / ny]);
            self.data.copy_within(from..from + nx, row * nx);
        }
        self.data.truncate(nx * ny * nz);
        self.data.shrink_to_fit();
        self.dims = dims;
        self.world_from_voxel *= DAffine3::from_translation(low.map(|n| n as f64).into());
    }

    /// Maps the samples, on the same grid.
    pub fn map<U>(&self, f: impl Fn(T) -> U) -> VoxelVolume<U> {
        VoxelVolume {
            dims: self.dims,
            data: self.data.iter().map(|&v| f(v)).collect(),
            world_from_voxel: self.world_from_voxel,
        }
    }

    /// Edge lengths of a voxel along i, j, k, mm.
    pub fn spacing_mm(&self) -> DVec3 {
        let m = self.world_from_voxel.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
    }

    /// Volume of one voxel, mm³.
    pub fn voxel_mm3(&self) -> f64 {
        self.world_from_voxel.matrix3.determinant().abs()
    }

    /// World centre of a voxel, mm.
    pub fn centre_of(&self, voxel: [usize; 3]) -> DVec3 {
        self.world_from_voxel.transform_point3(DVec3::new(voxel[0] as f64, voxel[1] as f64, voxel[2] as f64))
    }

    /// Lowest and highest corner of the box around the voxels' outer faces, world mm.
    pub fn world_corners(&self) -> (DVec3, DVec3) {
        let n = DVec3::from_array(self.dims.map(|n| n as f64));
        let corner = |bits: usize| {
            let at = |axis: usize| if bits >> axis & 1 == 0 { -0.5 } else { n[axis] - 0.5 };
            self.world_from_voxel.transform_point3(DVec3::new(at(0), at(1), at(2)))
        };
        (0..8).map(corner).fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(p), high.max(p)))
    }

    /// The box around the voxels' outer faces, world mm.
    pub fn world_box(&self) -> Aabb {
        let (low, high) = self.world_corners();
        Aabb { min: low.as_vec3(), max: high.as_vec3() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_cropped_stays_where_it_is() {
        let mut volume = VoxelVolume::isotropic([5, 4, 3], Vec3::new(1.0, 2.0, 3.0), 0.5, 0u16);
        volume.data.iter_mut().zip(0..).for_each(|(sample, at)| *sample = at);
        let whole = volume.clone();
        let [low, high] = whole.box_where(|sample| [27, 33, 52].contains(sample)).unwrap();
        assert_eq!((low, high), ([2, 1, 1], [3, 2, 2]));
        volume.crop(low, [2, 2, 2]);
        for (at, sample) in volume.data.iter().enumerate() {
            let voxel = [at % 2, at / 2 % 2, at / 4];
            let before = [0, 1, 2].map(|axis| voxel[axis] + low[axis]);
            assert_eq!((Some(*sample), volume.centre_of(voxel)), (whole.get(before), whole.centre_of(before)));
        }
        assert!(volume.box_where(|sample| *sample > 60).is_none());
    }
}
