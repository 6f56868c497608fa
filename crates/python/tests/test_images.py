"""Images: orientation, conversion, resampling, against numpy and closed forms."""

from __future__ import annotations

import gzip
import struct
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import trepan


def nifti(path: Path, data: np.ndarray, affine: np.ndarray) -> Path:
    """A NIfTI-1 file written here, byte by byte, by the standard's layout."""
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, *data.shape, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 16, 32)
    struct.pack_into("<8f", header, 76, 1, *np.linalg.norm(affine[:3, :3], axis=0), 0, 0, 0, 0)
    struct.pack_into("<3f", header, 108, 352, 1, 0)
    struct.pack_into("<b", header, 123, 2)
    struct.pack_into("<2h", header, 252, 0, 1)
    struct.pack_into("<12f", header, 280, *affine[:3].ravel())
    header[344:348] = b"n+1\0"
    path.write_bytes(bytes(header) + data.astype("<f4").tobytes(order="F"))
    return path


def test_a_nifti_has_its_samples_and_affine(tmp_path: Path) -> None:
    data = np.arange(2 * 3 * 4, dtype=np.float32).reshape(2, 3, 4)
    affine = np.array([[0, -2, 0, 5], [1.5, 0, 0, -6], [0, 0, 3, 7], [0, 0, 0, 1.0]])
    volume = trepan.read_volume(nifti(tmp_path / "a.nii", data, affine))
    np.testing.assert_array_equal(volume.data, data)
    np.testing.assert_array_equal(volume.affine, affine)
    np.testing.assert_array_equal(volume.spacing_mm, [1.5, 2, 3])
    np.testing.assert_array_equal(volume.to_world([1, 2, 3]), [1, -4.5, 16])
    assert volume.data.flags.f_contiguous and not volume.warnings


@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz", "a.nrrd"])
def test_what_is_written_is_read_again(tmp_path: Path, name: str) -> None:
    data = np.random.default_rng(1).normal(size=(5, 4, 3)).astype(np.float32)
    for order in ("C", "F"):
        volume = trepan.VoxelVolume(np.array(data, order=order), np.diag([1, 2, 3, 1.0]))
        trepan.write_volume(tmp_path / name, volume)
        again = trepan.read_volume(tmp_path / name)
        np.testing.assert_array_equal(again.data, data)
        np.testing.assert_array_equal(again.affine, volume.affine)


def test_a_linear_field_is_resampled_exactly() -> None:
    i, j, k = np.meshgrid(*[np.arange(12.0)] * 3, indexing="ij")
    affine = np.diag([2, 1, 0.5, 1.0])
    affine[:3, 3] = [1, 2, 3]
    field = trepan.VoxelVolume((3 * i - j + 2 * k).astype(np.float32), affine)
    to = trepan.resample(field, 0.5, "trilinear", np.nan)
    world = to.to_world(np.argwhere(np.isfinite(to.data)))
    index = (world - affine[:3, 3]) / [2, 1, 0.5]
    inside = ((index >= 0) & (index <= 11)).all(axis=1)
    wanted = index @ [3, -1, 2]
    found = to.data[np.isfinite(to.data)]
    assert inside.sum() > 5000
    np.testing.assert_allclose(found[inside], wanted[inside], atol=1e-4)


def test_a_distance_field_is_that_of_a_ball() -> None:
    ct, brain = trepan.scenes.head(4.0)
    field = trepan.distance_field(brain)
    radius = np.linalg.norm(field.to_world(np.argwhere(np.ones(field.data.shape))), axis=1)
    near = np.abs(radius - 65.0) < 12.0
    assert np.abs(field.data.ravel()[near] - (radius[near] - 65.0)).max() < 4.0
    assert ct.data.dtype == np.int16


def test_a_skull_from_the_built_in_ct(case_head: Path) -> None:
    ct = trepan.hounsfield(trepan.read_volume(case_head / "ct_hu.nii.gz"))
    isovalue = trepan.bone_isovalue(ct)
    assert ct.data.dtype == np.int16 and 300 <= isovalue <= 500
    alone, remark = trepan.skull_only(ct, isovalue)
    assert (alone.data >= isovalue).sum() <= (ct.data >= isovalue).sum()
    assert remark is None or "loose" in remark


def test_wrong_images_are_exceptions(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nope.nii: no such file; check"):
        trepan.read_volume(tmp_path / "nope.nii")
    (tmp_path / "text.nii").write_text("not an image")
    with pytest.raises(trepan.TrepanError, match="it is a text"):
        trepan.read_volume(tmp_path / "text.nii")
    whole = nifti(tmp_path / "whole.nii", np.zeros((8, 8, 8)), np.eye(4)).read_bytes()
    (tmp_path / "cut.nii").write_bytes(whole[:-100])
    with pytest.raises(trepan.TrepanError, match="cut.nii: ends after .* fetch the file again"):
        trepan.read_volume(tmp_path / "cut.nii")
    (tmp_path / "cut.nii.gz").write_bytes(gzip.compress(whole)[:-20])
    with pytest.raises(trepan.TrepanError, match="cut.nii.gz"):
        trepan.read_volume(tmp_path / "cut.nii.gz")
    with pytest.raises(trepan.TrepanError, match="must end in .nii"):
        trepan.write_volume(tmp_path / "a.png", trepan.VoxelVolume(np.zeros((2, 2, 2)), np.eye(4)))
    with pytest.raises(OSError):
        trepan.write_volume(tmp_path / "no" / "a.nii", trepan.VoxelVolume(np.zeros((2, 2, 2)), np.eye(4)))


def test_wrong_arrays_are_exceptions() -> None:
    flat = trepan.VoxelVolume(np.zeros((4, 4), np.int16), np.eye(4))
    with pytest.raises(ValueError, match=r"volume.data has shape \(4, 4\), it must be \(i, j, k\)"):
        trepan.bone_isovalue(flat)
    floats = trepan.VoxelVolume(np.zeros((4, 4, 4), np.float32), np.eye(4))
    with pytest.raises(ValueError, match="has dtype float32, it must be int16; convert"):
        trepan.bone_isovalue(floats)
    for affine in (np.zeros((4, 4)), np.full((4, 4), np.nan), np.eye(3), np.ones((4, 4))):
        with pytest.raises(ValueError, match="affine"):
            trepan.bone_isovalue(trepan.VoxelVolume(np.zeros((4, 4, 4), np.int16), affine))
    with pytest.raises(ValueError, match="2 voxels along each axis"):
        trepan.bone_isovalue(trepan.VoxelVolume(np.zeros((4, 1, 4), np.int16), np.eye(4)))
    with pytest.raises(trepan.TrepanError, match="NaN"):
        trepan.hounsfield(trepan.VoxelVolume(np.full((4, 4, 4), np.nan), np.eye(4)))
    with pytest.raises(ValueError, match="NaN or infinity"):
        trepan.resample(trepan.VoxelVolume(np.full((4, 4, 4), np.nan), np.eye(4)), 1.0, "cubic")
    with pytest.raises(ValueError, match="larger spacing"):
        trepan.resample(floats, 1e-3)
    with pytest.raises(ValueError, match="spacing_mm is -1"):
        trepan.resample(floats, -1.0)
    with pytest.raises(ValueError, match="interpolation is \"best\""):
        trepan.resample(floats, 1.0, "best")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="voxel along each axis"):
        trepan.resample(floats, trepan.VoxelVolume(np.zeros((0, 1, 1)), np.eye(4)))
    with pytest.raises(ValueError, match="it must be int16"):
        trepan.bone_isovalue(trepan.VoxelVolume(np.array([[["a"] * 2] * 2] * 2), np.eye(4)))
    with pytest.raises(TypeError, match="volume is a ndarray: it must have .data and .affine"):
        trepan.BoneVolume(np.zeros(3), 400)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="volume is a ndarray"):
        trepan.hounsfield(np.zeros((4, 4, 4)))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="volume is a ndarray: it must be a VoxelVolume"):
        trepan.resample(np.zeros((4, 4, 4)), 1.0)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"volume.data has shape \(4, 4\)"):
        trepan.resample(flat, 1.0)


def test_other_threads_go_on_while_a_call_computes() -> None:
    _, brain = trepan.scenes.head(2.0)
    worker = threading.Thread(target=trepan.tetrahedra, args=(brain, 20_000))
    worker.start()
    turns = 0
    while worker.is_alive():
        time.sleep(0.002)
        turns += 1
    assert turns > 20


def test_a_panic_is_an_exception(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(trepan.TrepanError, match="a test asked for it.*report"):
        trepan._trepan._panic()
    capfd.readouterr()
