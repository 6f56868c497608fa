#!/usr/bin/env bash
# An MGH volume of FreeSurfer whose goodRASFlag is 0 has the default axes of FreeSurfer:
# i left, j foot, k front ("LIA"; include/mri.h, VOL_GEOM: y_s = -1, z_a = 1).
# Expected: nibabel, which replaces the axes of such a file without a word, takes the same.
# Seen (nibabel 5.4.2): i left, j head, k back ("LSP"), half a turn about the ear-to-ear axis.
# Hurts: a head reads upside down with its face behind, and a mask beside it misses the brain.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet install nibabel==5.4.2
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import struct, nibabel
header = struct.pack(">7ih", 1, 4, 3, 2, 1, 0, 0, 0)
open("x.mgh", "wb").write(header.ljust(284, b"\0") + bytes(24))
axes = "".join(nibabel.aff2axcodes(nibabel.load("x.mgh").affine))
print("nibabel", nibabel.__version__, axes, "where FreeSurfer takes LIA")
assert axes == "LSP", "nibabel has other axes now"
PYTHON
