//! The drilled skull in the scanner's voxels: the CT as read, with air where bone was removed; and
//! on the nodes of the cut.
//!
//! # Theory
//! `r` is the removed share of the bone of a CT voxel, `V' = V + r (air - V)`. It is counted at
//! points spread evenly through the voxel, four a node near the cut, each looked up in the carved
//! grid and in the cut. Dense voxels without bone in the carved grid, such as partly filled voxels
//! at the rim of a piece and marrow within it, take the share of the nearest bone:
//!
//! ```text
//! r = gone / (gone + left)                   where the carved grid has bone
//! r = that of the nearest such voxel         where V ≥ 100 HU, along such voxels, within 3 mm
//! r = 0                                      elsewhere: soft tissue is unchanged
//! ```
//!
//! # Practice
//! Only a box around the removed bone is computed: a second for a large flap. On the nodes a skull
//! of 1 mm has eight times its voxels.

use crate::summary::RemovedLabel;
use glam::{DVec3, IVec3, USizeVec3};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use trepan_bone::{BetweenScratch, BoneVolume, cut_depth};
use trepan_geometry::Vec3;
use trepan_volume::{AIR_HU, VoxelVolume};

/// A numerical parameter: density from which a voxel may hold some bone, HU, above soft tissue.
const DENSE_HU: i16 = 100;
/// Largest distance at which a dense voxel takes the share of the nearest bone, mm.
const REACH_MM: f64 = 3.0;
/// Largest number of points along an edge of a voxel.
const MAX_POINTS: f64 = 24.0;
/// A numerical parameter: steepness with which the cut lowers densities on its nodes, HU a node.
const RAMP_HU: f32 = 500.0;
/// Margin of bone around what was removed, mm.
const MARGIN_MM: f64 = 2.0;

/// The drilled skull in the scanner's voxels.
#[derive(Clone, Debug)]
pub struct Drilled {
    /// Its densities, HU.
    pub densities: VoxelVolume<i16>,
    /// 1 where half or more of a voxel of bone, by the isovalue, was removed, else 0.
    pub removed: VoxelVolume<u8>,
}

impl Drilled {
    /// Number and volume of the voxels that are marked as removed.
    pub fn label(&self) -> RemovedLabel {
        let voxels = self.removed.data.iter().filter(|label| **label != 0).count();
        RemovedLabel { voxels, label_mm3: voxels as f64 * self.removed.world_from_voxel.matrix3.determinant().abs() }
    }
}

/// Removes from a CT the bone that was removed since it was scanned.
pub fn drilled(mut ct: VoxelVolume<i16>, bone: &BoneVolume) -> Drilled {
    let mut removed = VoxelVolume::filled(ct.dims, ct.world_from_voxel, 0u8);
    let Some((low, high)) = gone_box(bone) else { return Drilled { densities: ct, removed } };
    let part = Part::of(&ct, low, high);
    let mut shares: Vec<Option<f32>> = part.voxels().map(|voxel| share(&ct, voxel, bone)).collect();
    spread(&ct, &part, &mut shares);
    for (voxel, share) in part.voxels().zip(shares) {
        let at = ct.index(voxel.to_array());
        let (hu, share) = (f32::from(ct.data[at]), share.unwrap_or(0.0));
        removed.data[at] = u8::from(share >= 0.5 && ct.data[at] >= bone.isovalue());
        ct.data[at] = (hu + share * (f32::from(AIR_HU) - hu).min(0.0)).round() as i16;
    }
    Drilled { densities: ct, removed }
}

/// The bone that is left, HU on the nodes of the cut. The CT between its voxels lies under a ramp
/// through the isovalue at the cut.
pub fn on_nodes(bone: &BoneVolume) -> VoxelVolume<i16> {
    nodes_within(bone, IVec3::ZERO, bone.cut_nodes() * (IVec3::from(bone.dims().map(|n| n as i32)) - 1))
}

/// The same around the bone that was removed; `None` if nothing was.
pub fn on_nodes_around(bone: &BoneVolume) -> Option<VoxelVolume<i16>> {
    let (low, high) = gone_box(bone)?;
    let node = |place: DVec3| bone.node_at(place.as_vec3()).round().as_ivec3();
    let last = bone.cut_nodes() * (IVec3::from(bone.dims().map(|n| n as i32)) - 1);
    let (low, high) = (node(low - MARGIN_MM), node(high + MARGIN_MM));
    Some(nodes_within(bone, low.clamp(IVec3::ZERO, last), high.clamp(IVec3::ZERO, last)))
}

fn nodes_within(bone: &BoneVolume, low: IVec3, high: IVec3) -> VoxelVolume<i16> {
    let size = high - low + 1;
    let origin = bone.origin() + bone.node_mm() * low.as_vec3();
    let mut volume = VoxelVolume::isotropic(size.to_array().map(|n| n as usize), origin, bone.node_mm(), AIR_HU);
    let (mut scratch, layer) = (BetweenScratch::new(size.max_element() as usize), size.with_z(1));
    // Two layers of voxels serve the layers of nodes between them.
    let thick = bone.cut_nodes();
    let mut cut = vec![0; (layer.element_product() * thick) as usize];
    for z in (0..size.z).step_by(thick as usize) {
        let (low, size) = (low + z * IVec3::Z, size.with_z(thick.min(size.z - z)));
        let values = &mut volume.data[(layer.element_product() * z) as usize..][..size.element_product() as usize];
        bone.read_between(low, size, &mut scratch, values);
        bone.read_cut(low, size, &mut cut);
        for (hu, &value) in values.iter_mut().zip(&cut).filter(|(_, value)| **value != 0) {
            // What was cut is under the isovalue, and on its surface by the least.
            let under = (RAMP_HU * cut_depth(value)).round() as i32;
            let most = i32::from(bone.isovalue()) - if cut_depth(value) >= 0.0 { under.max(1) } else { under };
            *hu = (*hu).min(most.clamp(AIR_HU.into(), i16::MAX.into()) as i16);
        }
    }
    volume
}

/// Returns whether the bone at a place of the carved grid is gone; `None` where it had no bone.
fn is_gone(was: i16, is: i16, cut: bool, isovalue: i16) -> Option<bool> {
    match was {
        _ if was >= isovalue => Some(cut || is < isovalue),
        _ if was >= DENSE_HU && (cut || is < DENSE_HU) => Some(true),
        _ => None,
    }
}

/// Whether a world point was cut, by a Catmull-Rom spline between the nodes: linear, a bore of
/// 1.5 mm would lose a tenth.
fn is_cut(bone: &BoneVolume, point: Vec3) -> bool {
    let at = bone.node_at(point);
    let depth = |node: IVec3| cut_depth(bone.cut_at(node));
    let nearest = depth(at.round().as_ivec3());
    if nearest.abs() > 1.5 {
        return nearest > 0.0;
    }
    let (low, t) = (at.floor().as_ivec3(), at - at.floor());
    let [t2, t3] = [t * t, t * t * t];
    let weights = [-0.5 * t + t2 - 0.5 * t3, 1.0 - 2.5 * t2 + 1.5 * t3, 0.5 * t + 2.0 * t2 - 1.5 * t3, 0.5 * (t3 - t2)];
    let part = |n: usize| {
        let step = [n % 4, n / 4 % 4, n / 16];
        let weight = weights[step[0]].x * weights[step[1]].y * weights[step[2]].z;
        weight * depth(low + IVec3::from(step.map(|n| n as i32)) - 1)
    };
    (0..64).map(part).sum::<f32>() >= 0.0
}

/// Returns the world corners of a box around the removed bone, mm; `None` if nothing was removed.
fn gone_box(bone: &BoneVolume) -> Option<(DVec3, DVec3)> {
    let [nx, ny, nz] = bone.dims().map(|n| n as i32);
    let (nodes, half) = (bone.cut_nodes(), (bone.cut_nodes() + 1) / 2);
    let is_gone = |place: IVec3| {
        let node = nodes * place;
        let near =
            (-half..=half).flat_map(|z| (-half..=half).flat_map(move |y| (-half..=half).map(move |x| (x, y, z))));
        let cut = bone.is_cut_near(node - half, node + half)
            && near.into_iter().any(|offset| cut_depth(bone.cut_at(node + IVec3::from(offset))) >= 0.0);
        is_gone(bone.scanned(place), bone.ct(place), cut, bone.isovalue()) == Some(true)
    };
    // Bone that was not cut is gone where the CT differs.
    let in_row = |row: i32| {
        let start = IVec3::new(0, row % ny, row / ny);
        let (low, high) = (nodes * start - half, nodes * start.with_x(nx - 1) + half);
        let near = bone.is_cut_near(low, high);
        let is_gone = |x: &i32| {
            let place = start.with_x(*x);
            (near || bone.scanned(place) != bone.ct(place)) && is_gone(place)
        };
        let first = (0..nx).find(is_gone)?;
        let last = (first..nx).rfind(is_gone)?;
        Some([first, last].map(|x| bone.centre_of(start.with_x(x)).as_dvec3()))
    };
    let rows = (0..ny * nz).into_par_iter().filter_map(in_row);
    let ends = rows.map(|[a, b]| (a.min(b), a.max(b)));
    ends.reduce_with(|(low, high), (a, b)| (low.min(a), high.max(b)))
}

/// A box of the CT's voxels.
struct Part {
    low: USizeVec3,
    size: USizeVec3,
}

impl Part {
    /// Voxels within [`REACH_MM`] of a box in world coordinates.
    fn of(ct: &VoxelVolume<i16>, low: DVec3, high: DVec3) -> Self {
        let voxel_of_world = ct.world_from_voxel.inverse();
        let (low, high) =
            (low - REACH_MM - ct.spacing_mm().max_element(), high + REACH_MM + ct.spacing_mm().max_element());
        let corner = |bits: u8| {
            let pick = |axis: usize| if bits >> axis & 1 == 0 { low[axis] } else { high[axis] };
            voxel_of_world.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
        };
        let (first, last) =
            (0..8).map(corner).fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(p), high.max(p)));
        let dims = DVec3::from_array(ct.dims.map(|n| n as f64));
        let first = first.floor().clamp(DVec3::ZERO, dims).as_usizevec3();
        let end = (last.ceil() + 1.0).clamp(DVec3::ZERO, dims).as_usizevec3();
        Self { low: first, size: end.saturating_sub(first) }
    }

    fn voxels(&self) -> impl Iterator<Item = USizeVec3> + use<> {
        let (low, size) = (self.low, self.size);
        (0..size.element_product()).map(move |at| low + Self::place(size, at))
    }

    fn place(size: USizeVec3, at: usize) -> USizeVec3 {
        USizeVec3::new(at % size.x, at / size.x % size.y, at / (size.x * size.y))
    }

    /// Returns the neighbour of the voxel at `at` by a step along an axis.
    fn neighbour(&self, at: usize, step: IVec3) -> Option<usize> {
        let there = Self::place(self.size, at).as_ivec3() + step;
        let inside = there.cmpge(IVec3::ZERO).all() && there.cmplt(self.size.as_ivec3()).all();
        let there = there.as_usizevec3();
        inside.then(|| there.x + self.size.x * (there.y + self.size.y * there.z))
    }
}

/// Returns the share of a voxel's bone that is gone; `None` where the carved grid had none.
fn share(ct: &VoxelVolume<i16>, voxel: USizeVec3, bone: &BoneVolume) -> Option<f32> {
    if ct.data[ct.index(voxel.to_array())] < DENSE_HU {
        return None;
    }
    let middle = ct.centre_of(voxel.to_array()).as_vec3();
    let (node, reach) =
        (bone.node_at(middle).as_ivec3(), (ct.spacing_mm().length() as f32 / bone.node_mm()) as i32 + 1);
    let near = bone.is_cut_near(node - reach, node + reach);
    let between_mm = if near { 0.25 * bone.node_mm() } else { 0.5 * bone.spacing_mm() };
    let parts = (ct.spacing_mm() / f64::from(between_mm)).ceil().clamp(DVec3::ONE, DVec3::splat(MAX_POINTS));
    let [nx, ny, nz] = parts.as_usizevec3().to_array();
    let (mut gone, mut left) = (0u16, 0u16);
    for point in (0..nx * ny * nz).map(|n| DVec3::new((n % nx) as f64, (n / nx % ny) as f64, (n / (nx * ny)) as f64)) {
        let place = ct.world_from_voxel.transform_point3(voxel.as_dvec3() + (point + 0.5) / parts - 0.5);
        let place = place.as_vec3();
        let at = bone.voxel_of(place);
        match is_gone(bone.scanned(at), bone.ct(at), near && is_cut(bone, place), bone.isovalue()) {
            Some(true) => gone += 1,
            Some(false) => left += 1,
            None => {}
        }
    }
    (gone + left > 0).then(|| f32::from(gone) / f32::from(gone + left))
}

/// Gives dense voxels without a share that of the nearest voxel with one, along dense voxels. At
/// equal distance, remaining bone has priority over removed bone.
fn spread(ct: &VoxelVolume<i16>, part: &Part, shares: &mut [Option<f32>]) {
    let edges = ct.spacing_mm();
    let steps = [(IVec3::X, edges.x), (IVec3::Y, edges.y), (IVec3::Z, edges.z)];
    // Distance in µm, so that the order is that of integers; then the share in thousandths.
    let rank = |mm: f64, share: f32| ((1e3 * mm) as u32, (1e3 * share) as u32);
    let mut waiting = BinaryHeap::new();
    for (at, share) in shares.iter().enumerate() {
        share.iter().for_each(|share| waiting.push(Reverse((rank(0.0, share.round()), at))));
    }
    let mut reached: Vec<bool> = shares.iter().map(Option::is_some).collect();
    let dense: Vec<bool> = part.voxels().map(|v| ct.data[ct.index(v.to_array())] >= DENSE_HU).collect();
    while let Some(Reverse(((um, share), at))) = waiting.pop() {
        if !std::mem::replace(&mut reached[at], true) {
            shares[at] = Some(1e-3 * share as f32);
        } else if um > 0 {
            continue;
        }
        for (step, edge) in steps.into_iter().flat_map(|(step, edge)| [(step, edge), (-step, edge)]) {
            let far = f64::from(um) * 1e-3 + edge;
            let next = part.neighbour(at, step).filter(|next| !reached[*next] && dense[*next] && far <= REACH_MM);
            next.iter().for_each(|next| waiting.push(Reverse(((rank(far, 0.0).0, share), *next))));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DMat3};
    use trepan_bone::{CUT_STEPS, CUT_SURFACE};
    use trepan_mesh::isosurface;
    use trepan_volume::{Grid, Interpolation, resample};

    /// Makes a plate of bone 6 mm thick with marrow in its middle, in soft tissue. The image is
    /// blurred as by a scanner, on an oblique grid.
    fn ct() -> VoxelVolume<i16> {
        let matrix3 = DMat3::from_rotation_x(0.2) * DMat3::from_diagonal(DVec3::new(-0.6, 0.6, 1.1));
        let affine = DAffine3 { matrix3, translation: DVec3::new(24.0, -22.0, -16.0) };
        let mut ct = VoxelVolume::filled([80, 74, 32], affine, 40i16);
        for at in 0..ct.data.len() {
            let z = ct.centre_of([at % 80, at / 80 % 74, at / (80 * 74)]).z;
            let bone =
                (1.0 - 1.2 * (z.abs() - 3.0)).clamp(0.0, 1.0) - 0.85 * (1.0 - 1.2 * (z.abs() - 1.0)).clamp(0.0, 1.0);
            ct.data[at] = (40.0 + 1300.0 * bone) as i16;
        }
        ct
    }

    #[test]
    fn removed_bone_is_absent_at_a_low_threshold_and_the_rest_is_as_scanned() {
        let ct = ct();
        for spacing_mm in [0.5, 1.0] {
            let before = resample(&ct, &Grid::isotropic_over(&ct, spacing_mm), Interpolation::Cubic, AIR_HU);
            let bone = BoneVolume::new(&before, 400).unwrap();
            let nothing = drilled(ct.clone(), &bone);
            assert!(nothing.densities == ct && nothing.label() == RemovedLabel::default());
            let [nx, ny, nz] = before.dims;
            for (k, j, i) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (k, j, i)))) {
                let voxel = IVec3::new(i as i32, j as i32, k as i32);
                // As lifting a flap does: only voxels that are bone at the isovalue.
                if bone.centre_of(voxel).truncate().abs().max_element() < 8.0 && bone.is_bone(voxel) {
                    bone.set_hu(voxel, AIR_HU);
                }
            }
            let after = drilled(ct.clone(), &bone).densities;
            assert_eq!((after.dims, after.world_from_voxel), (ct.dims, ct.world_from_voxel));
            let (mut bone_within, mut rim) = (0, 0);
            for (at, (was, is)) in ct.data.iter().zip(&after.data).enumerate() {
                let place = ct.centre_of([at % 80, at / 80 % 74, at / (80 * 74)]);
                let across = place.truncate().abs().max_element();
                if across < 8.0 - 0.6 - f64::from(spacing_mm) {
                    assert!(*is < 150, "{is} HU of {was} HU are left at {place}, {spacing_mm} mm");
                    bone_within += usize::from(*was >= 400);
                    rim += usize::from((150..400).contains(was));
                } else if across > 8.0 + 0.6 + f64::from(spacing_mm) + REACH_MM {
                    assert_eq!(is, was, "changed at {place}");
                } else if across > 8.0 + 0.6 + f64::from(spacing_mm) && *was >= 400 {
                    assert_eq!(is, was, "bone changed at {place}");
                }
                assert!(is <= was && (*was >= 100 || is == was));
            }
            assert!(bone_within > 1000 && rim > 500, "{bone_within}, {rim}");
        }
    }

    #[test]
    fn a_voxel_loses_the_share_of_its_bone_that_was_removed() {
        let before = VoxelVolume::isotropic([8; 3], Vec3::splat(-3.5), 1.0, 1000i16);
        let bone = BoneVolume::new(&before, 400).unwrap();
        (0..64).for_each(|n| (0..5).for_each(|z| bone.set_hu(IVec3::new(n % 8, n / 8, z), AIR_HU)));
        let ct = VoxelVolume::isotropic([2; 3], Vec3::splat(-2.0), 4.0, 1000i16);
        let after = drilled(ct, &bone);
        assert_eq!((after.densities.get([0, 0, 0]), after.densities.get([1, 1, 1])), (Some(AIR_HU), Some(500)));
        assert_eq!((after.removed.get([0, 0, 0]), after.removed.get([1, 1, 1])), (Some(1), Some(0)));
        assert_eq!(after.label(), RemovedLabel { voxels: 4, label_mm3: 256.0 });
    }

    /// A block of 1 mm voxels with a bore of 1.5 mm along x, and the bore's axis.
    fn bored() -> (VoxelVolume<i16>, BoneVolume, Vec3) {
        let before = VoxelVolume::isotropic([20; 3], Vec3::ZERO, 1.0, 1000i16);
        let bone = BoneVolume::new(&before, 400).unwrap();
        let axis = Vec3::new(0.0, 9.3, 10.4);
        let last = 19 * bone.cut_nodes();
        let mut writer = bone.cut_writer();
        for node in (0..=last).flat_map(|z| (0..=last).flat_map(move |y| (0..=last).map(move |x| IVec3::new(x, y, z))))
        {
            let depth = (0.75 - (bone.node_mm() * node.as_vec3() - axis).with_x(0.0).length()) / bone.node_mm();
            if depth > -3.0 {
                writer.set(node, CUT_SURFACE + (depth * CUT_STEPS).round() as i16);
            }
        }
        drop(writer);
        (before, bone, axis)
    }

    #[test]
    fn a_bore_thinner_than_two_voxels_takes_its_share_of_each() {
        let (before, bone, axis) = bored();
        let after = drilled(before.clone(), &bone).densities;
        let gone = |at: usize| f64::from(1000 - after.data[at]) / 2000.0;
        // Of one layer across the bore.
        let layer = (0..400).map(|n| gone(10 + 20 * n)).sum::<f64>();
        assert!((layer / (std::f64::consts::PI * 0.5625) - 1.0).abs() < 0.04, "{layer} mm3 of a layer are gone");
        let far = |at: &usize| {
            (before.centre_of([at % 20, at / 20 % 20, at / 400]).as_vec3() - axis).with_x(0.0).length() > 1.7
        };
        assert!((0..8000).filter(far).all(|at| gone(at) == 0.0));
    }

    #[test]
    fn a_bore_on_the_nodes_is_round_closed_and_as_wide_as_the_burr() {
        let (before, bone, axis) = bored();
        let around = on_nodes_around(&bone).unwrap();
        assert!(around.dims[0] == 39 && around.dims[1] < 16 && around.spacing_mm().x == 0.5, "{:?}", around.dims);
        assert!(on_nodes_around(&BoneVolume::new(&before, 400).unwrap()).is_none());
        let mesh = isosurface(&on_nodes(&bone), 400);
        let wall = |p: &Vec3| (*p - axis).with_x(0.0).length();
        let off: Vec<f32> = mesh
            .positions
            .iter()
            .filter(|p| (2.0..17.0).contains(&p.x) && wall(p) < 3.0)
            .map(|p| wall(p) - 0.75)
            .collect();
        let worst = off.iter().fold(0.0f32, |worst, off| worst.max(off.abs()));
        // The distance is taken as linear along a diagonal of 0.71 mm across the bore.
        assert!(
            off.len() > 200 && worst < 0.5 / (8.0 * 0.75) + 1e-3,
            "{worst} mm off the bore at one of {} vertices",
            off.len()
        );
        let sides = || mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let all: std::collections::HashSet<_> = sides().collect();
        assert!(all.len() == 3 * mesh.triangles.len() && sides().all(|(a, b)| all.contains(&(b, a))), "open");
    }
}
