//! Local changes of shape: thickness of the vault, atrophy, size of the ventricles.
//!
//! # Theory
//! Each is a velocity along the gradient of a distance d. The map takes a point along the flow for
//! unit time:
//!
//! ```text
//! surface moved by m    speed -m · trapezoid(d), 1 between 0 and m, 0 beyond both ends
//! thickness times f     speed -ln(f) · min(d, S), S = 8 mm · (f - 1) / ln(f):   d to d / f
//! ```
//!
//! Trajectories of a continuous velocity field never meet, so the map cannot fold, even at a thin
//! ventricular horn.

use super::base::{Anatomy, smooth};
use super::recipe::HeadRecipe;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::{Add, Mul};
use trepan_volume::{DistanceField, VoxelVolume};

/// Distance from the cavity within which bone changes its thickness, mm: adult vault plus a margin.
const VAULT_MM: f32 = 8.0;
/// Depth in the brain at which atrophy fades out, mm.
const ATROPHY_MM: f32 = 16.0;
/// Distance outside the brain at which atrophy fades out, mm.
const SPACE_MM: f32 = 1.0;
/// Distance outside the ventricles at which their growth fades out, mm.
const AROUND_MM: f32 = 20.0;
/// Depth inside the ventricles at which their growth fades out, mm.
const INSIDE_MM: f32 = 3.0;
/// Number of integration steps of the flow.
const STEPS: usize = 6;

/// Local changes of one head.
pub struct Local {
    intact: Flow,
    with_atrophy: Option<Flow>,
}

impl Local {
    /// Creates the changes of a recipe, scaled by `share`.
    pub fn new(anatomy: &Anatomy, recipe: &HeadRecipe, share: f64) -> Self {
        let share = share as f32;
        let (thickness, ventricles) = (recipe.skull_thickness as f32, share * recipe.ventricles_mm as f32);
        let thickness = 1.0 + share * (thickness - 1.0);
        let mut intact = Flow::still(anatomy);
        if thickness != 1.0 {
            intact.add(&anatomy.cavity, |point| {
                let speed = thickening(1.0 + anatomy.vault(point) as f32 * (thickness - 1.0));
                move |d| speed.of(d)
            });
        }
        if ventricles != 0.0 {
            let speed = Trapezoid { by: ventricles, low: -INSIDE_MM - ventricles.abs(), high: AROUND_MM };
            intact.add(&anatomy.ventricles, |_| move |d| speed.of(d));
        }
        let atrophy = share * recipe.atrophy_mm as f32;
        let with_atrophy = (atrophy > 0.0).then(|| {
            let mut flow = intact.clone();
            let speed = Trapezoid { by: -atrophy, low: -ATROPHY_MM - atrophy, high: SPACE_MM };
            flow.add(&anatomy.brain, |_| move |d| speed.of(d));
            flow
        });
        let smoothed = |mut flow: Flow| {
            flow.smooth();
            flow
        };
        Self { intact: smoothed(intact), with_atrophy: with_atrophy.map(smoothed) }
    }

    /// Maps a point of the head to the base.
    pub fn place(&self, point: DVec3) -> FlowedPoint {
        let intact = self.intact.end(point.as_vec3());
        match &self.with_atrophy {
            Some(flow) => FlowedPoint { base: flow.end(point.as_vec3()), intact: Some(intact) },
            None => FlowedPoint { base: intact, intact: None },
        }
    }
}

/// Position of a point after the flow.
pub struct FlowedPoint {
    /// Point in the base.
    pub base: Vec3,
    /// Point in the base without atrophy, if the recipe has any.
    pub intact: Option<Vec3>,
}

/// Steady velocity field, mm per unit time; zero where empty.
#[derive(Clone)]
struct Flow {
    velocities: VoxelVolume<Vec3>,
    moves: bool,
}

impl Flow {
    fn still(anatomy: &Anatomy) -> Self {
        let grid = anatomy.cavity.values();
        Self { velocities: VoxelVolume::filled(grid.dims, grid.world_from_voxel, Vec3::ZERO), moves: false }
    }

    /// Adds a speed along a distance's gradient; the fields lie on one grid.
    fn add<S: Fn(f32) -> f32>(&mut self, field: &DistanceField, speed_at: impl Fn(DVec3) -> S + Sync) {
        self.moves = true;
        let ([nx, ny, _], world) = (self.velocities.dims, self.velocities.world_from_voxel);
        let distances = &field.values().data;
        self.velocities.data.par_chunks_mut(nx).enumerate().for_each(|(row, values)| {
            for (i, value) in values.iter_mut().enumerate() {
                let point = world.transform_point3(DVec3::new(i as f64, (row % ny) as f64, (row / ny) as f64));
                let speed = speed_at(point)(distances[i + nx * row]);
                if speed != 0.0 {
                    *value += speed * field.gradient(point.as_vec3());
                }
            }
        });
    }

    fn smooth(&mut self) {
        if self.moves {
            smooth(&mut self.velocities);
        }
    }

    /// Position of a point after unit time, by midpoint steps.
    fn end(&self, point: Vec3) -> Vec3 {
        if !self.moves {
            return point;
        }
        let step = 1.0 / STEPS as f32;
        (0..STEPS).fold(point, |p, _| p + step * self.at(p + 0.5 * step * self.at(p)))
    }

    fn at(&self, point: Vec3) -> Vec3 {
        let volume = &self.velocities;
        let (origin, edge) = (volume.world_from_voxel.translation.as_vec3(), volume.spacing_mm().x as f32);
        between(volume, (point - origin) / edge)
    }
}

/// Speed that moves the surface at distance 0 by a given length, mm, and fades out on both sides.
#[derive(Clone, Copy)]
struct Trapezoid {
    by: f32,
    low: f32,
    high: f32,
}

impl Trapezoid {
    fn of(self, distance: f32) -> f32 {
        let (first, last) = (self.by.min(0.0), self.by.max(0.0));
        let rise = (distance - self.low) / (first - self.low);
        let fall = (self.high - distance) / (self.high - last);
        -self.by * rise.min(fall).clamp(0.0, 1.0)
    }
}

/// Speed that scales a distance by a factor within the vault.
#[derive(Clone, Copy)]
struct Thickening {
    log: f32,
    limit_mm: f32,
}

fn thickening(factor: f32) -> Thickening {
    let log = factor.ln();
    Thickening { log, limit_mm: if log.abs() < 1e-3 { VAULT_MM } else { VAULT_MM * (factor - 1.0) / log } }
}

impl Thickening {
    fn of(self, distance: f32) -> f32 {
        -self.log * distance.clamp(0.0, self.limit_mm)
    }
}

/// Trilinear interpolation at continuous indices, clamped to the border.
pub fn between<T: Copy + Add<Output = T> + Mul<f32, Output = T>>(volume: &VoxelVolume<T>, place: Vec3) -> T {
    let last = Vec3::from_array(volume.dims.map(|n| (n - 1) as f32));
    let p = place.clamp(Vec3::ZERO, last);
    let at = p.min(last - 1.0).as_uvec3();
    let f = p - at.as_vec3();
    let [nx, ny, _] = volume.dims;
    let first = at.x as usize + nx * (at.y as usize + ny * at.z as usize);
    let data = &volume.data;
    let line = |from: usize| data[from] * (1.0 - f.x) + data[from + 1] * f.x;
    let plane = |from: usize| line(from) * (1.0 - f.y) + line(from + nx) * f.y;
    plane(first) * (1.0 - f.z) + plane(first + nx * ny) * f.z
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance after flowing for unit time.
    fn end_of_flow(speed: impl Fn(f32) -> f32, from: f32) -> f32 {
        (0..1000).fold(from, |d, _| d + 1e-3 * speed(d))
    }

    #[test]
    fn surfaces_move_as_requested_and_far_points_stay() {
        let near = |a: f32, b: f32| assert!((a - b).abs() < 0.05, "{a} instead of {b}");
        for by in [-4.0, -2.0, 1.0, 6.0] {
            let speed = Trapezoid { by, low: -16.0, high: 18.0 };
            near(end_of_flow(|d| speed.of(d), by), 0.0);
            assert_eq!([-20.0, 20.0].map(|d| end_of_flow(|d| speed.of(d), d)), [-20.0, 20.0]);
            let places: Vec<f32> = (-200..=200).map(|d| end_of_flow(|d| speed.of(d), 0.1 * d as f32)).collect();
            assert!(places.is_sorted_by(|a, b| a < b), "moved by {by}");
        }
        for factor in [0.6, 1.6] {
            let speed = thickening(factor);
            near(end_of_flow(|d| speed.of(d), factor * 6.0), 6.0);
            near(end_of_flow(|d| speed.of(d), 50.0), 50.0 - (factor - 1.0) * VAULT_MM);
            assert_eq!(end_of_flow(|d| speed.of(d), -5.0), -5.0);
        }
    }
}
