#!/usr/bin/env python3
"""Opens the images, meshes, markups and tables that Trepan writes with the field's own programs.

    pip install nibabel SimpleITK meshio vtk mcap-protobuf-support pandas slicer-core
    python3 written_files_open.py target/release/integrated [OUT [MESHES]]

Runs a session and `case build` on the built-in case, and on its CT as a gantry tilted by 27 degrees
would have scanned it, in a new folder OUT or a temporary one (5 GB of memory, two minutes). Prints
a row for each file and program; exits with 1 if one disagrees. `known` is what a program does to
other files, too. Where slicer-core is missing (no wheel for some Pythons) the last line says so.
MESHES has OUT/straight-case/brain.vtk of an earlier run as .vtu, .msh, .mesh, .inp or .node, by
`cargo run -p trepan-mesh --example inspect_mesh brain.vtk MESHES/brain.vtu`. No command writes PLY
or OBJ: of these, and of other STL, the readers are compared.
"""
import importlib.util, io, json, subprocess, sys, tempfile
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path

import meshio, nibabel, pandas, vtk
import numpy as np, SimpleITK as sitk
from mcap_protobuf.reader import read_protobuf_messages
from nibabel.affines import apply_affine
from vtkmodules.util.numpy_support import vtk_to_numpy

slicer = importlib.import_module("slicer") if importlib.util.find_spec("slicer_core") else None
HEAD = Path(__file__).resolve().parents[3] / "fixtures/case-head"
CT, MRI = HEAD / "ct_hu.nii.gz", HEAD / "mri_t1.nii.gz"
SURFACES = (".stl", ".ply", ".obj")
# By program, ending and refusal.
KNOWN = {("VTK", ".nrrd", False): "drops the directions", ("meshio", ".vtu", True): "no text field"}
rows, scenes = [], []


def row(path, program, what, off, most):
    known = KNOWN.get((program, path.suffix, off is None)) if off is None or off < np.inf else None
    agrees = "yes" if off is not None and off <= most else f"known: {known}" if known else "NO"
    off = "refused" if off is None else f"{off:.1e}"
    rows.append((f"{path.parent.name}/{path.name}", program, what, off, agrees))


def compare(path, readers, what, gap, most):
    for program in (name for name in readers if slicer or name != "3D Slicer"):
        off, words = None, io.StringIO()
        with redirect_stdout(words), redirect_stderr(words), suppress(Exception, SystemExit):
            off = np.abs(gap(readers[program](path))).max()
        row(path, program, what, off, most)


def nibabel_image(path):
    image = nibabel.load(path)
    return np.asanyarray(image.dataobj), image.affine


def itk_image(path):
    image, affine = sitk.ReadImage(str(path)), np.eye(4)
    affine[:3, :3] = np.reshape(image.GetDirection(), (3, 3)) * image.GetSpacing()
    affine[:3, 3] = image.GetOrigin()
    return sitk.GetArrayFromImage(image).T, np.diag([-1, -1, 1, 1]) @ affine


def of_vtk(image, *matrices):
    voxels, affine = vtk_to_numpy(image.GetPointData().GetScalars()).copy(), np.eye(4)
    for matrix in matrices:
        affine = affine @ [[matrix.GetElement(r, c) for c in range(4)] for r in range(4)]
    return voxels.reshape(image.GetDimensions(), order="F"), affine


def vtk_reader(kind, path):
    reader = getattr(vtk, f"vtk{kind}Reader")()
    reader.SetFileName(str(path))
    reader.Update()
    return reader


def vtk_image(path):
    reader = vtk_reader("Nrrd" if path.suffix == ".nrrd" else "NIFTIImage", path)
    outer = [reader.GetSFormMatrix()] if path.suffix != ".nrrd" else []
    return of_vtk(reader.GetOutput(), *outer, reader.GetOutput().GetIndexToPhysicalMatrix())


def slicer_node(path, storage, node):
    scenes.append(slicer.vtkMRMLScene())
    node = scenes[-1].AddNewNodeByClass(f"vtkMRML{node}Node")
    storage = getattr(slicer, f"vtkMRML{storage}StorageNode")()
    storage.SetFileName(str(path))
    return node if storage.ReadData(node) else None


def slicer_image(path):
    kind = "LabelMapVolume" if "label" in path.name else "ScalarVolume"
    node, matrix = slicer_node(path, "VolumeArchetype", kind), vtk.vtkMatrix4x4()
    node.GetIJKToRASMatrix(matrix)
    return of_vtk(node.GetImageData(), matrix)


def slicer_points(path):
    kind = json.loads(path.read_text())["markups"][0]["type"]
    node = slicer_node(path, "MarkupsJson", f"Markups{kind}")
    points = range(node.GetNumberOfControlPoints())
    return np.array([node.GetNthControlPointPositionWorld(n) for n in points])


def vtk_mesh(path):
    kinds = {".vtk": "GenericDataObject", ".vtu": "XMLUnstructuredGrid"}
    return vtk_reader(kinds.get(path.suffix, path.suffix[1:].upper()), path).GetOutput()


def corners(mesh):
    if isinstance(mesh, meshio.Mesh):
        return mesh.points.astype(np.float32)[mesh.cells[0].data]
    cells = mesh.GetPolys() if mesh.IsA("vtkPolyData") else mesh.GetCells()
    nodes = vtk_to_numpy(cells.GetConnectivityArray()).reshape(mesh.GetNumberOfCells(), -1)
    return vtk_to_numpy(mesh.GetPoints().GetData())[nodes]


def meshes(path, true=None):
    readers = {"meshio": meshio.read}
    if path.suffix in (".vtk", ".vtu", *SURFACES):
        readers["3D Slicer"] = lambda path: slicer_node(path, "Model", "Model").GetMesh()
        readers |= {} if true is None else {"VTK": vtk_mesh}
    true = corners(vtk_mesh(path)) if true is None else true
    off = lambda other: other - true if other.shape == true.shape else np.inf
    gap = lambda mesh: off(corners(mesh))
    compare(path, readers, "corners of all cells to VTK's, mm", gap, 1e-5)
    return true


def outside(cells, mask, affine):
    """Share of cells whose middle is outside a mask, %."""
    at = np.rint(apply_affine(np.linalg.inv(affine), cells.mean(axis=1))).astype(int)
    return 100 - 100 * (mask[tuple(np.clip(at, 0, np.array(mask.shape) - 1).T)] > 0).mean()


def volumes(out, case, ct, ending):
    drilled, label = out / f"drilled.{ending}", out / f"removed-label.{ending}"
    readers = {"SimpleITK": itk_image, "VTK": vtk_image, "3D Slicer": slicer_image}
    for path in drilled, label, out / "drilled-fine.nii.gz", *sorted(case.glob("*.nii")):
        values, affine = (itk_image(path)[0], ct) if path.suffix == ".nrrd" else nibabel_image(path)
        at = np.argwhere(np.ones((2, 2, 2))) * (np.array(values.shape) - 1)
        off = lambda other: apply_affine(other, at) - apply_affine(affine, at)
        gap = lambda image: off(image[1]) if np.array_equal(image[0], values) else np.inf
        compare(path, readers, "values; corners to nibabel's, mm", gap, 1e-4)
    summary = json.loads((out / "summary.json").read_text())
    off = itk_image(label)[0].sum() * np.linalg.det(ct) - summary["removed_label"]["label_mm3"]
    row(label, "SimpleITK", "volume to summary.json, mm3", abs(off), 1e-6)
    image, (values, affine) = sitk.ReadImage(str(drilled)), nibabel_image(CT)
    grid = sitk.ReadImage(str(CT)), sitk.Transform(), sitk.sitkNearestNeighbor
    moved = sitk.GetArrayFromImage(sitk.Resample(image, *grid)).T
    off = apply_affine(affine, np.argwhere(moved != values)) - summary["opening"]["entry_mm"]
    off = np.linalg.norm(off, axis=1).max() if len(off) else np.inf
    row(drilled, "SimpleITK", "opening to last change of CT, mm", off, 12)
    off = outside(meshes(case / "brain.vtk"), *nibabel_image(case / "mask.nii"))
    row(case / "brain.vtk", "nibabel", "tetrahedra outside mask.nii, %", off, 5)
    if ending != "nrrd":
        isovalue = json.loads((case / "case.json").read_text())["isovalue_hu"]
        bone = sitk.GetArrayFromImage(sitk.GrayscaleDilate(image, [1, 1, 1])).T >= isovalue
        off = outside(meshes(out / "drilled.stl"), bone, affine)
        row(out / "drilled.stl", "SimpleITK", "triangles a voxel off the bone, %", off, 5)


def tables(out):
    summary = json.loads((out / "summary.json").read_text())
    recorded = read_protobuf_messages(out / "session.mcap", topics=["/tick"])
    tips = [message.proto_msg.proxy.translation for message in recorded]
    tips = np.array([[tip.x, tip.y, tip.z] for tip in tips])
    row(out / "session.mcap", "mcap", "ticks to summary.json", abs(len(tips) - summary["ticks"]), 0)
    table = pandas.read_csv(out / "ticks.csv")[[f"tip_{axis}_ras_mm" for axis in "xyz"]]
    off = np.abs(table.to_numpy() - tips).max() if len(table) == len(tips) else np.inf
    row(out / "ticks.csv", "pandas", "tip to mcap's, mm", off, 1e-5)
    session = pandas.read_csv(out / "sessions.csv").iloc[0]
    off = [abs(session[f"scores.{key}"] - score) for key, score in summary["scores"].items()]
    row(out / "sessions.csv", "pandas", "scores to summary.json", max(off), 1e-5)
    plan, norm = summary["opening"], lambda points: np.linalg.norm(points, axis=1)
    entry, inward = np.array(plan["entry_mm"]), np.array(plan["inward"])
    below = entry + plan["bone_mm"] * inward
    gaps = {
        "opening": lambda at: at[:2] - [entry, below],
        "plan": lambda at: at - [entry - 30 * inward, below],
        "flap-line": lambda at: norm(np.cross(at - entry, inward)) - plan["hole_mm"],
        "tool-path": lambda at: [norm(tips - one).min() for one in at],
    }
    for file, gap in gaps.items():
        path, what = out / f"{file}.mrk.json", "points to plan or recording, mm"
        compare(path, {"3D Slicer": slicer_points}, what, gap, 1e-3)


def main(program, folder, mesh_folder=None):
    folder.mkdir(parents=True)
    (values, affine), shear, tilted = nibabel_image(CT), np.eye(4), folder / "tilted.nii.gz"
    air, nz = values.min(), values.shape[2]
    slices = [np.pad(values[..., k], ((0, 0), (nz - k, k)), constant_values=air) for k in range(nz)]
    shear[1, 2:] = 1, -nz
    nibabel.save(nibabel.Nifti1Image(np.stack(slices, axis=2), affine @ shear), tilted)
    patient = ["--ct", tilted, "--mri", MRI, "--cache", folder / "cache"]
    short = ["--headless", "--duration=5", "--quality=draft", "--frames-per-second=0"]
    for name, patient, ending in ("straight", [], "nii.gz"), ("tilted", patient, "nrrd"):
        out, case = folder / name, folder / f"{name}-case"
        for words in (
            [*short, "--drilled-fine", "--out", out, *(patient or ["--stl"])],
            ["case", "build", "--out", case, *patient],
            ["recording", "export", out / "session.mcap", "--csv", out / "ticks.csv"],
            ["sessions", "export", out, "--csv", out / "sessions.csv"],
        ):
            subprocess.run([program, *map(str, words)], check=True, stdout=subprocess.DEVNULL)
        volumes(out, case, affine @ shear if patient else affine, ending)
        tables(out)
    brain = corners(vtk_mesh(folder / "straight-case/brain.vtk"))
    for path in sorted(Path(mesh_folder).iterdir()) if mesh_folder else ():
        meshes(path, None if path.suffix in SURFACES else brain)
    print(f"{'file':30} {'program':9} {'compared':34} {'gap':7} agrees")
    print(*("{:30} {:9} {:34} {:7} {}".format(*line) for line in rows), sep="\n")
    print("" if slicer else "SKIPPED: all rows of 3D Slicer, as slicer-core is not installed.")
    return 1 if any(line[4] == "NO" for line in rows) else 0


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        new = Path(sys.argv[2] if len(sys.argv) > 2 else f"{temporary}/out")
        sys.exit(main(sys.argv[1], new, *sys.argv[3:4]))
