//! The elements and nodes of a body, and their passes.

use crate::config::Config;
use crate::dynamic_scaling::DynamicScaling;
use crate::fill::{Fills, RAMP_STEPS};
use crate::force_slots::ForceSlots;
use crate::node_groups::NodeGroups;
use crate::nodes::{Nodes, Update};
use crate::part::{Forcing, Part, PartGroups, Quiet};
use crate::relaxation::Relaxation;
use crate::scaling::Scaling;
use crate::sheet::sheets;
use crate::team::{Team, Work};
use trepan_geometry::Vec3;
use trepan_soft::Body;
use trepan_soft::simd::PassReport;
use trepan_soft::simd::{Layout, kind};
use trepan_soft::simd::{NODES, WIDTH};

/// Elements of a part: enough that gathering is cheap, few enough that its nodes stay in the L1
/// cache.
const PART: usize = 64 * WIDTH;
const _: () = assert!(4 * PART <= NODES);

/// The elements and nodes of a body.
pub(crate) struct Elements {
    team: Team,
    averaged_pressure: bool,
    relaxation: Relaxation,
    dynamic: DynamicScaling,
    still_mm: f32,
    pub fills: Fills,
}

impl Elements {
    pub fn of(
        body: &Body,
        layout: &Layout,
        (scaling, dynamic): (&Scaling, DynamicScaling),
        nodes: Nodes,
        config: &Config,
    ) -> Self {
        let node_groups = NodeGroups::of(body, layout, config.averaged_pressure);
        let inverse_volume =
            if config.averaged_pressure { node_groups.inverse_volumes(body, layout) } else { Vec::new() };
        let sheets = sheets(&body.membrane, layout, PART);
        let of_one_law = layout.tet_at.chunk_by(|&a, &b| kind(body, a) == kind(body, b));
        let tets_of: Vec<&[u32]> = of_one_law.flat_map(|tets| tets.chunks(PART)).collect();
        let groups_of = |t: u32| node_groups.of_tet(body, layout, t);
        let group_at = |node: u32| node_groups.any_at(layout.place_of[node as usize]);
        let corners =
            |sheet: &Vec<u32>| sheet.iter().flat_map(|&t| body.membrane.triangles[t as usize]).collect::<Vec<_>>();
        let groups_of_sheet = |sheet: &Vec<u32>| sorted(corners(sheet).into_iter().map(group_at));
        let of_tets = tets_of.iter().map(|tets| sorted(tets.iter().flat_map(|&t| groups_of(t))));
        let owned: Vec<Vec<u32>> = of_tets.chain(sheets.iter().map(groups_of_sheet)).collect();
        let (force_slots, slots) = ForceSlots::of(&owned, &node_groups, layout.node_at.len(), inverse_volume);
        let places = |groups: &[u32]| groups.iter().map(|&s| node_groups.place_of[s as usize]).collect();
        let mut of_parts = owned.into_iter().zip(slots).map(|(node_groups, slots)| PartGroups {
            places: places(&node_groups),
            node_groups,
            slots,
        });
        let scaling = (scaling, &dynamic);
        let of_tets = tets_of.iter().zip(of_parts.by_ref());
        let mut parts: Vec<Part> =
            of_tets.map(|(tets, groups)| Part::of(body, scaling, tets, &groups_of, groups, config)).collect();
        parts.extend(sheets.iter().zip(of_parts).map(|(sheet, groups)| Part::of_sheet(body, sheet, &group_at, groups)));
        Self {
            fills: Fills::full(body, &tets_of, &sheets, node_groups),
            team: Team::of(parts, nodes, force_slots, config.kernel.resolved(), config.threads),
            averaged_pressure: config.averaged_pressure,
            relaxation: config.relaxation,
            dynamic,
            still_mm: config.still_mm,
        }
    }

    /// Lets every fill above its goal fall by a step.
    pub fn fall(&mut self, body: &Body, layout: &Layout) {
        let (fills, team) = (&mut self.fills, &self.team);
        if fills.falling.is_empty() {
            return;
        }
        let mut falling = std::mem::take(&mut fills.falling);
        for &tet in &falling {
            let filling = fills.fall(tet);
            team.fill(fills.indices[tet as usize], body, tet, filling);
            fills.triangles_on(tet).for_each(|(triangle, index)| team.fill(index, body, triangle, filling));
        }
        for node in falling.iter().flat_map(|&tet| body.mesh.tets[tet as usize]) {
            team.nodes().set_weight(layout.place_of[node as usize] as usize, fills.grams(node));
            if self.averaged_pressure {
                let volumes = fills.volumes(body, layout, node);
                volumes.for_each(|(group, mm3)| team.force_slots().set_volume(group, mm3));
            }
        }
        falling.retain(|&tet| fills.is_falling(tet));
        fills.falling = falling;
    }

    /// Takes lower fills at once.
    pub fn empty_to(&mut self, fills: &[u16], body: &Body, layout: &Layout) {
        (0u32..).zip(fills).for_each(|(tet, &fill)| self.fills.lower(tet, fill));
        (0..RAMP_STEPS).for_each(|_| self.fall(body, layout));
    }

    /// The nodes.
    pub fn nodes(&self) -> &Nodes {
        self.team.nodes()
    }

    /// Averages the volume change by node group, if averaged pressure is on, `dt_ms` after the
    /// last step.
    pub fn volumes(&mut self, dt_ms: f32) {
        if self.averaged_pressure {
            self.team.compute(Work::Volumes(self.quiet(dt_ms)));
            self.team.compute(Work::Average);
        }
    }

    /// Computes every element's forces from the nodes' displacements, `dt_ms` after the last step.
    pub fn forces(&mut self, dt_ms: f32) -> PassReport {
        let Self { averaged_pressure, dynamic, .. } = *self;
        let (fade, quiet) = (self.relaxation.fade(dt_ms), self.quiet(dt_ms));
        self.team.compute(Work::Forces(Forcing { fade, averaged_pressure, dynamic, quiet }));
        self.team.report()
    }

    /// Computes every element's forces from the nodes' displacements after `relaxed_ms` of rest
    /// there; no part sleeps.
    pub fn forces_at_rest(&mut self, relaxed_ms: f32) -> PassReport {
        let still_mm = std::mem::take(&mut self.still_mm);
        self.team.wake();
        self.volumes(relaxed_ms);
        let report = self.forces(relaxed_ms);
        self.still_mm = still_mm;
        report
    }

    /// Adds the mass for stiffened elements to their nodes for the rest of a step, or takes it away
    /// again.
    pub fn weigh(&self, adds: bool) {
        if self.dynamic != DynamicScaling::NONE {
            self.team.weigh(adds);
        }
    }

    fn quiet(&self, dt_ms: f32) -> Quiet {
        Quiet { dt_ms, still_mm: self.still_mm }
    }

    /// Moves the nodes.
    pub fn update(&mut self, update: Update) {
        self.team.compute(Work::Update(update));
    }

    /// Prepares forces that average the accelerations of the coming update over the elements.
    pub fn oppose(&mut self, update: Update) {
        self.team.oppose(update);
    }

    /// Force of the elements on the node at `place`, N.
    pub fn force(&self, place: usize) -> Vec3 {
        self.team.force_slots().force(place).truncate()
    }

    /// Share of the elements that are awake.
    pub fn awake(&self) -> f32 {
        let [all, awake] = self.team.awake();
        awake as f32 / all as f32
    }

    /// Wakes all elements.
    pub fn wake(&mut self) {
        if self.still_mm > 0.0 {
            self.team.wake();
        }
    }

    /// Clears the stress memory.
    pub fn forget(&mut self) {
        self.team.forget();
    }

    /// Exchanges the stress memory with that of elements in the same order; clears it part by part
    /// where they are not.
    pub fn take_memory(&mut self, from: &mut Self) {
        self.team.take_memory(&mut from.team);
    }
}

fn sorted(values: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut values: Vec<u32> = values.collect();
    values.sort_unstable();
    values.dedup();
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_soft::simd::Kernel;
    use trepan_soft::{Fluid, Material, Membrane, boxes};

    #[test]
    fn kernels_give_the_same_bits_for_every_law_and_the_sum_of_all_forces_vanishes() {
        let mesh = boxes::split_box([3, 2, 3], Vec3::new(24.0, 16.0, 20.0));
        let stiff = Material::StVenantKirchhoff { young_mpa: 0.003, poisson: 0.45, density_g_mm3: 1e-3 };
        let mooney = Material::MooneyRivlin { c10_mpa: 3e-4, c01_mpa: 2e-4, poisson: 0.45, density_g_mm3: 1e-3 };
        let stiffening =
            Material::Stiffening { shear_mpa: 1e-3, share: 0.4, bound: 0.02, poisson: 0.45, density_g_mm3: 1e-3 };
        for material in [Material::BRAIN, stiff, mooney, Material::BRAIN_OGDEN, stiffening] {
            let body = Body::uniform(mesh.clone(), vec![], material);
            for (averaged, relaxation) in
                [(false, Relaxation::NONE), (true, Relaxation::NONE), (true, Relaxation::BRAIN)]
            {
                compare(&body, averaged, relaxation);
            }
        }
        let mut mixed = Body::uniform(mesh, vec![], Material::BRAIN);
        mixed.materials.extend([stiff, mooney, Material::BRAIN_OGDEN, stiffening]);
        mixed.material_of_tet.iter_mut().enumerate().for_each(|(t, m)| *m = (t * 7 % 5) as u8);
        let triangles = trepan_mesh::Surface::of(&mixed.mesh).triangles;
        mixed.membrane = Membrane { triangles, shear_n_per_mm: 0.1 };
        compare(&mixed, false, Relaxation::NONE);
        compare(&mixed, true, Relaxation::BRAIN);
    }

    fn compare(body: &Body, averaged: bool, relaxation: Relaxation) {
        let layout = Layout::of(body);
        let noise = |i: usize| ((i as f32 * 12.9898).sin() * 43758.547).fract() * 3.0;
        let count = layout.node_at.len();
        let forces = |kernel: Kernel, threads: usize| {
            let nodes = Nodes::of(body, &layout, &body.lumped_masses_g(), None);
            (0..count).for_each(|n| nodes.set(n, Vec3::from([3 * n, 3 * n + 1, 3 * n + 2].map(noise)), Vec3::ZERO));
            let config = Config { kernel, averaged_pressure: averaged, relaxation, threads, ..Config::default() };
            let scaling = Scaling::of(body, 0.0);
            let dynamic = DynamicScaling {
                limit: 0.1 * scaling.stiffest as f32,
                stiffest: scaling.stiffest as f32,
                most: 4.0,
                averages: false,
            };
            let mut elements = Elements::of(body, &layout, (&scaling, dynamic), nodes, &config);
            let mut compute = || {
                elements.volumes(0.7);
                elements.forces(0.7)
            };
            let report = (0..3).map(|_| compute()).last();
            let free = Update {
                dt_ms: 1.0,
                kick_ms: 1.0,
                damping_per_ms: 0.0,
                gravity: Vec3::ZERO,
                fluid: Fluid::default(),
                max_speed: 1.0,
                max_displacement_mm: 1.0,
                rigid: None,
                calm_mm: 0.0,
            };
            elements.weigh(true);
            let masses: Vec<f32> =
                (0..count).map(|place| elements.nodes().present_inverse_mass(place, &free)).collect();
            assert!((0..count).any(|n| masses[n] != elements.nodes().inverse_mass.get(n)));
            elements.weigh(false);
            assert!(
                (0..count)
                    .all(|n| elements.nodes().present_inverse_mass(n, &free) == elements.nodes().inverse_mass.get(n))
            );
            (report, masses, (0..count).map(|place| elements.force(place).to_array()).collect::<Vec<_>>())
        };
        let scalar = forces(Kernel::Scalar, 1);
        for kernel in Kernel::all().into_iter().filter(|k| k.runs_here()) {
            for threads in [1, 2, 3] {
                assert_eq!(scalar, forces(kernel, threads), "{} {threads} {:?}", kernel.name(), body.materials);
            }
        }
        let total: Vec3 = scalar.2.iter().map(|f| Vec3::from_array(*f)).sum();
        let largest = scalar.2.iter().flatten().fold(0.0f32, |m, f| m.max(f.abs()));
        assert!(largest > 0.0 && total.length() < 1e-5 * largest, "{total} {largest}");
    }
}
