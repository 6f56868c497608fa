"""The program, and a simulated study with its tables and results."""

import os
import subprocess
from pathlib import Path

import pytest

PROTOCOLS = Path(__file__).resolve().parent.parent / "protocols"


def program(*arguments: object) -> str:
    """What `trepan-analysis` prints."""
    command = [os.environ["TREPAN_ANALYSIS"], *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="session")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with `runs`, and `results` of the demonstration."""
    folder = tmp_path_factory.mktemp("study")
    protocol = PROTOCOLS / "demonstration.toml"
    program("simulate", protocol, "--out", folder / "runs")
    assert "nothing is missing: 320 sessions" in program("check", protocol, folder / "runs")
    assert "simulated participants" in program("study", protocol, folder / "runs", "--out", folder / "results")
    return folder


@pytest.fixture(scope="session")
def perception(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with `runs`, and `results` of the comparison of rigid methods."""
    folder = tmp_path_factory.mktemp("perception")
    protocol = PROTOCOLS / "rigid-methods.toml"
    program("simulate", protocol, "--out", folder / "runs")
    assert "nothing is missing: 216 sessions" in program("check", protocol, folder / "runs")
    program("study", protocol, folder / "runs", "--out", folder / "results")
    return folder
