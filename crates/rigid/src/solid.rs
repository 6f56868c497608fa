//! Where the surface of the bone is read from: densities and cut on the cells of a grid.

use crate::window::Window;
use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;
use wide::i16x8;

/// Fall of the cut along an edge under which a steeper edge is nearby, HU. The cosine of a
/// surface's angle with one of the axes is at least 0.58.
const GRAZED: f32 = 500.0;
/// Widest disc that does not stand out over a cut which ends over two nodes away, cells.
const WIDEST: f32 = 1.2;
/// Slope of the cut along an edge that counts as steep, HU a cell.
pub(crate) const STEEP: f32 = -300.0;

/// Where the surface is read from: one or two fields on the cells of a grid, bone where all of
/// them are over their borders.
pub(crate) trait Solid {
    /// How far a cell is over the border of bone in a field, HU or 1000 a node.
    fn over(&self, field: Field, cell: IVec3) -> f32;
    /// Whether a cell is bone.
    fn is_bone(&self, cell: IVec3) -> bool;
    /// One bit for each of `count` cells along x from `start` that is bone, at most 128.
    fn bone_bits(&self, start: IVec3, count: i32) -> u128 {
        (0..count).fold(0, |bits, i| bits | u128::from(self.is_bone(start.with_x(start.x + i))) << i)
    }
    /// Whether there is a cut beside the densities.
    const CUT: bool = false;
    /// Whether the edge by `step` lies so far from all cuts that none of them can bound the bone
    /// there.
    fn is_far(&self, _cell: IVec3, _step: IVec3) -> bool {
        false
    }
    /// Cells from one voxel to the next where the edge by `step` lies far from all cuts, else 1.
    /// Far from cuts the surface is looked for on the edges between voxels alone.
    fn stride(&self, cell: IVec3, step: IVec3) -> i32 {
        if self.is_far(cell, step) { self.voxel() } else { 1 }
    }
    /// Cells from one voxel to the next.
    fn voxel(&self) -> i32 {
        1
    }
    /// Its nodes, if it has any.
    fn fine(&self) -> Option<&Fine<'_>> {
        None
    }
    /// Widest disc, cells.
    fn widest(&self) -> f32 {
        f32::MAX
    }
}

/// Which field bounds the bone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Field {
    /// The CT.
    #[default]
    Density,
    /// What tools have cut.
    Cut,
}

/// CT and cut on the nodes of the cut.
pub(crate) struct Fine<'a> {
    pub density: &'a Window,
    pub cut: &'a Window,
    /// Nodes from one voxel to the next.
    pub stride: i32,
    /// Whether anything was cut nearby.
    pub near: bool,
}

impl Solid for Fine<'_> {
    const CUT: bool = true;

    fn is_far(&self, cell: IVec3, step: IVec3) -> bool {
        self.cut.at(cell) == 0 && self.cut.at(cell + step) == 0
    }

    fn voxel(&self) -> i32 {
        self.stride
    }

    fn fine(&self) -> Option<&Fine<'_>> {
        Some(self)
    }

    fn widest(&self) -> f32 {
        if self.near { WIDEST } else { f32::MAX }
    }

    fn over(&self, field: Field, cell: IVec3) -> f32 {
        match field {
            Field::Density => self.density.over(cell),
            Field::Cut => self.cut.over(cell),
        }
    }

    fn is_bone(&self, cell: IVec3) -> bool {
        self.cut.at(cell) < self.cut.border() && self.density.at(cell) >= self.density.border()
    }

    fn bone_bits(&self, start: IVec3, count: i32) -> u128 {
        let [cut, density] = [self.cut, self.density].map(|window| i16x8::splat(window.border()));
        let dense = self.density.bits(start, count, |cells| !cells.simd_lt(density));
        if dense == 0 || !self.near { dense } else { dense & self.cut.bits(start, count, |cells| cells.simd_lt(cut)) }
    }
}

/// The voxels with what was cut from them.
impl Solid for BoneVolume {
    fn over(&self, _: Field, cell: IVec3) -> f32 {
        f32::from(self.hu(cell)) - f32::from(self.isovalue())
    }

    fn is_bone(&self, cell: IVec3) -> bool {
        BoneVolume::is_bone(self, cell)
    }
}
/// Whether the cut passes an edge at so little an angle that it passes a steeper one nearby.
pub(crate) fn is_grazed(solid: &impl Solid, cell: IVec3, step: IVec3) -> bool {
    let beyond = solid.over(Field::Cut, cell + step);
    beyond <= 0.0 && solid.over(Field::Cut, cell) - beyond < GRAZED && solid.over(Field::Density, cell + step) >= 0.0
}

/// Where bone ends on the edge from bone voxel `local` by `step`, voxels from `base`, and what ends
/// it.
pub(crate) fn crossing<S: Solid>(solid: &S, base: IVec3, local: IVec3, step: IVec3) -> (Vec3, Field) {
    let of = |field| {
        let over = |n: i32| solid.over(field, base + local + n * step);
        let (here, after) = (over(0), over(1));
        match field {
            _ if after >= 0.0 => 1.0,
            Field::Density => here / (here - after),
            Field::Cut => end_of_bone([over(-1), here, after, over(2)]),
        }
    };
    let mut found = (of(Field::Density), Field::Density);
    if S::CUT {
        let cut = of(Field::Cut);
        // On equal terms it is the cut: a density on its border is bone, a cut is not.
        found = if cut <= found.0 { (cut, Field::Cut) } else { found };
    }
    (local.as_vec3() + found.0 * step.as_vec3(), found.1)
}

/// Where the cubic of [`cubic`] passes 0.
pub(crate) fn end_of_bone([a, b, c, d]: [f32; 4]) -> f32 {
    let [one, two, three] = coefficients([a, b, c, d]);
    let value = |t: f32| b + t * (one + t * (two + t * three));
    let slope = |t: f32| one + t * (2.0 * two + 3.0 * t * three);
    // Two of Newton's steps from the line between the ends: exact to 1e-4 where the cubic is steep.
    let line = b / (b - c);
    let near = line - value(line) / slope(line);
    let found = near - value(near) / slope(near);
    if slope(line) < STEEP && slope(near) < STEEP && (0.0..=1.0).contains(&found) {
        return found;
    }
    let (mut low, mut high, mut t) = (0.0, 1.0, line);
    for _ in 0..10 {
        (low, high) = if value(t) >= 0.0 { (t, high) } else { (low, t) };
        let next = t - value(t) / slope(t);
        // Newton's step, or half way where that leads out.
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        if (next - t).abs() < 3e-4 {
            return next;
        }
        t = next;
    }
    t
}

/// The slope of a field at a cell, HU a cell.
pub(crate) fn slope(solid: &impl Solid, field: Field, cell: IVec3) -> Vec3 {
    let near = |step: IVec3| solid.over(field, cell + step);
    0.5 * Vec3::new(
        near(IVec3::X) - near(IVec3::NEG_X),
        near(IVec3::Y) - near(IVec3::NEG_Y),
        near(IVec3::Z) - near(IVec3::NEG_Z),
    )
}

/// The Catmull-Rom cubic through `b` at 0 and `c` at 1, with `a` and `d` before and after, at `t`.
pub(crate) fn cubic([a, b, c, d]: [f32; 4], t: f32) -> f32 {
    let [one, two, three] = coefficients([a, b, c, d]);
    b + t * (one + t * (two + t * three))
}

/// Its coefficients of t, t² and t³.
fn coefficients([a, b, c, d]: [f32; 4]) -> [f32; 3] {
    [0.5 * (c - a), 0.5 * (2.0 * a - 5.0 * b + 4.0 * c - d), 0.5 * (3.0 * (b - c) + d - a)]
}
