//! The elements of a body and what the nodes get of them.

use crate::block::{Quad, WIDTH};
use crate::config::Config;
use crate::kernel::{Found, Kernel};
use crate::layout::{Layout, kind};
use crate::part::{Part, Work};
use crate::relaxation::Relaxation;
use crate::scaling::Scaling;
use crate::team::Team;
use trepan_soft::Body;

/// Parts for every thread: so many that one can take over from another, so few that summing them stays cheap.
const PARTS_PER_THREAD: usize = 2;

/// The elements of a body and their latest forces on the nodes.
pub(crate) struct Elements {
    team: Team,
    /// By place: force on the node, N.
    sums: Vec<Quad>,
    /// By place: change of the volume around the node, mm³.
    shares: Vec<f32>,
    inverse_volume: Vec<f32>,
    kernel: Kernel,
    cure_locking: bool,
    relaxation: Relaxation,
}

impl Elements {
    pub fn of(body: &Body, layout: &Layout, scaling: &Scaling, config: &Config) -> Self {
        let mut volume = vec![0.0; layout.node_at.len()];
        for (t, tet) in body.mesh.tets.iter().enumerate() {
            tet.iter().for_each(|&n| volume[layout.place_of[n as usize] as usize] += 0.25 * body.mesh.volume_mm3(t));
        }
        let parts = if config.threads > 1 { PARTS_PER_THREAD * config.threads } else { 1 };
        let blocks = layout.tet_at.len().div_ceil(WIDTH).div_ceil(parts);
        let of_one_law = layout.tet_at.chunk_by(|&a, &b| kind(body, a) == kind(body, b));
        let part = |tets: &[u32]| Part::of(body, layout, scaling, tets, &config.relaxation);
        let parts = of_one_law.flat_map(|tets| tets.chunks(blocks * WIDTH)).map(part).collect();
        Self {
            team: Team::of(parts, volume.len(), config.threads),
            sums: vec![[0.0; 4]; volume.len()],
            shares: vec![0.0; volume.len()],
            inverse_volume: volume.iter().map(|v| (1.0 / v) as f32).collect(),
            kernel: config.kernel.resolved(),
            cure_locking: config.cure_locking,
            relaxation: config.relaxation,
        }
    }

    /// Computes every element's forces from displacements by place, `dt_ms` after the last time.
    pub fn compute(&mut self, u: &mut [Quad], dt_ms: f32) -> Found {
        if self.cure_locking {
            self.team.compute(self.kernel, Work::Volumes, u);
            self.shares.fill(0.0);
            self.team.each(|part| part.add_shares_to(&mut self.shares));
            for ((u, share), inverse) in u.iter_mut().zip(&self.shares).zip(&self.inverse_volume) {
                u[3] = share * inverse;
            }
        }
        let forces = Work::Forces { fade: self.relaxation.fade(dt_ms), cure_locking: self.cure_locking };
        self.team.compute(self.kernel, forces, u);
        self.sum()
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
            let mut u: Vec<Quad> =
                (0..count).map(|n| [noise(3 * n), noise(3 * n + 1), noise(3 * n + 2), 0.0]).collect();
            let mut elements = Elements::of(
                body,
                &layout,
                &Scaling::of(body, 0.0),
                &Config { kernel, cure_locking: cure, relaxation, threads, ..Config::default() },
            );
            let found = (0..3).map(|_| elements.compute(&mut u, 0.7)).last();
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
