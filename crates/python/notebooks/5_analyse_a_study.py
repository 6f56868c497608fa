# %% [markdown]
# # Analyse a study
# Recordings are MCAP files with every tick of the hand. `TREPAN_STUDY` names a folder with sessions;
# without it the recorded paths of the repository stand in.

# %%
import os
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import trepan

HERE = Path(__file__).resolve() if "__file__" in globals() else Path.cwd() / "notebook"
folder = Path(os.environ.get("TREPAN_STUDY", HERE.parents[3] / "fixtures" / "paths"))
recordings = [trepan.read_recording(path) for path in sorted(folder.rglob("*.mcap"))]
assert recordings, f"{folder} holds no .mcap file"
for recording in recordings:
    print(recording.path.name, recording.app, len(recording), recording.losses or "complete")

# %% [markdown]
# A row for each session: time, way of the tip, speed, smoothness (log dimensionless jerk of the
# tip; Hogan and Sternad 2009, less negative is smoother), forces, bone.


# %%
def row(recording: trepan.Recording) -> dict[str, float]:
    """Figures of one session."""
    ticks = recording.ticks
    time_s = 1e-3 * ticks["time_ms"]
    step_s = float(np.median(np.diff(time_s)))
    tip = ticks["proxy_mm"].astype(np.float64)
    # A mean over 50 ms: jerk is a third derivative.
    window = max(1, round(0.05 / step_s))
    smooth = np.stack([np.convolve(axis, np.ones(window) / window, "valid") for axis in tip.T], axis=1)
    velocity = np.diff(smooth, axis=0) / step_s
    speed = np.linalg.norm(velocity, axis=1)
    jerk = np.diff(velocity, n=2, axis=0) / step_s**2
    duration = step_s * len(speed)
    cost = (jerk**2).sum() * step_s * duration**3 / max(speed.max(), 1e-9) ** 2
    force = np.linalg.norm(ticks["force_n"], axis=1)
    return {
        "time_s": time_s[-1] - time_s[0],
        "path_mm": speed.sum() * step_s,
        "mean_mm_s": speed.mean(),
        "log_jerk": -np.log(max(cost, 1e-300)),
        "peak_n": force.max(),
        "touching_%": 100 * (ticks["contact_normal"] != 0).any(axis=1).mean(),
        "bone_mm3": ticks["removed_mm3"].sum(),
        "tick_us": float(np.median(ticks["compute_us"])),
    }


rows = [row(recording) for recording in recordings]
print(f"{'':28}" + "".join(f"{name:>12}" for name in rows[0]))
for recording, numbers in zip(recordings, rows):
    print(f"{recording.path.stem:28}" + "".join(f"{number:12.2f}" for number in numbers.values()))

# %% [markdown]
# Scores stand in each session's folder, with their units.

# %%
for recording in recordings:
    try:
        scores = recording.scores
    except FileNotFoundError:
        continue
    print(recording.path.parent.name, {name: f"{score.value:g} {score.unit}" for name, score in scores.items()})

# %%
figure = Figure(figsize=(6, 4), layout="constrained")
axes = figure.subplots()
axes.scatter([numbers["path_mm"] for numbers in rows], [numbers["log_jerk"] for numbers in rows])
for recording, numbers in zip(recordings, rows):
    axes.annotate(recording.path.stem, (numbers["path_mm"], numbers["log_jerk"]), fontsize=8)
axes.set(xlabel="way of the tip, mm", ylabel="log dimensionless jerk")
axes.margins(x=0.2)
figure

# %%
recordings[-1].plot()
