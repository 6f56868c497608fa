//! The CT between its voxels: trilinear, on the nodes of the cut.
//!
//! # Theory
//! The same interpolation as in the picture and in the exported surface, so that all of them end
//! the bone at the same place. Nodes lie on the voxels' grid: along an edge between two nodes the
//! density is linear, and what is read here loses nothing. Of a plane behind a scanner's blur (full
//! width at half maximum of 1.25 voxels) a ball of 3 voxels stands 0.05 voxels off (95th
//! percentile); a Catmull-Rom spline is no better, cubic splines of wider support gain a third.
//!
//! # When not to use it
//! For single points: read the eight voxels around them.

use crate::BoneVolume;
use glam::IVec3;

/// Memory for [`BoneVolume::read_between`], taken in advance.
#[derive(Debug, Default)]
pub struct BetweenScratch {
    /// One row of voxels.
    row: Vec<f32>,
    /// Rows of one layer of voxels, fine along x.
    rows: Vec<f32>,
    /// The last two layers of voxels, fine along x and y.
    layers: [Vec<f32>; 2],
}

impl BetweenScratch {
    /// Room for boxes of up to `edge` nodes along each axis.
    pub fn new(edge: usize) -> Self {
        let more = edge + 2;
        let layer = || Vec::with_capacity(edge * edge);
        Self { row: Vec::with_capacity(more), rows: Vec::with_capacity(more * edge), layers: [layer(), layer()] }
    }
}

/// Which voxels lie around the nodes of a box, along one axis.
struct Axis {
    nodes: i32,
    low: i32,
}

impl Axis {
    fn first_voxel(&self) -> i32 {
        self.low.div_euclid(self.nodes)
    }

    /// Voxels around so many nodes.
    fn voxels(&self, count: i32) -> i32 {
        (self.low + count - 1).div_euclid(self.nodes) + 2 - self.first_voxel()
    }

    /// Of each of `count` nodes: its first voxel, from the first of all, and how far it is past it.
    fn of(&self, count: i32) -> impl Iterator<Item = (usize, f32)> {
        let (nodes, mut past, mut at) = (self.nodes, self.low.rem_euclid(self.nodes), 0);
        (0..count).map(move |_| {
            let here = (at, past as f32 / nodes as f32);
            past += 1;
            if past == nodes {
                (past, at) = (0, at + 1);
            }
            here
        })
    }
}

impl BoneVolume {
    /// The CT's density at the nodes of a box, HU, x fastest. Cut bone counts as if it were there.
    ///
    /// About 2 ns a node, more for boxes thinner than a voxel. Allocates where `scratch` is too
    /// small.
    pub fn read_between(&self, low: IVec3, size: IVec3, scratch: &mut BetweenScratch, out: &mut [i16]) {
        let nodes = self.cut.nodes;
        if size.cmple(IVec3::ZERO).any() {
            return;
        }
        let [x, y, z] = low.to_array().map(|low| Axis { nodes, low });
        let [nx, ny, nz] = size.to_array().map(|n| n as usize);
        let (first, across) = (IVec3::new(x.first_voxel(), y.first_voxel(), z.first_voxel()), x.voxels(size.x));
        let (deep, high) = (y.voxels(size.y), z.voxels(size.z));
        if nodes == 1 {
            for (at, out) in out[..nx * ny * nz].chunks_exact_mut(nx).enumerate() {
                let start = low + IVec3::new(0, (at % ny) as i32, (at / ny) as i32);
                out.iter_mut().zip(0..).for_each(|(out, i)| *out = self.ct(start + i * IVec3::X));
            }
            return;
        }
        let BetweenScratch { row, rows, layers } = scratch;
        layers.iter_mut().for_each(|layer| layer.resize(nx * ny, 0.0));
        let mut slices = z.of(size.z).zip(out.chunks_exact_mut(nx * ny)).peekable();
        for layer in 0..high {
            rows.clear();
            for j in 0..deep {
                row.clear();
                let start = first + IVec3::new(0, j, layer);
                row.extend((0..across).map(|i| f32::from(self.ct(start + IVec3::new(i, 0, 0)))));
                rows.extend(x.of(size.x).map(|(at, t)| row[at] + t * (row[at + 1] - row[at])));
            }
            let fine = &mut layers[layer as usize % 2];
            for ((at, t), to) in y.of(size.y).zip(fine.chunks_exact_mut(nx)) {
                let (below, above) = rows[at * nx..(at + 2) * nx].split_at(nx);
                to.iter_mut().zip(below.iter().zip(above)).for_each(|(to, (a, b))| *to = a + t * (b - a));
            }
            while let Some(((at, t), to)) = slices.next_if(|((at, _), _)| *at as i32 + 1 == layer) {
                let (below, above) = (&layers[at % 2], &layers[(at + 1) % 2]);
                let whole = |a: f32, b: f32| (a + t * (b - a) + 32768.5) as i32 - 32768;
                to.iter_mut().zip(below.iter().zip(above)).for_each(|(to, (a, b))| *to = whole(*a, *b) as i16);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;
    use trepan_volume::VoxelVolume;

    #[test]
    fn nodes_lie_between_the_voxels_around_them() {
        let mut ct = VoxelVolume::isotropic([12, 11, 10], Vec3::ZERO, 1.5, 0i16);
        ct.data.iter_mut().enumerate().for_each(|(at, hu)| *hu = (at * 7919 % 2500) as i16 - 900);
        let bone = BoneVolume::new(&ct, 100).unwrap();
        let n = bone.cut_nodes();
        assert_eq!(n, 3);
        for (low, size) in
            [(IVec3::new(5, -6, 7), IVec3::new(13, 11, 9)), (IVec3::new(30, 29, 28), IVec3::new(9, 1, 4))]
        {
            let mut out = vec![0; size.element_product() as usize];
            bone.read_between(low, size, &mut BetweenScratch::new(4), &mut out);
            for (at, hu) in out.iter().enumerate() {
                let at = at as i32;
                let node = low + IVec3::new(at % size.x, at / size.x % size.y, at / (size.x * size.y));
                let (voxel, part) =
                    (node.div_euclid(IVec3::splat(n)), node.rem_euclid(IVec3::splat(n)).as_vec3() / n as f32);
                let truth: f32 = (0..8)
                    .map(|c| {
                        let step = IVec3::new(c & 1, c >> 1 & 1, c >> 2);
                        let weight = Vec3::select(step.cmpeq(IVec3::ONE), part, 1.0 - part).element_product();
                        weight * f32::from(bone.ct(voxel + step))
                    })
                    .sum();
                assert!((f32::from(*hu) - truth).abs() < 0.51, "{node} {hu} {truth}");
            }
        }
    }
}
