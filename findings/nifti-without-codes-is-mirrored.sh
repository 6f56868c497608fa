#!/usr/bin/env bash
# A NIfTI-1 file whose qform_code and sform_code are 0 is valid ("method 1" of the standard).
# Expected: readers agree on where it lies, or one of them warns.
# Seen (nibabel 5.4.2, SimpleITK 2.5.7): both put i to the left without a word, but j to the front
# in nibabel and to the back in SimpleITK, so that one head is the mirror image of the other.
# Hurts: an anonymised CT of this kind, masked in one and shown in the other, changes sides.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet install nibabel==5.4.2 SimpleITK==2.5.7
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import struct, numpy, nibabel, SimpleITK
header = bytearray(352)
struct.pack_into("<i", header, 0, 348)
struct.pack_into("<8h", header, 40, 3, 4, 3, 2, 1, 1, 1, 1)
struct.pack_into("<2h", header, 70, 4, 16)
struct.pack_into("<4f", header, 76, 1, 1, 2, 3)
struct.pack_into("<2f", header, 108, 352, 1)
header[123], header[344:348] = 2, b"n+1\0"
open("x.nii", "wb").write(bytes(header) + numpy.arange(24, dtype="<i2").tobytes())
itk = SimpleITK.ReadImage("x.nii")
itk = numpy.diag([-1, -1, 1]) @ numpy.array(itk.GetDirection()).reshape(3, 3) @ numpy.diag(itk.GetSpacing())
nib = nibabel.load("x.nii").affine[:3, :3]
print("nibabel", nibabel.__version__, nib.tolist(), "SimpleITK", SimpleITK.Version.VersionString(), itk.tolist())
assert numpy.linalg.det(nib) * numpy.linalg.det(itk) < 0, "the two readers agree now"
PYTHON
