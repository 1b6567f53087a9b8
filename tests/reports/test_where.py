"""What is off beyond its limit is named: the coordinate, by how much in its own unit, and when."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from crossbody.cases import Case, Coordinate, Trajectory, load
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.told import runs_of, sentence
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.measuring.placed import Placed, largest
from crossbody.reports.measuring.truth import Truth
from crossbody.reports.metrics import _motions, position


def cases() -> list[Case]:
    return [load("bouncing_ball", "linear"), load("tossed_cube", "slides", t_end=0.05)]


@pytest.mark.parametrize("case", cases(), ids=lambda case: case.label)
@pytest.mark.parametrize("seed", range(4))
def test_the_coordinate_that_was_put_off_is_named(case: Case, seed: int) -> None:
    rng, truth = np.random.default_rng(seed), truth_of(case)
    run, free = truth.trajectory, [j for j in range(len(case.coordinates)) if not _turns(case, j)]
    i, j, by = int(rng.integers(1, len(run.t) - 1)), int(rng.choice(free)), float(rng.uniform(1e-4, 1e-3))
    q = run.q.copy()
    q[i, j] += by
    name, unit = case.coordinates[j].name, case.coordinates[j].unit
    assert _where(truth, replace(run, q=q), case) == f"{name} by {by:.2g} {unit} at {run.t[i]:.3g} s"


def _where(truth: Truth, run: Trajectory, case: Case) -> str:
    found = position.measure(truth, run, case)
    assert isinstance(found, Placed)
    return found.where


def _turns(case: Case, j: int) -> bool:
    return any(at <= j < at + 4 for at in case.quaternions)


def test_a_body_that_is_turned_is_named_by_its_angle() -> None:
    case = cases()[1]
    truth = truth_of(case)
    (at,) = case.quaternions
    turned = truth.trajectory.q.copy()
    turned[-1, at : at + 4] = _times(turned[-1, at : at + 4], 0.02)
    said = _where(truth, replace(truth.trajectory, q=turned), case)
    assert said == f"free by 0.02 rad at {truth.trajectory.t[-1]:.3g} s"


def _times(q: np.ndarray, angle: float) -> np.ndarray:
    """A rotation followed by one about its own z axis."""
    w, x, y, z = q
    c, s = np.cos(angle / 2.0), np.sin(angle / 2.0)
    return np.array([w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s])


def test_the_sentence_names_it_and_what_is_within_has_none() -> None:
    case = cases()[0]
    truth = truth_of(case)
    off = replace(truth.trajectory, q=truth.trajectory.q + 1e-3)
    entries = [Entry(engine="fake", profile=name, run=run) for name, run in (("off", off), ("right", truth.trajectory))]
    rows = [row.row() for row in judged(case, entries, truth, "")]
    positions = {row["profile"]: row["where"] for row in rows if row["metric"] == "position"}
    assert "m at" not in positions["right"] or _size(positions["right"]) < 1e-12
    assert " by 0.001 m at " in positions["off"]
    text = sentence(runs_of([row for row in rows if row["metric"] in ("position", "finished")]))
    assert positions["off"] in text


SIGNALS = {
    "position": "height", "velocity": "height", "gap_error": "floor", "event_times": "floor", "lam_impulse": "floor",
    "lam_impulse_path": "floor", "energy_drift": "energy",
}  # fmt: skip


@pytest.mark.parametrize("metric", SIGNALS)
def test_every_number_that_has_an_instant_says_of_what_it_is_and_when(metric: str) -> None:
    case = load("bouncing_ball", "linear")
    truth = truth_of(case)
    late = replace(truth.trajectory, t=truth.trajectory.t * 1.001, events=tuple(
        replace(event, t=event.t * 1.001) for event in truth.trajectory.events
    ), lam=truth.trajectory.lam * 1.01)  # fmt: skip
    rows = [row.row() for row in judged(case, [Entry(engine="fake", profile="off", run=late)], truth, "")]
    (row,) = [row for row in rows if row["metric"] == metric and row["engine"] == "fake"]
    assert row["value"] > 0.0
    assert re.fullmatch(rf".*\b{SIGNALS[metric]} by \S+ \S.* at \S+ s", row["where"])


@pytest.mark.parametrize("seed", range(20))
def test_the_largest_of_errors_is_that_of_the_signal_and_the_instant_named(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, k = rng.integers(1, 9, 2)
    off, t, scale = rng.uniform(0.1, 1.0, (n, k)), np.sort(rng.uniform(0.0, 9.0, n)), rng.uniform(0.5, 2.0, k)
    found = largest(off, t, [(f"row {j}", "m") for j in range(k)], scale)
    name, size, at = re.fullmatch(r"row (\d+) by (\S+) m at (\S+) s", found.where).groups()
    (i,) = np.flatnonzero([f"{one:.3g}" == at for one in t])
    assert f"{off[i, int(name)]:.2g}" == size
    assert found == pytest.approx(float((off / scale).max()), rel=1e-15)
    assert found == pytest.approx(off[i, int(name)] / scale[int(name)], rel=1e-15)


def _size(said: str) -> float:
    return float(said.partition(" by ")[2].partition(" ")[0])


def test_how_far_a_start_is_off_is_over_the_largest_of_its_own_unit() -> None:
    named, motion = (Coordinate(name="x", unit="m"), Coordinate(name="turn", unit="rad")), np.array([[1.0, 1000.0]])
    found = _motions._apart(np.array([1e-3, 0.0]), motion, named, False)
    assert found == pytest.approx(1e-3)
    assert found.where == "x by 0.001 m at 0 s"
