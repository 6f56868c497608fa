"""Tissue: meshes, the solver against a closed form, contact, wrong input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import trepan

Block = tuple[trepan.TetMesh, np.ndarray]


def test_a_mask_is_filled_and_keeps_its_volume(tmp_path: Path) -> None:
    _, brain = trepan.scenes.head(4.0)
    mesh = trepan.tetrahedra(brain, 3000)
    quality = mesh.quality()
    assert len(mesh.tets) == pytest.approx(3000, rel=0.1)
    assert quality["total_mm3"] == pytest.approx(brain.data.sum() * 64, rel=0.01)
    assert quality["min_dihedral_deg"] > 10
    surface = mesh.surface()
    corners = surface.positions[surface.triangles].astype(np.float64)
    inside = np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert inside == pytest.approx(quality["total_mm3"], rel=1e-5)
    for name in ("a.vtu", "a.msh", "a.mesh"):
        trepan.write_mesh(tmp_path / name, mesh)
        again = trepan.read_mesh(tmp_path / name)
        np.testing.assert_allclose(again.positions, mesh.positions, atol=1e-4)
        np.testing.assert_array_equal(again.tets, mesh.tets)
    trepan.write_surface(tmp_path / "a.ply", surface)
    assert len(trepan.read_surface(tmp_path / "a.ply").triangles) == len(surface.triangles)
    sizes = trepan.voxel_size(mesh)
    assert sizes.analytic_mm > sizes.mean_edge_mm == pytest.approx(quality["mean_edge_mm"], rel=1e-6)


def test_an_isosurface_is_that_of_a_ball() -> None:
    ct, _ = trepan.scenes.head(2.0)
    skull = trepan.isosurface(ct, 400)
    radius = np.linalg.norm(skull.positions, axis=1)
    assert set(np.round(radius).astype(int)) <= {66, 67, 68, 72, 73, 74}


def test_a_hanging_block_weighs_what_it_weighs(block: Block) -> None:
    mesh, fixed = block
    solver = trepan.Tled(mesh, fixed, trepan.Material.BRAIN)
    loads = trepan.Loads(gravity=(0, 0, -9.81e-3))
    converged, left_mm, _ = solver.settle(loads, 1e-3)
    assert converged and left_mm <= 1e-3
    solver.step(loads)
    weight = 9.81e-3 * 40**3 * 1e-3
    # The fixed nodes carry all but their own mass: half of the lowest of six layers.
    assert solver.support_force_n(fixed)[:, 2].sum() == pytest.approx(11 / 12 * weight, rel=1e-4)
    assert solver.positions()[:, 2].max() < 40


def test_steps_in_one_call_are_the_steps_one_by_one(block: Block) -> None:
    mesh, fixed = block
    loads = trepan.Loads(gravity=(0, 0, -9.81e-3))
    one, many = (trepan.Tled(mesh, fixed, trepan.Material.WHOLE_BRAIN, averaged_pressure=True) for _ in range(2))
    for _ in range(130):
        one.step(loads, one.stable_dt_ms)
    report = many.step(loads, steps=130)
    np.testing.assert_array_equal(one.positions(), many.positions())
    np.testing.assert_array_equal(one.velocities(), many.velocities())
    assert report.substeps >= 130 and report.inverted == report.non_finite == 0
    many.reset()
    np.testing.assert_array_equal(many.positions(), mesh.positions)


def test_a_probe_dents_a_block_and_is_pushed_back(block: Block) -> None:
    mesh, fixed = block
    solver = trepan.Tled(mesh, fixed, trepan.Material.BRAIN, pia_n_per_mm=0.0)
    touch = trepan.TissueCollision(mesh, trepan.Tool.probe(6.0))
    loads, forces = trepan.Loads(), []
    for down in np.linspace(0.0, 4.0, 800):
        found = touch.step(solver.positions(), (20, 20, 46 - down), velocities=solver.velocities())
        loads.clear()
        loads.touch(found)
        solver.step(loads)
        forces.append(found.force_n[2])
    assert forces[0] == 0 < forces[-1] < 1
    assert solver.positions()[:, 2].max() <= 41
    top = np.argmin(np.linalg.norm(mesh.positions - [20, 20, 40], axis=1))
    assert solver.positions()[top, 2] < 38


def test_a_spring_presses_its_nodes(block: Block) -> None:
    mesh, fixed = block
    top = np.flatnonzero(mesh.positions[:, 2] > 39.9)
    solver, loads = trepan.Tled(mesh, fixed, trepan.Material.BRAIN), trepan.Loads()
    loads.press(top[:60], (0, 0, 2), offset_mm=3 - 40, stiffness=0.5)
    assert loads.springs == 1
    assert solver.settle(loads)[0]
    report = solver.step(loads)
    dent = 40 - solver.positions()[top[:60], 2].mean()
    assert report.contact_n == pytest.approx(0.5 * (3 - dent), rel=0.02) and 0 < dent < 3


def test_wrong_input_is_an_exception(block: Block, tmp_path: Path) -> None:
    mesh, fixed = block
    brain = trepan.Material.BRAIN
    with pytest.raises(ValueError, match="fixed names node 1000000, but there are only 343 nodes"):
        trepan.Tled(mesh, [10**6], brain)
    with pytest.raises(ValueError, match="fixed names node -1"):
        trepan.Tled(mesh, [-1], brain)
    with pytest.raises(ValueError, match="fixed has dtype float64"):
        trepan.Tled(mesh, [0.5], brain)
    flipped = trepan.TetMesh(mesh.positions, mesh.tets[:, [1, 0, 2, 3]])
    with pytest.raises(ValueError, match="must be positive"):
        trepan.Tled(flipped, fixed, brain)
    with pytest.raises(ValueError, match="volume"):
        flipped.quality()
    with pytest.raises(ValueError, match=r"mesh.positions\[0\]"):
        trepan.Tled(trepan.TetMesh(np.full((4, 3), np.nan, np.float32), mesh.tets[:1]), [], brain)
    with pytest.raises(ValueError, match="names node 500"):
        trepan.Tled(trepan.TetMesh(mesh.positions, np.array([[0, 1, 2, 500]], np.uint32)), [], brain)
    with pytest.raises(ValueError, match="threads"):
        trepan.Tled(mesh, fixed, brain, threads=0)
    with pytest.raises(ValueError, match="poisson is 0.5"):
        trepan.Material.neo_hookean(0.003, 0.5)
    loads = trepan.Loads()
    with pytest.raises(ValueError, match="a spring takes 64"):
        loads.press(np.arange(65), (0, 0, 1), 0.0, 1.0)
    with pytest.raises(ValueError, match="stiffness is -1"):
        loads.press([0], (0, 0, 1), 0.0, -1.0)
    loads.press([500], (0, 0, 1), 0.0, 1.0)
    with pytest.raises(ValueError, match="press node 500, but there are only 343"):
        trepan.Tled(mesh, fixed, brain).step(loads)
    touch = trepan.TissueCollision(mesh, trepan.Tool.probe(3.0))
    with pytest.raises(ValueError, match="positions has 3 rows: the mesh has 343 nodes"):
        touch.step(np.zeros((3, 3)), (0, 0, 0))
    with pytest.raises(ValueError, match="friction is -1"):
        trepan.TissueCollision(mesh, trepan.Tool.probe(3.0), friction=-1)
    with pytest.raises(ValueError, match="target_tets"):
        trepan.tetrahedra(trepan.scenes.head(8.0)[1], 1)
    with pytest.raises(ValueError, match="no voxel that is not 0"):
        trepan.tetrahedra(trepan.VoxelVolume(np.zeros((4, 4, 4)), np.eye(4)))
    with pytest.raises(FileNotFoundError):
        trepan.read_mesh(tmp_path / "no.vtu")
    (tmp_path / "bad.vtu").write_text("<VTKFile>")
    with pytest.raises(trepan.TrepanError, match="bad.vtu"):
        trepan.read_mesh(tmp_path / "bad.vtu")
    with pytest.raises(ValueError, match="1 to 1,000,000 cells"):
        trepan.split_box((10**9, 10**9, 10**9), (1, 1, 1))
