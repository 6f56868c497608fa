#!/usr/bin/env bash
# A tilted CT (gantry tilt) has a shear, which NIfTI's sform can hold.
# Expected: an image that SimpleITK reads and shows right is saved right, or not at all.
# Seen (SimpleITK 2.5.7): saved as NIfTI its axes are made orthogonal with a warning on the console
# alone; read again, its last slice lies 51 mm off. Saved as NRRD or MetaImage it keeps its place.
# Hurts: "convert to NIfTI" moves a skull by centimetres, most where it is farthest from the origin.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet install SimpleITK==2.5.7
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import math, SimpleITK
open("x.nrrd", "wb").write(b"""NRRD0004
type: uchar
dimension: 3
space: left-posterior-superior
sizes: 16 16 100
space directions: (1,0,0) (0,1,0) (0,1,2)
space origin: (0,0,0)
encoding: raw

""" + bytes(25600))
image = SimpleITK.ReadImage("x.nrrd")
place = image.TransformIndexToPhysicalPoint((0, 0, 99))
off = {}
for name in ("y.nii.gz", "y.nrrd", "y.mha"):
    SimpleITK.WriteImage(image, name)
    off[name] = math.dist(place, SimpleITK.ReadImage(name).TransformIndexToPhysicalPoint((0, 0, 99)))
print("SimpleITK", SimpleITK.Version.VersionString(), "moved by mm:", off)
assert off["y.nrrd"] < 1e-3 and off["y.mha"] < 1e-3
assert off["y.nii.gz"] > 10, "NIfTI keeps the shear now"
PYTHON
