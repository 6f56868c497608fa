# %% [markdown]
# # Drill headless
# First the burr alone, then the environment for learning, then a whole session of the simulator
# where its program is at hand.

# %%
import numpy as np
from matplotlib.figure import Figure

import trepan
from trepan.gym import DrillEnv

bone = trepan.BoneVolume(trepan.scenes.slab(6.0), isovalue=400)
figure = Figure(figsize=(9, 3.6), layout="constrained")
left, right = figure.subplots(1, 2)
for feed_mm_s in (2.0, 4.0):
    burr = trepan.RigidContact(trepan.BoneVolume(trepan.scenes.slab(6.0), 400), trepan.Tool.burr(2.0))
    height = 2.2 - 1e-3 * feed_mm_s * np.arange(int(9000 / feed_mm_s))
    path = burr.path(np.column_stack([0 * height, 0 * height, height]), drilling=True)
    force_n = burr.stiffness_n_per_mm * path.depth_mm
    time_s = 1e-3 * np.arange(len(height))
    left.plot(time_s, force_n, lw=0.8, label=f"{feed_mm_s:.0f} mm/s")
    right.plot(time_s, np.cumsum(path.removed_mm3), label=f"{feed_mm_s:.0f} mm/s")
    through = np.flatnonzero(path.broke_through)
    print(f"{feed_mm_s:.0f} mm/s: {force_n.max():.1f} N at most, through after {time_s[through[0]]:.2f} s")
left.set(xlabel="time, s", ylabel="force of the task, N")
right.set(xlabel="time, s", ylabel="bone removed, mm$^3$")
left.legend()
figure

# %% [markdown]
# The environment: a policy that slows down with the bone left, known from the map of its CT.


# %%
def episode(env: DrillEnv, seed: int, is_careful: bool) -> dict[str, float]:
    """Drills one hole; returns what the episode ends with."""
    seen, info = env.reset(seed=seed)
    is_over, reward = False, 0.0
    while not is_over:
        left_mm = info["thickness_mm"] + seen[2] - 2.0
        feed = 0.2 * min(1.0, max(0.15, left_mm / 3.0)) if is_careful else 0.3
        down = -0.5 if seen[8] > 0 and is_careful else feed
        seen, gained, terminated, truncated, info = env.step(np.array([0, 0, down], np.float32))
        reward += gained
        is_over = terminated or truncated
    return info | {"reward": reward}


env = DrillEnv()
for is_careful in (False, True):
    ends = [episode(env, seed, is_careful) for seed in range(5)]
    mean = {name: np.mean([end[name] for end in ends]) for name in ("reward", "plunge_mm", "force_n")}
    print("careful" if is_careful else "steady ", {name: round(float(number), 2) for name, number in mean.items()})

# %% [markdown]
# A whole operation, as `integrated --headless` runs it: skull, dura, brain, all forces, one folder.

# %%
try:
    trepan.session.find_program()
except FileNotFoundError as fault:
    print(fault)
else:
    session = trepan.session.run(["--duration", "5"])
    print(session, "in", session.path.parent)
    for name in ("bone_removed_mm3", "peak_bone_force_n", "plunge_mm"):
        print(name, session.scores[name])
