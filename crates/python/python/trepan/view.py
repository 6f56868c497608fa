"""Surfaces that turn under the mouse, by PyVista (needs pyvista)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .meshes import TetMesh, TriMesh

if TYPE_CHECKING:
    from pyvista import Plotter as _Plotter
    from pyvista import PolyData as _PolyData


def _pyvista() -> Any:
    try:
        import pyvista
    except ImportError as fault:
        raise ImportError("trepan.view needs PyVista: pip install pyvista") from fault
    return pyvista


def poly_data(mesh: TriMesh | TetMesh) -> _PolyData:
    """A surface, or the boundary of tetrahedra, as PyVista's ``PolyData``; points in RAS mm."""
    surface = mesh.surface() if isinstance(mesh, TetMesh) else mesh
    threes = np.full((len(surface.triangles), 1), 3, np.int64)
    data: _PolyData = _pyvista().PolyData(surface.positions, np.hstack([threes, surface.triangles]).ravel())
    return data


def view(
    skull: TriMesh | None = None,
    brain: TriMesh | TetMesh | None = None,
    path_mm: NDArray[np.float32] | None = None,
    off_screen: bool = False,
) -> _Plotter:
    """A plotter with a translucent skull, the brain, and the path (n, 3) of a tool, RAS mm.

    Nothing opens before ``.show()``; with ``off_screen`` ``.screenshot("head.png")`` draws.
    """
    pyvista = _pyvista()
    plotter: _Plotter = pyvista.Plotter(off_screen=off_screen)
    if brain is not None:
        plotter.add_mesh(poly_data(brain), color="#d9a6a0", smooth_shading=True, name="brain")
    if skull is not None:
        plotter.add_mesh(poly_data(skull), color="#e8e0cc", opacity=0.35, name="skull")
    if path_mm is not None:
        plotter.add_mesh(pyvista.lines_from_points(path_mm), color="#2060c0", line_width=3, name="path")
    plotter.add_axes(xlabel="R", ylabel="A", zlabel="S")
    plotter.camera_position = "xz"
    return plotter
