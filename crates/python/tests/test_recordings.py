"""Recordings, scores, plots and sessions."""

from __future__ import annotations

import os
import shutil
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import trepan

REPOSITORY = Path(__file__).resolve().parents[3]


def test_ticks_are_columns(skull_drill: Path) -> None:
    recording = trepan.read_recording(skull_drill)
    ticks = recording.ticks
    assert len(recording) == 3000 == len(ticks["tick"]) and recording.losses is None
    assert (np.diff(ticks["tick"].astype(np.int64)) == 1).all() and (np.diff(ticks["time_ms"]) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(ticks["device_quaternion"], axis=1), 1, atol=1e-5)
    assert ticks["force_n"].shape == (3000, 3) and ticks["drilling"].dtype == bool
    assert recording.case == "case-head" and recording.app and repr(recording).startswith("Recording(")
    assert isinstance(recording.config, dict) and recording.ticks is ticks
    second = recording.second
    assert second["force_n"].shape == (0, 3) and len(second["tick"]) == 0


def test_a_path_that_was_recorded_can_be_drilled_again(skull_drill: Path, case_head: Path) -> None:
    ticks = trepan.read_recording(skull_drill).ticks
    ct = trepan.hounsfield(trepan.read_volume(case_head / "ct_hu.nii.gz"))
    bone = trepan.BoneVolume(trepan.resample(ct, 1.0, "cubic", trepan.AIR_HU), trepan.bone_isovalue(ct))
    contact = trepan.RigidContact(bone, trepan.Tool.burr(3.0))
    contact.reset(ticks["device_mm"][0], ticks["device_quaternion"][0])
    path = contact.path(ticks["device_mm"], ticks["device_quaternion"], (ticks["buttons"] & 1) == 1)
    assert path.removed_mm3.sum() > 1 and np.isfinite(path.proxy_mm).all()


def test_a_cut_recording_is_an_exception_unless_asked_for(skull_drill: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    data = skull_drill.read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    with pytest.raises(trepan.TrepanError, match="cut.mcap: it is cut or damaged at byte .*allow_damaged=True"):
        trepan.read_recording(cut)
    part = trepan.read_recording(cut, allow_damaged=True)
    assert 0 < len(part) < 3000 and part.losses is not None and "cut" in part.losses
    cut.write_bytes(data[:20])
    with pytest.raises(trepan.TrepanError, match="no session header"):
        trepan.read_recording(cut, allow_damaged=True)
    (tmp_path / "text.mcap").write_text("text")
    with pytest.raises(trepan.TrepanError, match="not a recording"):
        trepan.read_recording(tmp_path / "text.mcap")
    with pytest.raises(FileNotFoundError, match="check the name"):
        trepan.read_recording(tmp_path / "no.mcap")


def test_scores_have_units(skull_drill: Path, tmp_path: Path) -> None:
    shutil.copy(skull_drill, tmp_path / "session.mcap")
    recording = trepan.read_recording(tmp_path)
    with pytest.raises(FileNotFoundError, match="scores lie in the folder of a session"):
        recording.scores
    text = 'name,value\nperson,"A, b"\nscores.peak_bone_n,1.5\nplan.dice,0.5\nscores.none_mm,\nwarnings.x.count,2\n'
    (tmp_path / "scores.csv").write_text(text)
    assert recording.scores == {
        "peak_bone_n": trepan.Score(1.5, "N"),
        "plan.dice": trepan.Score(0.5, ""),
        "warnings.x.count": trepan.Score(2, "1"),
    }


def test_a_plot_has_its_curves(skull_drill: Path, tmp_path: Path) -> None:
    figure = trepan.read_recording(skull_drill).plot()
    force, depth, bone = figure.axes
    assert [axes.get_ylabel() for axes in figure.axes] == ["force, N", "depth, mm", "volume, mm$^3$"]
    assert np.shape(force.lines[0].get_xdata()) == (3000,) and len(depth.lines) >= 2 and len(bone.lines) >= 1
    figure.savefig(tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 10_000


def test_a_view_holds_its_surfaces() -> None:
    from trepan.view import poly_data, view

    ct, brain = trepan.scenes.head(4.0)
    skull, mesh = trepan.isosurface(ct, 400), trepan.tetrahedra(brain, 2000)
    plotter = view(skull, mesh, np.array([[0, 0, 90], [0, 0, 60.0]]), off_screen=True)
    assert set(plotter.actors) >= {"skull", "brain", "path"}
    assert poly_data(skull).n_cells == len(skull.triangles)
    assert poly_data(mesh).volume == pytest.approx(mesh.quality()["total_mm3"], rel=1e-3)
    plotter.close()


def fake_program(folder: Path, script: str) -> None:
    """A program in a folder that TREPAN_BIN names."""
    folder.mkdir(exist_ok=True)
    program = folder / "integrated"
    program.write_text(f"#!{sys.executable}\n{script}")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)


def test_a_session_that_fails_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TREPAN_BIN", str(tmp_path / "bin"))
    with pytest.raises(FileNotFoundError, match="cargo build --release"):
        trepan.session.run()
    with pytest.raises(ValueError, match="use the argument out"):
        trepan.session.run(["--out=here"])
    with pytest.raises(ValueError, match="list of words"):
        trepan.session.run("--duration 1")
    fake_program(tmp_path / "bin", "import sys; print('no such flag', sys.argv[1], file=sys.stderr); sys.exit(2)")
    with pytest.raises(trepan.TrepanError, match="ended with 2: no such flag --headless"):
        trepan.session.run(["--bad"])
    fake_program(tmp_path / "bin", "import time; time.sleep(60)")
    with pytest.raises(TimeoutError, match="within 0.5 s"):
        trepan.session.run(timeout_s=0.5, out=tmp_path / "out")


def interruptible() -> None:
    """Undoes what a job in the background inherits: that Ctrl-C is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.skipif(os.name != "posix", reason="sends a signal")
def test_ctrl_c_ends_a_session_in_order(tmp_path: Path) -> None:
    script = f"""
import signal, sys, time
def end(*_):
    open({str(tmp_path / "ended")!r}, "w").close(); sys.exit(0)
signal.signal(signal.SIGINT, end)
open({str(tmp_path / "begun")!r}, "w").close()
time.sleep(60)"""
    fake_program(tmp_path / "bin", script)
    python = subprocess.Popen(
        [sys.executable, "-c", f"import trepan; trepan.session.run(out={str(tmp_path / 'out')!r})"],
        env=os.environ | {"TREPAN_BIN": str(tmp_path / "bin")},
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=interruptible,
    )
    until = time.monotonic() + 30
    while not (tmp_path / "begun").exists() and time.monotonic() < until:
        time.sleep(0.05)
    python.send_signal(signal.SIGINT)
    assert "KeyboardInterrupt" in python.communicate(timeout=30)[1]
    assert (tmp_path / "ended").exists()


def test_a_real_session_is_run_and_read(tmp_path: Path) -> None:
    try:
        trepan.session.find_program()
    except FileNotFoundError as fault:
        pytest.skip(str(fault))
    recording = trepan.session.run(["--duration", "3"], out=tmp_path / "session", timeout_s=300)
    assert len(recording) >= 2000 and recording.losses is None and recording.app == "integrated"
    assert recording.scores["bone_removed_mm3"].value > 0 and recording.scores["path_mm"].unit == "mm"
    assert any(event.kind == "phase" for event in recording.events)


def test_ctrl_c_ends_a_long_call(tmp_path: Path) -> None:
    script = """
import trepan, numpy as np
mesh = trepan.split_box((6, 6, 6), (40, 40, 40))
solver = trepan.Tled(mesh, np.flatnonzero(mesh.positions[:, 2] < 1), trepan.Material.BRAIN)
print("begun", flush=True)
solver.step(trepan.Loads(), steps=2**31)"""
    python = subprocess.Popen(
        [sys.executable, "-c", script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=interruptible,
    )
    try:
        assert python.stdout is not None and python.stdout.readline() == "begun\n"
        time.sleep(0.3)
        python.send_signal(signal.SIGINT)
        assert "KeyboardInterrupt" in python.communicate(timeout=30)[1]
    finally:
        python.kill()
