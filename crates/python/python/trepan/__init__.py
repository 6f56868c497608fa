"""Trepan from Python: images, bone, tissue and recordings as numpy arrays.

Units are mm, ms, g, hence N and MPa; world space is the patient's RAS+ mm. Volumes have the shape
(i, j, k) with the affine from voxel indices to RAS mm, as in nibabel. Names are those of the Rust
crates, whose READMEs have theory, cost and sources.

Wrong arguments raise ``ValueError`` or ``TypeError``, files that the system cannot read ``OSError``,
files with a wrong content and failed computations :class:`TrepanError`. Each says what is wrong,
where, and the remedy.
"""

from importlib.metadata import version as _version

from . import scenes, session
from ._trepan import (
    AIR_HU,
    BoneVolume,
    Loads,
    Material,
    RigidContact,
    RigidPath,
    RigidStep,
    StepReport,
    TissueCollision,
    TissueStep,
    Tled,
    Tool,
    TrepanError,
)
from .bone import first_bone
from .images import (
    VoxelVolume,
    bone_isovalue,
    distance_field,
    hounsfield,
    read_volume,
    resample,
    skull_only,
    write_volume,
)
from .meshes import (
    CellSizes,
    TetMesh,
    TriMesh,
    isosurface,
    read_mesh,
    read_surface,
    split_box,
    tetrahedra,
    voxel_size,
    write_mesh,
    write_surface,
)
from .recordings import Event, Recording, Score, read_recording

__version__ = _version("trepan")

__all__ = [
    "AIR_HU",
    "BoneVolume",
    "CellSizes",
    "Event",
    "Loads",
    "Material",
    "Recording",
    "RigidContact",
    "RigidPath",
    "RigidStep",
    "Score",
    "StepReport",
    "TetMesh",
    "TissueCollision",
    "TissueStep",
    "Tled",
    "Tool",
    "TrepanError",
    "TriMesh",
    "VoxelVolume",
    "__version__",
    "bone_isovalue",
    "distance_field",
    "first_bone",
    "hounsfield",
    "isosurface",
    "read_mesh",
    "read_recording",
    "read_surface",
    "read_volume",
    "resample",
    "scenes",
    "session",
    "skull_only",
    "split_box",
    "tetrahedra",
    "voxel_size",
    "write_mesh",
    "write_surface",
    "write_volume",
]
