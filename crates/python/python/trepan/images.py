"""Images with patient orientation: read, convert, resample, write (crate ``trepan-volume``)."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _trepan


@dataclass(frozen=True, eq=False)
class VoxelVolume:
    """Samples on a grid, with the affine from voxel indices to the patient's RAS+ mm.

    ``data`` has the shape (i, j, k), ``affine`` (4, 4); voxel (i, j, k) has its centre at
    ``affine @ (i, j, k, 1)``. Readers add ``warnings``, ``facts`` and the ``modality`` (DICOM).
    """

    data: NDArray[Any]
    affine: NDArray[np.float64]
    warnings: tuple[str, ...] = ()
    facts: dict[str, str] = field(default_factory=dict)
    modality: str | None = None

    @property
    def spacing_mm(self) -> NDArray[np.float64]:
        """Edges of a voxel along i, j, k, mm, shape (3,)."""
        spacing: NDArray[np.float64] = np.linalg.norm(self.affine[:3, :3], axis=0)
        return spacing

    def to_world(self, voxels: ArrayLike) -> NDArray[np.float64]:
        """Centres, RAS mm, of voxels given as (..., 3) indices."""
        world: NDArray[np.float64] = np.asarray(voxels) @ self.affine[:3, :3].T + self.affine[:3, 3]
        return world

    def with_data(self, data: NDArray[Any]) -> VoxelVolume:
        """Other samples of the same shape in the same place."""
        if data.shape != self.data.shape:
            raise ValueError(f"data has shape {data.shape}, it must be {self.data.shape}")
        return VoxelVolume(data, self.affine)


def read_volume(path: str | os.PathLike[str], number: int | None = None) -> VoxelVolume:
    """Read a NIfTI, NRRD, MetaImage, MGH or DICOM image, or a folder with a DICOM series.

    ``data`` is float32. ``number`` chooses the series of a folder or the volume of a file, from 0;
    without it the only one, or the largest, is read and a warning says so.

    Raises ``OSError`` where there is no such file, ``TrepanError`` for a wrong content.
    """
    data, affine, notes, modality, facts = _trepan.import_volume(path, number)
    return VoxelVolume(data, affine, tuple(notes), dict(facts), modality)


def write_volume(path: str | os.PathLike[str], volume: VoxelVolume) -> None:
    """Write float32 samples as .nii, .nii.gz or .nrrd; the file appears whole or not at all."""
    _trepan.write_volume(path, volume)


def hounsfield(ct: VoxelVolume) -> VoxelVolume:
    """Round a CT to whole HU, int16. Raises ``TrepanError`` for values that are not of a CT."""
    data = _trepan.hounsfield(ct)
    return ct.with_data(data)


def bone_isovalue(ct: VoxelVolume) -> int:
    """Threshold of bone from the histogram of a CT of int16, HU (Otsu 1979, within 300 to 500)."""
    return _trepan.bone_isovalue(ct)


def skull_only(ct: VoxelVolume, isovalue: int) -> tuple[VoxelVolume, str | None]:
    """The CT (int16) with its largest piece of bone alone, and a remark on what was left out."""
    data, remark = _trepan.skull_only(ct, isovalue)
    return ct.with_data(data), remark


def resample(
    volume: VoxelVolume,
    to: float | VoxelVolume,
    interpolation: Literal["trilinear", "cubic", "nearest", "majority"] = "trilinear",
    outside: float = 0.0,
) -> VoxelVolume:
    """Resample to cubes along RAS of ``to`` mm that cover the image, or to the grid of another.

    float32, int16, uint16 and uint8 keep their type, others become float32. ``outside`` is the
    value beyond the image: ``AIR_HU`` for a CT. Take ``cubic`` for a CT that is drilled,
    ``majority`` for labels.
    """
    if isinstance(to, VoxelVolume):
        shape, affine = _shape(to), to.affine
    else:
        shape, affine = _trepan.isotropic_over(_shape(volume), volume.affine, to)
    data = _trepan.resample(volume, shape, affine, interpolation, outside)
    return VoxelVolume(data, affine)


def distance_field(mask: VoxelVolume) -> VoxelVolume:
    """Signed distance to the border of a mask (not 0), mm, float32, negative inside."""
    data = _trepan.distance_field(mask)
    return mask.with_data(data)


def _shape(volume: VoxelVolume) -> tuple[int, int, int]:
    if not isinstance(volume, VoxelVolume):
        raise TypeError(f"volume is a {type(volume).__name__}: it must be a VoxelVolume")
    if volume.data.ndim != 3:
        raise ValueError(f"volume.data has shape {volume.data.shape}, it must be (i, j, k)")
    i, j, k = volume.data.shape
    return i, j, k
