"""Recordings and scores that a session leaves (crate ``trepan-link``)."""

from __future__ import annotations

import csv
import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from numpy.typing import NDArray

from . import _trepan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_UNITS = {
    "mm3": "mm3", "mm2": "mm2", "mm": "mm", "n_s": "N s", "n": "N", "ms": "ms", "us": "us", "s": "s", "seconds": "s",
    "deg": "degrees", "hz": "Hz", "m_s": "m/s", "share": "1", "count": "1", "ml": "ml", "j": "J",
}  # fmt: skip


class Event(NamedTuple):
    """An event: haptic tick, session time in ms, kind (``phase``, ``warning``...), text."""

    tick: int
    time_ms: float
    kind: str
    text: str


class Score(NamedTuple):
    """A number that a session left, with its unit; "" where its name ends with none."""

    value: float
    unit: str


class Recording:
    """What a session left: ``path`` is an MCAP file, or a session's folder with one.

    A cut or damaged file raises ``TrepanError``; with ``allow_damaged`` what stands before the
    damage is read, and :attr:`losses` says what is missing. About 250 B of memory a tick.
    """

    def __init__(self, path: str | os.PathLike[str], allow_damaged: bool = False) -> None:
        given = Path(path)
        self.path = given / "session.mcap" if given.is_dir() else given
        self._file = _trepan.Recording(self.path, allow_damaged)

    def __len__(self) -> int:
        """Number of haptic ticks."""
        return len(self._file)

    def __repr__(self) -> str:
        return f"Recording({str(self.path)!r}, {self.app}, case {self.case!r}, {len(self)} ticks)"

    @property
    def app(self) -> str:
        """Name of the program that recorded."""
        return self._file.app

    @property
    def case(self) -> str:
        """Name of the case, or the user's pseudonym for it."""
        return self._file.case

    @property
    def version(self) -> str:
        """Version of the program that recorded."""
        return self._file.version

    @property
    def config(self) -> dict[str, str]:
        """The session's configuration, an entry for each setting by its path."""
        return self._file.config

    @property
    def hashes(self) -> dict[str, str]:
        """Hashes of the inputs by name, hexadecimal."""
        return self._file.hashes

    @property
    def losses(self) -> str | None:
        """What is missing in the file; ``None`` for a complete one."""
        return self._file.losses

    @cached_property
    def ticks(self) -> dict[str, NDArray[Any]]:
        """Haptic ticks, an array of n a column; vectors are (n, 3), quaternions (n, 4) x, y, z, w.

        The unit ends a column's name: ``time_ms``, ``device_mm`` and ``proxy_mm`` (RAS),
        ``velocity_m_s``, ``force_n`` (on the hand), ``torque_n_mm``, ``tissue_n``, ``depth_mm`` (in
        bone), ``tissue_depth_mm``, ``removed_mm3``, ``spindle_rpm``, ``brain_distance_mm``,
        ``compute_us``. ``late``, ``drilling``, ``through`` and ``clamped`` are bool; the others are
        ``tick``, ``buttons``, ``phase``, ``tool``, ``contact_normal``, ``device_quaternion``,
        ``proxy_quaternion``.
        """
        return self._file.ticks()

    @cached_property
    def second(self) -> dict[str, NDArray[Any]]:
        """The second hand's ticks as columns, as in :attr:`ticks`; empty arrays without that hand.

        Names: ``tick``, ``time_ms``, ``buttons``, ``proxy_mm`` (n, 3), ``proxy_quaternion`` (n, 4),
        ``force_n`` (n, 3), ``depth_mm``, ``tissue_depth_mm``.
        """
        return self._file.second()

    @cached_property
    def solver(self) -> dict[str, NDArray[Any]]:
        """Solver steps by column: step, time_ms, max_displacement_mm, inverted, compute_us."""
        return self._file.solver()

    @cached_property
    def events(self) -> list[Event]:
        """Events in the order in which they happened."""
        return [Event(*event) for event in self._file.events()]

    @cached_property
    def scores(self) -> dict[str, Score]:
        """Numbers of ``scores.csv`` beside the recording, by name without ``scores.``, with units.

        Raises ``OSError`` where the session left none: a recording that was moved, or was killed.
        """
        file = self.path.with_name("scores.csv")
        if not file.is_file():
            raise FileNotFoundError(f"{file}: no such file; scores lie in the folder of a session")
        with file.open(encoding="utf-8", newline="") as lines:
            rows = [row for row in csv.reader(lines) if len(row) == 2]
        return {name.removeprefix("scores."): _score(name, text) for name, text in rows if _is(text)}

    def plot(self) -> Figure:
        """Forces, depths and bone removed over time, with events (needs matplotlib)."""
        from .plot import plot_recording

        return plot_recording(self)


def read_recording(path: str | os.PathLike[str], allow_damaged: bool = False) -> Recording:
    """Read a recording: an MCAP file or the folder of a session; see :class:`Recording`."""
    return Recording(path, allow_damaged)


def _is(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _score(name: str, text: str) -> Score:
    ends = [end for end in _UNITS if name.endswith("_" + end) or name.endswith("." + end)]
    return Score(float(text), _UNITS[max(ends, key=len)] if ends else "")
