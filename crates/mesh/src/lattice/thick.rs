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

/// Distances in a label volume from each label but the most frequent to other labels.
pub(super) struct Thickness {
    host: u16,
    /// First voxel of the box that holds all labels, and the labels there.
    low: [usize; 3],
    here: VoxelVolume<u16>,
    /// By label, mm.
    to_others: Vec<(u16, Vec<f32>)>,
}

/// More than what a distance is rounded by, mm.
const SPARE_MM: f32 = 0.1;

/// Where balls have one radius: from one distance to another from the finer region, mm.
struct Scale {
    from_mm: f64,
    to_mm: f64,
    radius_mm: f64,
}

impl Thickness {
    pub(super) fn of(labels: &VoxelVolume<u16>) -> Self {
        let blocks = Block::of_each(labels);
        let most = |(label, block): &&(u16, Block)| (block.voxels, u16::MAX - label);
        let host = blocks.iter().max_by_key(most).map_or(0, |(label, _)| *label);
        let whole = blocks.iter().fold(blocks[0].1, |whole, (_, block)| whole.with(block));
        let here = cropped(labels, whole.low, whole.high);
        let distance = |(label, _): &(u16, Block)| {
            let others = here.map(|found| u8::from(found != 0 && found != *label));
            (*label, DistanceField::of_mask(&others).into_values().data)
        };
        let to_others = blocks.iter().filter(|(label, _)| *label != host).map(distance).collect();
        Self { host, low: whole.low, here, to_others }
    }

    /// Labels with borders of their own on a lattice of `spacing` mm, and the host in place of
    /// others.
    pub(super) fn borders(&self, labels: &VoxelVolume<u16>, config: &Config, spacing: f64) -> VoxelVolume<u16> {
        let mut borders = labels.map(|label| if label == 0 { 0 } else { self.host });
        for (label, to_others) in &self.to_others {
            for scale in scales(config, spacing) {
                self.add_core((*label, to_others), config, &scale, &mut borders);
            }
        }
        borders
    }

    /// Adds the core of one label at one scale.
    fn add_core(
        &self,
        (label, to_others): (u16, &[f32]),
        config: &Config,
        scale: &Scale,
        borders: &mut VoxelVolume<u16>,
    ) {
        let spacing_mm = self.here.spacing_mm();
        let away = |place: DVec3| {
            config.fine.map_or(0.0, |fine| place.distance(fine.centre.as_dvec3()) - f64::from(fine.radius_mm))
        };
        let is_centre = |at: &usize| self.here.data[*at] == label && f64::from(to_others[*at]) >= scale.radius_mm;
        let voxel = |dims: [usize; 3], at: usize| [at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])];
        // Balls that reach into the scale's region.
        let reaches = |at: &[usize; 3]| away(self.here.centre_of(*at)) <= scale.to_mm + scale.radius_mm;
        let centres = (0..self.here.data.len()).filter(is_centre).map(|at| voxel(self.here.dims, at)).filter(reaches);
        let bounds = centres.fold(None, |bounds: Option<[[usize; 3]; 2]>, at| {
            let [low, high] = bounds.unwrap_or([at; 2]);
            Some([[0, 1, 2].map(|d| low[d].min(at[d])), [0, 1, 2].map(|d| high[d].max(at[d]))])
        });
        let Some([low, high]) = bounds else { return };
        // A ball of voxels is rounder than a ball by half of one.
        let reach_mm = scale.radius_mm + 0.5 * spacing_mm.length();
        let reach = (reach_mm / spacing_mm).ceil().to_array().map(|n| n as usize + 1);
        let low = [0, 1, 2].map(|d| low[d].saturating_sub(reach[d]));
        let high = [0, 1, 2].map(|d| (high[d] + reach[d]).min(self.here.dims[d] - 1));
        let part = cropped(&self.here, low, high);
        let in_whole = |at: usize| {
            let at = voxel(part.dims, at);
            self.here.index([0, 1, 2].map(|d| low[d] + at[d]))
        };
        let mut centres = part.map(|_| 0u8);
        centres.data.iter_mut().enumerate().for_each(|(at, is)| *is = u8::from(is_centre(&in_whole(at))));
        let core = DistanceField::of_mask_within(&centres, reach_mm as f32 + SPARE_MM);
        for at in (0..part.data.len()).filter(|at| part.data[*at] == label) {
            let place = voxel(part.dims, at);
            let away = away(part.centre_of(place));
            let is_here = away > scale.from_mm && away <= scale.to_mm;
            if is_here && f64::from(core.values().data[at]) <= reach_mm {
                let to = borders.index([0, 1, 2].map(|d| self.low[d] + low[d] + place[d]));
                borders.data[to] = label;
            }
        }
    }
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
