//! The elements of a body and what the nodes get of them.

use crate::block::{Quad, WIDTH};
use crate::config::Config;
use crate::kernel::{Found, Kernel};
use crate::layout::{Layout, kind};
use crate::part::{Now, Part, Work};
use crate::relaxation::Relaxation;
use crate::scaling::Scaling;
use crate::seats::Seats;
use crate::team::Team;
use trepan_soft::Body;

/// Elements of a part: enough that adding up its sums is cheap, few enough that its nodes stay in the fastest cache.
const PART: usize = 64 * WIDTH;

/// The elements of a body and their latest forces on the nodes.
pub(crate) struct Elements {
    team: Team,
    /// By place: force on the node, N.
    sums: Vec<Quad>,
    /// By seat: mean `J - 1` around it.
    swelling: Vec<f32>,
    /// By seat, where locking is cured.
    inverse_volume: Vec<f32>,
    kernel: Kernel,
    cure_locking: bool,
    relaxation: Relaxation,
}

impl Elements {
    pub fn of(body: &Body, layout: &Layout, scaling: &Scaling, config: &Config) -> Self {
        let seats = Seats::of(body, layout, config.cure_locking);
        let inverse_volume = if config.cure_locking { seats.inverse_volumes(body, layout) } else { Vec::new() };
        let of_one_law = layout.tet_at.chunk_by(|&a, &b| kind(body, a) == kind(body, b));
        let part = |tets: &[u32]| Part::of(body, layout, &seats, scaling, tets, &config.relaxation);
        let parts = of_one_law.flat_map(|tets| tets.chunks(PART)).map(part).collect();
        let places = layout.node_at.len();
        Self {
            team: Team::of(parts, places, inverse_volume.len(), config.threads),
            sums: vec![[0.0; 4]; places],
            swelling: vec![0.0; inverse_volume.len()],
            inverse_volume,
            kernel: config.kernel.resolved(),
            cure_locking: config.cure_locking,
            relaxation: config.relaxation,
        }
    }

    /// Both passes over the elements.
    pub fn compute(&mut self, u: &[Quad], dt_ms: f32) -> Found {
        self.average_volumes(u);
        self.find_forces(u, dt_ms)
    }

    /// Computes every element's forces from displacements by place, `dt_ms` after the last time.
    pub fn find_forces(&mut self, u: &[Quad], dt_ms: f32) -> Found {
        let forces = Work::Forces { fade: self.relaxation.fade(dt_ms), cure_locking: self.cure_locking };
        self.team.compute(self.kernel, forces, Now { u, swelling: &self.swelling });
        self.sum()
    }

    /// Averages the volume change by seat, where locking is cured.
    pub fn average_volumes(&mut self, u: &[Quad]) {
        if !self.cure_locking {
            return;
        }
        let swelling = &mut self.swelling;
        self.team.compute(self.kernel, Work::Volumes, Now { u, swelling });
        swelling.fill(0.0);
        self.team.each(|part| part.add_shares_to(swelling));
        swelling.iter_mut().zip(&self.inverse_volume).for_each(|(swelling, inverse)| *swelling *= inverse);
    }

    /// Force of the elements on the node at `place`, N.
    #[inline(always)]
    pub fn force(&self, place: usize) -> glam::Vec3 {
        let [x, y, z, _] = self.sums[place];
        glam::Vec3::new(x, y, z)
    }

    /// Forgets past stress.
    pub fn forget(&mut self) {
        self.team.each(Part::forget);
    }

    fn sum(&mut self) -> Found {
        let (sums, mut all) = (&mut self.sums, Found::default());
        sums.fill([0.0; 4]);
        self.team.each(|part| {
            part.add_to(sums);
            all.inverted += part.found.inverted;
            all.stiffest = all.stiffest.max(part.found.stiffest);
        });
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;
    use trepan_soft::{Material, boxes};

    #[test]
    fn kernels_give_the_same_bits_for_every_law_and_the_sum_of_all_forces_vanishes() {
        let mesh = boxes::split_box([3, 2, 3], Vec3::new(24.0, 16.0, 20.0));
        let stiff = Material::StVenantKirchhoff { young_mpa: 0.003, poisson: 0.45, density_g_mm3: 1e-3 };
        let mooney = Material::MooneyRivlin { c10_mpa: 3e-4, c01_mpa: 2e-4, poisson: 0.45, density_g_mm3: 1e-3 };
        for material in [Material::BRAIN, stiff, mooney, Material::BRAIN_OGDEN] {
            let body = Body::uniform(mesh.clone(), vec![], material);
            for (cure, relaxation) in [(false, Relaxation::NONE), (true, Relaxation::NONE), (true, Relaxation::BRAIN)] {
                compare(&body, cure, relaxation);
            }
        }
        let mut mixed = Body::uniform(mesh, vec![], Material::BRAIN);
        mixed.materials.extend([stiff, mooney, Material::BRAIN_OGDEN, Material::TUMOUR]);
        mixed.material_of_tet.iter_mut().enumerate().for_each(|(t, m)| *m = (t * 7 % 5) as u8);
        compare(&mixed, false, Relaxation::NONE);
        compare(&mixed, true, Relaxation::BRAIN);
    }

    fn compare(body: &Body, cure: bool, relaxation: Relaxation) {
        let layout = Layout::of(body);
        let noise = |i: usize| ((i as f32 * 12.9898).sin() * 43758.547).fract() * 3.0;
        let count = layout.node_at.len();
        let forces = |kernel: Kernel, threads: usize| {
            let u: Vec<Quad> = (0..count).map(|n| [noise(3 * n), noise(3 * n + 1), noise(3 * n + 2), 0.0]).collect();
            let mut elements = Elements::of(
                body,
                &layout,
                &Scaling::of(body, 0.0),
                &Config { kernel, cure_locking: cure, relaxation, threads, ..Config::default() },
            );
            let found = (0..3).map(|_| elements.compute(&u, 0.7)).last();
            (found, (0..count).map(|place| elements.force(place).to_array()).collect::<Vec<_>>())
        };
        let scalar = forces(Kernel::Scalar, 1);
        for kernel in Kernel::all().into_iter().filter(|k| k.runs_here()) {
            for threads in [1, 2, 3] {
                assert_eq!(scalar, forces(kernel, threads), "{} {threads} {:?}", kernel.name(), body.materials);
            }
        }
        let total: Vec3 = scalar.1.iter().map(|f| Vec3::from_array(*f)).sum();
        let largest = scalar.1.iter().flatten().fold(0.0f32, |m, f| m.max(f.abs()));
        assert!(largest > 0.0 && total.length() < 1e-5 * largest, "{total} {largest}");
    }
}
