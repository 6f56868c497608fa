"""Sessions of the simulator, headless, as a process of their own.

The programs are not in this package: they bring graphics and windows, and are built from the
repository with ``cargo build --release``. A fault of a graphics driver then ends a session, not the
notebook, and Ctrl-C ends it as in a terminal, with its files written.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from ._trepan import TrepanError
from .recordings import Recording

# Time in which a session writes its files after Ctrl-C, s.
_PATIENCE_S = 20.0


def find_program(name: str = "integrated") -> Path:
    """Path of a program: in the folder ``TREPAN_BIN``, else on ``PATH``.

    Raises ``FileNotFoundError`` where there is none.
    """
    folder = os.environ.get("TREPAN_BIN")
    found = shutil.which(name, path=folder) if folder else shutil.which(name)
    if found is None:
        place = f"the folder TREPAN_BIN={folder}" if folder else "PATH"
        raise FileNotFoundError(
            f"the program {name} is not in {place}: build it with `cargo build --release` in Trepan's "
            "repository and set TREPAN_BIN to the folder target/release"
        )
    return Path(found)


def run(
    flags: Sequence[str] = (),
    *,
    program: Literal["integrated", "craniotomy", "brain"] = "integrated",
    out: str | os.PathLike[str] | None = None,
    timeout_s: float | None = None,
) -> Recording:
    """Run a session without a window and read its recording; other Python threads go on.

    ``flags`` are those of the program, such as ``["--duration", "20"]``; ``--headless`` and
    ``--out`` are added. ``out`` is a new folder, by default a temporary one that stays. Scores are
    ``recording.scores``, files lie in ``recording.path.parent``.

    Raises ``ValueError`` for flags that this function gives, ``FileNotFoundError`` without the
    program, ``TrepanError`` with the program's own words if it fails, ``TimeoutError`` after
    ``timeout_s``. Ctrl-C ends the session in order and raises ``KeyboardInterrupt``.
    """
    if isinstance(flags, str):
        raise ValueError(f"flags is the text {flags!r}: give a list of words")
    for flag in flags:
        if flag.split("=")[0] in ("--headless", "--out"):
            raise ValueError(f"{flag} is given by run() itself: use the argument out for the folder")
    found = find_program(program)
    home = Path(tempfile.mkdtemp(prefix="trepan-")) if out is None else None
    folder = Path(out or ".") if home is None else home / "session"
    command = [str(found), "--headless", "--out", str(folder), *flags]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        _, log = process.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        _end(process)
        raise TimeoutError(
            f"{program} was not done within {timeout_s} s and was ended; what it wrote lies in {folder}"
        ) from None
    except BaseException:
        _end(process)
        raise
    if process.returncode != 0:
        if home is not None:
            shutil.rmtree(home, ignore_errors=True)
        raise TrepanError(f"{program} ended with {process.returncode}: {log.strip()[-2000:]}")
    return Recording(folder)


def _end(process: subprocess.Popen[str]) -> None:
    """Ends a session as Ctrl-C does; kills one that does not end."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT if os.name == "posix" else signal.SIGTERM)
    try:
        process.communicate(timeout=_PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
