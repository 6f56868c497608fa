"""Small synthetic scenes for tests, notebooks and training: nobody's data."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._trepan import AIR_HU
from .images import VoxelVolume


def _cubes(low_mm: float, count: int, spacing_mm: float) -> tuple[VoxelVolume, list[NDArray[np.float64]]]:
    affine = np.diag([spacing_mm, spacing_mm, spacing_mm, 1.0])
    affine[:3, 3] = low_mm
    axis = low_mm + spacing_mm * np.arange(count)
    volume = VoxelVolume(np.zeros((count,) * 3, np.int16, order="F"), affine)
    return volume, list(np.meshgrid(axis, axis, axis, indexing="ij", sparse=True))


def slab(thickness_mm: float = 6.0, spacing_mm: float = 0.5, hu: float = 1200.0) -> VoxelVolume:
    """A CT of a flat bone, int16 HU: its outer face is z = 0, the inner z = -``thickness_mm``.

    32 mm wide. Its density crosses 400 HU at the faces with 1000 HU a voxel.
    """
    count = int(32.0 / spacing_mm)
    volume, (_, _, z) = _cubes(-16.0 + 0.5 * spacing_mm, count, spacing_mm)
    depth = np.minimum(-z, z + thickness_mm)
    density = np.clip(400.0 + 1000.0 / spacing_mm * depth, float(AIR_HU), hu)
    return volume.with_data(np.asfortranarray(np.broadcast_to(density, (count,) * 3).astype(np.int16)))


def head(spacing_mm: float = 2.0) -> tuple[VoxelVolume, VoxelVolume]:
    """A CT, int16 HU, and a brain mask, uint8, of a round head of 75 mm radius around 0.

    Scalp, a skull 6 mm thick, 2 mm of fluid, brain of 65 mm radius.
    """
    volume, axes = _cubes(-80.0, int(160.0 / spacing_mm) + 1, spacing_mm)
    radius = np.sqrt(sum(axis**2 for axis in axes))
    bone = np.minimum(73.0 - radius, radius - 67.0) / spacing_mm
    tissue = np.where(radius < 75.0, 40.0, float(AIR_HU))
    density = np.maximum(tissue, np.clip(400.0 + 1000.0 * bone, float(AIR_HU), 1200.0))
    ct = volume.with_data(np.asfortranarray(density.astype(np.int16)))
    return ct, volume.with_data(np.asfortranarray((radius < 65.0).astype(np.uint8)))
