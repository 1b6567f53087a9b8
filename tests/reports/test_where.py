"""What is off beyond its limit is named: the coordinate, by how much in its own unit, and when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody.cases import Case, load
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.told import runs_of, sentence
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.metrics import position


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
    assert position.where(truth, replace(run, q=q), case) == f"{name} by {by:.2g} {unit} at {run.t[i]:.3g} s"


def _turns(case: Case, j: int) -> bool:
    return any(at <= j < at + 4 for at in case.quaternions)


def test_a_body_that_is_turned_is_named_by_its_angle() -> None:
    case = cases()[1]
    truth = truth_of(case)
    (at,) = case.quaternions
    turned = truth.trajectory.q.copy()
    turned[-1, at : at + 4] = _times(turned[-1, at : at + 4], 0.02)
    said = position.where(truth, replace(truth.trajectory, q=turned), case)
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
    assert positions["right"] == ""
    assert " by 0.001 m at " in positions["off"]
    assert all(row["where"] == "" for row in rows if row["verdict"] == "within")
    text = sentence(runs_of([row for row in rows if row["metric"] in ("position", "finished")]))
    assert positions["off"] in text
