#!/usr/bin/env bash
# A tilted CT (gantry tilt) keeps its shear in the "space directions" of an NRRD file.
# Expected: VTK's reader gives the directions, as it does for other formats, or refuses the file.
# Seen (VTK 9.6.2; SimpleITK 2.5.7 reads it right): vtkNrrdReader takes the lengths of the columns
# as spacing and the identity as directions, without a word. The last of 100 slices lies 102 mm off.
# Hurts: a plan or a drilled skull shown by a VTK program lies beside the patient's other images.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet install vtk==9.6.2 SimpleITK==2.5.7
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import numpy, SimpleITK, vtk
header = """NRRD0004
type: uchar
dimension: 3
space: left-posterior-superior
sizes: 16 16 100
space directions: (1,0,0) (0,1,0) (0,1,2)
space origin: (0,0,0)
encoding: raw

"""
open("x.nrrd", "wb").write(header.encode() + bytes(25600))
itk = SimpleITK.ReadImage("x.nrrd").TransformIndexToPhysicalPoint((0, 0, 99))
reader = vtk.vtkNrrdReader()
reader.SetFileName("x.nrrd")
reader.Update()
image = reader.GetOutput()
seen = [0.0] * 3
image.TransformIndexToPhysicalPoint(0, 0, 99, seen)
print("SimpleITK", itk, "VTK", vtk.vtkVersion.GetVTKVersion(), seen, image.GetSpacing())
assert numpy.allclose(itk, (0, 99, 198))
assert abs(seen[1]) < 1e-6 and abs(seen[2] - 99 * 5 ** 0.5) < 1e-3, "VTK reads the directions now"
PYTHON
