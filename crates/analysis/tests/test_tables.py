"""Other programs open the tables, and give the same numbers."""

import csv
from pathlib import Path

import duckdb
import pandas as pd
import polars as pl
import pyarrow.parquet as pq
from conftest import program

SQL = """select session, count(*) as n, avg(depth_mm) as depth, max(force_z_n) as force from {ticks}
where drilling and time_ms > 1000 group by session order by session"""


def test_duckdb_polars_and_pandas_agree_with_query(study: Path) -> None:
    tables = study / "results" / "tables"
    rows = study / "rows.csv"
    program("query", tables, "--sql", SQL.format(ticks="ticks"), "--csv", rows)
    ours = pd.read_csv(rows, dtype={"session": str})
    assert len(ours) == 320 and ours.n.min() > 1000

    duck = duckdb.sql(SQL.format(ticks=f"read_parquet('{tables}/ticks/*/*.parquet', hive_types={{'session': varchar}})")).df()
    scan = pl.scan_parquet(tables / "ticks", hive_schema={"session": pl.String})
    polars = (
        scan.filter(pl.col("drilling") & (pl.col("time_ms") > 1000))
        .group_by("session")
        .agg(n=pl.len(), depth=pl.col("depth_mm").mean(), force=pl.col("force_z_n").max())
        .sort("session")
        .collect()
        .to_pandas()
    )
    frame = pd.read_parquet(tables / "ticks", columns=["session", "drilling", "time_ms", "depth_mm", "force_z_n"])
    frame = frame[frame.drilling & (frame.time_ms > 1000)]
    groups = frame.groupby(frame.session.astype(str))
    pandas = groups.agg(n=("depth_mm", "size"), depth=("depth_mm", "mean"), force=("force_z_n", "max")).reset_index()
    for other in (duck, polars, pandas):
        assert list(other.session) == list(ours.session) and list(other.n) == list(ours.n)
        assert abs(other.depth - ours.depth).max() < 1e-5
        assert (other.force.astype("float32") == ours.force.astype("float32")).all()


def test_fields_have_units_and_the_sessions_say_that_they_are_simulated(study: Path) -> None:
    part = next((study / "results" / "tables" / "ticks").glob("*/part.parquet"))
    schema = pq.read_schema(part)
    assert schema.field("second_force_x_n").metadata[b"unit"] == b"N"
    for field in schema:
        unit = (field.metadata or {}).get(b"unit", b"").decode()
        if unit not in ("", "1", "bits"):
            ending = "rpm" if unit == "1/min" else unit.replace(" ", "_").replace("/", "_").lower()
            assert field.name.endswith("_" + ending), f"{field.name} is in {unit}"
    assert pq.read_metadata(part).metadata[b"trepan.tables"] == b"1"
    cases = pd.read_parquet(study / "results" / "tables" / "cases")
    assert cases.simulated.all() and cases.complete.all() and cases.participant.nunique() == 40
    assert "Simulated." in (study / "results" / "study.html").read_text()


def test_scores_are_those_of_the_sessions(study: Path) -> None:
    scores = pd.read_parquet(study / "results" / "tables" / "scores")
    written = []
    for file in (study / "runs").glob("*/scores.csv"):
        with file.open() as lines:
            written += [float(row["value"]) for row in csv.DictReader(lines) if row["name"] == "scores.plunge_mm"]
    assert sorted(written) == sorted(scores[scores.name == "plunge_mm"].value)
    assert set(scores[scores.name == "plunge_mm"].unit) == {"mm"}
