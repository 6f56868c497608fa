"""scikit-fem: quadratic displacements and linear pressure, TLED's law, Newton's method, f64, straight to rest."""
import taylor_hood

for n in scene["implicit_cells"]:
    start = time.perf_counter(), time.process_time()
    row = taylor_hood.run("hang", poisson, n)
    wall, cpu = time.perf_counter() - start[0], time.process_time() - start[1]
    report(f"{n} cells across", dt_ms=None, fault=None, samples=[sample(0.0, wall, cpu, row["moved_mm"])])
