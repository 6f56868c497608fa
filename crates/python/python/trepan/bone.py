"""Where bone is (crate ``trepan-bone``)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._trepan import BoneVolume


def first_bone(bone: BoneVolume, start: ArrayLike, end: ArrayLike) -> NDArray[np.float64] | None:
    """First bone from one point to another, RAS mm, shape (3,), to a tenth of a voxel.

    ``None`` where there is none.
    """
    ends = np.asarray([start, end], np.float64)
    count = int(np.linalg.norm(ends[1] - ends[0]) / (0.1 * bone.spacing_mm)) + 2
    points: NDArray[np.float64] = np.linspace(ends[0], ends[1], count)
    inside = bone.is_bone(points)
    return points[inside.argmax()] if inside.any() else None
