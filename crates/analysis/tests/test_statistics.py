"""Results of a study against SciPy and pingouin, from its table of sessions."""

import re
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pingouin as pg
import pytest
from conftest import PROTOCOLS, program
from scipy import optimize, stats

MEASURES = ["plunge_mm", "peak_bone_force_n", "drilling_s", "strokes.peak_mm_s"]


def sessions(folder: Path) -> pd.DataFrame:
    frame = pd.read_csv(folder / "results" / "sessions.csv", dtype={"session": str})
    return frame.assign(group=frame.participant.str.rstrip("0123456789"))


@pytest.mark.parametrize("measure", MEASURES)
def test_groups(study: Path, measure: str) -> None:
    frame = sessions(study)
    means = frame.groupby(["group", "participant"])[measure].mean()
    n, e = means["N"].to_numpy(), means["E"].to_numpy()
    table = pd.read_csv(study / "results" / "comparisons.csv")
    ours = table[table.measure == measure].iloc[0]
    assert ours["g"] == pytest.approx(pg.compute_effsize(n, e, eftype="hedges"), rel=1e-9)
    test = stats.permutation_test((n, e), lambda a, b: a.mean() - b.mean(), n_resamples=9999, rng=1)
    assert ours["p"] == pytest.approx(test.pvalue, abs=4 * np.sqrt(test.pvalue / 9999) + 2e-4)

    def g(a: np.ndarray, b: np.ndarray, axis: int = -1) -> np.ndarray:
        pooled = np.sqrt(0.5 * (a.var(axis=axis, ddof=1) + b.var(axis=axis, ddof=1)))
        return (a.mean(axis=axis) - b.mean(axis=axis)) / pooled * (1 - 3 / (4 * 40 - 9))

    theirs = stats.bootstrap((n, e), g, method="BCa", n_resamples=9999, rng=1).confidence_interval
    width = theirs.high - theirs.low
    assert abs(ours["g_low"] - theirs.low) < 0.05 * width and abs(ours["g_high"] - theirs.high) < 0.05 * width


def test_conditions_and_holm(perception: Path) -> None:
    frame = sessions(perception)
    table = pd.read_csv(perception / "results" / "comparisons.csv")
    means = frame.groupby(["condition", "participant"]).plunge_mm.mean()
    ours = table[(table.measure == "plunge_mm") & (table["first"] == "A") & (table["second"] == "C")].iloc[0]
    difference = (means["A"] - means["C"]).to_numpy()
    test = stats.permutation_test((difference,), np.mean, permutation_type="samples", n_resamples=9999, rng=1)
    assert ours["p"] == pytest.approx(test.pvalue, abs=0.02)
    assert ours["g"] == pytest.approx(difference.mean() / difference.std(ddof=1) * (1 - 3 / (4 * 23 - 1)), rel=1e-9)
    adjusted = pg.multicomp(table.p.to_list(), method="holm")[1]
    assert np.allclose(adjusted, table.p_holm, atol=1e-12)
    # Three conditions in pairs: three scores, three Likert items, the raw TLX.
    assert len(table) == 3 * (3 + 3 + 1)
    answers = pd.read_csv(perception / "runs" / "answers.csv")
    tlx = answers[answers.item.str.startswith("tlx-")].groupby(["condition", "participant"]).value.mean()
    ours = table[(table.measure == "raw NASA-TLX") & (table["first"] == "A") & (table["second"] == "B")].iloc[0]
    assert ours.mean_first == pytest.approx(tlx["A"].mean()) and ours.mean_second == pytest.approx(tlx["B"].mean())


@pytest.mark.parametrize("measure", MEASURES)
def test_reliability(study: Path, measure: str) -> None:
    later = sessions(study).query("attempt >= 5")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        icc = pg.intraclass_corr(later, targets="participant", raters="attempt", ratings=measure)
    table = pd.read_csv(study / "results" / "reliability.csv")
    ours = table[table.measure == measure].iloc[0]
    interval = next(name for name in icc.columns if name.startswith("CI95"))
    for row, column in ((1, "icc_2_1"), (2, "icc_3_1")):
        assert ours[column] == pytest.approx(icc.ICC.iloc[row], abs=1e-6)
        assert [ours[f"{column}_low"], ours[f"{column}_high"]] == pytest.approx(list(icc[interval].iloc[row]), abs=0.006)


def test_learning(study: Path) -> None:
    means = pd.read_csv(study / "results" / "learning.csv").groupby(["measure", "group"])
    laws = pd.read_csv(study / "results" / "laws.csv")

    def law(n: np.ndarray, floor: float, gain: float, rate: float) -> np.ndarray:
        return floor + gain * n**-rate

    assert len(laws) == 8
    for _, ours in laws.iterrows():
        of = means.get_group((ours.measure, ours.group))
        n, y = of["attempt"].to_numpy(float), of["mean"].to_numpy()
        bounds = ([-np.inf, -np.inf, 0.02], [np.inf, np.inf, 4.0])
        start = [y[-1], y[0] - y[-1], 0.7]
        fitted, _ = optimize.curve_fit(law, n, y, p0=start, bounds=bounds, max_nfev=100_000)
        left = ((law(n, *fitted) - y) ** 2).sum()
        assert ((law(n, ours.floor, ours.gain, ours.rate) - y) ** 2).sum() <= left * (1 + 1e-6)
        assert ours.rate_low <= ours.rate <= ours.rate_high


def test_outliers(study: Path) -> None:
    frame, table = sessions(study), pd.read_csv(study / "results" / "outliers.csv")
    found = set()
    for measure in MEASURES:
        for _, of in frame.groupby("group"):
            x = of[measure]
            z = 0.6745 * (x - x.median()) / stats.median_abs_deviation(x)
            found |= {(session, measure) for session in of.session[z.abs() > 3.5]}
    assert found == set(zip(table.session.astype(str), table.measure))


def test_power() -> None:
    text = program("plan", PROTOCOLS / "demonstration.toml")
    power, needed = map(float, re.search(r"with power ([\d.]+); 0.8 needs (\d+)", text).groups())

    def exact(n: int) -> float:
        shift, freedom = 1.2 * np.sqrt(n / 2), 2 * n - 2
        t = stats.t.ppf(0.995, freedom)
        return stats.nct.sf(t, freedom, shift) + stats.nct.cdf(-t, freedom, shift)

    assert power == pytest.approx(exact(20), abs=6e-4)
    assert exact(int(needed)) >= 0.8 > exact(int(needed) - 1)


def test_the_true_difference_is_found_and_equal_conditions_are_not(study: Path, perception: Path) -> None:
    table = pd.read_csv(study / "results" / "comparisons.csv")
    assert table[table.measure.isin(MEASURES[:3])].found.all()
    # Simulated participants feel no difference: at most one of 21 is a false finding.
    assert pd.read_csv(perception / "results" / "comparisons.csv").found.sum() <= 1
