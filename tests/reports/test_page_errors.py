"""Errors on pages: each in its own unit, rotations by their angle, nothing drawn over a long step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody.cases import Trajectory
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.pages import errors
from crossbody.reports.pages.figures import farthest, note, plots
from crossbody.reports.pages.known_pages import wrong
from crossbody.reports.runs.store import Trace


def motions(q: list[np.ndarray], units: list[str], names: list[str] | None = None) -> list[Trace]:
    """A truth and an engine, by their coordinates (n, nq)."""
    n, width = q[0].shape
    about = {
        "coordinates": [{"name": name, "unit": unit} for name, unit in
                        zip(names or [f"c{k}" for k in range(width)], units, strict=True)],
        "contacts": [], "scales": [float(np.abs(column).max()) for column in q[0].T],
    }  # fmt: skip
    runs = [
        Trajectory(t=np.linspace(0.0, 1.0, n), q=one, v=np.zeros((n, width)), gap=np.zeros((n, 0)),
                   lam=np.zeros((n, 0)), energy=np.zeros((n, 2)), mode=np.zeros((n, 0), np.int8))
        for one in q
    ]  # fmt: skip
    return [
        Trace(about=about | {"engine": TRUTH, "profile": ""}, run=runs[0]),
        Trace(about=about | {"engine": "fake", "profile": "p"}, run=runs[1], truth=runs[0]),
    ]


@pytest.mark.parametrize("seed", range(20))
def test_of_each_unit_the_largest_error_in_it_is_first_and_said(seed: int) -> None:
    """However small a coordinate is, what is off by a metre is farther off than what is off by a millimetre."""
    draw = np.random.default_rng(seed)
    units = draw.choice(["m", "rad"], 6).tolist()
    true = draw.normal(size=(30, 6)) * 10.0 ** draw.uniform(-3.0, 3.0, 6)
    away = draw.normal(size=(30, 6)) * 10.0 ** draw.uniform(-6.0, -1.0, 6)
    traces = motions([true, true + away], units)
    sizes, order = np.abs(away).max(axis=0), farthest(traces)
    for unit in set(units):
        own = [k for k in order if units[k] == unit]
        assert own == sorted(own, key=lambda k: -sizes[k])
        (row,) = [row for row in errors.largest(traces[1]) if row["unit"] == unit]
        assert row["coordinate"] == f"c{own[0]}"
        assert row["size"] == pytest.approx(sizes[own[0]], rel=1e-9)
        assert f"c{own[0]} by {sizes[own[0]]:.2g} {unit}" in errors.told(traces)


def test_a_rotation_that_is_off_most_is_seen_first() -> None:
    angle = np.linspace(0.0, 0.5, 40)
    turned = [np.column_stack([np.cos(a / 2), np.sin(a / 2), 0 * a, 0 * a]) for a in (angle, 1.2 * angle)]
    names = [*(f"x{k}" for k in range(6)), "cube qw", "cube qx", "cube qy", "cube qz"]
    draw = np.random.default_rng(1)
    places = draw.normal(size=(40, 6))
    q = [np.column_stack([places + i * 1e-6 * draw.normal(size=(40, 6)), turned[i]]) for i in range(2)]
    traces = motions(q, [*["m"] * 6, *["1"] * 4], names)
    assert farthest(traces)[0] == 6
    first, *_ = plots("motion", traces)
    titles = [axis["title"]["text"] for key, axis in first.figure["layout"].items() if key.startswith("yaxis")]
    assert "rotation cube<br>[rad]" in titles
    assert "qx" not in note("motion", traces)


@pytest.mark.parametrize("until", [0.25, 1.0])
def test_what_is_not_known_is_shaded_to_the_end(until: float) -> None:
    q = np.random.default_rng(2).normal(size=(2, 30, 8))
    for plot in plots("motion", motions([*q], ["m"] * 8), until=until):
        layout = plot.figure["layout"]
        veils = [one for one in layout["shapes"] if one["type"] == "rect"]
        assert [(one["x0"], one["x1"], one["yref"]) for one in veils] == (
            [(until, 1.0, "paper")] if until < 1.0 else []
        )
        assert ("the truth is known up to 0.25 s only" in layout["title"]["text"]) == (until < 1.0)


def test_nothing_compared_is_no_error() -> None:
    q = np.ones((5, 2))
    traces = motions([q, q], ["m", "rad"])
    blind = replace(traces[1], truth=replace(traces[0].run, q=np.full((5, 2), np.nan)))
    assert [*errors.largest(blind)] == []
    assert errors.farthest_off(traces[:1]) == []
    assert errors.told(traces[:1]) == ""


@pytest.mark.parametrize("kind", ["rotations", "long steps"])
def test_known_answers(kind: str) -> None:
    assert [found for found in wrong() if found[0] == kind] == []
