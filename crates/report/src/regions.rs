//! Forces on the brain by region: the tissue under the tool and the side of the head.
//!
//! # Theory
//! The point under the tool's ball is projected along the contact normal to the brain's surface at
//! rest. A tick with force counts for the tissue class 1 mm below that point, or of the nearest
//! brain tissue within 4 mm along the normal. A region's impulse is `∫ F dt`. Tissue displaced
//! sideways is not followed: its force counts for the neighbouring region.
//!
//! # When not to use it
//! For functional regions: there is no atlas.

use serde::Serialize;
use trepan_geometry::{Tool, Vec3};
use trepan_link::wire::TickRecord;
use trepan_patient::RestBrain;
use trepan_patient::TissueClass;
use trepan_volume::DistanceField;

/// Force on one region over time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Region {
    /// Side and tissue, as in `right grey`.
    pub name: String,
    /// Time under force, s.
    pub seconds: f64,
    /// Force summed over time, N s.
    pub impulse_n_s: f64,
    /// Largest force, N.
    pub peak_n: f32,
}

/// Depths below the surface at which brain tissue is searched for, mm, in this order.
const DEPTHS_MM: [f32; 5] = [1.0, 0.0, 2.0, 3.0, 4.0];
/// Longest time that counts for one tick, s.
const MAX_TICK_S: f64 = 0.1;

/// Returns the regions that were pressed, largest impulse first.
pub fn regions(brain: &RestBrain, tray: &[Tool], ticks: &[TickRecord]) -> Vec<Region> {
    let middle = brain.mesh.bounds().centre().x;
    let mut all: Vec<Region> = Vec::new();
    for pair in ticks.windows(2).filter(|pair| pair[1].tissue_depth_mm > 0.0 && pair[1].phase == 1) {
        let (before, tick) = (&pair[0], &pair[1]);
        let (place, normal) = (touched(&brain.field, tray, tick), tick.tissue_normal());
        let Some(class) = DEPTHS_MM.iter().find_map(|mm| class_at(brain, place - *mm * normal)) else { continue };
        let side = if place.x > middle { "right" } else { "left" };
        let name = format!("{side} {}", class.name());
        let at = all.iter().position(|region| region.name == name).unwrap_or_else(|| {
            all.push(Region { name, seconds: 0.0, impulse_n_s: 0.0, peak_n: 0.0 });
            all.len() - 1
        });
        let seconds = (1e-3 * (tick.time_ms - before.time_ms)).clamp(0.0, MAX_TICK_S);
        let force = tick.tissue_n();
        let region = &mut all[at];
        region.seconds += seconds;
        region.impulse_n_s += seconds * f64::from(force);
        region.peak_n = region.peak_n.max(force);
    }
    all.sort_by(|a, b| b.impulse_n_s.total_cmp(&a.impulse_n_s));
    all
}

/// Returns the point of the brain at rest that a tick touches, world mm.
pub fn touched(brain: &DistanceField, tray: &[Tool], tick: &TickRecord) -> Vec3 {
    let radius_mm = tray.get(usize::from(tick.tool)).map_or(0.0, |tool| tool.tip_radius_mm);
    let normal = tick.tissue_normal();
    let under = tick.proxy.translation - radius_mm * normal;
    under - brain.sample(under).min(0.0) * normal
}

fn class_at(brain: &RestBrain, place: Vec3) -> Option<TissueClass> {
    let voxel = brain.classes.world_from_voxel.inverse().transform_point3(place.as_dvec3()).round();
    let inside = voxel.cmpge(glam::DVec3::ZERO).all();
    let code = inside.then(|| brain.classes.get(voxel.as_usizevec3().to_array())).flatten()?;
    TissueClass::ALL.into_iter().find(|class| class.code() == code)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use trepan_geometry::{Pose, Wrench};
    use trepan_volume::VoxelVolume;

    #[test]
    fn a_press_counts_for_the_tissue_below_and_its_side() {
        let mut classes = VoxelVolume::isotropic([20; 3], Vec3::splat(-9.5), 1.0, TissueClass::White.code());
        classes.data[20 * 20 * 10..].fill(TissueClass::Grey.code());
        classes.data[20 * 20 * 15..].fill(0);
        classes.data.iter_mut().step_by(20).for_each(|code| *code = 0);
        let mut mesh = trepan_soft::boxes::split_box([2; 3], Vec3::splat(18.0));
        mesh.positions.iter_mut().for_each(|p| *p -= 9.0);
        let field = Arc::new(DistanceField::of_mask(&classes));
        let mri = classes.map(f32::from);
        let brain =
            RestBrain { mesh, class_of_tet: vec![], mixtures: vec![], fixed: vec![], field, classes, mri, tint: None };
        let press = |ms: u16, x: f32, z: f32, newton: f32| TickRecord {
            time_ms: f64::from(ms),
            proxy: Pose::from_translation(Vec3::new(x, 0.0, z)),
            contact_normal: Vec3::Z,
            tissue_depth_mm: 1.0,
            wrench: Wrench { force: newton * Vec3::Z, torque: Vec3::ZERO },
            phase: 1,
            ..TickRecord::default()
        };
        let ticks = [
            press(0, 5.0, 6.0, 0.2),
            press(20, 5.0, 6.0, 0.2),
            press(40, 5.0, 6.0, 0.4),
            TickRecord { contact_normal: Vec3::NEG_X, ..press(60, -11.0, -5.0, 0.3) },
            TickRecord { tissue_depth_mm: 0.0, ..press(80, 5.0, 6.0, 9.0) },
        ];
        let pressed = regions(&brain, &[Tool::probe(2.0)], &ticks);
        let names: Vec<&str> = pressed.iter().map(|r| r.name.as_str()).collect();
        assert_eq!(names, ["right grey", "left white"]);
        assert!((pressed[0].seconds - 0.04).abs() < 1e-9 && (pressed[0].impulse_n_s - 0.012).abs() < 1e-6);
        assert_eq!((pressed[0].peak_n, pressed[1].peak_n), (0.4, 0.3));
    }
}
