"""What the other tests do not use of the package, with its types: `mypy --strict` checks them."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import trepan

Triple = tuple[float, float, float]


def test_tools_and_steps(bone: trepan.BoneVolume) -> None:
    tools: list[trepan.Tool] = [trepan.Tool.perforator(), trepan.Tool.craniotome(), trepan.Tool.probe(2.0)]
    kinds: list[str] = [tool.kind for tool in tools]
    radii: list[float] = [tool.tip_radius_mm for tool in tools]
    assert kinds == ["perforator", "craniotome", "probe"] and radii == pytest.approx([5.5, 1.2, 2.0])
    corners: list[list[float]] = bone.bounds_mm
    assert corners[0][2] == pytest.approx(-6, abs=0.5) and corners[1][2] == pytest.approx(0, abs=0.5)
    contact = trepan.RigidContact(bone, tools[2])
    contact.reset((0, 0, 3), (0, 0, 0, 1))
    stiffness: float = contact.stiffness_n_per_mm
    step: trepan.RigidStep = contact.step((0, 0, 1.5))
    point: Triple = step.point_mm
    assert stiffness > 0 and point[2] == pytest.approx(0, abs=0.6) and "depth_mm" in repr(step)
    path: trepan.RigidPath = contact.path([[0, 0, 1.5]], [[0, 0, 0, 1]], True)
    columns: list[NDArray[Any]] = [path.depth_mm, path.normal, path.proxy_mm, path.broke_through]
    assert [column.shape for column in columns] == [(1,), (1, 3), (1, 3), (1,)]


def test_a_perforator_turns_and_a_probe_does_not_cut(bone: trepan.BoneVolume) -> None:
    z = np.linspace(6.0, 3.0, 2000)
    way = np.column_stack([0 * z, 0 * z, z])
    cut = {}
    for tool in (trepan.Tool.perforator(), trepan.Tool.probe(5.5)):
        contact = trepan.RigidContact(bone, tool)
        contact.reset(way[0])
        cut[tool.kind] = float(contact.path(way, drilling=True).removed_mm3.sum())
    assert cut["perforator"] > 5 and cut["probe"] == 0


def test_materials_know_their_moduli() -> None:
    presets = [trepan.Material.CORTEX, trepan.Material.CORONA_RADIATA, trepan.Material.TUMOUR]
    made = trepan.Material.stiffening(0.001, 0.5, 0.02, poisson=0.4)
    for material in [*presets, made, trepan.Material.BRAIN, trepan.Material.WHOLE_BRAIN]:
        young: float = material.young_mpa
        assert 1e-4 < young < 0.1 and 0.3 < material.poisson < 0.5 and material.density_g_mm3 == np.float32(1e-3)
    assert made.young_mpa == pytest.approx(2 * 0.001 * 1.4, rel=1e-5)


def test_a_stretched_bar_pulls_back_as_hooke_says() -> None:
    mesh = trepan.split_box((2, 2, 10), (10.0, 10.0, 50.0))
    bottom, top = (np.flatnonzero(np.abs(mesh.positions[:, 2] - z) < 1e-3) for z in (0, 50))
    fixed = np.concatenate([bottom, top])
    solver = trepan.Tled(mesh, fixed, trepan.Material.neo_hookean(0.01, 0.0))
    for node in top:
        solver.set_node(int(node), (0, 0, 0.1))
    assert solver.settle(trepan.Loads(), 1e-5)[0]
    report: trepan.StepReport = solver.step(trepan.Loads())
    pull = solver.support_force_n(top)[:, 2].sum()
    assert pull == pytest.approx(0.01 * 100 * 0.1 / 50, rel=0.02)
    assert report.limited == 0 and report.skipped_ms == 0 and report.contact_n == 0


def test_records_and_their_types(skull_drill: Path, case_head: Path) -> None:
    recording: trepan.Recording = trepan.read_recording(skull_drill)
    texts: list[str] = [recording.version, recording.app, recording.case]
    assert all(texts) and isinstance(recording.hashes, dict)
    steps: dict[str, NDArray[Any]] = recording.solver
    assert set(steps) == {"step", "time_ms", "max_displacement_mm", "inverted", "compute_us"}
    events: list[trepan.Event] = recording.events
    assert all(event.tick >= 0 and event.time_ms >= 0 and event.text for event in events)
    volume: trepan.VoxelVolume = trepan.read_volume(case_head / "brain_mask.nii.gz")
    doubled: trepan.VoxelVolume = volume.with_data(2 * volume.data)
    assert volume.modality is None and doubled.data.max() == 2 * volume.data.max()
    with pytest.raises(ValueError, match="data has shape"):
        volume.with_data(volume.data[1:])
    surface: trepan.TriMesh = trepan.split_box((1, 1, 1), (1, 1, 1)).surface()
    sizes: trepan.CellSizes = trepan.voxel_size(trepan.split_box((1, 1, 1), (1, 1, 1)))
    assert len(surface.triangles) == 12 and sizes.mean_edge_mm > 1 and trepan.__version__ == "0.1.0"
    found: trepan.TissueStep = trepan.TissueCollision(
        trepan.split_box((2, 2, 2), (20, 20, 20)), trepan.Tool.probe(4.0)
    ).step(trepan.split_box((2, 2, 2), (20, 20, 20)).positions, (10, 10, 22))
    assert found.points_in_contact > 0 and found.normal[2] > 0.9 and found.depth_mm == pytest.approx(2, abs=0.2)


@pytest.mark.parametrize("module", ["gymnasium", "matplotlib.figure", "pyvista"])
def test_what_is_not_installed_is_named(
    module: str, skull_drill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(sys.modules, "trepan.gym", raising=False)
    with pytest.raises(ImportError, match="pip install " + module.split(".")[0]):
        if module == "gymnasium":
            importlib.import_module("trepan.gym")
        elif module == "pyvista":
            from trepan.view import view

            view()
        else:
            trepan.read_recording(skull_drill).plot()
