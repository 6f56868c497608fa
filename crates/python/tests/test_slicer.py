"""Files as 3D Slicer's own core reads them (slicer-core): they lie there where they lie here."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import trepan

slicer = pytest.importorskip("slicer_core")

# Limit of the distance between a place there and here, mm.
NEAR_MM = 0.01


def affine_and_image(path: Path) -> tuple[NDArray[np.float64], Any]:
    """Affine (4, 4) from voxels to RAS mm, and the vtkImageData."""
    reader = slicer.vtkITKArchetypeImageSeriesScalarReader()
    reader.SetArchetype(str(path))
    reader.SetOutputScalarTypeToNative()
    reader.SetDesiredCoordinateOrientationToNative()
    reader.SetUseNativeOriginOn()
    reader.Update()
    matrix = reader.GetRasToIjkMatrix()
    return np.linalg.inv([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)]), reader.GetOutput()


def check(path: Path, volume: trepan.VoxelVolume) -> None:
    """Corners and some voxels of a file against the volume."""
    affine, image = affine_and_image(path)
    assert image.GetDimensions() == volume.data.shape
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]) * (np.array(volume.data.shape) - 1)
    there = corners @ affine[:3, :3].T + affine[:3, 3]
    assert np.linalg.norm(there - volume.to_world(corners), axis=1).max() < NEAR_MM
    for at in np.random.default_rng(7).integers(0, volume.data.shape, (50, 3)):
        assert image.GetScalarComponentAsDouble(*map(int, at), 0) == pytest.approx(float(volume.data[tuple(at)]))


def test_the_built_in_head_lies_there_where_it_lies_here(case_head: Path) -> None:
    for name in ("ct_hu", "mri_t1"):
        check(case_head / f"{name}.nii.gz", trepan.read_volume(case_head / f"{name}.nii.gz"))


@pytest.mark.parametrize("suffix", ["nii.gz", "nrrd"])
def test_what_is_written_lies_there_where_it_lies_here(suffix: str, tmp_path: Path) -> None:
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = turn @ np.diag([0.7, 1.3, 2.1]), [-31.25, 12.5, 88.0]
    data = np.random.default_rng(4).integers(-1000, 2000, (17, 13, 9)).astype(np.int16)
    volume = trepan.VoxelVolume(data, affine)
    trepan.write_volume(tmp_path / f"v.{suffix}", volume)
    check(tmp_path / f"v.{suffix}", volume)


@pytest.mark.skipif("TREPAN_BIN" not in os.environ, reason="needs the built programs")
def test_a_sessions_places_lie_there_where_they_lie_here(tmp_path: Path) -> None:
    recording = trepan.session.run(["--duration", "4", "--quality", "draft"], program="brain", out=tmp_path / "s")
    scene = slicer.vtkMRMLScene()
    curve, storage = slicer.vtkMRMLMarkupsCurveNode(), slicer.vtkMRMLMarkupsJsonStorageNode()
    scene.AddNode(curve)
    scene.AddNode(storage)
    storage.SetFileName(str(tmp_path / "s" / "tool-path.mrk.json"))
    assert storage.ReadData(curve) == 1 and curve.GetNumberOfControlPoints() > 3
    path_mm = recording.ticks["proxy_mm"]
    for number in range(curve.GetNumberOfControlPoints()):
        place = [0.0, 0.0, 0.0]
        curve.GetNthControlPointPositionWorld(number, place)
        assert np.linalg.norm(path_mm - place, axis=1).min() < NEAR_MM
