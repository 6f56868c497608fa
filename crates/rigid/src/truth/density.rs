//! Bone before it is cut: closed forms, and a CT between its voxels.

use glam::{DAffine3, DVec3};
use trepan_volume::VoxelVolume;

/// Where bone is, and how dense.
pub trait Density: Send + Sync {
    /// Density at a place, HU.
    fn hu(&self, place: DVec3) -> f64;
    /// How far a place is over the border of bone, in any unit; continuous, negative outside.
    fn within(&self, place: DVec3) -> f64;
    /// Most that [`within`](Self::within) changes in a mm.
    fn steepest(&self) -> f64;
}

/// A solid of a signed distance.
pub struct ClosedForm<D, H> {
    /// Distance to the surface, mm, negative in bone; it changes by at most 1 in a mm.
    pub distance: D,
    /// Density at a distance, HU.
    pub hu: H,
}

impl<D: Fn(DVec3) -> f64 + Send + Sync, H: Fn(f64) -> f64 + Send + Sync> Density for ClosedForm<D, H> {
    fn hu(&self, place: DVec3) -> f64 {
        (self.hu)((self.distance)(place))
    }

    fn within(&self, place: DVec3) -> f64 {
        -(self.distance)(place)
    }

    fn steepest(&self) -> f64 {
        1.0
    }
}

/// A block of a CT, trilinear between its voxels, on its own grid. Beyond the block goes on what
/// its outermost voxels hold.
pub struct Scan {
    dims: [usize; 3],
    hu: Vec<f64>,
    from_world: DAffine3,
    isovalue: f64,
    steepest: f64,
}

impl Scan {
    /// The voxels within `reach_mm` of a place, along each axis of the grid.
    pub fn around(ct: &VoxelVolume<i16>, isovalue: i16, place: DVec3, reach_mm: f64) -> Self {
        let from_world = ct.world_from_voxel.inverse();
        let middle = from_world.transform_point3(place);
        let last = DVec3::from(ct.dims.map(|n| n as f64 - 1.0));
        let reach = reach_mm / ct.spacing_mm();
        let [low, high] =
            [(middle - reach).floor(), (middle + reach).ceil()].map(|at| at.clamp(DVec3::ZERO, last).as_usizevec3());
        let dims = (high - low + 1).to_array();
        let voxel = |at: usize| {
            low.to_array()
                .iter()
                .zip([at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])])
                .map(|(low, at)| low + at)
                .collect::<Vec<_>>()
        };
        let hu: Vec<f64> =
            (0..dims.iter().product()).map(voxel).map(|v| f64::from(ct.data[ct.index([v[0], v[1], v[2]])])).collect();
        let steps = [1, dims[0], dims[0] * dims[1]];
        let most = |axis: usize| {
            let inner = |at: &usize| at / steps[axis] % dims[axis] + 1 < dims[axis];
            let apart = (0..hu.len()).filter(inner).map(|at| (hu[at + steps[axis]] - hu[at]).abs());
            apart.fold(0.0, f64::max) / ct.spacing_mm()[axis]
        };
        let steepest = DVec3::new(most(0), most(1), most(2)).length().max(1.0);
        let from_world = DAffine3::from_translation(-low.as_dvec3()) * from_world;
        Self { dims, hu, from_world, isovalue: isovalue.into(), steepest }
    }
}

impl Density for Scan {
    fn hu(&self, place: DVec3) -> f64 {
        let last = DVec3::from(self.dims.map(|n| n as f64 - 1.0));
        let at = self.from_world.transform_point3(place).clamp(DVec3::ZERO, last);
        let low = at.min((last - 1.0).max(DVec3::ZERO)).floor();
        let t = at - low;
        let [nx, ny, _] = self.dims;
        let corner = low.x as usize + nx * (low.y as usize + ny * low.z as usize);
        let [dx, dy, dz] = [1, nx, nx * ny];
        let mix = |a: f64, b: f64, t: f64| a + t * (b - a);
        let line = |at: usize| mix(self.hu[at], self.hu[at + dx], t.x);
        let plane = |at: usize| mix(line(at), line(at + dy), t.y);
        mix(plane(corner), plane(corner + dz), t.z)
    }

    fn within(&self, place: DVec3) -> f64 {
        self.hu(place) - self.isovalue
    }

    fn steepest(&self) -> f64 {
        self.steepest
    }
}
