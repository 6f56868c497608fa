"""Times of exports and queries: `benchmarks.py TREPAN_ANALYSIS SESSIONS TABLES`, with duckdb installed.

SESSIONS is a folder by `cargo run --release --example make_sessions -- SESSIONS 1000 60`.
"""

import resource
import subprocess
import sys
import time

program, sessions, tables = sys.argv[1:]
QUERIES = {
    "mean and maximum by session": "select session, count(*) as n, avg(depth_mm) as depth, max(force_z_n) as force "
    "from {ticks} group by session order by session",
    "filter of three columns": "select count(*) as n, avg(compute_us) as us from {ticks} "
    "where drilling and depth_mm > 0.3 and force_z_n > 0.6",
    "histogram of depth": "select floor(depth_mm * 200) as bin, count(*) as n from {ticks} group by 1 order by 1",
}


def seconds(*command: str) -> float:
    """Best of three."""
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - begin)
    return min(times)


subprocess.run([program, "export", sessions, "--parquet", tables], check=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(f"export: {used.ru_utime + used.ru_stime:.0f} s of CPU time, {used.ru_maxrss / 1024:.0f} MiB at most")
for name, query in QUERIES.items():
    ours = seconds(program, "query", tables, "--sql", query.format(ticks="ticks"), "--csv", f"{tables}/rows.csv")
    sql = query.format(ticks=f"'{tables}/ticks/*/*.parquet'")
    script = f'import duckdb; duckdb.sql("set enable_progress_bar = false"); duckdb.sql("""copy ({sql}) to \'{tables}/rows.csv\'""")'
    duck = seconds(sys.executable, "-c", script)
    print(f"{name}: {ours:.1f} s, DuckDB {duck:.1f} s, {ours / duck:.2f} times")
