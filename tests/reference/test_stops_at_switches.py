"""A horizon, a sample or a change of inputs a few roundings of time beside a switch of contacts is reached.

No step fits between: where a slip stopped a rounding before the horizon, the run ended as step_too_small.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from places import ROOT

from crossbody import cases, engines
from crossbody.cases import Case, Trajectory

NEAR = range(-6, 7)
"""Roundings of time by which it is beside the switch."""
RUBS = [("sliding_block", "stops"), ("rolling_sphere", "straight"), ("dry_oscillator", "stops")]
HITS = [("bouncing_ball", "linear"), ("bouncing_ball", "listing"), ("newtons_cradle", "pendulums")]


def ran(case: Case, **settings: object) -> Trajectory:
    return engines.load("reference").prepare(case, "compiled", rtol=1e-10, **settings).run()


def beside(t: float, roundings: int) -> float:
    for _ in range(abs(roundings)):
        t = float(np.nextafter(t, np.inf if roundings > 0 else 0.0))
    return t


def instants(case: Case) -> list[float]:
    found = sorted({event.t for event in ran(case).events if event.t > 0.0})
    return [found[0], found[len(found) // 2], found[-1]]


@pytest.mark.parametrize(("name", "variant"), [*RUBS, *HITS])
def test_a_horizon_beside_a_switch_is_reached(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    for t in instants(case):
        for k in NEAR:
            end = beside(t, k)
            run = ran(replace(case, t_end=end))
            assert (run.outcome.value, run.t[-1]) == ("finished", end), (t, k, run.message)


@pytest.mark.parametrize(("name", "variant"), RUBS)
def test_samples_beside_a_switch_at_the_horizon_are_all_there(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    for t in instants(case):
        for k in NEAR:
            asked = np.array([0.0, 0.5 * t, *(beside(t, j) for j in range(k - 2, k + 1)), beside(t, k)])
            run = ran(replace(case, t_end=asked[-1]), samples=asked)
            assert run.outcome.ok
            np.testing.assert_array_equal(run.t, asked)


@pytest.mark.parametrize("ledger", [True, False])
@pytest.mark.parametrize(("name", "variant"), [*RUBS, *HITS])
def test_a_sample_at_such_a_horizon_has_all_that_the_run_has_there(name: str, variant: str, ledger: bool) -> None:
    """Its energy was that of the sample before where none is booked."""
    case = cases.load(name, variant)
    for t in instants(case):
        for k in NEAR:
            end = beside(t, k)
            short = replace(case, t_end=end)
            whole, run = ran(short, ledger=ledger), ran(short, ledger=ledger, samples=np.array([0.0, 0.5 * t, end]))
            for signal in ("q", "v", "gap", "energy"):
                np.testing.assert_allclose(getattr(run, signal)[-1], getattr(whole, signal)[-1], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("k", NEAR)
def test_inputs_that_change_beside_a_switch_change(k: int, tmp_path: Path) -> None:
    path, table = ROOT / "tests" / "support" / "driven_ball.xml", tmp_path / "u.csv"
    table.write_text("t,m\n0,0\n0.9,1\n")
    case = cases.load(str(path), friction=1, ctrl=str(table), t_end=1.0)
    before = [event.t for event in ran(case).events if 0.0 < event.t < 0.9]
    for t in before[:3]:
        table.write_text(f"t,m\n0,0\n{beside(t, k)!r},1\n")
        run = ran(cases.load(str(path), friction=1, ctrl=str(table), t_end=1.0))
        assert run.outcome.ok, (t, run.message)
    assert before
