//! Materials, loads, and the TLED solver of soft tissue.

use crate::arrays::{Any, Array2, nodes, points_out, tet_mesh, vector, within};
use crate::errors::{compute, value};
use crate::tissue::TissueStep;
use glam::Vec3;
use pyo3::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};
use trepan_contact::NodalContact;
use trepan_soft::{Body, Loads as Acting, Membrane, SoftSolver, StepReport as Report};
use trepan_tled::{Config, Damping, Relaxation, Settling};

/// Steps between two looks for Ctrl-C.
const STEPS: u32 = 64;

/// A hyperelastic material; moduli in MPa (3 kPa = 0.003), density in g/mm3 (water 1e-3).
#[pyclass(frozen, module = "trepan._trepan")]
pub struct Material {
    material: trepan_soft::Material,
}

#[pymethods]
impl Material {
    /// Compressible neo-Hookean solid. Raises ``ValueError`` for what is not physical.
    #[staticmethod]
    #[pyo3(signature = (young_mpa, poisson=0.45, density_g_mm3=1e-3))]
    fn neo_hookean(young_mpa: f32, poisson: f32, density_g_mm3: f32) -> PyResult<Self> {
        Self::of(trepan_soft::Material::NeoHookean { young_mpa, poisson, density_g_mm3 })
    }

    /// Stiffening with strain; ``share`` is neo-Hookean, the smaller ``bound`` the stiffer.
    #[staticmethod]
    #[pyo3(signature = (shear_mpa, share, bound, poisson=0.45, density_g_mm3=1e-3))]
    fn stiffening(shear_mpa: f32, share: f32, bound: f32, poisson: f32, density_g_mm3: f32) -> PyResult<Self> {
        Self::of(trepan_soft::Material::Stiffening { shear_mpa, share, bound, poisson, density_g_mm3 })
    }

    #[classattr]
    const BRAIN: Self = Self { material: trepan_soft::Material::BRAIN };

    #[classattr]
    const WHOLE_BRAIN: Self = Self { material: trepan_soft::Material::WHOLE_BRAIN };

    #[classattr]
    const CORTEX: Self = Self { material: trepan_soft::Material::CORTEX };

    #[classattr]
    const CORONA_RADIATA: Self = Self { material: trepan_soft::Material::CORONA_RADIATA };

    #[classattr]
    const TUMOUR: Self = Self { material: trepan_soft::Material::TUMOUR };

    #[getter]
    fn young_mpa(&self) -> f64 {
        self.material.young_mpa()
    }

    #[getter]
    fn poisson(&self) -> f32 {
        self.material.poisson()
    }

    #[getter]
    fn density_g_mm3(&self) -> f32 {
        self.material.density_g_mm3()
    }
}

impl Material {
    fn of(material: trepan_soft::Material) -> PyResult<Self> {
        material.check().map_err(value)?;
        Ok(Self { material })
    }
}

/// What acts on a body: gravity, mm/ms2 (9.81e-3 on Earth), and springs of tools.
#[pyclass(frozen, module = "trepan._trepan")]
pub struct Loads {
    acting: Mutex<Acting>,
}

impl Loads {
    fn acting(&self) -> MutexGuard<'_, Acting> {
        self.acting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Loads {
    #[new]
    #[pyo3(signature = (gravity=None))]
    fn new(gravity: Option<&Any<'_>>) -> PyResult<Self> {
        let gravity = gravity.map_or(Ok(Vec3::ZERO), |gravity| vector(gravity, "gravity"))?;
        Ok(Self { acting: Mutex::new(Acting { gravity, ..Acting::default() }) })
    }

    /// Add a spring that presses on the mean x of up to 64 nodes (n,), along ``-normal``.
    ///
    /// Its depth is ``offset_mm + x . normal``; it pushes with ``stiffness``, N/mm, and
    /// ``damping``, N ms/mm, and never pulls.
    #[pyo3(signature = (nodes, normal, offset_mm, stiffness, damping=0.0))]
    fn press(&self, nodes: &Any<'_>, normal: &Any<'_>, offset_mm: f32, stiffness: f32, damping: f32) -> PyResult<()> {
        let normal =
            vector(normal, "normal")?.try_normalize().ok_or_else(|| value("normal is 0: it needs a length"))?;
        within(offset_mm, "offset_mm", [-1e6, 1e6])?;
        within(stiffness, "stiffness", [0.0, 1e6])?;
        within(damping, "damping", [0.0, 1e6])?;
        let mut spring = NodalContact::none();
        (spring.normal, spring.offset_mm, spring.stiffness, spring.damping) = (normal, offset_mm, stiffness, damping);
        let nodes = crate::arrays::nodes(nodes, "nodes")?;
        nodes.iter().for_each(|&node| spring.add(node, 1.0));
        if spring.overflow > 0 {
            let most = trepan_contact::MAX_NODES;
            return Err(value(format!("nodes names {}, a spring takes {most}: take more springs", nodes.len())));
        }
        spring.normalise();
        self.push([spring])
    }

    /// Add the springs of a collision step.
    fn touch(&self, step: &TissueStep) -> PyResult<()> {
        let mut springs = trepan_contact::NodalContacts::none();
        step.step.springs(&mut springs);
        self.push(springs.iter().copied())
    }

    /// Remove all springs; gravity stays.
    fn clear(&self) {
        self.acting().contacts.clear();
    }

    #[getter]
    fn springs(&self) -> usize {
        self.acting().contacts.len()
    }
}

impl Loads {
    fn push(&self, springs: impl IntoIterator<Item = NodalContact>) -> PyResult<()> {
        let mut acting = self.acting();
        springs.into_iter().for_each(|spring| acting.contacts.push(spring));
        match std::mem::take(&mut acting.contacts.overflow) {
            0 => Ok(()),
            lost => Err(value(format!("{lost} springs are too many; clear() the loads before each contact"))),
        }
    }
}

/// What happened in the steps of a call.
#[pyclass(frozen, get_all, module = "trepan._trepan")]
#[derive(Default)]
pub struct StepReport {
    /// Most elements that were inside out at once.
    inverted: u32,
    non_finite: u32,
    /// Times that a node was held to the limit of speed or way.
    limited: u32,
    substeps: u32,
    /// Time that was asked for and not simulated, ms.
    skipped_ms: f32,
    /// Forces of all springs at the end, N.
    contact_n: f32,
}

impl StepReport {
    fn add(&mut self, report: &Report) {
        self.inverted = self.inverted.max(report.inverted);
        self.non_finite += report.non_finite;
        self.limited += report.limited;
        self.substeps += report.substeps;
        self.skipped_ms += report.skipped_ms;
        self.contact_n = report.contact_n;
    }
}

/// Total Lagrangian explicit dynamics of one body (Miller et al. 2007; ``trepan-tled``).
///
/// ``mesh`` is a ``TetMesh``, ``fixed`` (n,) the nodes that do not move. ``damping`` is a share of
/// critical, ``averaged_pressure`` keeps tetrahedra from locking, ``pia_n_per_mm`` is the shear
/// stiffness of a membrane on the surface. Raises ``ValueError`` for a mesh or setting with a
/// fault.
#[pyclass(frozen, module = "trepan._trepan")]
pub struct Tled {
    solver: Mutex<trepan_tled::Tled>,
    nodes: u32,
}

impl Tled {
    fn solver(&self) -> MutexGuard<'_, trepan_tled::Tled> {
        self.solver.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Calls with the loads, after a look at the nodes that they name.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        loads: &Loads,
        f: impl FnOnce(&mut trepan_tled::Tled, &Acting) -> T + Send,
    ) -> PyResult<T> {
        let called = compute(py, || {
            let acting = loads.acting();
            let mut named = acting.contacts.iter().flat_map(|spring| spring.nodes().map(|(node, _)| node));
            match named.find(|&node| node >= self.nodes) {
                Some(node) => Err(node),
                None => Ok(f(&mut self.solver(), &acting)),
            }
        })?;
        called.map_err(|node| value(format!("the loads press node {node}, but there are only {} nodes", self.nodes)))
    }
}

#[pymethods]
impl Tled {
    #[new]
    #[pyo3(signature = (
        mesh, fixed, material, *, damping=1.0, averaged_pressure=false, mass_scaling=0.0,
        selective_mass_scaling=false, relaxation=false, pia_n_per_mm=0.0, balanced_gravity=None, threads=1,
    ))]
    fn new(
        py: Python<'_>,
        mesh: &Any<'_>,
        fixed: &Any<'_>,
        material: &Material,
        damping: f32,
        averaged_pressure: bool,
        mass_scaling: f32,
        selective_mass_scaling: bool,
        relaxation: bool,
        pia_n_per_mm: f32,
        balanced_gravity: Option<&Any<'_>>,
        threads: usize,
    ) -> PyResult<Self> {
        let mesh = tet_mesh(mesh)?;
        let nodes = mesh.positions.len() as u32;
        let triangles = if pia_n_per_mm == 0.0 { Vec::new() } else { trepan_mesh::Surface::of(&mesh).triangles };
        let membrane = Membrane { triangles, shear_n_per_mm: pia_n_per_mm };
        let fixed = self::nodes(fixed, "fixed")?;
        let body = Body { membrane, ..Body::uniform(mesh, fixed, material.material) };
        let config = Config {
            damping: Damping::Critical(damping),
            averaged_pressure,
            mass_scaling,
            selective_mass_scaling,
            relaxation: if relaxation { Relaxation::BRAIN } else { Relaxation::NONE },
            balanced_gravity: balanced_gravity.map_or(Ok(Vec3::ZERO), |g| vector(g, "balanced_gravity"))?,
            threads,
            ..Config::default()
        };
        let solver = compute(py, || trepan_tled::Tled::new(&body, &config))?.map_err(value)?;
        Ok(Self { solver: Mutex::new(solver), nodes })
    }

    /// Longest stable step with margin, ms.
    #[getter]
    fn stable_dt_ms(&self) -> f32 {
        self.solver().stable_dt_ms()
    }

    /// Advance by ``steps`` of ``dt_ms``, by default the stable step. Ctrl-C ends it between.
    #[pyo3(signature = (loads, dt_ms=None, steps=1))]
    fn step(&self, py: Python<'_>, loads: &Loads, dt_ms: Option<f32>, steps: u32) -> PyResult<StepReport> {
        let dt_ms = dt_ms.unwrap_or_else(|| self.solver().stable_dt_ms());
        within(dt_ms, "dt_ms", [1e-6, 1e3])?;
        let (mut sum, mut left) = (StepReport::default(), steps);
        while left > 0 {
            let now = left.min(STEPS);
            let run = |solver: &mut trepan_tled::Tled, acting: &Acting| {
                (0..now).for_each(|_| sum.add(&solver.step(acting, dt_ms)));
            };
            self.with(py, loads, run)?;
            left -= now;
            if left > 0 {
                py.check_signals()?;
            }
        }
        Ok(sum)
    }

    /// Move to equilibrium: whether it converged, way left in mm, evaluations.
    #[pyo3(signature = (loads, tolerance_mm=0.01, steps=2000))]
    fn settle(&self, py: Python<'_>, loads: &Loads, tolerance_mm: f32, steps: u32) -> PyResult<(bool, f32, u32)> {
        let settling = Settling { tolerance_mm, steps };
        let settled = self.with(py, loads, |solver, acting| solver.settle(acting, &settling))?;
        Ok((settled.converged, settled.left_mm, settled.steps))
    }

    /// Present node positions, mm, (n, 3): a copy.
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Array2<'py, f32>> {
        points_out(py, self.solver().positions())
    }

    /// Present node velocities, mm/ms, (n, 3): a copy.
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Array2<'py, f32>> {
        points_out(py, self.solver().velocities())
    }

    /// Put a node at a displacement from rest, mm; a fixed one stays there.
    fn set_node(&self, node: u32, displacement_mm: &Any<'_>) -> PyResult<()> {
        if node >= self.nodes {
            return Err(value(format!("node is {node}, but there are only {} nodes", self.nodes)));
        }
        self.solver().set_node(node, vector(displacement_mm, "displacement_mm")?, Vec3::ZERO);
        Ok(())
    }

    /// Force of the support on fixed nodes in the last step, N, (n, 3).
    fn support_force_n<'py>(&self, py: Python<'py>, nodes: &Any<'py>) -> PyResult<Array2<'py, f32>> {
        let nodes = self::nodes(nodes, "nodes")?;
        let solver = self.solver();
        points_out(py, &nodes.iter().map(|&node| solver.support_force(node)).collect::<Vec<_>>())
    }

    /// Put every node at rest.
    fn reset(&self) {
        self.solver().reset();
    }
}
