"""Metrics of the cradle on motions whose answer is known beforehand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from crossbody.cases import Case, Event, Inputs, InvalidValue, Mode, Tier, Trajectory, load
from crossbody.cases.case import CaseMetric
from crossbody.cases.mechanisms.cradle.claims import row
from crossbody.cases.mechanisms.cradle.rules import answer
from crossbody.reports import metrics
from crossbody.reports.measuring.truth import from_run

PATTERNS = {
    "pattern_distance": "sequential", "pattern_simultaneous": "simultaneous", "pattern_linear": "linear",
    "pattern_hertz": "hertz", "pattern_memoryless": "memoryless",
}  # fmt: skip


@pytest.fixture
def case() -> Case:
    """Two of five: with two of four all at once would give the ideal pattern too."""
    return load("newtons_cradle", n=5, lifted=2, speed=2.0, gap=1e-4)


def leaving(case: Case, speeds: np.ndarray) -> Trajectory:
    """The exact motion, but that it ends with other speeds."""
    assert case.closed_form is not None
    run = case.closed_form(np.linspace(0.0, case.t_end, 20))
    return replace(run, v=np.vstack([run.v[:-1], speeds]))


def measure(name: str, run: Trajectory, case: Case) -> float | None:
    return metrics.of(case)[name].measure(from_run(run, Tier.D, "itself"), run, case)


@pytest.mark.parametrize("metric", PATTERNS)
def test_a_rule_is_recognised_by_its_own_pattern_alone(metric: str, case: Case) -> None:
    speeds = answer(PATTERNS[metric], row(case))
    assert speeds is not None
    found = {name: measure(name, leaving(case, speeds), case) for name in PATTERNS}
    assert found.pop(metric) == 0.0
    assert all(value is not None and value > 1e-6 for value in found.values())


def test_a_pattern_is_measured_by_the_speed_that_came_in(case: Case) -> None:
    off = np.array([0.0, 0.0, 0.5, 2.0, 1.7])
    assert measure("pattern_distance", leaving(case, off), case) == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize(
    ("speeds", "count"), [([0, 0, 0, 2, 2], 2), ([-0.2, 0.1, 0.9, 1.1, 2], 2), ([1, 1, 1, 1, 1], 0)]
)
def test_balls_out_are_those_faster_than_half(case: Case, speeds: list[float], count: int) -> None:
    assert measure("balls_out", leaving(case, np.array(speeds, dtype=float)), case) == count


def test_momentum_and_energy_are_seen(case: Case) -> None:
    fast = leaving(case, np.array([0.0, 0.0, 0.0, 2.0, 2.2]))
    assert measure("momentum", fast, case) == pytest.approx(0.05, rel=1e-12)
    more = replace(fast, energy=np.vstack([fast.energy[:-1], 1.1 * fast.energy[-1]]))
    assert measure("energy_created", more, case) == pytest.approx(0.1, rel=1e-9)


def test_chains_have_no_answer_with_damping() -> None:
    case = load("newtons_cradle", n=3, zeta=0.1)
    run = leaving(case, np.zeros(3))
    assert measure("pattern_linear", run, case) is None
    assert measure("pattern_distance", run, case) is not None


def test_energy_of_switching_needs_one_stiffness_in_real_time(case: Case) -> None:
    run = leaving(case, np.zeros(5))
    assert measure("energy_switching", run, case) is None
    real = load("newtons_cradle", n=3, gap=1e-4, collisions="resolved")
    still = Trajectory(
        t=np.array([0.0, 1.0]), q=np.array([[0.0, 0.0, 0.0], [4e-4, 2e-4, 1e-4]]), v=np.ones((2, 3)),
        gap=np.array([[1e-4, 1e-4], [-1e-4, 0.0]]), lam=np.zeros((2, 2)), energy=np.ones((2, 2)),
        mode=np.array([[0, 0], [1, 1]], dtype=np.int8),
        events=tuple(Event(t=t, contact=i, before=Mode.FREE, after=Mode.CONTACT) for i, t in enumerate((0.9, 1.0))),
    )  # fmt: skip
    # Row 0 is switched on at h = 1e-4 - 0.9 2e-4, row 1 at h_0 = -1e-4: 1/2 a0 h^2 m (1/2, and 2/3 - 1/2).
    first, second = 0.5e6 * 0.1 * (0.8e-4) ** 2 * 0.5, 0.5e6 * 0.1 * 1e-8 * (2 / 3 - 1 / 2)
    assert measure("energy_switching", still, real) == pytest.approx(first + second, rel=1e-9)
    pushed = Inputs(names=("force",), times=np.zeros(1), values=np.ones((1, 1)))
    assert measure("energy_switching", still, replace(real, inputs=pushed)) is None
    assert measure("energy_switching", replace(still, mode=np.array([[0, 0], [-1, 1]], dtype=np.int8)), real) is None
    unequal = replace(real, law=replace(real.law, a0=np.array([1e6, 2e6])))
    assert measure("energy_switching", still, unequal) is None


@pytest.mark.parametrize("metric", [*PATTERNS, "balls_out", "momentum", "energy_created"])
def test_other_mechanisms_have_no_pattern(metric: str) -> None:
    assert metric not in metrics.of(load("bouncing_ball", "linear"))


def test_a_metric_of_a_case_has_a_name_of_its_own() -> None:
    case = load("newtons_cradle")
    with pytest.raises(InvalidValue, match=r"metrics position have the same names as metrics of all cases"):
        metrics.of(replace(case, metrics={"position": case.metrics["balls_out"]}))


@pytest.mark.parametrize("given", [{}, {"number": len, "signal": len}])
def test_a_metric_of_a_case_is_one_function(given: dict[str, Any]) -> None:
    with pytest.raises(InvalidValue, match="has exactly one of number, signal and instants"):
        CaseMetric(doc="", **given)


def test_pendulums_are_judged_when_the_first_collisions_are_over() -> None:
    """A motion that swings on: the pattern is that of the first instant at which no gap closes."""
    case = load("newtons_cradle", "pendulums", n=2)
    speed = row(case).speed / case.number("length")
    v = speed * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.3, 0.2]])
    run = Trajectory(
        t=np.array([0.0, 0.25, 0.25, 0.5]), q=np.zeros((4, 2)), v=v, gap=np.array([[0.1], [0.0], [0.0], [0.1]]),
        lam=np.zeros((4, 1)), energy=np.ones((4, 2)), mode=np.zeros((4, 1), dtype=np.int8),
        events=(
            Event(t=0.25, contact=0, before=Mode.FREE, after=Mode.COLLISION),
            Event(t=0.25, contact=0, before=Mode.COLLISION, after=Mode.FREE),
        ),
    )  # fmt: skip
    assert measure("pattern_distance", run, case) == pytest.approx(0.0, abs=1e-12)
    assert measure("pattern_distance", replace(run, events=()), case) is None
