"""What figures draw and pages order by, from made-up numbers of which no two are alike: none can stand for another."""

from __future__ import annotations

import base64
import math
from typing import Any

import numpy as np
import pytest

from crossbody.cases import Ledger, Trajectory
from crossbody.reports.judging import told
from crossbody.reports.pages import figures, precision
from crossbody.reports.runs.store import Trace

SAMPLES, SHOWN = 41, 1e-3


def accounted(rng: np.random.Generator, missing: np.ndarray) -> Trajectory:
    """A motion whose energy is what its account says, and what is missing."""
    t = np.linspace(0.0, 1.0, SAMPLES)
    book = [np.cumsum(rng.normal(size=SAMPLES)) for _ in range(4)]
    total = 5.0 + (book[0] + book[1]) + book[2] - book[3] + missing
    total -= total[0] - 5.0 - missing[0]
    column = np.zeros((SAMPLES, 1))
    return Trajectory(
        t=t, q=column, v=column, gap=np.zeros((SAMPLES, 2)), lam=np.zeros((SAMPLES, 2)),
        energy=np.stack([0.3 * total, 0.7 * total], axis=1), mode=np.zeros((SAMPLES, 2), dtype=np.int8),
        ledger=Ledger(contact=np.stack(book[:2], axis=1), input=book[2], dissipated=book[3]),
    )  # fmt: skip


def drawn(figure: Any, axis: str) -> np.ndarray:
    """Return the numbers of the one line on an axis."""
    (line,) = [one for one in figure["data"] if one.get("yaxis", "y") == axis and one.get("mode") == "lines"]
    return np.frombuffer(base64.b64decode(line["y"]["bdata"]), dtype=line["y"]["dtype"]).astype(float)


@pytest.mark.parametrize("seed", range(10))
def test_the_plot_of_energies_shows_what_no_part_of_the_account_explains(seed: int) -> None:
    """Work of all rows, what inputs bring and what is dissipated, each with its sign."""
    rng = np.random.default_rng(seed)
    missing = np.concatenate([[0.0], rng.uniform(0.1, 1.0, SAMPLES - 1)])
    trace = Trace(about={"engine": "e", "profile": "p", "place": 0}, run=accounted(rng, missing))
    shown = drawn(figures.energy([trace], points=10 * SAMPLES), "y3")
    assert shown.max() == pytest.approx(missing.max(), rel=SHOWN)
    assert shown[1:].min() == pytest.approx(missing[1:].min(), rel=SHOWN)


@pytest.mark.parametrize("seed", range(10))
def test_a_run_stands_at_its_error_and_its_time_in_ms(seed: int, tmp_path: Any) -> None:
    rng = np.random.default_rng(seed)
    names = [f"e{i}:p" for i in range(3)]
    errors, walls = 10.0 ** rng.uniform(-9, -2, 3), 10.0 ** rng.uniform(-4, 1, 3)
    rows = [
        {"who": who, "metric": metric, "value": value, "limit": 1.0, "verdict": "within"}
        for who, error in zip(names, errors.tolist(), strict=True)
        for metric, value in (("position", error), ("velocity", 3.0 * error))
    ]
    (section,) = precision.precision(
        tmp_path, "case:v", rows, dict(zip(names, walls.tolist(), strict=True)), dict.fromkeys(names, 0)
    )
    (plot,) = section.plots
    marks = {one["name"]: (one["x"][0], one["y"][0]) for one in plot.figure["data"]}
    assert marks == {
        who: (pytest.approx(error), pytest.approx(1e3 * wall))
        for who, error, wall in zip(names, errors.tolist(), walls.tolist(), strict=True)
    }


@pytest.mark.parametrize("seed", range(20))
def test_a_number_is_out_by_its_distance_from_what_is_claimed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    expected, limit, off = float(rng.normal()), float(10.0 ** rng.uniform(-9, 0)), float(rng.uniform(0.1, 9.0))
    row: dict[str, Any] = {
        "value": expected + off * limit * rng.choice([-1.0, 1.0]),
        "expected": expected,
        "limit": limit,
    }
    assert told.share(row) == pytest.approx(off, rel=1e-6 + 1e-15 * abs(expected) / limit)  # type: ignore[arg-type]
    plain = row | {"value": off * limit, "expected": math.nan}
    assert told.share(plain) == pytest.approx(off)  # type: ignore[arg-type]
