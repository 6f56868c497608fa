"""Measures what a call from Python costs over the same call in Rust, and the environment's speed.

    python benchmarks.py [STEP_COST]

Each pair runs in one process, in turns: steps called one by one from Python, and the same steps in
one call, whose loop is in Rust. STEP_COST is the program that `cargo build --release --example
step_cost` builds; with it the same steps without Python are printed too, the least of 25 batches.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

import trepan


def median_us(*calls: Callable[[], None], number: int) -> list[float]:
    """Median time of a step, us, of each call of `number` steps; calls take turns 200 times.

    The first stands for itself, the others are it plus the median of the differences of a turn:
    what the machine does meanwhile falls on all calls of a turn alike.
    """
    times = np.empty((200, len(calls)))
    for turn in times:
        for at, call in enumerate(calls):
            begin = time.perf_counter()
            call()
            turn[at] = (time.perf_counter() - begin) / number * 1e6
    first = float(np.median(times[:, 0]))
    return [first] + [first + float(np.median(times[:, at] - times[:, 0])) for at in range(1, len(calls))]


def solver() -> list[float]:
    """A step of a block of 10,368 tetrahedra that hangs: in one call, from Python, with positions."""
    mesh = trepan.split_box((12, 12, 12), (100.0, 100.0, 100.0))
    tled = trepan.Tled(mesh, np.flatnonzero(mesh.positions[:, 2] < 1), trepan.Material.BRAIN)
    loads, dt = trepan.Loads(gravity=(0, 0, -9.81e-3)), tled.stable_dt_ms

    def one_by_one() -> None:
        for _ in range(20):
            tled.step(loads, dt)

    def with_positions() -> None:
        for _ in range(20):
            tled.step(loads, dt)
            tled.positions()

    return median_us(lambda: _none(tled.step(loads, dt, steps=20)), one_by_one, with_positions, number=20)


def tick() -> list[float]:
    """A tick of a burr that slides on bone: in one call, from Python."""
    contact = trepan.RigidContact(trepan.BoneVolume(trepan.scenes.slab(15.0), 400), trepan.Tool.burr(3.0))
    contact.reset((0, 0, 4))
    angle = 0.01 * np.arange(200)
    tips = np.column_stack([2 * np.sin(angle), 0 * angle, 0 * angle + 2.7])
    each = [tuple(tip) for tip in tips.tolist()]

    def one_by_one() -> None:
        for tip in each:
            contact.step(tip)

    return median_us(lambda: _none(contact.path(tips)), one_by_one, number=200)


def environment() -> float:
    """Simulated over CPU time of DrillEnv, drilling all the time, on one core."""
    from trepan.gym import DrillEnv

    env, steps, used = DrillEnv(), 0, 0.0
    for seed in range(8):
        env.reset(seed=seed)
        action, is_over = np.array([0.1, 0.1, 0.15], np.float32), False
        begin = time.process_time()
        while not is_over:
            _, _, terminated, truncated, _ = env.step(action)
            steps, is_over = steps + 1, terminated or truncated
        used += time.process_time() - begin
    return 0.01 * steps / used


def _none(_: object) -> None:
    """Drops a result."""


def main() -> None:
    """Prints a line for each figure."""
    in_rust, from_python, with_positions = solver()
    tick_in_rust, tick_from_python = tick()
    for name, python, rust in (
        ("solver step", from_python, in_rust),
        ("solver step and positions()", with_positions, in_rust),
        ("tick on bone", tick_from_python, tick_in_rust),
    ):
        share = 100 * (python / rust - 1)
        print(f"{name}: Python {python:.2f} us, Rust {rust:.2f} us, {python - rust:+.2f} us, {share:+.1f} %")
    if len(sys.argv) > 1:
        alone = subprocess.run(sys.argv[1:2], capture_output=True, text=True, check=True).stdout.split()
        print(f"without Python: solver step {alone[0]} us, tick on bone {alone[1]} us")
    print(f"DrillEnv: {environment():.0f} times as fast as real time (CPU time)")


if __name__ == "__main__":
    main()
