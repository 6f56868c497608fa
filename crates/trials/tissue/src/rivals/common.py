"""Shared by the scripts of all programs: the scene in SI units, and the run of one setting.

Arguments: scene file, number of threads. Prints one JSON line for each setting.
"""
import json
import os
import sys
import time

scene, threads = json.load(open(sys.argv[1])), sys.argv[2]
for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = threads

import numpy as np

X, tets = 1e-3 * np.array(scene["positions_mm"]), np.array(scene["tets"])
fixed, watched = np.array(scene["fixed"]), np.array(scene["watched"])
young, poisson = 1e6 * scene["young_mpa"], scene["poisson"]
density, gravity = 1e6 * scene["density_g_mm3"], 1e3 * scene["gravity_mm_per_ms2"]
shear = young / (2 * (1 + poisson))
bulk = young / (3 * (1 - 2 * poisson))
damping = 1e3 * scene["damping_per_ms"]  # of mass, 1/s
volumes = np.abs(np.linalg.det(X[tets[:, 1:]] - X[tets[:, :1]])) / 6
masses = density * np.bincount(tets.ravel(), np.repeat(volumes / 4, 4), len(X))


def report(setting, **found):
    print(json.dumps(dict(setting=setting, **found)), flush=True)


def sample(simulated_ms, wall, cpu, moved_mm):
    return dict(simulated_ms=simulated_ms, wall_ms=1e3 * wall, cpu_ms=1e3 * cpu, moved_mm=np.asarray(moved_mm).tolist())


def run(setting, dt, advance, positions):
    """Simulates the scene in steps of dt seconds; samples the watched nodes every 25 ms."""
    steps, simulated, samples = max(1, round(0.025 / dt)), 0.0, []
    clocks = time.perf_counter, time.process_time
    start, wall, cpu = [clock() for clock in clocks], 0.0, 0.0
    while simulated < 1e-3 * scene["simulated_ms"] and cpu < scene["longest_s"]:
        for _ in range(steps):
            advance()
        simulated += steps * dt
        wall, cpu = (clock() - since for clock, since in zip(clocks, start))
        moved = 1e3 * (np.asarray(positions())[watched] - X[watched])
        if not np.abs(moved).max() < 1e3:
            return report(setting, dt_ms=1e3 * dt, fault=f"diverges after {1e3 * simulated:.0f} ms", samples=[])
        samples.append(sample(1e3 * simulated, wall, cpu, moved))
    report(setting, dt_ms=1e3 * dt, fault=None, samples=samples)
