#!/usr/bin/env python3
"""Compares `integrated inspect --json` with nibabel, SimpleITK, pydicom's series (by SimpleITK) and
meshio, on every file of a folder that both read.

    pip install nibabel SimpleITK meshio
    python3 inspect_agrees.py target/release/integrated FOLDER

Prints a row for each kind of file: how many both read, how many agree in size, spacing, affine (1e-5)
and values (1e-6 of the range), and the files that do not. Exits with 1 if one does not.
"""
import json, subprocess, sys
from collections import defaultdict
from pathlib import Path

import numpy as np


def inspected(program, path):
    run = subprocess.run([program, "inspect", "--json", str(path)], capture_output=True, text=True, timeout=120)
    return json.loads(run.stdout) if run.returncode == 0 else None


def of_nibabel(path):
    import nibabel

    image = nibabel.load(path)
    data = image.get_fdata(dtype=np.float64)
    if data.ndim == 4 and data.shape[3] > 1 or data.ndim > 4:
        return None
    return data.reshape(data.shape[:3]), image.affine[:3]


def of_itk(path):
    import SimpleITK as sitk

    if path.is_dir():
        reader = sitk.ImageSeriesReader()
        names = [reader.GetGDCMSeriesFileNames(str(path), n) for n in reader.GetGDCMSeriesIDs(str(path))]
        if len(names) != 1 or len(names[0]) < 2:
            return None
        image = sitk.ReadImage(names[0])
    else:
        image = sitk.ReadImage(str(path))
    if image.GetDimension() != 3 or image.GetNumberOfComponentsPerPixel() != 1:
        return None
    data = sitk.GetArrayFromImage(image).astype(float).transpose(2, 1, 0)
    turn = np.diag([-1.0, -1.0, 1.0])
    matrix = turn @ np.array(image.GetDirection()).reshape(3, 3) @ np.diag(image.GetSpacing())
    return data, np.column_stack([matrix, turn @ np.array(image.GetOrigin())])


def of_meshio(path):
    import meshio

    mesh = meshio.read(path)
    tets = sum(len(block.data) for block in mesh.cells if block.type in ("tetra", "tetra10"))
    return tets or None


def compared(seen, data, affine):
    faults = []
    if list(data.shape) != seen["size, voxels"]:
        return ["size"]
    if not np.allclose(seen["affine to RAS, mm"], affine, atol=1e-5, rtol=1e-6):
        faults.append("affine")
    spacing = np.linalg.norm(affine[:, :3], axis=0)
    if not np.allclose(seen["spacing, mm"], spacing, atol=1e-5, rtol=1e-6):
        faults.append("spacing")
    finite = data[np.isfinite(data)]
    values = seen["values"]
    if finite.size and isinstance(values, dict):
        scale = max(1.0, np.abs(finite).max())
        found = [values["least"], values["greatest"], values["mean"]]
        if not np.allclose(found, [finite.min(), finite.max(), finite.mean()], atol=1e-6 * scale, rtol=0):
            faults.append("values")
    return faults


def main(program, folder):
    rows, odd = defaultdict(lambda: [0, 0, 0]), []
    files = [p for p in sorted(Path(folder).rglob("*")) if p.is_file()]
    folders = sorted({p.parent for p in files if p.suffix.lower() == ".dcm"})
    for path in folders + files:
        name = path.name.lower()
        kind, readers = None, []
        if path.is_dir():
            kind, readers = "DICOM folder", [of_itk]
        elif name.endswith((".nii", ".nii.gz", ".mgz", ".mgh")):
            kind, readers = "NIfTI, MGH", [of_nibabel]
        elif name.endswith((".nrrd", ".nhdr", ".mha", ".mhd")):
            kind, readers = "NRRD, MetaImage", [of_itk]
        elif name.endswith((".msh", ".vtk", ".vtu", ".mesh", ".inp")):
            kind = "mesh"
        else:
            continue
        seen = inspected(program, path)
        row = rows[kind]
        if kind == "mesh":
            try:
                tets = of_meshio(path)
            except (Exception, SystemExit):
                tets = None
            if seen is None or tets is None or "tetrahedra" not in seen:
                row[2] += 1
                continue
            row[0] += 1
            row[1] += seen["tetrahedra"] == tets
            if seen["tetrahedra"] != tets:
                odd.append(f"{path}: {seen['tetrahedra']} tetrahedra, meshio {tets}")
            continue
        other = None
        for reader in readers:
            try:
                other = reader(path)
            except Exception:
                other = None
        seen = seen.get("taken", seen) if seen else None
        if seen is None or other is None or "size, voxels" not in seen:
            row[2] += 1
            continue
        faults = compared(seen, *other)
        row[0] += 1
        row[1] += not faults
        if faults:
            odd.append(f"{path}: {', '.join(faults)}")
    print(f"{'kind':18} both read  agree  read by one or none")
    for kind, (both, agree, other) in sorted(rows.items()):
        print(f"{kind:18} {both:9} {agree:6} {other:20}")
    print(*odd, sep="\n")
    return 1 if odd else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2]))
