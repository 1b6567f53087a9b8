"""Any horizon of a case is judged fairly: what is right at the default one is not outside at another."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.truth import _tight, truth_of
from crossbody.reports.metrics._align import aligned
from crossbody.reports.metrics._impulse import with_collisions
from crossbody.reports.runs import jobs

FACTORS = (0.1, 0.5, 2.0)
EVERY = [(name, variant, factor) for name in cases.names() for variant in cases.variants(name) for factor in FACTORS]
LATE = ("ball_maze", "solve", 2.0)
"""Two and a half minutes of rest in the centre: nothing new."""
QUICK = (("ball_maze", "outside", 0.1), ("red_body", "frozen", 2.0), ("soft_contact", "axis", 0.1))
"""What was outside once, or rests, and costs little."""


def outside(name: str, variant: str, factor: float, engine: str) -> list[tuple[str, str, float, str]]:
    case = cases.load(name, variant, t_end=factor * cases.load(name, variant).t_end)
    found = jobs.run_case(case, jobs.picks((engine,)), refine=False)
    rows = judged(case, found.entries, found.truth, "")
    return [(row.profile, row.metric, row.value, row.why) for row in rows if row.verdict in ("outside", "crashed")]


@pytest.mark.parametrize(("name", "variant", "factor"), QUICK)
def test_a_right_motion_is_not_outside_at_another_horizon(name: str, variant: str, factor: float) -> None:
    assert outside(name, variant, factor, "reference:compiled") == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "variant", "factor"), [one for one in EVERY if one != LATE])
def test_no_integrator_of_ours_is_outside_at_any_horizon(name: str, variant: str, factor: float) -> None:
    assert outside(name, variant, factor, "reference") == []


@pytest.mark.parametrize(
    ("name", "variant"),
    [("bouncing_ball", "listing"), pytest.param("ball_maze", "solve", marks=pytest.mark.slow)],
)
def test_a_truth_has_both_sides_of_every_event_of_one_motion(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    truth, natural = truth_of(case), _tight(case)
    assert truth.trajectory.events == natural.events
    events = np.array([event.t for event in natural.events if 0.0 < event.t < case.t_end])
    sampled = truth.at(np.repeat(events, 2))
    for i, t in enumerate(events):
        before, behind = np.searchsorted(natural.t, t, side="left"), np.searchsorted(natural.t, t, side="right") - 1
        np.testing.assert_array_equal(sampled.lam[2 * i], natural.lam[before])
        np.testing.assert_array_equal(sampled.lam[2 * i + 1], natural.lam[behind])


def test_an_impulse_does_not_depend_on_the_side_of_a_release_on_which_a_sample_stands() -> None:
    case = cases.load("ball_maze", "outside")
    truth = truth_of(case)
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-9).run()
    inside, exact = aligned(truth, run, releases=True)
    theirs = with_collisions(exact, truth.trajectory.events)
    off = np.abs(with_collisions(run, run.events)[inside] - theirs).max() / np.abs(theirs).max()
    assert 0.0 < off < 1e-8
