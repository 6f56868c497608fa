"""Bone: contact against geometry, drilling, threads, wrong input."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import trepan


def test_a_ball_on_a_plane_is_as_deep_as_it_is_pressed(bone: trepan.BoneVolume) -> None:
    contact = trepan.RigidContact(bone, trepan.Tool.burr(3.0))
    contact.reset((0.0, 0.0, 4.0))
    for height in (3.5, 2.9, 2.7, 2.4):
        step = contact.step(np.array([0.0, 0.0, height]))
        assert step.depth_mm == pytest.approx(max(0.0, 3.0 - height), abs=0.01)
    assert step.normal == pytest.approx((0, 0, 1), abs=1e-3)
    assert step.proxy_mm == pytest.approx((0, 0, 3), abs=0.01)
    assert step.removed_mm3 == 0 and step.fallbacks == 0


def test_a_path_is_its_ticks_bit_for_bit() -> None:
    def contact() -> trepan.RigidContact:
        made = trepan.RigidContact(trepan.BoneVolume(trepan.scenes.slab(6.0), 400), trepan.Tool.burr(2.0))
        made.reset((0, 0, 3))
        return made

    z = np.linspace(2.5, -1.0, 400)
    tips = np.column_stack([np.sin(z), np.zeros(400), z])
    drilling = np.arange(400) > 50
    path = contact().path(tips, drilling=drilling)
    one = contact()
    steps = [one.step(tip, drilling=bool(pedal)) for tip, pedal in zip(tips, drilling)]
    np.testing.assert_array_equal(path.depth_mm, np.array([step.depth_mm for step in steps], np.float32))
    np.testing.assert_array_equal(path.removed_mm3, np.array([step.removed_mm3 for step in steps], np.float32))
    np.testing.assert_array_equal(path.proxy_mm, np.array([step.proxy_mm for step in steps], np.float32))
    assert path.removed_mm3[:51].sum() == 0 < path.removed_mm3.sum()


def test_the_bone_that_goes_is_the_bone_that_is_missing() -> None:
    slab = trepan.scenes.slab(6.0)
    bone = trepan.BoneVolume(slab, 400)
    contact = trepan.RigidContact(bone, trepan.Tool.burr(3.0))
    contact.reset((0, 0, 3.5))
    z = np.linspace(3.5, -6.0, 4000)
    path = contact.path(np.column_stack([0 * z, 0 * z, z]), drilling=True)
    assert path.broke_through.any() and (path.spindle_rpm > 0).any()
    axis = np.arange(-5.0, 5.0, 0.2)
    grid = np.stack(np.meshgrid(axis, axis, np.arange(-8.0, 1.0, 0.2), indexing="ij"), -1).reshape(-1, 3)
    gone = trepan.BoneVolume(slab, 400).is_bone(grid) & ~bone.is_bone(grid)
    assert path.removed_mm3.sum() == pytest.approx(gone.sum() * 0.2**3, rel=0.05)
    hu, affine = bone.snapshot()
    assert hu.shape == bone.shape and affine[2, 3] == slab.affine[2, 3]
    assert (hu < slab.data).sum() * bone.spacing_mm**3 > 0.5 * path.removed_mm3.sum()


def test_first_bone_is_on_the_face(bone: trepan.BoneVolume) -> None:
    found = trepan.first_bone(bone, (1, 2, 9), (1, 2, -9))
    assert found is not None and found[2] == pytest.approx(0, abs=0.06)
    assert trepan.first_bone(bone, (0, 0, 9), (5, 0, 9)) is None


def test_threads_share_a_bone(bone: trepan.BoneVolume) -> None:
    removed: list[float] = []

    def drill(x: float) -> None:
        contact = trepan.RigidContact(bone, trepan.Tool.burr(2.0))
        contact.reset((x, 0, 2.5))
        z = np.linspace(2.5, 0.0, 1500)
        path = contact.path(np.column_stack([0 * z + x, 0 * z, z]), drilling=True)
        removed.append(float(path.removed_mm3.sum()))

    threads = [threading.Thread(target=drill, args=(x,)) for x in (-6.0, 0.0, 6.0)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(removed) == 3 and max(removed) == pytest.approx(min(removed), rel=0.01)


def test_wrong_input_is_an_exception(bone: trepan.BoneVolume) -> None:
    contact = trepan.RigidContact(bone, trepan.Tool.burr(3.0))
    with pytest.raises(ValueError, match=r"position is \[NaN, 0, 0\]: it must be finite"):
        contact.step((np.nan, 0, 0))
    with pytest.raises(ValueError, match="position must be three numbers"):
        contact.step((0, 0))
    with pytest.raises(ValueError, match="quaternion is .* not all 0"):
        contact.step((0, 0, 9), (0, 0, 0, 0))
    with pytest.raises(ValueError, match="dt_ms is 0"):
        contact.step((0, 0, 9), dt_ms=0)
    with pytest.raises(ValueError, match=r"positions has shape \(3, 2\), it must be \(n, 3\)"):
        contact.path(np.zeros((3, 2)))
    with pytest.raises(ValueError, match=r"positions\[1\]"):
        contact.path([(0, 0, 9), (0, np.inf, 9)])
    with pytest.raises(ValueError, match="drilling has 2 entries, positions 3"):
        contact.path(np.zeros((3, 3)), drilling=np.array([True, False]))
    with pytest.raises(ValueError, match="quaternions has 1 rows, positions 3"):
        contact.path(np.zeros((3, 3)), quaternions=np.ones((1, 4)))
    with pytest.raises(ValueError, match="tip_radius_mm is -1"):
        trepan.Tool.burr(-1)
    with pytest.raises(ValueError, match="tip_radius_mm is 1000: it must be 0.02 to 50"):
        trepan.Tool.burr(1000)
    with pytest.raises(ValueError, match="within 1e6"):
        contact.step((0, 0, 1e9))
    coarse = trepan.VoxelVolume(np.full((4, 4, 4), 900, np.int16), np.diag([50, 50, 50, 1.0]))
    with pytest.raises(ValueError, match="edge of a voxel in mm is 50: it must be 0.02 to 20"):
        trepan.BoneVolume(coarse, 400)
    with pytest.raises(ValueError, match="no voxel reaches 9000 HU"):
        trepan.BoneVolume(trepan.scenes.slab(), 9000)
    tilted = trepan.scenes.slab()
    with pytest.raises(ValueError, match="resample it first"):
        trepan.BoneVolume(trepan.VoxelVolume(tilted.data, np.diag([1, 2, 3, 1.0])), 400)
    assert len(contact.path(np.zeros((0, 3))).depth_mm) == 0
