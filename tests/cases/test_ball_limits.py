"""Limits of the bouncing ball at other parameters: they follow from the fall and from the method."""

from __future__ import annotations

import hypothesis.strategies as st
import pytest
from hypothesis import example, given, settings

from crossbody import cases
from crossbody.cases.library import bouncing_ball
from crossbody.reports.judging.comparison import judged
from crossbody.reports.runs import choice, jobs

DRAWN = {
    "variant": st.sampled_from(["elastic", "linear", "listing"]), "height": st.floats(0.2, 8.0),
    "mass": st.floats(1e-3, 1e3), "gravity": st.floats(1.0, 30.0), "t_end": st.floats(0.5, 5.0),
}  # fmt: skip


@settings(max_examples=2)
@given(**DRAWN)
@example(variant="elastic", height=1.2, mass=1.0, gravity=9.81, t_end=5.0)
@example(variant="linear", height=2.5, mass=1e3, gravity=9.81, t_end=5.0)
def test_a_correct_engine_is_not_outside_at_other_parameters(variant: str, **given: float) -> None:
    """From 1.2 m fixed steps lost 1.05e-5 of the energy, and 1.04e-5 J a bounce: limits were those of a fall of 1 m."""
    case = cases.load("bouncing_ball", variant, **given)
    run = jobs.run_case(case, choice.picks(["reference:compiled", "mujoco:matched"]), refine=False)
    rows = judged(case, run.entries, run.truth, "")
    assert [(row.engine, row.metric, row.value, row.limit) for row in rows if row.verdict == "outside"] == []


@pytest.mark.parametrize("mass", [1e-3, 1.0, 1e3])
def test_limits_in_units_of_energy_and_force_grow_with_the_mass(mass: float) -> None:
    found = {x.metric: x.value for x in cases.load("bouncing_ball", "elastic", mass=mass).limits if x.engine == "*"}
    unit = {x.metric: x.value for x in cases.load("bouncing_ball", "elastic").limits if x.engine == "*"}
    assert found["energy_per_bounce"] == pytest.approx(mass * unit["energy_per_bounce"])
    assert found["position"] == unit["position"]


def test_what_fixed_steps_lose_adds_up_over_impacts_and_is_less_than_a_fault() -> None:
    p = {"mass": 1.0, "gravity": 10.0, "height": 0.2, "speed": 0.0, "t_end": 4.0}  # 2 m/s: flights of 0.4 s
    assert bouncing_ball.lost(p) == pytest.approx(11.0 * bouncing_ball.lost(p | {"gravity": 0.0, "speed": 1.0}))
    for each in cases.load("bouncing_ball", "elastic", height=1e-3).limits:
        if (each.engine, each.profile) == ("mujoco", "matched") and "_times" not in each.metric:
            assert each.value <= bouncing_ball.FAULT
