# %% [markdown]
# # Read my CT
# A CT becomes Hounsfield units, a skull of 1 mm cubes, a surface, and a case that a burr can drill.
# Run it as it stands with the built-in head, or name your own: `TREPAN_CT=head_ct.nii.gz`.

# %%
import os
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import trepan

HERE = Path(__file__).resolve() if "__file__" in globals() else Path.cwd() / "notebook"
BUILT_IN = HERE.parents[3] / "fixtures" / "case-head" / "ct_hu.nii.gz"
image = trepan.read_volume(os.environ.get("TREPAN_CT", BUILT_IN))
print(image.data.shape, "voxels of", image.spacing_mm, "mm")
for name, fact in image.facts.items():
    print(f"{name}: {fact}")
for warning in image.warnings:
    print("warning:", warning)

# %% [markdown]
# Whole Hounsfield units; the threshold of bone comes from the histogram.

# %%
ct = trepan.hounsfield(image)
isovalue = trepan.bone_isovalue(ct)
skull, remark = trepan.skull_only(trepan.resample(ct, 1.0, "cubic", trepan.AIR_HU), isovalue)
print(f"bone from {isovalue} HU;", remark or "no loose bone")

# %%
figure = Figure(figsize=(9, 3.4), layout="constrained")
for axes, axis in zip(figure.subplots(1, 3), range(3)):
    plane = np.take(skull.data, skull.data.shape[axis] // 2, axis=axis)
    axes.imshow(plane.T, origin="lower", cmap="gray", vmin=-200, vmax=1500)
    axes.contour(plane.T, [isovalue], colors="tab:red", linewidths=0.6)
    axes.set_title(("sagittal", "coronal", "axial")[axis])
    axes.set_axis_off()
figure

# %% [markdown]
# The surface in RAS mm, at 2 mm so that it turns quickly, and the thickness of bone along a line
# into the head.

# %%
surface = trepan.isosurface(trepan.resample(skull, 2.0, "cubic", trepan.AIR_HU), isovalue)
print(f"{len(surface.triangles)} triangles")
bone = trepan.BoneVolume(skull, isovalue)
low, high = np.array(bone.bounds_mm)
middle = 0.5 * (low + high)
outer = trepan.first_bone(bone, [middle[0], middle[1], high[2] + 2], middle)
assert outer is not None, "no bone over the middle of the head"
below = outer - np.arange(0, 30, 0.1)[:, None] * [0, 0, 1]
thickness_mm = 0.1 * np.argmin(bone.is_bone(below))
print(f"outer table at {np.round(outer, 1)} mm, {thickness_mm:.1f} mm of bone below")
assert 1 < thickness_mm < 20

# %% [markdown]
# Turn it with the mouse: `trepan.view.view(surface).show()` (needs PyVista).
