"""Meshes: read, write, fill a mask with tetrahedra, cell sizes (``trepan-mesh``,
``trepan-voxel-size``)."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _trepan
from .images import VoxelVolume


@dataclass(frozen=True, eq=False)
class TriMesh:
    """Triangles: ``positions`` (n, 3), RAS mm, and ``triangles`` (m, 3), node numbers."""

    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class TetMesh:
    """Tetrahedra: ``positions`` (n, 3), RAS mm, and ``tets`` (m, 4), node numbers."""

    positions: NDArray[np.float32]
    tets: NDArray[np.uint32]
    warnings: tuple[str, ...] = ()

    def surface(self, positions: ArrayLike | None = None) -> TriMesh:
        """The boundary with normals outwards, at rest or at other positions (n, 3)."""
        triangles, _ = _trepan.boundary(self)
        moved = self.positions if positions is None else np.asarray(positions, np.float32)
        if moved.shape != self.positions.shape:
            raise ValueError(f"positions has shape {moved.shape}, it must be {self.positions.shape}")
        return TriMesh(moved, triangles)

    def quality(self) -> dict[str, float]:
        """Angles, edges, mm, and volume, mm3; raises ``ValueError`` for a mesh with a fault."""
        return dict(_trepan.quality(self))


class CellSizes(NamedTuple):
    """Edges of a cell of a collision grid, mm."""

    analytic_mm: float
    mean_edge_mm: float


def read_mesh(path: str | os.PathLike[str]) -> TetMesh:
    """Read tetrahedra from Gmsh, Medit, VTK, VTU, Abaqus or TetGen.

    Raises ``OSError`` where there is no such file, ``TrepanError`` for a wrong content.
    """
    (positions, tets), notes = _trepan.import_mesh(path)
    return TetMesh(positions, tets, tuple(notes))


def read_surface(path: str | os.PathLike[str]) -> TriMesh:
    """Read triangles from STL, OBJ or PLY; errors as :func:`read_mesh`."""
    (positions, triangles), notes = _trepan.import_surface(path)
    return TriMesh(positions, triangles, tuple(notes))


def write_mesh(path: str | os.PathLike[str], mesh: TetMesh) -> None:
    """Write tetrahedra in the format of the name's ending, such as .vtu or .msh."""
    _trepan.write_mesh(path, mesh)


def write_surface(path: str | os.PathLike[str], mesh: TriMesh) -> None:
    """Write triangles in the format of the name's ending, such as .ply or .stl."""
    _trepan.write_surface(path, mesh)


def tetrahedra(
    mask: VoxelVolume,
    target_tets: int = 15_000,
    *,
    smoothing: float = 0.3,
    coarsening: int = 0,
    fine: tuple[tuple[float, float, float], float, int] | None = None,
) -> TetMesh:
    """Fill the largest part of a mask (not 0) with tetrahedra, their count within 10 %.

    Isosurface stuffing (Labelle and Shewchuk 2007). ``smoothing`` is the width of the Gaussian in
    lattice spacings, ``coarsening`` how often cubes may double to the inside, ``fine`` a ball with
    smaller elements: centre, RAS mm, radius, mm, and halvings of the edge. Some seconds.
    """
    positions, tets = _trepan.tetrahedra(
        mask, target_tets, smoothing, coarsening, fine
    )
    return TetMesh(positions, tets)


def isosurface(ct: VoxelVolume, isovalue: int) -> TriMesh:
    """The surface on which an int16 volume reaches an isovalue."""
    positions, triangles = _trepan.isosurface(ct, isovalue)
    return TriMesh(positions, triangles)


def split_box(cells: tuple[int, int, int], size_mm: tuple[float, float, float]) -> TetMesh:
    """A box with one corner at 0, of cells that are cut into six tetrahedra each."""
    positions, tets = _trepan.split_box(cells, size_mm)
    return TetMesh(positions, tets)


def voxel_size(mesh: TetMesh, p_nc: float = 0.99, r_t: float = 5.0) -> CellSizes:
    """Cell edge that makes collision cheapest, by the thesis's cost model, and the mean edge.

    ``p_nc`` is the fraction of tetrahedra without contact, ``r_t`` the cost of a test in visits.
    """
    return CellSizes(*_trepan.voxel_size(mesh, p_nc, r_t))
