"""What is stored of runs: read back as it was written, beside what stays, and for the same parameters and settings."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody import engines
from crossbody.cases import Case, load, names, variants
from crossbody.reports.judging import stored
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.run_verdicts import Entry, measured
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import Regression, Word

ENDS = (math.inf, 0.5)
"""Up to when a truth is known, s."""
CASES = (("bouncing_ball", "linear"), ("newtons_cradle", "sliders"))
ENGINES = (("one", "a"), ("one", "b"), ("two", "a"))


@pytest.fixture(autouse=True)
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(stored, "FILE", tmp_path / "stored.json")
    stored._table.cache_clear()
    yield
    stored._table.cache_clear()


@pytest.mark.parametrize("label", [f"{name}:{variant}" for name in names() for variant in variants(name)])
def test_what_is_stored_goes_from_one_process_to_another(label: str) -> None:
    """Not so its case, whose truth may be functions within others."""
    laid = stored.laid(load(label), entry(("one", "a"), 1e-3), {"position": 0.1}, 0.5)
    assert pickle.loads(pickle.dumps(laid)) == laid


def entry(who: tuple[str, str], dt: float) -> Entry:
    return Entry(engine=who[0], profile=who[1], settings={"dt": dt})


@pytest.mark.parametrize("seed", range(20))
def test_a_table_of_runs_keeps_what_still_holds(seed: int) -> None:
    """Runs are stored time and again, now and then with new parameters or a truth of another end, which make all others
    of the case old."""
    rng, known = np.random.default_rng(seed), dict[str, tuple[Any, dict[Any, tuple[float, dict[str, float]]]]]()
    now: dict[str, tuple[Case, float]] = {}
    for _ in range(4):
        runs = []
        for name, variant in CASES:
            t_end = float(rng.choice([1.0, 2.0], p=[0.7, 0.3]))
            end = float(rng.choice(ENDS, p=[0.7, 0.3]))
            case, _ = now[name] = load(name, variant, t_end=t_end), end
            for k in rng.choice(3, rng.integers(0, 3), replace=False):
                dt, found = float(rng.choice([1e-3, 1e-4])), {"position": float(rng.uniform()), "lam": math.nan}
                runs.append((case, entry(ENGINES[k], dt), found, end))
                if name not in known or known[name][0] != (t_end, end):
                    known[name] = (t_end, end), {}
                known[name][1][ENGINES[k]] = dt, found
        stored.write(stored.laid(*run) for run in runs)
        for name, (case, until) in now.items():
            (t_end, end), held = known.get(name, ((math.nan, math.nan), {}))
            for who in ENGINES:
                dt, wanted = held.get(who, (math.nan, {}))
                same = who in held and case.t_end == t_end
                for asked, known_to in ((1e-3, until), (1e-4, until), (dt, 0.98 * until), (dt, 0.996 * until)):
                    found = stored.deviations(case, entry(who, asked), known_to)
                    alike = asked == dt and abs(min(known_to, t_end) - min(end, t_end)) < 0.01 * t_end
                    assert found == pytest.approx(wanted if same and alike else {}, rel=6e-3, nan_ok=True)
                assert stored.defaults(case, entry(who, 1e-3)) == (f"dt={dt:g}" if same else "")
                assert stored.differing(case, entry(who, 1e-3)) == frozenset(wanted)


def test_numbers_come_again_of_the_same_version_and_settings_up_to_the_horizon(monkeypatch: pytest.MonkeyPatch) -> None:
    case = load("bouncing_ball", "linear")
    monkeypatch.setattr(stored, "versions", lambda engine: "one 1.0")
    one, other = entry(ENGINES[0], 1e-3), entry(ENGINES[1], 1e-3)
    found = {"position": 0.1, "velocity": 0.2}
    stored.write([stored.laid(case, one, found, math.inf, ["velocity"]), stored.laid(case, other, found, math.inf)])
    assert stored.repeated(case, one) == {"position"}
    assert stored.repeated(case, other) == frozenset()  # steps that a tolerance chooses
    assert stored.repeated(case, entry(ENGINES[0], 1e-4)) == frozenset()
    assert stored.repeated(load("bouncing_ball", "linear", t_end=0.5), one) == frozenset()
    monkeypatch.setattr(stored, "versions", lambda engine: "one 1.1")
    assert stored.repeated(case, one) == frozenset()
    stored.write([stored.laid(case, one, found, 0.5 * case.t_end, ["velocity"])])
    monkeypatch.setattr(stored, "versions", lambda engine: "one 1.0")
    assert stored.repeated(case, one) == frozenset()


@pytest.mark.parametrize("part", [0.5, 0.94, 1.0, 1.06, 2.1])
def test_another_number_than_the_same_version_gave_is_told(part: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Outside where it is expected-outside, else a regression: a step, a setting or a metric has changed."""
    case = load("bouncing_ball", "linear")
    prepared = engines.load("mujoco").prepare(case, "default")
    made = Entry(engine="mujoco", profile="default", run=prepared.run(), settings=prepared.settings)
    truth = truth_of(case)
    found = measured(case, made, truth)
    monkeypatch.setattr(stored, "versions", lambda engine: "mujoco 4")
    stored.write([stored.laid(case, made, {name: value / part for name, value in found.items()}, truth.trusted, [])])
    rows = {row.metric: row for row in judged(case, [made], truth, "")}
    assert rows["position"].verdict == (Word.EXPECTED if part == 1.0 else Word.OUTSIDE)
    assert rows["position"].regression == (Regression.KEPT if part == 1.0 else Regression.LOST)
