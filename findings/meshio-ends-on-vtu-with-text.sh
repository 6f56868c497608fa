#!/usr/bin/env bash
# meshio 5.3.5 ends the whole Python process on a VTU file that holds a text.
#
# Expected: a mesh, or at least an exception. Every VTU that 3D Slicer saves holds the text field
# SPACE (RAS or LPS), and VTK and PyVista write any text of the field data in the same way.
# Seen: meshio.read prints "Illegal data type 'String'" and raises SystemExit, which `except
# Exception` does not catch: a script that reads many files stops at the first one of 3D Slicer.
# VTK 9.6.2 reads the same file.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" -q install meshio==5.3.5 vtk==9.6.2
cd "$folder"
venv/bin/python - <<'PYTHON'
import meshio, vtk

mesh = vtk.vtkUnstructuredGrid()
points = vtk.vtkPoints()
for corner in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)):
    points.InsertNextPoint(corner)
mesh.SetPoints(points)
mesh.InsertNextCell(vtk.VTK_TETRA, 4, (0, 1, 2, 3))
space = vtk.vtkStringArray()
space.SetName("SPACE")
space.InsertNextValue("RAS")
mesh.GetFieldData().AddArray(space)
writer = vtk.vtkXMLUnstructuredGridWriter()
writer.SetFileName("mesh.vtu")
writer.SetInputData(mesh)
writer.Write()
reader = vtk.vtkXMLUnstructuredGridReader()
reader.SetFileName("mesh.vtu")
reader.Update()
print("VTK", vtk.VTK_VERSION, "reads", reader.GetOutput().GetNumberOfCells(), "tetrahedron")
assert reader.GetOutput().GetNumberOfCells() == 1
try:
    meshio.read("mesh.vtu")
except SystemExit as end:
    print("meshio", meshio.__version__, "raises", repr(end))
else:
    raise SystemExit("meshio reads it now: this finding is out of date")
PYTHON
