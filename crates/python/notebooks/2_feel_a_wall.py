# %% [markdown]
# # Feel a wall
# Force against depth, on bone and on brain. Bone holds the proxy at its surface: the force is a
# stiffness times the depth of the hand behind it. Brain gives way under the probe.

# %%
import numpy as np
from matplotlib.figure import Figure

import trepan

bone = trepan.BoneVolume(trepan.scenes.slab(6.0), isovalue=400)
burr = trepan.RigidContact(bone, trepan.Tool.burr(3.0))
burr.reset((0, 0, 4))

press_mm = np.linspace(-0.5, 1.5, 400)
path = burr.path(np.column_stack([0 * press_mm, 0 * press_mm, 3.0 - press_mm]))
bone_n = burr.stiffness_n_per_mm * path.depth_mm
assert np.abs(path.depth_mm - np.maximum(press_mm, 0)).max() < 0.01
print(f"the wall lies within {1e3 * np.abs(path.depth_mm - np.maximum(press_mm, 0)).max():.2g} um of z = 0")

# %% [markdown]
# A block of brain, 60 mm wide, held at its bottom; a ball of 6 mm radius comes down at 10 mm/s. Each
# step finds the contact with the present nodes and gives it to the solver as springs.

# %%
mesh = trepan.split_box((10, 10, 8), (60.0, 60.0, 48.0))
fixed = np.flatnonzero(mesh.positions[:, 2] < 1e-3)
solver = trepan.Tled(mesh, fixed, trepan.Material.WHOLE_BRAIN, averaged_pressure=True)
touch = trepan.TissueCollision(mesh, trepan.Tool.probe(6.0))
loads, dt = trepan.Loads(), solver.stable_dt_ms
depths, forces = [], []
for step in range(int(450 / dt)):
    depth = 0.01 * step * dt
    found = touch.step(
        solver.positions(), (30, 30, 54 - depth), velocities=solver.velocities(), velocity=(0, 0, -0.01)
    )
    loads.clear()
    loads.touch(found)
    solver.step(loads, dt)
    depths.append(depth)
    forces.append(found.force_n[2])
print(f"{forces[-1]:.3f} N at {depths[-1]:.1f} mm; the brain is {len(mesh.tets)} tetrahedra")
assert 0.01 < forces[-1] < 1

# %%
figure = Figure(figsize=(9, 3.6), layout="constrained")
left, right = figure.subplots(1, 2)
left.plot(press_mm, bone_n)
left.set(xlabel="hand behind the surface, mm", ylabel="force, N", title="burr on bone, not drilling")
right.plot(depths, 1e3 * np.array(forces))
right.set(xlabel="way of the probe, mm", ylabel="force, mN", title="ball of 6 mm on brain")
figure
