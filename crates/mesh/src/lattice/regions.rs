//! The labels of a volume as smooth functions of world position.
//!
//! # Theory
//! All labels together have a smoothed distance φ₀ (about millimetres, positive inside), and each
//! label has its own, φ. A point is outside where φ₀ + level₀ is negative; otherwise it belongs to
//! the label with the largest φ + level. So regions neither overlap nor leave gaps, whatever the
//! smoothing, and the outer surface is as smooth where two labels meet as elsewhere. Raising level₀
//! moves the outer surface outwards by as much; raising a label's level moves its boundaries by
//! half of that. Levels make up for what flat triangles cut off, which grows with the square of
//! their edge h: in a finer region they count with (h / coarsest h)².
//!
//! # Practice
//! Labels are indexed in ascending order from 1; 0 is the outside. Only the largest 6-connected
//! labelled part is kept.

use super::Fine;
use super::field::{Block, Field};
use crate::MeshError;
use glam::DVec3;
use trepan_volume::{VoxelVolume, largest_component};

/// Most labels in one mesh; a volume with more is taken for an image.
const MOST_LABELS: usize = 255;

/// A partition of space into labels.
pub(super) trait Partition: Sync {
    /// Difference between the values of one label and another at a point.
    fn lead(&self, label: u16, other: u16, p: DVec3) -> f64;

    /// The label of a point.
    fn label_at(&self, p: DVec3) -> u16;

    /// The label of a point that counts as inside.
    fn inner_at(&self, p: DVec3) -> u16;

    /// Of some labels the one with the largest value at a point; the first on a tie.
    fn strongest(&self, among: &[u16], p: DVec3) -> u16 {
        let stronger = |best: u16, &label: &u16| if self.lead(label, best, p) > 0.0 { label } else { best };
        among.iter().skip(1).fold(among[0], stronger)
    }
}

/// The regions of a label volume.
#[derive(Clone)]
pub(super) struct Regions {
    /// The volume's label of each region; the outside first.
    pub(super) names: Vec<u16>,
    /// Volume of each region, mm³; 0 for the outside.
    pub(super) mm3: Vec<f64>,
    /// Offset of each φ, mm; the first is that of all labels together.
    pub(super) levels: Vec<f64>,
    /// World box of all labelled voxels.
    pub(super) bounds: [DVec3; 2],
    /// The distance field of each label, ascending.
    fields: Vec<Field>,
    /// The distance field of all labels together, if there are several.
    union: Option<Field>,
    /// The finer region with its edge, mm.
    fine: Option<(Fine, f64)>,
}

/// Distance from a finer region over the edge of the cubes there, where it is over the finest.
/// Cubes of one size are two deep, and begin where their corners leave the region.
pub(super) const GROWTH: f64 = 3.0;

impl Regions {
    /// All labels as one region, not smoothed, with a margin for smoothing up to `most_mm` (by the
    /// volume, mm³).
    pub(super) fn whole(labels: &VoxelVolume<u16>, most_mm: impl FnOnce(f64) -> f64) -> Self {
        let blocks = Block::of_each(labels);
        let block = blocks.iter().skip(1).fold(blocks[0].1, |whole, (_, block)| whole.with(block));
        let mm3 = block.voxels as f64 * labels.voxel_mm3();
        let field = Field::of(labels, &block, most_mm(mm3), |label| label != 0);
        Self {
            names: vec![0, blocks[0].0],
            mm3: vec![0.0, mm3],
            levels: vec![0.0; 2],
            bounds: block.world_box(labels),
            fields: vec![field],
            union: None,
            fine: None,
        }
    }

    /// These regions, smoothed before, divided by their labels, which are smoothed by `sigma_mm`.
    pub(super) fn divided(self, labels: &VoxelVolume<u16>, sigma_mm: f64) -> Self {
        let blocks = Block::of_each(labels);
        let names = std::iter::once(0).chain(blocks.iter().map(|(name, _)| *name)).collect();
        if blocks.len() == 1 {
            return Self { names, ..self };
        }
        let volume = |(_, block): &(u16, Block)| block.voxels as f64 * labels.voxel_mm3();
        let field = |(name, block): &(u16, Block)| {
            let mut field = Field::of(labels, block, sigma_mm, |label| label == *name);
            field.smooth(sigma_mm);
            field
        };
        let mut levels = vec![0.0; blocks.len() + 1];
        levels[0] = self.levels[0];
        Self {
            names,
            mm3: std::iter::once(0.0).chain(blocks.iter().map(volume)).collect(),
            levels,
            fields: blocks.iter().map(field).collect(),
            union: self.fields.into_iter().next(),
            ..self
        }
    }

    /// Smooths all φ with a Gaussian of `sigma_mm`.
    pub(super) fn smooth(&mut self, sigma_mm: f64) {
        self.fields.iter_mut().chain(&mut self.union).for_each(|field| field.smooth(sigma_mm));
    }

    /// Sets the region with a finer boundary and the edge of its cubes, mm.
    pub(super) fn refine(&mut self, fine: Option<Fine>, edge_mm: f64) {
        self.fine = fine.map(|fine| (fine, edge_mm));
    }

    /// Share of the levels that counts at a point: the squared edge there over the coarsest.
    fn share(&self, p: DVec3) -> f64 {
        self.fine.map_or(1.0, |(fine, edge_mm)| {
            let away = p.distance(fine.centre.as_dvec3()) - f64::from(fine.radius_mm);
            let edges = (away / (GROWTH * edge_mm)).max(1.0);
            (edges / f64::from(1u32 << fine.halvings)).min(1.0).powi(2)
        })
    }

    /// Approximate distance of a point from the nearest boundary, mm, and whether it is outside.
    pub(super) fn depth(&self, p: DVec3) -> (f64, bool) {
        let inside = self.inside(p);
        let (mut first, mut second) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        let labels = if self.union.is_some() && inside > 0.0 { self.names.len() as u16 } else { 1 };
        for label in 1..labels {
            let hold = self.hold(label, p);
            (first, second) = if hold > first { (hold, first) } else { (first, second.max(hold)) };
        }
        let to_label = if labels > 1 { 0.5 * (first - second) } else { f64::INFINITY };
        (inside.abs().min(to_label), inside <= 0.0)
    }

    /// Depth of a point inside all labels together, mm.
    fn inside(&self, p: DVec3) -> f64 {
        self.union.as_ref().unwrap_or(&self.fields[0]).sample(p) + self.share(p) * self.levels[0]
    }

    /// Value of a label at a point inside.
    fn hold(&self, label: u16, p: DVec3) -> f64 {
        self.fields[usize::from(label) - 1].sample(p) + self.share(p) * self.levels[usize::from(label)]
    }
}

impl Partition for Regions {
    fn lead(&self, label: u16, other: u16, p: DVec3) -> f64 {
        match (label, other) {
            (0, 0) => 0.0,
            (0, _) => -self.inside(p),
            (_, 0) => self.inside(p),
            _ => self.hold(label, p) - self.hold(other, p),
        }
    }

    fn label_at(&self, p: DVec3) -> u16 {
        if self.inside(p) <= 0.0 { 0 } else { self.inner_at(p) }
    }

    fn inner_at(&self, p: DVec3) -> u16 {
        let mut best = (f64::NEG_INFINITY, 1);
        for label in (1..self.names.len() as u16).filter(|&label| self.fields[usize::from(label) - 1].contains(p)) {
            let hold = self.hold(label, p);
            if hold > best.0 {
                best = (hold, label);
            }
        }
        best.1
    }
}

/// The largest 6-connected labelled part.
///
/// # Errors
/// If the volume is not one of labels, or has none.
pub(super) fn largest_part(labels: &VoxelVolume<u16>) -> Result<VoxelVolume<u16>, MeshError> {
    check_volume(labels)?;
    let mut labels = labels.clone();
    let part = largest_component(&labels.map(|l| u8::from(l != 0)));
    labels.data.iter_mut().zip(&part.data).for_each(|(label, kept)| *label *= u16::from(*kept));
    match Block::of_each(&labels).len() {
        0 => Err(MeshError::EmptyMask),
        1..=MOST_LABELS => Ok(labels),
        count => {
            let got = format!("{count} labels");
            Err(MeshError::Mask { field: "data", got, wanted: "at most 255 of them; is it an image?" })
        }
    }
}

fn check_volume(labels: &VoxelVolume<u16>) -> Result<(), MeshError> {
    let wanted = labels.dims.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
    if wanted != Some(labels.data.len()) {
        let got = format!("{:?} with {} samples", labels.dims, labels.data.len());
        return Err(MeshError::Mask { field: "dims", got, wanted: "as many samples as the product of the dimensions" });
    }
    let determinant = labels.world_from_voxel.matrix3.determinant();
    if !labels.world_from_voxel.is_finite() || !determinant.is_finite() || determinant.abs() < 1e-12 {
        let got = format!("{:?}", labels.world_from_voxel);
        return Err(MeshError::Mask { field: "world_from_voxel", got, wanted: "finite and invertible" });
    }
    Ok(())
}
