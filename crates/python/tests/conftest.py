"""Fixtures: the built-in case and recorded paths of the repository, synthetic scenes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import trepan

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures"


@pytest.fixture(scope="session")
def case_head() -> Path:
    """Folder of the built-in head."""
    return FIXTURES / "case-head"


@pytest.fixture(scope="session")
def skull_drill() -> Path:
    """A recorded path of 3,000 ticks."""
    return FIXTURES / "paths" / "skull-drill.mcap"


@pytest.fixture()
def bone() -> trepan.BoneVolume:
    """A flat bone of 6 mm under z = 0."""
    return trepan.BoneVolume(trepan.scenes.slab(6.0), 400)


@pytest.fixture(scope="session")
def block() -> tuple[trepan.TetMesh, np.ndarray]:
    """A block of 40 mm with its bottom nodes."""
    mesh = trepan.split_box((6, 6, 6), (40.0, 40.0, 40.0))
    return mesh, np.flatnonzero(mesh.positions[:, 2] < 1e-3)
