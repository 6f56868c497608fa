#!/usr/bin/env bash
# MuJoCo Warp 4.0.0 freezes a scene that was given no room for constraints.
#
# `make_data(njmax=0)` is what its own sizing advice leads to for a scene without contacts, joint
# limits or equalities: a soft block that hangs, a ball that falls.
# Expected: the free fall of MuJoCo itself.
# Seen: with the default integrator (Euler with implicit joint damping) the ball stays where it is
# for ever, while `qacc` holds -9.81 m/s²; no warning. With njmax=1, or with the integrator RK4, it
# falls as in MuJoCo. A comparison of solvers would time steps that do nothing.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" -q install mujoco-warp==4.0.0 mujoco==4.0.0 warp-lang==1.19.0
cd "$folder"
WARP_CACHE_PATH="$folder/kernels" venv/bin/python - <<'PYTHON'
from importlib.metadata import version

import mujoco
import mujoco_warp as mjw
import warp as wp

wp.config.log_level = wp.LOG_ERROR
wp.set_device("cpu")
ball = mujoco.MjModel.from_xml_string(
    '<mujoco><option timestep="0.001"/><worldbody><body pos="0 0 1"><freejoint/>'
    '<geom size=".1"/></body></worldbody></mujoco>')
exact = mujoco.MjData(ball)
for _ in range(100):
    mujoco.mj_step(ball, exact)


def height(njmax, integrator):
    ball.opt.integrator = integrator
    model = mjw.put_model(ball)
    data = mjw.make_data(ball, njmax=njmax, nconmax=0)
    for _ in range(100):
        mjw.step(model, data)
    return float(data.qpos.numpy()[0, 2]), float(data.qacc.numpy()[0, 2])


euler, rk4 = mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_RK4
print("mujoco-warp", version("mujoco-warp"), "MuJoCo:", round(float(exact.qpos[2]), 5), "m after 0.1 s")
frozen, acceleration = height(0, euler)
print("njmax=0, Euler:", frozen, "m, qacc", round(acceleration, 2))
moved = {"njmax=1, Euler": height(1, euler)[0], "njmax=0, RK4": height(0, rk4)[0]}
print({name: round(z, 5) for name, z in moved.items()})
assert all(abs(z - exact.qpos[2]) < 1e-3 for z in moved.values())
assert abs(acceleration + 9.81) < 1e-3
if frozen != 1.0:
    raise SystemExit("the ball falls now: this finding is out of date")
PYTHON
