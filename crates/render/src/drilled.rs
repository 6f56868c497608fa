//! What tools have cut from the bone, as depths on a lattice in the bricks of cells near cuts.
//!
//! # Theory
//! Bone is where the CT reaches the isovalue and nothing was cut. The cut is a signed distance on
//! nodes at most 0.5 mm apart. Linear between nodes, a bore of 1.5 mm would show facets of 0.04 mm
//! through the microscope. A Catmull-Rom spline therefore halves the distance between nodes once,
//! when a brick is copied, and rays stay linear in between, where a cubic is solved exactly.
//!
//! # Practice
//! A brick has the lattice points on its upper walls too, so that a cell needs one look-up. Four
//! bytes of table a brick of cells; for each brick near a cut 10 kB at voxels of 1 mm. Memory grows
//! with the cut and does not shrink. About 20 µs a brick that has changed.

use glam::IVec3;
use trepan_bone::{BoneVolume, CUT_STEPS, CUT_SURFACE};

/// Edge of a brick of cells; `BRICK` in `bricks.wgsl`. Divides the bone's own brick.
pub(crate) const LEAP: usize = 4;

/// Depth of a place far from all cuts, nodes; `FAR` in `drilled.wgsl`.
pub(crate) const FAR: f32 = -4.0;
/// Depth of the highest node of a brick that is left out. Normals look half a node around.
const LEFT_OUT: i16 = CUT_SURFACE - 2 * CUT_STEPS as i16;

/// Depths in the cut.
#[derive(Clone, Debug)]
pub(crate) struct Drilled {
    /// Lattice points along the edge of a brick of cells.
    pub edge: usize,
    /// For each brick of cells its place and 1, or 0.
    pub table: Vec<u32>,
    /// Depths in place after place, x fastest, in steps of a node; over 0 was cut.
    pub depths: Vec<i16>,
}

impl Drilled {
    /// Nothing is cut of so many bricks of cells, with `steps` of the lattice along a cell's edge.
    pub fn new(steps: usize, bricks: usize) -> Self {
        Self { edge: LEAP * steps + 1, table: vec![0; bricks], depths: Vec::new() }
    }

    /// Values of a place, an even number.
    pub fn stride(&self) -> usize {
        self.edge.pow(3).next_multiple_of(2)
    }

    /// The depths in a brick, if something near it was cut.
    #[inline(always)]
    pub fn brick(&self, at: usize) -> Option<&[i16]> {
        let place = (self.table[at] as usize).checked_sub(1)?;
        Some(&self.depths[place * self.stride()..][..self.edge.pow(3)])
    }

    /// Copies the cut in a brick of cells; returns the place of the brick, if it has one.
    pub fn follow(&mut self, bone: &BoneVolume, at: usize, brick: [usize; 3]) -> Option<usize> {
        let nodes = bone.cut_nodes();
        // Padded voxel 0 is one before the bone's first; the spline needs one node more on each
        // side.
        let low = nodes * (IVec3::from(brick.map(|b| (b * LEAP) as i32)) - 1) - 1;
        let count = LEAP as i32 * nodes + 3;
        if self.table[at] == 0 && !bone.is_cut_near(low, low + count) {
            return None;
        }
        // Beyond the grid the outermost node continues, so that a bore at its border stays open.
        let last = nodes * (IVec3::from(bone.dims().map(|n| n as i32)) - 1);
        let (first, end) = (low.clamp(IVec3::ZERO, last), (low + count - 1).clamp(IVec3::ZERO, last));
        let size = end - first + 1;
        let mut inside = vec![0; size.element_product() as usize];
        bone.read_cut(first, size, &mut inside);
        if self.table[at] == 0 && inside.iter().all(|&value| value < LEFT_OUT) {
            return None;
        }
        let axis = |n: usize| (0..count).map(move |x| ((low[n] + x).clamp(first[n], end[n]) - first[n]) as usize);
        let [wide, deep] = [size.x, size.y].map(|n| n as usize);
        let rows = axis(2).flat_map(|z| axis(1).map(move |y| wide * (y + deep * z)));
        let depth = |at: usize| f32::from(inside[at] - CUT_SURFACE);
        let around: Vec<f32> = rows.flat_map(|row| axis(0).map(move |x| row + x)).map(depth).collect();
        let fine = (0..3).fold(around, |values, _| halved(&values, count as usize));
        let place = (self.table[at] as usize).checked_sub(1).unwrap_or(self.depths.len() / self.stride());
        self.table[at] = place as u32 + 1;
        let start = place * self.stride();
        self.depths.resize(self.depths.len().max(start + self.stride()), 0);
        self.depths[start..].iter_mut().zip(fine).for_each(|(to, depth)| *to = depth as i16);
        Some(place)
    }

    /// Whether a cell of a brick that was cut may still hold bone.
    pub fn is_left(&self, depths: &[i16], cell: IVec3) -> bool {
        let steps = (self.edge - 1) / LEAP;
        let first = cell.as_usizevec3() * steps;
        let rows = (0..=steps).flat_map(|z| (0..=steps).map(move |y| (y, z)));
        let row = |(y, z)| first.x + self.edge * (first.y + y + self.edge * (first.z + z));
        rows.map(row).any(|at| depths[at..=at + steps].iter().any(|&depth| depth < 0))
    }
}

/// Halves the distance between values along rows of `count` by a Catmull-Rom spline, without those
/// at both ends. The rows' axis becomes the slowest.
fn halved(rows: &[f32], count: usize) -> Vec<f32> {
    let (many, fine) = (rows.len() / count, 2 * count - 5);
    let mut out = vec![0.0; many * fine];
    for (n, row) in rows.chunks_exact(count).enumerate() {
        for at in 0..fine {
            let v = &row[at / 2..];
            out[n + many * at] = if at % 2 == 0 { v[1] } else { (9.0 * (v[1] + v[2]) - v[0] - v[3]) / 16.0 };
        }
    }
    out
}
