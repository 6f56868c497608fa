"""MuJoCo Warp's flex on a block of linear tetrahedra: largest stable step, and a step's time.

    python3 mujoco_warp.py NX NY NZ [--device cuda|cpu] [--gravity 9.81] [--seconds 140]

Cubes of 8 mm, six tetrahedra each, stand on their fixed bottom and are pulled sideways. Prints a
JSON line for each setting, then a summary; after --seconds the rest is skipped and named. Times are
medians of five runs from rest, on CUDA of a captured graph.

Nodes are bodies with three sliders, of the mass that their tetrahedra give. Damping goes with mass,
critical for the lowest shear. Laws: St. Venant-Kirchhoff (SVK), which folds over when pressed hard
(see inverted_percent), and stable neo-Hookean (SNH), for the discrete integrator only.

"tuned": no collisions, constraints or sensors; gravity as forces, since the option launches threads
for all pairs of bodies and freedoms; bodies in groups of 64 under fixed ones, since single threads
walk through all trees; wide blocks in the discrete integrator's solver. "flexcomp": the documented
way, without room for constraints. "default": with the usual room.
"""
import argparse, functools, importlib.metadata, itertools, json, math, os, statistics, sys, time

BEGIN = time.perf_counter()
# Scripts beside this one, and itself, have the names of packages.
sys.path[:] = [path for path in sys.path if not os.path.exists(f"{path}/mujoco_warp.py")]
import mujoco
import numpy as np
import warp as wp
wp.config.log_level = wp.LOG_WARNING
import mujoco_warp as mjw

EDGE, DENSITY, YOUNG, POISSON = 8e-3, 1040.0, 3000.0, 0.45  # SI units, as everything here
FIRST_DT, LONGEST_DT, SHORTEST_DT = 2e-3, 0.016, 1e-5  # s; the longest is that of a picture
parser = argparse.ArgumentParser()
parser.add_argument("cubes", type=int, nargs=3)
for name, default in ("--device", "cuda"), ("--gravity", 9.81), ("--seconds", 140.0):
    parser.add_argument(name, type=type(default), default=default)
ARGS = parser.parse_args()
wp.set_device(ARGS.device)
LATTICE, TETS = np.add(ARGS.cubes, 1), []
NODES, CELLS = (np.indices(counts).reshape(3, -1).T for counts in (LATTICE, ARGS.cubes))
for axes in itertools.permutations(np.eye(3, dtype=int)):
    order = [0, 1, 2, 3] if np.linalg.det(axes) > 0 else [0, 1, 3, 2]
    corners = np.cumsum([0 * axes[0], *axes], 0)[order]
    TETS.append(np.stack([np.ravel_multi_index((CELLS + at).T, LATTICE) for at in corners], 1))
X, TETS = EDGE * NODES, np.concatenate(TETS)
FREE, FIXED = np.flatnonzero(NODES[:, 2]), np.flatnonzero(NODES[:, 2] == 0)
volumes = lambda at: np.linalg.det(at[TETS[:, 1:]] - at[TETS[:, :1]]) / 6
MASSES = DENSITY * np.bincount(TETS.ravel(), np.repeat(volumes(X) / 4, 4), len(X))
DAMPING = math.pi / X[-1, 2] * math.sqrt(YOUNG / (2 + 2 * POISSON) / DENSITY)  # 1/s
left = lambda: ARGS.seconds - (time.perf_counter() - BEGIN)
text = lambda array: " ".join(map(str, np.ravel(array).tolist()))


@functools.lru_cache(1)
def models(tuned, law):
    """The model on the host and on the device."""
    flex = f"""dim="3" radius="1e-4" element="{text(TETS)}">
    <contact selfcollide="none" contype="0" conaffinity="0"/>
    <elasticity young="{YOUNG}" poisson="{POISSON}"/>"""
    world = f"""<worldbody><flexcomp name="block" type="direct" mass="{MASSES.sum()}"
    point="{text(X)}" {flex}<pin id="{text(FIXED)}"/></flexcomp></worldbody>"""
    if tuned:
        bodies = [f"""<body name="{v}" pos="{text(X[v])}"><inertial mass="{MASSES[v]}" pos="0 0 0"
        diaginertia="1e-8 1e-8 1e-8"/><joint type="slide" axis="1 0 0"/><joint type="slide"
        axis="0 1 0"/><joint type="slide" axis="0 0 1"/></body>""" for v in FREE]
        groups = [f"<body>{''.join(bodies[i:i + 64])}</body>" for i in range(0, len(FREE), 64)]
        names = " ".join(str(v) if NODES[v, 2] else "world" for v in range(len(X)))
        world = f"""<worldbody>{''.join(groups)}</worldbody><deformable><flex name="block"
        body="{names}" vertex="{text(np.where(NODES[:, 2:], 0, X))}" {flex}</flex></deformable>"""
    option = f'<size memory="2G"/><option gravity="{ARGS.gravity} 0 0" integrator="discrete"/>'
    spec = mujoco.MjSpec.from_string(f"<mujoco>{option}{world}</mujoco>")
    spec.flexes[0].elastic3d = int(law == "SNH")
    made = spec.compile()
    made.body_mass[made.flex_vertbodyid[FREE]] = MASSES[FREE]  # <flexcomp> gives all the same
    mujoco.mj_setConst(made, mujoco.MjData(made))
    made.dof_damping[:] = DAMPING * np.repeat(MASSES[FREE], 3)  # the text may not hold it
    return made, mjw.put_model(made)


class Run:
    def __init__(self, style, law, integrator, tolerance=1e-6):
        made, self.m = models(style == "tuned", law)
        self.d = mjw.make_data(made, **({} if style == "default" else dict(njmax=0, nconmax=0)))
        self.m.opt.integrator = getattr(mjw.IntegratorType, integrator)
        self.m.opt.tolerance.fill_(float(tolerance))
        off, self.graph = mjw.DisableBit, None
        # Without room for constraints, nothing moves unless EULERDAMP is off.
        self.m.opt.disableflags = 0 if style == "default" else int(off.EULERDAMP)
        if style == "tuned":
            for flag in off.CONSTRAINT, off.CONTACT, off.SENSOR, off.ACTUATION, off.GRAVITY:
                self.m.opt.disableflags |= int(flag)
            self.m.opt.run_collision_detection, self.m.block_dim.eff_pcg = False, 512
            forces = np.outer(MASSES[FREE], [ARGS.gravity, 0, 0]).reshape(1, -1)
            self.d.qfrc_applied.assign(forces.astype(np.float32))
        self.steps(1, SHORTEST_DT)  # compiles the kernels
        if wp.get_device().is_cuda:
            with wp.ScopedCapture() as capture:
                mjw.step(self.m, self.d)
            self.graph = capture.graph
        self.pace, self.least = max(self.steps(1), self.steps(1)), 0.7 * left()

    def steps(self, count, restart_dt=0.0):
        """Steps, from rest if given a length. Returns the time of one, s."""
        if left() < 0:
            raise TimeoutError("out of time")
        if restart_dt:
            self.m.opt.timestep.fill_(restart_dt)
            for array in self.d.qpos, self.d.qvel, self.d.qacc, self.d.qacc_warmstart:
                array.zero_()
        wp.synchronize()
        start = time.perf_counter()
        for _ in range(count):
            wp.capture_launch(self.graph) if self.graph else mjw.step(self.m, self.d)
        wp.synchronize()
        return (time.perf_counter() - start) / count

    def simulate(self, dt):
        """Moves of the free nodes after 0.1 and 0.5 s, or none if they are not stable."""
        marks, moved, done = [round(0.1 / dt), math.ceil(0.5 / dt)], {}, 0
        often = max(1, min(50, int(1 / self.pace)))
        for stop in sorted({*marks, *range(often, marks[1], often)}):
            self.pace = self.steps(stop - done, 0.0 if done else dt)
            done, moved[stop] = stop, np.array(self.d.qpos.numpy()).reshape(-1, 3)
            if not 0 < np.abs(moved[stop]).max() < X.max():
                return None
            if left() < self.least:
                raise TimeoutError("gave up the search for the largest step: out of time")
        return [moved[mark] for mark in marks]

    def told(self):
        """The largest stable step found, and times of it and of a usual one."""
        dt, best, factor, told = FIRST_DT, None, 2.0, dict(graph=bool(self.graph))
        try:
            while not (best := self.simulate(dt)) and dt >= 2 * SHORTEST_DT:
                dt /= 2
            while best and factor > 1.05:
                wide = dt * factor < 1.001 * LONGEST_DT and self.simulate(dt * factor)
                dt, best, factor = (dt * factor, wide, factor) if wide else (dt, best, factor**0.5)
            told["fault"] = None if best else "no step that is stable and moves"
        except TimeoutError as error:
            told["fault"] = str(error)
        if best:
            at = X.copy()
            at[FREE] += best[1]
            told.update(largest_stable_dt_s=dt, inverted_percent=100 * np.mean(volumes(at) < 0),
                        corner_mm_after_100_and_500_ms=[(1e3 * at[-1]).tolist() for at in best])
        told["times"], count = [], max(2, min(200, int(0.04 * left() / self.pace)))
        for dt in sorted({min(FIRST_DT, dt), dt}):
            us = 1e6 * statistics.median(self.steps(count, dt) for _ in range(5))
            told["times"].append(dict(dt_s=dt, us_per_step=us, us_per_simulated_ms=us / (1e3 * dt),
                                      timed=5 * count, tets_per_s=1e6 * len(TETS) / us))
        return told


about = {name: importlib.metadata.version(name) for name in ("mujoco", "mujoco-warp", "warp-lang")}
about.update(device=wp.get_device().name, tets=len(TETS), nodes=len(X), gravity=ARGS.gravity)
found = {}
for name in ("tuned SVK EULER", "tuned SVK IMPLICITFAST", "tuned SVK IMPLICIT", "tuned SVK RK4",
             "tuned SVK DISCRETE", "tuned SNH DISCRETE", "tuned SNH DISCRETE 1e-3",
             "tuned SNH EULER", "flexcomp SVK EULER", "flexcomp SVK DISCRETE", "default SVK EULER"):
    try:
        if left() < 30:
            raise TimeoutError("skipped, out of time")
        line = Run(*name.split()).told()
    except Exception as error:
        line = dict(error=f"{type(error).__name__}: {error}")
    found[name] = line.get("error") or line["times"][-1]["us_per_simulated_ms"]
    print(json.dumps(dict(setting=name, **line, seconds_left=left(), **about)), flush=True)
about["peak_mib"] = ARGS.device == "cuda" and wp.get_mempool_used_mem_high() / 2**20
print(json.dumps(dict(summary="us_per_simulated_ms", settings=found, **about)))
