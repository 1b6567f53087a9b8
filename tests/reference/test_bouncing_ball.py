"""The case as a user meets it: variants, claims, and what bad input says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody.cases import InvalidValue, UnknownName, load, variants


def test_listing_is_the_default() -> None:
    case = load("bouncing_ball")
    assert case.label == "bouncing_ball:listing"
    assert (case.law.a0[0], case.law.a1[0], case.law.a2[0]) == (100.0, 20.0, 1e6)
    assert {c.metric: c.expected for c in case.claims} == {
        "contacts": 3, "bounces": 2, "transitions": 7, "final_lam": 9.81, "final_gap": 0.0,
    }  # fmt: skip


def test_published_claims_fall_with_the_published_numbers() -> None:
    assert not load("bouncing_ball", "listing", a0=101.0).claims


@pytest.mark.parametrize("variant", variants("bouncing_ball"))
def test_closed_form_exactly_where_the_law_is_linear(variant: str) -> None:
    case = load("bouncing_ball", variant)
    assert (case.closed_form is not None) == case.law.linear
    assert load("bouncing_ball", variant, a2=0.0).closed_form is not None


def test_resting_never_bounces() -> None:
    case = load("bouncing_ball", "resting")
    assert case.closed_form is not None
    trace = case.closed_form(np.linspace(0, 5, 5))
    assert len(trace.events) == 1
    assert trace.lam[-1, 0] == pytest.approx(9.81, rel=1e-9)


def test_one_impact_without_gravity_has_closed_form_claims() -> None:
    case = load("bouncing_ball", "linear", gravity=0.0, speed=2.0)
    assert {c.metric for c in case.claims} == {"restitution", "contact_time", "penetration", "separation_gap"}
    assert case.v0[0] == -2.0


def test_no_claims_for_a_ball_that_never_comes_down() -> None:
    assert not load("bouncing_ball", "linear", gravity=0.0, speed=-1.0).claims


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        ({"mass": 0.0}, "mass is 0; valid: (0"),
        ({"mass": float("nan")}, "mass is nan"),
        ({"a0": -1.0}, "a0 is -1"),
        ({"a1": float("inf")}, "a1 is inf"),
        ({"t_end": -2.0}, "t_end is -2"),
        ({"height": "high"}, "height is 'high'; it must be a number [m]"),
    ],
)
def test_bad_values_say_what_would_be_valid(overrides: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidValue) as told:
        load("bouncing_ball", **overrides)
    assert says in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("arguments", "overrides", "says"),
    [
        (("bouncing_bal",), {}, "Did you mean 'bouncing_ball'?"),
        (("bouncing_ball", "lstng"), {}, "listing"),
        (("bouncing_ball",), {"stiffness": 1.0}, "a0"),
        (("nowhere/case.py",), {}, "nowhere/case.py"),
    ],
)
def test_unknown_names_list_the_known_ones(arguments: tuple[str, ...], overrides: dict[str, float], says: str) -> None:
    with pytest.raises(UnknownName) as told:
        load(*arguments, **overrides)
    assert says in str(told.value)
