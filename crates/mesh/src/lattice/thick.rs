//! Which structures are thick enough for borders of their own.
//!
//! # Theory
//! A lattice of spacing a cannot hold a structure thinner than about two of it. A point belongs to
//! the core of its label if a ball of radius R, centred in the label, contains it and no other
//! label: the morphological opening of the label, where the outside counts as its own (a sheet on
//! the outer surface has one border, and counts as twice as thick). 2 R is the least thickness
//! times the spacing there. The label with the most voxels needs no core: it is what the others lie
//! in. What belongs to no core is one region, with that label.
//!
//! # Sources
//! J. Serra: Image analysis and mathematical morphology, 1982 (opening). T. Hildebrand, P.
//! Rüegsegger: A new method for the model-independent assessment of thickness, J. Microscopy 185,
//! 1997 (thickness by the largest ball).

use super::Config;
use super::field::Block;
use super::regions::GROWTH;
use glam::{DAffine3, DVec3};
use trepan_volume::{DistanceField, VoxelVolume};

/// A distance of the finer region's surface, mm, from which to which balls have one radius.
struct Scale {
    from_mm: f64,
    to_mm: f64,
    radius_mm: f64,
}

/// Labels with borders of their own on a lattice of `spacing` mm, and the host in place of others.
pub(super) fn resolved(labels: &VoxelVolume<u16>, config: &Config, spacing: f64) -> VoxelVolume<u16> {
    let blocks = Block::of_each(labels);
    let host =
        blocks.iter().max_by_key(|(label, block)| (block.voxels, u16::MAX - label)).map_or(0, |(label, _)| *label);
    if config.least_thickness == 0.0 {
        return labels.clone();
    }
    let mut regions = labels.map(|label| if label == 0 { 0 } else { host });
    for (label, block) in blocks.iter().filter(|(label, _)| *label != host) {
        scales(config, spacing).iter().for_each(|scale| add_core(labels, (*label, block), config, scale, &mut regions));
    }
    regions
}

/// Radii of the balls: one for each size of cube, by where they are.
fn scales(config: &Config, spacing: f64) -> Vec<Scale> {
    let halvings = config.fine.map_or(0, |fine| fine.halvings);
    let end = |level: u32| GROWTH * spacing * f64::from(1u32 << level);
    let scale = |level: u32| Scale {
        from_mm: if level == 0 { f64::NEG_INFINITY } else { end(level - 1) },
        to_mm: if level == halvings { f64::INFINITY } else { end(level) },
        radius_mm: 0.5 * config.least_thickness * spacing * f64::from(1u32 << level),
    };
    (0..=halvings).map(scale).filter(|scale| scale.radius_mm.is_finite()).collect()
}

/// Adds the core of one label at one scale to the regions.
fn add_core(
    labels: &VoxelVolume<u16>,
    (label, block): (u16, &Block),
    config: &Config,
    scale: &Scale,
    regions: &mut VoxelVolume<u16>,
) {
    let reach = 2.0 * scale.radius_mm;
    let ball = config.fine.filter(|_| scale.to_mm.is_finite());
    let ball = ball.map(|fine| (fine.centre.as_dvec3(), f64::from(fine.radius_mm) + scale.to_mm));
    let Some((low, high)) = block.near(labels, ball, reach) else { return };
    let here = cropped(labels, low, high);
    let others = here.map(|found| u8::from(found != 0 && found != label));
    let to_others = DistanceField::of_mask(&others);
    let to_others = &to_others.values().data;
    let mut eroded = here.map(|found| u8::from(found == label));
    let is_deep = |at: usize| f64::from(to_others[at]) >= scale.radius_mm;
    eroded.data.iter_mut().enumerate().for_each(|(at, kept)| *kept &= u8::from(is_deep(at)));
    if !eroded.data.contains(&1) {
        return;
    }
    let core = DistanceField::of_mask(&eroded);
    // A ball of voxels is rounder than a ball by half of one.
    let slack_mm = 0.5 * here.spacing_mm().length();
    let [nx, ny, _] = here.dims;
    for (at, _) in here.data.iter().enumerate().filter(|(_, found)| **found == label) {
        let voxel = [at % nx, at / nx % ny, at / (nx * ny)];
        let away =
            |fine: super::Fine| here.centre_of(voxel).distance(fine.centre.as_dvec3()) - f64::from(fine.radius_mm);
        let away = config.fine.map_or(f64::INFINITY, away);
        if f64::from(core.values().data[at]) <= scale.radius_mm + slack_mm
            && away > scale.from_mm
            && away <= scale.to_mm
        {
            let to = regions.index([0, 1, 2].map(|d| low[d] + voxel[d]));
            regions.data[to] = label;
        }
    }
}

/// The voxels from `low` to `high`, inclusive.
fn cropped(labels: &VoxelVolume<u16>, low: [usize; 3], high: [usize; 3]) -> VoxelVolume<u16> {
    let dims = [0, 1, 2].map(|d| high[d] - low[d] + 1);
    let shift = DAffine3::from_translation(DVec3::from_array(low.map(|n| n as f64)));
    let mut part = VoxelVolume::filled(dims, labels.world_from_voxel * shift, 0u16);
    for (row, to) in part.data.chunks_mut(dims[0]).enumerate() {
        let from = labels.index([low[0], low[1] + row % dims[1], low[2] + row / dims[1]]);
        to.copy_from_slice(&labels.data[from..from + dims[0]]);
    }
    part
}
