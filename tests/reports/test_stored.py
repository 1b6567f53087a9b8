"""What is stored of runs: read back as it was written, beside what stays, and for the same parameters and settings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody.cases import Case, load
from crossbody.reports.judging import stored
from crossbody.reports.judging.comparison import Entry

CASES = (("bouncing_ball", "linear"), ("newtons_cradle", "sliders"))
ENGINES = (("one", "a"), ("one", "b"), ("two", "a"))


@pytest.fixture(autouse=True)
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(stored, "FILE", tmp_path / "stored.json")
    stored._table.cache_clear()
    yield
    stored._table.cache_clear()


def entry(who: tuple[str, str], dt: float) -> Entry:
    return Entry(engine=who[0], profile=who[1], settings={"dt": dt})


@pytest.mark.parametrize("seed", range(20))
def test_a_table_of_runs_keeps_what_still_holds(seed: int) -> None:
    """Runs are stored time and again, with new parameters now and then, which make all others of the case old."""
    rng, known = np.random.default_rng(seed), dict[str, tuple[float, dict[Any, tuple[float, dict[str, float]]]]]()
    now: dict[str, Case] = {}
    for _ in range(4):
        runs = []
        for name, variant in CASES:
            t_end = float(rng.choice([1.0, 2.0], p=[0.7, 0.3]))
            case = now[name] = load(name, variant, t_end=t_end)
            for k in rng.choice(3, rng.integers(0, 3), replace=False):
                dt, found = float(rng.choice([1e-3, 1e-4])), {"position": float(rng.uniform()), "lam": math.nan}
                runs.append((case, entry(ENGINES[k], dt), found))
                if known.get(name, (t_end,))[0] != t_end or name not in known:
                    known[name] = t_end, {}
                known[name][1][ENGINES[k]] = dt, found
        stored.write(runs)
        for name, case in now.items():
            t_end, held = known.get(name, (math.nan, {}))
            for who in ENGINES:
                dt, wanted = held.get(who, (math.nan, {}))
                same = who in held and case.t_end == t_end
                for asked in (1e-3, 1e-4):
                    found = stored.deviations(case, entry(who, asked))
                    assert found == pytest.approx(wanted if same and asked == dt else {}, rel=6e-3, nan_ok=True)
                assert stored.defaults(case, entry(who, 1e-3)) == (f"dt={dt:g}" if same else "")
                assert stored.differing(case, entry(who, 1e-3)) == frozenset(wanted)
