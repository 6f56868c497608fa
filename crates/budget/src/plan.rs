//! The planner: selects bone, tissue and picture models.

use crate::choice::{Choice, Neighbour, choose};
use crate::machine::check;
use crate::step::{edge_mm, stable_dt_ms};
use crate::{Bone, Machine, Picture, PlanError, Quality, Row, Rows, Scene, Setup, Tissue, TissueForce};
use core::f64::consts::PI;

/// A numerical parameter: fraction of a tick available to the rigid contact; the rest is for
/// device, force model and guard.
const TICK_SHARE: f64 = 0.25;
/// A numerical parameter: by how much threads must be faster than a body at rest needs; a deformed
/// one takes shorter steps.
const STIFFENED: f64 = 1.25;
/// Speed-up from each solver thread after the first.
const THREAD_GAIN: f64 = 0.8;
/// Longest step of a solver with a stability bound, ms: one haptic tick at 1 kHz.
const LONGEST_DT_MS: f64 = 1.0;
/// Step of the implicit solver, ms: four haptic ticks at 1 kHz.
pub(crate) const IMPLICIT_DT_MS: f64 = 4.0;
/// Time of a haptic tick without bone, µs. The spin before its deadline takes 10 to 70, collision
/// with tissue 45, device, force model, guard and recording the rest.
const FIXED_US_PER_TICK: f64 = 125.0;
/// Time of a window's picture beside drawing it, ns a pixel of the 3-D view. Where no graphics card
/// draws, the driver takes 14 ms for 744x800, the display 3.
const WINDOW_NS: f64 = 30.0;

/// The chosen models.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Bone; `None` in a scene without bone. Its error is in N.
    pub bone: Option<Choice<Bone>>,
    /// Tissue; `None` in a scene without tissue. Its error is in mm.
    pub tissue: Option<Choice<Tissue>>,
    /// Picture. Its error is in percent of white.
    pub picture: Choice<Picture>,
    /// Fixed cost of a session, cores.
    pub fixed_cores: f64,
    /// Threads of the solver: as few as keep it 1.25 times as fast as real time at rest.
    pub solver_threads: u32,
    /// The requested scene.
    pub scene: Scene,
    /// The machine.
    pub machine: Machine,
}

impl Plan {
    /// The setup to run; parts that the scene lacks get the usual preset.
    pub fn setup(&self) -> Setup {
        let usual = Quality::Usual.preset().expect("only Auto has none");
        Setup {
            bone: self.bone.map_or(usual.bone, |choice| choice.what),
            tissue: self.tissue.map_or(usual.tissue, |choice| choice.what),
            picture: self.picture.what,
        }
    }

    /// Total cost, cores (CPU seconds per second).
    pub fn cores(&self) -> f64 {
        let parts = [self.bone.map(|c| c.cost), self.tissue.map(|c| c.cost), Some(self.picture.cost)];
        self.fixed_cores + parts.into_iter().flatten().sum::<f64>()
    }

    /// Whether every part is within its tolerance.
    pub fn meets_tolerances(&self) -> bool {
        self.bone.is_none_or(|c| c.meets_tolerance)
            && self.tissue.is_none_or(|c| c.meets_tolerance)
            && self.picture.meets_tolerance
    }

    /// Whether every part runs in time.
    pub fn in_time(&self) -> bool {
        self.bone.is_none_or(|c| c.in_time) && self.tissue.is_none_or(|c| c.in_time) && self.picture.in_time
    }

    /// Solver step, ms, and mean edge of the tetrahedra, mm, from their number. TLED's step is the
    /// one that its cost in these rows is based on, light and slender elements included.
    pub fn step_and_edge(&self) -> Option<(f64, f64)> {
        let Choice { what, cost, .. } = self.tissue?;
        let step_ms = match what.solver {
            "tled" => {
                let share = THREAD_GAIN + (1.0 - THREAD_GAIN) / f64::from(self.solver_threads);
                what.tets as f64 * self.machine.ns_per_tet_step * 1e-6 / (share * cost)
            }
            _ => dt_ms(&self.scene, &what),
        };
        Some((step_ms, edge_mm(self.scene.brain_mm3, what.tets)))
    }
}

/// Makes a plan from the stored rows.
///
/// # Errors
/// When a number of the machine or the scene is out of range.
pub fn plan(machine: &Machine, scene: &Scene) -> Result<Plan, PlanError> {
    plan_with(machine, scene, &Rows::stored()?)
}

/// Makes a plan from the caller's rows.
///
/// # Errors
/// When a number is out of range or a required list of rows is empty.
pub fn plan_with(machine: &Machine, scene: &Scene, rows: &Rows) -> Result<Plan, PlanError> {
    check(machine, scene)?;
    let window_ns = if scene.has_window && !machine.device_draws { WINDOW_NS * scene.pixels() } else { 0.0 };
    let fixed_cores = FIXED_US_PER_TICK * 1e-6 * scene.device_rate_hz + 1e-9 * window_ns * scene.pictures_per_s;
    let mut free = f64::from(machine.threads) - fixed_cores;
    let bone = scene.has_bone.then(|| bone(machine, scene, rows)).transpose()?;
    free -= bone.map_or(0.0, |choice| choice.cost);
    let tissue = scene.has_tissue.then(|| tissue(machine, scene, rows, free)).transpose()?;
    let alone = |choice: &Choice<Tissue>| rows.tissue.iter().find(|row| row.what == choice.what);
    let alone = tissue.as_ref().and_then(alone).map_or(0.0, |row| tissue_cores(machine, scene, row));
    let solver_threads = Solver::of(machine, scene, free).threads(alone);
    free -= tissue.map_or(0.0, |choice| choice.cost);
    let picture = picture(machine, scene, rows, free)?;
    Ok(Plan { bone, tissue, picture, fixed_cores, solver_threads, scene: *scene, machine: *machine })
}

fn bone(machine: &Machine, scene: &Scene, rows: &Rows) -> Result<Choice<Bone>, PlanError> {
    let judged = rows.bone.iter().filter(|row| holds_walls(&row.what, scene.tool_radius_mm)).map(|row| {
        let cost = bone_cores(machine, scene, row);
        Neighbour { what: row.what, error: bone_error_n(scene, row), force: None, cost, in_time: cost <= TICK_SHARE }
    });
    choose(judged, |n| n.error / scene.force_error_n).ok_or(PlanError::NoRows("bone"))
}

/// Methods with a proxy, with the points of each unless a choice gives others; 0 has none.
const PROXIES: [(&str, usize); 6] = [
    ("god-object-sphere", 0),
    ("god-object-sphere-shaft", 0),
    ("brute", 0),
    ("centre-line", 0),
    ("thesis", 466),
    ("thesis-printed", 466),
];

/// Whether a bone model keeps a burr of a radius, mm, on the side of the bone that it came from.
///
/// It needs a proxy, and points no further apart than a voxel: through `4πr²/N > h²` a burr passes
/// a hole that is narrower than itself, and jams in it. Other models lose thin walls, whatever
/// their error on thick ones; a plan never takes them.
pub fn holds_walls(bone: &Bone, tool_radius_mm: f64) -> bool {
    let Some((_, own)) = PROXIES.into_iter().find(|(method, _)| *method == bone.method) else { return false };
    let points = if own == 0 || bone.points == 0 { own } else { bone.points } as f64;
    points == 0.0 || 4.0 * PI * tool_radius_mm.powi(2) <= points * bone.spacing_mm.powi(2)
}

fn tissue(machine: &Machine, scene: &Scene, rows: &Rows, free: f64) -> Result<Choice<Tissue>, PlanError> {
    let solver = Solver::of(machine, scene, free);
    let judged = rows.tissue.iter().map(|row| {
        let alone = tissue_cores(machine, scene, row);
        let (cost, in_time) = (solver.cores(alone), solver.in_time(alone));
        let error = row.error.at_most(&scene.tissue_features());
        Neighbour { what: row.what, error, force: row.force, cost, in_time }
    });
    choose(judged, |n| tissue_over(scene, n.error, n.force)).ok_or(PlanError::NoRows("tissue"))
}

fn picture(machine: &Machine, scene: &Scene, rows: &Rows, free: f64) -> Result<Choice<Picture>, PlanError> {
    let judged = rows.picture.iter().map(|row| {
        let cost = picture_cores(machine, scene, row);
        let error = row.error.at_most(&scene.picture_features());
        Neighbour { what: row.what, error, force: None, cost, in_time: cost <= free }
    });
    choose(judged, |n| n.error / scene.picture_error_percent).ok_or(PlanError::NoRows("picture"))
}

/// Bound of the force error, N, met by 95 of 100 ticks.
pub fn bone_error_n(scene: &Scene, row: &Row<Bone>) -> f64 {
    scene.stiffness * row.error.at_most(&scene.bone_features())
}

/// The worst of a tissue model's errors over their tolerances: displacement, mm, and force, where
/// that was measured.
pub fn tissue_over(scene: &Scene, error_mm: f64, force: Option<TissueForce>) -> f64 {
    let of_force = force.map_or(0.0, |force| force.error_n / force.allowed_n(scene));
    of_force.max(error_mm / scene.displacement_mm)
}

/// Cost of a bone model, cores.
pub fn bone_cores(machine: &Machine, scene: &Scene, row: &Row<Bone>) -> f64 {
    machine.us_per_rigid_tick * row.cost.expected(&scene.bone_features()) * 1e-6 * scene.device_rate_hz
}

/// Cost of a tissue model in real time, cores.
pub fn tissue_cores(machine: &Machine, scene: &Scene, row: &Row<Tissue>) -> f64 {
    let step_ms = row.what.tets as f64 * machine.ns_per_tet_step * 1e-6 * row.cost.expected(&scene.tissue_features());
    step_ms / dt_ms(scene, &row.what)
}

/// Cost of a picture mode on the processor, cores; 0 where a graphics device renders.
pub fn picture_cores(machine: &Machine, scene: &Scene, row: &Row<Picture>) -> f64 {
    if machine.device_draws {
        return 0.0;
    }
    machine.ns_per_ray * 1e-9 * scene.pixels() * row.cost.expected(&scene.picture_features()) * scene.pictures_per_s
}

/// Solver step on a mesh, from its number of tetrahedra, ms.
pub fn dt_ms(scene: &Scene, tissue: &Tissue) -> f64 {
    match tissue.solver {
        "corotational" => IMPLICIT_DT_MS,
        _ => stable_dt_ms(scene.brain_mm3, tissue.tets, &scene.material).min(LONGEST_DT_MS),
    }
}

/// The threads that a solver may have.
struct Solver {
    /// Fewest and most.
    threads: [u32; 2],
    /// Cores that are free for them.
    free: f64,
    /// Required speed over real time.
    headroom: f64,
}

impl Solver {
    fn of(machine: &Machine, scene: &Scene, free: f64) -> Self {
        let threads = machine.solver_threads.map_or([1, free.round().max(1.0) as u32], |given| [given.max(1); 2]);
        Self { threads, free, headroom: scene.headroom }
    }

    /// How much faster it runs on so many threads: further ones add less than the first.
    fn speed(&self, threads: u32) -> f64 {
        1.0 + THREAD_GAIN * f64::from(threads - 1)
    }

    /// The fewest threads that step a model in time which takes so many cores on one. A further
    /// thread has no core of its own beside the picture's, and the first waits for it.
    fn threads(&self, alone: f64) -> u32 {
        let [least, most] = self.threads;
        (least..most).find(|n| STIFFENED * alone <= self.speed(*n)).unwrap_or(most)
    }

    /// Cores that its threads take.
    fn cores(&self, alone: f64) -> f64 {
        let threads = self.threads(alone);
        alone * f64::from(threads) / self.speed(threads)
    }

    fn in_time(&self, alone: f64) -> bool {
        let in_step = self.headroom * alone <= self.speed(self.threads[1]);
        in_step && self.headroom * self.cores(alone) <= self.free
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PowerLaw;
    use proptest::prelude::*;
    use trepan_soft::Material;

    const MACHINE: Machine = Machine {
        ns_per_tet_step: 20.0,
        us_per_rigid_tick: 40.0,
        ns_per_ray: 500.0,
        threads: 2,
        solver_threads: None,
        device_draws: false,
    };

    fn row<T>(what: T, error: f64, cost: f64) -> Row<T> {
        Row { what, error: PowerLaw::constant(error), cost: PowerLaw::constant(cost), force: None }
    }

    fn rows() -> Rows {
        let bone = |spacing_mm| Bone { method: "god-object-sphere", spacing_mm, points: 0 };
        let tissue = |tets| Tissue { solver: "tled", tets, halvings: 0 };
        let picture = |detail| Picture { sparse: detail < 1.0, detail };
        Rows {
            bone: vec![row(bone(1.0), 0.1, 0.8), row(bone(0.5), 0.04, 1.0), row(bone(0.25), 0.02, 2.0)],
            tissue: vec![row(tissue(5_000), 2.0, 1.0), row(tissue(10_000), 1.2, 1.0), row(tissue(20_000), 0.8, 1.0)],
            picture: vec![row(picture(0.5), 4.0, 0.1), row(picture(0.7), 2.0, 0.25), row(picture(1.0), 0.0, 1.0)],
        }
    }

    fn scene() -> Scene {
        Scene {
            force_error_n: 0.1,
            displacement_mm: 1.0,
            picture_error_percent: 3.0,
            stiffness: 2.0,
            picture_pixels: [1000, 800],
            ..Scene::default()
        }
    }

    /// A burr of 3 mm has 113 mm² for 211 points: 0.73 mm apart.
    #[test]
    fn points_further_apart_than_a_voxel_hold_no_wall() {
        let model = |method, spacing_mm, points| Bone { method, spacing_mm, points };
        assert!(holds_walls(&model("thesis", 0.75, 211), 3.0) && !holds_walls(&model("thesis", 0.6, 211), 3.0));
        assert!(holds_walls(&model("thesis", 0.6, 466), 3.0) && holds_walls(&model("thesis", 0.35, 211), 1.0));
        assert!(holds_walls(&model("god-object-sphere", 0.35, 0), 3.0));
        assert!(!holds_walls(&model("voxel-sum", 2.0, 0), 3.0) && !holds_walls(&model("none", 2.0, 0), 3.0));
    }

    /// The cheapest choice within each tolerance, computed by hand.
    ///
    /// - Bone: 2 N/mm · 0.04 mm = 0.08 N is the first under 0.1 N; 40 us · 1000 Hz is 0.04 core.
    /// - Tissue, 20 000 tetrahedra: a = 7.985 mm, dt = 0.35 · 6.519/3.373 = 0.6766 ms; a step takes
    ///   20 000 · 20 ns = 0.4 ms: 0.591 core.
    /// - Picture: 800 000 pixels · 500 ns · 0.25 · 10/s: 1 core; the remaining 1.24 cores do not
    ///   allow the full picture.
    #[test]
    fn the_cheapest_within_the_tolerance_is_taken() {
        let plan = plan_with(&MACHINE, &scene(), &rows()).unwrap();
        let (bone, tissue) = (plan.bone.unwrap(), plan.tissue.unwrap());
        assert_eq!((bone.what.spacing_mm, tissue.what.tets, plan.picture.what.detail), (0.5, 20_000, 0.7));
        assert!((bone.error - 0.08).abs() < 1e-12 && (bone.cost - 0.04).abs() < 1e-12);
        assert!((tissue.cost - 0.5912).abs() < 1e-3 && (plan.picture.cost - 1.0).abs() < 1e-9);
        assert!((plan.cores() - 0.125 - 1.6312).abs() < 1e-3);
        assert_eq!(plan.picture.better.map(|n| (n.what.detail, n.in_time)), Some((1.0, false)));
        assert_eq!(tissue.cheaper.map(|n| n.what.tets), Some(10_000));
        assert!(plan.meets_tolerances() && plan.in_time());
        assert_eq!(plan.setup().tissue, tissue.what);
    }

    /// 10,000 tetrahedra are near enough in displacement, but 0.03 N off in force.
    ///
    /// A tenth of 0.25 N are 0.025 N, of 0.4 N 0.04 N.
    #[test]
    fn force_on_tissue_has_its_own_tolerance() {
        let taken = |force_n: f64| {
            let mut rows = rows();
            let errors = [0.05, 0.03, 0.01];
            let forces = errors.map(|error_n| Some(TissueForce { error_n, force_n }));
            rows.tissue.iter_mut().zip(forces).for_each(|(row, force)| row.force = force);
            plan_with(&MACHINE, &Scene { displacement_mm: 1.5, ..scene() }, &rows).unwrap()
        };
        let (weak, strong) = (taken(0.25), taken(0.4));
        assert_eq!([&weak, &strong].map(|plan| plan.tissue.unwrap().what.tets), [20_000, 10_000]);
        assert!(strong.to_string().contains("force 0.030 N off of 0.040 allowed"), "{strong}");
    }

    #[test]
    fn a_slow_machine_takes_what_runs_and_reports_the_missed_tolerance() {
        let slow = Machine { ns_per_tet_step: 60.0, ..MACHINE };
        let plan = plan_with(&slow, &scene(), &rows()).unwrap();
        assert_eq!(plan.tissue.unwrap().what.tets, 10_000);
        assert!(!plan.meets_tolerances() && plan.to_string().contains("tolerance not met"));
        let hopeless = plan_with(&Machine { ns_per_tet_step: 1e4, ..MACHINE }, &scene(), &rows()).unwrap();
        assert_eq!(hopeless.tissue.unwrap().what.tets, 5_000);
        assert!(!hopeless.in_time() && hopeless.to_string().contains("too slow even so"));
    }

    /// Three threads are 2.6 times as fast as one.
    ///
    /// 20 000 tetrahedra at 60 ns take 1.77 cores on one thread: with headroom 1.2 that is 2.13
    /// seconds a second.
    #[test]
    fn a_mesh_that_one_thread_cannot_step_gets_more() {
        let machine = Machine { ns_per_tet_step: 60.0, threads: 4, ..MACHINE };
        let scene = Scene { headroom: 1.2, ..scene() };
        let plan = plan_with(&machine, &scene, &rows()).unwrap();
        let tissue = plan.tissue.unwrap();
        assert_eq!((tissue.what.tets, plan.solver_threads, tissue.in_time), (20_000, 3, true));
        assert!((tissue.cost - 1.774 * 3.0 / 2.6).abs() < 0.01, "{}", tissue.cost);
        assert!((plan.step_and_edge().unwrap().0 - 0.6766).abs() < 1e-3);
        let one = plan_with(&Machine { solver_threads: Some(1), ..machine }, &scene, &rows()).unwrap();
        assert_eq!((one.tissue.unwrap().what.tets, one.solver_threads), (10_000, 1));
        // At 25 ns it is 0.74 cores: one thread does, though it has no headroom of 1.5.
        let scene = Scene { headroom: 1.5, ..scene };
        let shown = Scene { has_window: true, ..scene };
        let window = plan_with(&machine, &shown, &rows()).unwrap().fixed_cores - plan.fixed_cores;
        assert!((window - 30e-9 * shown.pixels() * shown.pictures_per_s).abs() < 1e-9 && window > 0.1, "{window}");
        let fast = plan_with(&Machine { ns_per_tet_step: 25.0, ..machine }, &scene, &rows()).unwrap();
        assert_eq!((fast.tissue.unwrap().what.tets, fast.solver_threads), (20_000, 1));
    }

    #[test]
    fn missing_parts_and_device_rendering_cost_nothing() {
        let bare = Scene { has_bone: false, has_tissue: false, ..scene() };
        let plan = plan_with(&Machine { device_draws: true, ..MACHINE }, &bare, &rows()).unwrap();
        assert_eq!((plan.bone, plan.tissue), (None, None));
        assert_eq!((plan.picture.what.detail, plan.picture.cost), (1.0, 0.0));
        assert_eq!(plan.cores(), plan.fixed_cores);
        assert_eq!(plan.setup().bone, Quality::Usual.preset().unwrap().bone);
    }

    #[test]
    fn stiffer_tissue_needs_shorter_steps() {
        let at = |material| plan_with(&MACHINE, &Scene { material, displacement_mm: 2.0, ..scene() }, &rows()).unwrap();
        let [brain, thesis] = [Material::BRAIN, Material::THESIS].map(|m| at(m).tissue.unwrap().cost);
        assert!(thesis > 1.2 * brain, "{thesis} {brain}");
    }

    #[test]
    fn bad_numbers_are_refused_by_name() {
        let refused = |machine, scene| plan_with(&machine, &scene, &rows()).unwrap_err().to_string();
        assert!(refused(Machine { threads: 0, ..MACHINE }, scene()).contains("threads"));
        assert!(refused(Machine { ns_per_ray: 0.0, ..MACHINE }, scene()).contains("ns_per_ray"));
        assert!(refused(MACHINE, Scene { headroom: 0.5, ..scene() }).contains("headroom"));
        assert!(refused(MACHINE, Scene { brain_mm3: f64::NAN, ..scene() }).contains("brain_mm3"));
        assert!(refused(MACHINE, Scene { press_mm: 3.5, ..scene() }).contains("at most scene.tool_radius_mm"));
        assert!(
            refused(MACHINE, Scene { tissue_motion_mm: 6.5, ..scene() }).contains("at most 3 of scene.probe_radius_mm")
        );
        assert!(refused(MACHINE, Scene { picture_pixels: [0, 600], ..scene() }).contains("picture_pixels[0]"));
        assert_eq!(plan_with(&MACHINE, &scene(), &Rows { bone: vec![], ..rows() }), Err(PlanError::NoRows("bone")));
    }

    /// Scenes and machines of possible sessions.
    fn any() -> impl Strategy<Value = (Machine, Scene)> {
        let lengths = (0.5f64..4.0, 0.2f64..2.0, 0.5f64..2.0, 0.3f64..1.0, 2.0f64..5.0, 60.0f64..300.0);
        let asked = (0.02f64..0.5, 0.1f64..3.0, 0.5f64..15.0, 1u32..64, 300u32..1200);
        (lengths, asked).prop_map(|((tool, press, finest, motion, probe, view), (n, mm, percent, threads, pixels))| {
            let scene = Scene {
                force_error_n: n,
                displacement_mm: mm,
                picture_error_percent: percent,
                tool_radius_mm: tool,
                press_mm: press.min(tool),
                finest_mm: finest,
                tissue_motion_mm: motion * probe,
                probe_radius_mm: probe,
                view_mm: view,
                picture_pixels: [pixels, pixels],
                ..Scene::default()
            };
            (Machine { threads, ..Machine::default() }, scene)
        })
    }

    /// Whether the machine has threads for everything, so that only accuracy decides.
    fn unhurried(machine: &Machine) -> Machine {
        Machine { threads: 1000, ..*machine }
    }

    proptest! {
        #[test]
        fn a_tighter_tolerance_is_never_cheaper((machine, scene) in any(), share in 0.05f64..1.0) {
            let machine = unhurried(&machine);
            let tighter = Scene {
                force_error_n: share * scene.force_error_n,
                tissue_force_n: share * scene.tissue_force_n,
                displacement_mm: share * scene.displacement_mm,
                picture_error_percent: share * scene.picture_error_percent,
                ..scene
            };
            let (loose, tight) = (plan(&machine, &scene).unwrap(), plan(&machine, &tighter).unwrap());
            let parts = |p: &Plan| [p.bone.map(|c| (c.cost, c.meets_tolerance)), p.tissue.map(|c| (c.cost, c.meets_tolerance)), Some((p.picture.cost, p.picture.meets_tolerance))];
            for (loose, tight) in parts(&loose).into_iter().zip(parts(&tight)) {
                let ((loose, _), (tight, met)) = (loose.unwrap(), tight.unwrap());
                prop_assert!(!met || tight >= loose, "{tight} under {loose}");
            }
        }

        #[test]
        fn auto_is_never_dearer_than_a_preset_that_meets_the_tolerance((machine, scene) in any()) {
            let (machine, rows) = (unhurried(&machine), Rows::stored().unwrap());
            let plan = plan_with(&machine, &scene, &rows).unwrap();
            for preset in Quality::ALL.into_iter().filter_map(Quality::preset) {
                let bone = rows.bone.iter().find(|row| row.what == preset.bone).unwrap();
                if bone_error_n(&scene, bone) <= scene.force_error_n {
                    prop_assert!(plan.bone.unwrap().cost <= bone_cores(&machine, &scene, bone));
                }
                let tissue = rows.tissue.iter().find(|row| row.what == preset.tissue).unwrap();
                if tissue.error.at_most(&scene.tissue_features()) <= scene.displacement_mm {
                    prop_assert!(plan.tissue.unwrap().cost <= tissue_cores(&machine, &scene, tissue));
                }
                let picture = rows.picture.iter().find(|row| row.what == preset.picture).unwrap();
                if picture.error.at_most(&scene.picture_features()) <= scene.picture_error_percent {
                    prop_assert!(plan.picture.cost <= picture_cores(&machine, &scene, picture));
                }
            }
        }

        #[test]
        fn the_choice_runs_in_time_if_any_does((machine, scene) in any()) {
            let plan = plan(&machine, &scene).unwrap();
            prop_assert!(!plan.in_time() || plan.cores() <= f64::from(machine.threads) + 1e-9);
            prop_assert!(plan.cores().is_finite() && plan.to_string().contains("picture: "));
            let again = super::plan(&machine, &scene).unwrap();
            prop_assert_eq!(plan, again);
        }

        #[test]
        fn more_threads_never_make_tissue_less_accurate((machine, scene) in any()) {
            let more = Machine { threads: machine.threads + 1, ..machine };
            let (few, many) = (plan(&machine, &scene).unwrap(), plan(&more, &scene).unwrap());
            let error = |p: &Plan| p.tissue.unwrap().error.max(scene.displacement_mm);
            prop_assert!(error(&many) <= error(&few));
        }
    }
}
