"""Images, meshes, poses and markers over OpenIGTLink, with pyigtl's own client at the other end."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trepan
from trepan import igtl

pyigtl = pytest.importorskip("pyigtl")


@pytest.fixture()
def ends() -> Iterator[tuple[igtl.Link, Any]]:
    """A server and a client that is connected to it."""
    with igtl.serve(0) as link:
        client = pyigtl.OpenIGTLinkClient(host="127.0.0.1", port=link.port)
        link.wait(10.0)
        yield link, client
        client.stop()


def test_a_recording_is_received_in_its_time_and_a_marker_comes_back(
    ends: tuple[igtl.Link, Any], skull_drill: Path
) -> None:
    link, client = ends
    recording = trepan.read_recording(skull_drill)
    begun = time.monotonic()
    sent = link.play(recording, rate_hz=60.0)
    took_s = time.monotonic() - begun
    length_s = float(recording.ticks["time_ms"][-1] - recording.ticks["time_ms"][0]) / 1e3
    assert length_s - 0.1 < took_s and 0.5 * 60 * length_s < sent < 1.1 * 60 * length_s + 2
    matrix = client.wait_for_message("Tool", timeout=5).matrix
    np.testing.assert_allclose(matrix[:3, 3], recording.ticks["proxy_mm"][-1], atol=1e-4)
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-5)
    client.send_message(pyigtl.PointMessage(positions=[[1.0, -2.0, 3.5]], device_name="Marker"), wait=True)
    end = time.monotonic() + 5
    while "Marker" not in link.markers() and time.monotonic() < end:
        time.sleep(0.01)
    np.testing.assert_allclose(link.markers()["Marker"], [[1.0, -2.0, 3.5]], atol=1e-6)


def test_an_image_arrives_where_it_lies(ends: tuple[igtl.Link, Any]) -> None:
    link, client = ends
    affine = np.array([[0.0, 0.0, -2.0, 30.0], [1.5, 0.0, 0.0, -7.0], [0.0, 1.0, 0.0, 4.0], [0.0, 0.0, 0.0, 1.0]])
    data = np.arange(4 * 3 * 2, dtype=np.int16).reshape(4, 3, 2)
    link.send_volume("CT", trepan.VoxelVolume(data, affine))
    image = client.wait_for_message("CT", timeout=5)
    assert image.world_coordinate_system == "ras" and image.image.dtype == np.int16
    np.testing.assert_array_equal(np.asarray(image.image).reshape(2, 3, 4).transpose(2, 1, 0), data)
    np.testing.assert_allclose(image.ijk_to_world_matrix, affine, atol=1e-4)


def test_a_mesh_arrives_as_the_protocol_has_it() -> None:
    # By hand: pyigtl 0.3.4 sends POLYDATA and cannot read it.
    surface = trepan.isosurface(trepan.scenes.slab(6.0), 400)
    with igtl.serve(0) as link, socket.create_connection(("127.0.0.1", link.port)) as client:
        link.wait(10.0)
        link.send_surface("Skull", surface)
        client.settimeout(10.0)
        stream = client.makefile("rb")
        _, kind, name, _, size, _ = struct.unpack(">H12s20sQQQ", stream.read(58))
        body = stream.read(size)
    assert kind.rstrip(b"\0") == b"POLYDATA" and name.rstrip(b"\0") == b"Skull"
    content = body[struct.unpack(">H", body[:2])[0] :]
    counts = struct.unpack(">10I", content[:40])
    points, triangles = len(surface.positions), len(surface.triangles)
    assert counts == (points, 0, 0, 0, 0, triangles, 16 * triangles, 0, 0, 0)
    places = np.frombuffer(content, ">f4", 3 * points, 40).reshape(-1, 3)
    polygons = np.frombuffer(content, ">u4", 4 * triangles, 40 + 12 * points).reshape(-1, 4)
    np.testing.assert_array_equal(places, surface.positions)
    assert (polygons[:, 0] == 3).all() and (polygons[:, 1:] == surface.triangles).all()


def test_a_pose_has_the_axes_of_its_rotation() -> None:
    turned = igtl.pose_matrix([1, 2, 3], [0, 0, np.sqrt(0.5), np.sqrt(0.5)])
    np.testing.assert_allclose(turned, [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-12)
    with pytest.raises(ValueError, match="give \\(3,\\) and \\(4,\\)"):
        igtl.pose_matrix([1, 2], [0, 0, 0, 1])
    with pytest.raises(ValueError, match="of length 1"):
        igtl.pose_matrix([1, 2, 3], [0, 0, 0, 2])
    with pytest.raises(ValueError, match="finite"):
        igtl.pose_matrix([1, np.nan, 3], [0, 0, 0, 1])


def test_nobody_there_is_an_exception_and_a_wrong_rate_too(skull_drill: Path) -> None:
    with igtl.serve(0) as link:
        with pytest.raises(TimeoutError, match="nobody connected"):
            link.wait(0.05)
        with pytest.raises(ValueError, match="both must be positive"):
            link.play(trepan.read_recording(skull_drill), rate_hz=0.0)
