"""Totals are those of one horizon, by the clock of each motion, and what is told as compared was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Acts, Tier
from crossbody.reports import metrics
from crossbody.reports.judging.known_answers import MADE
from crossbody.reports.judging.known_impulses import held, pulses
from crossbody.reports.judging.made_up import MadeUp, case_of
from crossbody.reports.judging.run_verdicts import value_of
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.measuring.truth import from_run, shortened


def test_a_ball_that_rests_when_its_clock_is_ahead_has_its_whole_impulse() -> None:
    """Touches that are laid at other instants leave out .7 s of rest: its weight is no error."""
    case = cases.load("bouncing_ball", "listing")
    truth = shortened(truth_of(case))
    try:
        run = engines.load("pinocchio").prepare(case, "admm").run()
    except cases.EngineUnavailable as error:
        pytest.skip(str(error))
    found, until = value_of(metrics.load("lam_impulse"), "lam_impulse", truth, run, case)
    assert found is not None
    assert found < 1e-6
    assert until == 1.0
    assert 0.5 < value_of(metrics.load("position"), "position", truth, run, case)[1] < 0.9


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(("units", "opens", "own", "rubs"), MADE)
def test_what_is_told_as_compared_is_what_both_clocks_show(
    units: tuple[str, ...], opens: tuple[bool, ...], own: int, rubs: int, seed: int
) -> None:
    made = MadeUp(case_of(units, opens, seed, rubs), seed + own)
    last, t_end = made.trusted - 1, made.case.t_end
    for name in ("position", "velocity", "energy_drift", "gap_error", "penetration_error", "lam_impulse_path"):
        value, part = value_of(metrics.load(name), name, made.truth, made.run, made.case)
        if value is not None and value > 0.0:
            assert part * t_end == pytest.approx(min(made.t[last], made.run.t[last]), abs=1e-12)
    until = max(t for t in made.run.t if t <= made.truth.trusted)
    _, part = value_of(metrics.load("lam_impulse"), "lam_impulse", made.truth, made.run, made.case)
    assert part * t_end == pytest.approx(until, abs=1e-12)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("acts", [Acts.BEFORE, Acts.BEHIND])
def test_totals_of_steps_do_not_ask_when_pulses_were(acts: Acts, seed: int) -> None:
    """Each comes as much earlier or later as it likes, a touch or none: what all come to is the same."""
    draw = np.random.default_rng(seed)
    truth, run = from_run(pulses(), Tier.A, "made up"), held(acts, more := float(draw.uniform(0.5, 2.0)))
    order = np.concatenate([[0], 1 + draw.permutation(len(run.t) - 2), [len(run.t) - 1]])
    moved = replace(run, lam=run.lam[order], mode=run.mode[order])
    found = metrics.load("lam_impulse").measure(truth, moved, case_of(("m",), (True,), 1))
    assert found == pytest.approx(abs(more - 1.0), abs=1e-6)
