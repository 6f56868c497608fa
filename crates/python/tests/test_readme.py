"""The Python of the READMEs runs as it is printed."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[3]


def blocks(readme: Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", readme.read_text(encoding="utf-8"), re.DOTALL)


def test_the_first_lines_of_the_repository(
    case_head: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(case_head / "ct_hu.nii.gz", "head_ct.nii.gz")
    (code,) = blocks(REPOSITORY / "README.md")
    exec(code, {})
    assert re.search(r"\d\.\d+ mm deep at most, [1-9]\d+ mm3 removed", capsys.readouterr().out)


def test_the_blocks_of_the_package(
    skull_drill: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("demo").mkdir()
    shutil.copy(skull_drill, "demo/session.mcap")
    Path("demo/scores.csv").write_text("name,value\nscores.bone_removed_mm3,59.5\n")
    plot, session, gym = blocks(REPOSITORY / "crates" / "python" / "README.md")
    exec(plot, {})
    assert "Score(value=59.5, unit='mm3')" in capsys.readouterr().out and Path("demo.png").stat().st_size > 10_000
    exec(gym, {})
    assert "trepan.session.run" in session
