"""Exports of whole, cut, copied, changed and mixed recordings."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import duckdb
import pandas as pd
import pytest
from conftest import PROTOCOLS, program


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sessions of simulated participants."""
    folder = tmp_path_factory.mktemp("made") / "runs"
    program("simulate", PROTOCOLS / "demonstration.toml", "--out", folder, "--seed", 5)
    return folder


@pytest.fixture
def runs(made: Path, tmp_path: Path) -> Path:
    """Three sessions of their own for a test."""
    folder = tmp_path / "runs"
    for name in ("N01-001", "N01-002", "E01-001"):
        shutil.copytree(made / name, folder / name)
    return folder


def export(runs: Path, code: int = 0) -> tuple[str, str]:
    """Lines and warnings of an export into `tables` beside the runs."""
    command = [os.environ["TREPAN_ANALYSIS"], "export", runs, "--parquet", runs.with_name("tables")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    return done.stdout, done.stderr


def cell(runs: Path, sql: str) -> object:
    """The first cell of a query on the tables, by DuckDB."""
    tables = runs.with_name("tables")
    for name in ("ticks", "events", "scores", "cases"):
        sql = sql.replace(f"@{name}", f"read_parquet('{tables}/{name}/*/*.parquet', hive_types={{'session': varchar}})")
    return duckdb.sql(sql).fetchall()[0][0]


def test_a_second_run_writes_nothing_and_new_scores_are_taken(runs: Path) -> None:
    assert "3 sessions exported, 0 were there" in export(runs)[0]
    assert cell(runs, "select count(*) from @ticks") == 4500 and cell(runs, "select count(*) from @events") == 18
    assert "0 sessions exported, 3 were there" in export(runs)[0]
    scores = {"plunge_mm": "mm", "tissue_impulse_n_s": "N s", "tools.burr.mean_n": "N", "times_through": "", "drilling_s": "s"}
    lines = [f"{name if '.' in name else 'scores.' + name},10.25" for name in scores]
    (runs / "E01-001" / "scores.csv").write_text("\n".join(["name,value", *lines]))
    assert "1 sessions exported, 2 were there" in export(runs)[0]
    assert cell(runs, "select value from @scores where name = 'plunge_mm' order by value desc") == 10.25
    assert cell(runs, "select count(distinct session) from @cases") == 3
    units = cell(runs, "select map_from_entries(list((name, unit))) from @scores where value = 10.25")
    assert units == scores


def test_a_cut_recording_gives_its_whole_part_and_is_replaced(runs: Path) -> None:
    file = runs / "E01-001" / "session.mcap"
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    out, warnings = export(runs)
    assert "3 sessions" in out and "cut or damaged at byte" in warnings and "fetch the file again" in warnings
    assert 3000 < cell(runs, "select count(*) from @ticks") < 4400
    assert "cut or damaged" in cell(runs, "select losses from @cases where not complete")
    file.write_bytes(whole)
    assert "1 sessions exported, 2 were there" in export(runs)[0]
    assert cell(runs, "select count(*) from @ticks") == 4500 and cell(runs, "select bool_and(complete) from @cases")


def test_what_cannot_be_read_stops_nothing_and_leaves_nothing(runs: Path) -> None:
    copy = runs / "copy"
    copy.mkdir()
    (copy / "session.mcap").write_bytes((runs / "N01-001" / "session.mcap").read_bytes())
    (runs / "N01-002" / "session.mcap").write_bytes(b"nothing")
    (runs / "E01-001" / "summary.json").write_text("{")
    _, told = export(runs, 1)
    assert "left out" in told and "is not a recording" in told and "is no summary" in told and "2 recordings" in told
    left = runs.with_name("tables") / "ticks" / "session=s0123456789abcdef"
    left.mkdir()
    others = left.with_name("2024")
    others.mkdir()
    (runs.with_name("tables") / ".part-x").mkdir()
    export(runs, 1)
    assert not left.exists() and not (runs.with_name("tables") / ".part-x").exists() and others.exists()
    others.rmdir()
    for table in ("ticks", "events", "scores", "cases"):
        assert len(list((runs.with_name("tables") / table).iterdir())) == 1


def test_a_killed_export_leaves_whole_sessions_only(made: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    runs.symlink_to(made, target_is_directory=True)
    command = [os.environ["TREPAN_ANALYSIS"], "export", runs, "--parquet", tmp_path / "tables"]
    for _ in range(3):
        killed = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        try:
            killed.wait(0.05)
        except subprocess.TimeoutExpired:
            killed.kill()
            killed.wait()
    assert "recordings were not exported" not in export(runs)[1]
    for table in ("ticks", "scores", "cases"):
        assert cell(runs, f"select count(distinct session) from @{table}") == 320
    assert cell(runs, "select count(*) from @ticks") == 320 * 1500


def test_no_name_reaches_the_tables_and_versions_are_counted(runs: Path) -> None:
    file = runs / "E01-001" / "session.mcap"
    file.write_bytes(file.read_bytes().replace(b'"version":"0.1.0"', b'"version":"0.9.0"', 1))
    summary = {"person": "Ada Lovelace", "name": "Ada's", "device": "replay:/data/Ada/a.mcap", "case": "Ada"}
    (runs / "N01-001" / "summary.json").write_text(json.dumps(summary))
    (runs / "N01-001" / "scores.csv").write_text("name,value\nperson,Ada\nsession_name,Ada\nhashes.case,7\nscores.a_s,1\n")
    (runs / "N01-001").rename(runs / "Ada Lovelace")
    _, told = export(runs)
    assert "--person N07" in told and "simulated 0.1.0 (2), simulated 0.9.0 (1)" in told
    tables = runs.with_name("tables")
    texts = "".join(pd.read_parquet(tables / name).to_csv() for name in ("cases", "events", "scores"))
    assert "Ada" not in texts and "Lovelace" not in texts and "E01" in texts
    assert not [path for path in tables.rglob("*") if "Ada" in path.name or b"Ada" in (path.is_file() and path.read_bytes() or b"")]


def test_tables_of_another_version_are_an_error(runs: Path) -> None:
    export(runs)
    for part in (runs.with_name("tables") / "cases").glob("*/part.parquet"):
        part.write_bytes(part.read_bytes().replace(b"trepan.tables\x18\x011", b"trepan.tables\x18\x019"))
    assert "tables of version 9" in export(runs, 1)[1]
