"""Images, meshes and the moving tool to 3D Slicer and other OpenIGTLink programs, and markers back.

Needs ``pip install trepan[igtl]`` (pyigtl). All places are RAS mm, as in Slicer, where the module
OpenIGTLinkIF connects as a client to ``localhost`` and the port.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .images import VoxelVolume
from .meshes import TriMesh
from .recordings import Recording


def pose_matrix(position_mm: ArrayLike, quaternion: ArrayLike) -> NDArray[np.float64]:
    """Matrix (4, 4) of a pose: position (3,), unit quaternion (4,) as x, y, z, w.

    Raises ``ValueError`` for another shape, and for numbers that are not finite or no rotation.
    """
    place, turn = np.asarray(position_mm, float), np.asarray(quaternion, float)
    if place.shape != (3,) or turn.shape != (4,):
        raise ValueError(f"position has shape {place.shape} and quaternion {turn.shape}: give (3,) and (4,)")
    length = np.linalg.norm(turn)
    if not (np.isfinite(place).all() and abs(length - 1.0) < 1e-3):
        raise ValueError("position and quaternion must be finite, and the quaternion of length 1")
    x, y, z, w = turn / length
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = place
    return matrix


class Link:
    """A server that one OpenIGTLink program is connected to, or will be."""

    def __init__(self, server: Any) -> None:
        self._server = server
        self._markers: dict[str, NDArray[np.float64]] = {}

    @property
    def port(self) -> int:
        """The port."""
        return int(self._server.server_address[1])

    def wait(self, timeout_s: float = 60.0) -> None:
        """Wait until a program is connected. Raises ``TimeoutError``."""
        end = time.monotonic() + timeout_s
        while not self._server.is_connected():
            if time.monotonic() > end:
                raise TimeoutError(f"nobody connected within {timeout_s:g} s: connect to localhost and this port")
            time.sleep(0.01)

    def send_pose(self, name: str, position_mm: ArrayLike, quaternion: ArrayLike) -> None:
        """Send a pose as TRANSFORM; see :func:`pose_matrix`."""
        import pyigtl

        self._send(pyigtl.TransformMessage(pose_matrix(position_mm, quaternion), device_name=name))

    def send_volume(self, name: str, volume: VoxelVolume) -> None:
        """Send an image as IMAGE, where it lies; float64 as float32, bool as 0 and 1."""
        import pyigtl

        narrow = {"float64": np.float32, "bool": np.uint8, "int64": np.int32, "uint64": np.uint32}
        data = volume.data.astype(narrow.get(volume.data.dtype.name, volume.data.dtype))
        image = np.ascontiguousarray(data.transpose(2, 1, 0))
        self._send(
            pyigtl.ImageMessage(
                image, ijk_to_world_matrix=volume.affine, world_coordinate_system="ras", device_name=name
            )
        )

    def send_surface(self, name: str, surface: TriMesh) -> None:
        """Send triangles as POLYDATA, which Slicer reads; pyigtl 0.3.4 sends it only."""
        import pyigtl

        # As VTK counts them: before each triangle its number of corners.
        polygons = np.insert(surface.triangles.astype(np.uint32), 0, 3, axis=1).ravel()
        points = surface.positions.astype(np.float32)
        self._send(pyigtl.PolyDataMessage(points=points, polygons=polygons, device_name=name))

    def play(self, recording: Recording, *, name: str = "Tool", rate_hz: float = 60.0, speed: float = 1.0) -> int:
        """Send the tool's pose along a recording in its time; returns the number of poses sent.

        Ends early where the other program leaves. Raises ``ValueError`` for a rate or speed that is
        not positive, or a recording without a tick.
        """
        if not (rate_hz > 0 and speed > 0):
            raise ValueError(f"rate_hz is {rate_hz} and speed {speed}: both must be positive")
        ticks = recording.ticks
        times_ms = ticks["time_ms"]
        if len(times_ms) == 0:
            raise ValueError("the recording has no tick")
        begun, sent = time.monotonic(), 0
        while self._server.is_connected():
            now_ms = times_ms[0] + (time.monotonic() - begun) * 1e3 * speed
            at = min(int(np.searchsorted(times_ms, now_ms)), len(times_ms) - 1)
            self.send_pose(name, ticks["proxy_mm"][at], ticks["proxy_quaternion"][at])
            sent += 1
            if now_ms >= times_ms[-1]:
                break
            time.sleep(max(0.0, begun + sent / rate_hz - time.monotonic()))
        return sent

    def markers(self) -> dict[str, NDArray[np.float64]]:
        """Places (n, 3), RAS mm, of all POINT messages that came so far, the newest of each name."""
        for message in self._server.get_latest_messages():
            if message.message_type == "POINT":
                self._markers[message.device_name] = np.asarray(message.positions, float).reshape(-1, 3)
        return dict(self._markers)

    def _send(self, message: Any) -> None:
        self._server.send_message(message, wait=True)


@contextmanager
def serve(port: int = 18944) -> Iterator[Link]:
    """Open a port on this machine for one OpenIGTLink program; closed at the end of ``with``.

    Port 0 is a free one, which :attr:`Link.port` then tells. Raises ``OSError`` where the port is taken.
    """
    import pyigtl

    server = pyigtl.OpenIGTLinkServer(port=port, local_server=True)
    try:
        yield Link(server)
    finally:
        server.stop()
