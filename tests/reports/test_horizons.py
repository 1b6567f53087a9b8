"""Any horizon and tolerance is judged fairly: what is right at the default ones is not outside at others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Tier
from crossbody.cases.defaults import limits_of
from crossbody.cases.mechanisms.soft.claims import STEP
from crossbody.cases.mechanisms.soft.form import fastest
from crossbody.cases.mechanisms.soft.scene import numbers
from crossbody.cases.scene import Body, Joint, RowLaw, Scene
from crossbody.reports.judging import run_verdicts
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.reach import tight
from crossbody.reports.judging.run_verdicts import EXACT, GROWING
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import Verdict, Word, limit_for
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.impulse import with_collisions
from crossbody.reports.runs import choice, jobs

MAZES = cases.variants("ball_maze")
FACTORS = (0.1, 0.5, 2.0, 6.0)
TOLERANCES = (1e-12, 1e-8, 1e-5, 1e-3)
NO_LONGER = ("ball_maze:solve", *(f"rocking_block:{variant}" for variant in cases.variants("rocking_block")))
"""What is two and a half minutes of rest in the centre then, and what a closed form ends."""
EVERY = [(name, variant) for name in cases.names() for variant in cases.variants(name)]
LONGER = [(*one, factor) for one in EVERY for factor in FACTORS if factor < 1.0 or ":".join(one) not in NO_LONGER]
FOLLOW = ("reference:compiled", "mujoco:matched", "pinocchio:law")
"""Engines that follow the case's law, or whose known properties say why not."""
QUICK = (
    ("ball_maze", "outside", 0.1, 0.0, "reference:compiled"), ("red_body", "frozen", 2.0, 0.0, "reference:compiled"),
    ("soft_contact", "axis", 0.1, 0.0, "reference:compiled"), ("delta_tracking", "circle", 0.1, 0.0, "pinocchio:law"),
    ("bouncing_ball", "elastic", 6.0, 0.0, "mujoco:matched"),
    ("bouncing_ball", "listing", 1.0, 1e-8, "pinocchio:law"), ("ball_maze", "inside", 1.0, 1e-5, "reference:compiled"),
    ("sliding_block", "flat", 1.0, 1e-8, "reference:compiled"),
    ("ball_maze", "outside", 1.0, 1e-3, "reference:compiled"), ("red_body", "frozen", 1.0, 1e-12, "pinocchio:law"),
    ("delta_free", "light", 1.0, 1e-6, "pinocchio:law"),
)  # fmt: skip
"""What was outside once, or rests, and costs little."""


def rows(
    name: str, variant: str, factor: float, rtols: Sequence[float], *wanted: str
) -> Iterator[tuple[Case, list[Verdict]]]:
    """Yield a case at a part of its horizon, and what is said of engines, with each tolerance or their own for 0."""
    case = cases.load(name, variant)
    case = case if factor == 1.0 else cases.load(name, variant, t_end=factor * case.t_end)
    truth = None
    for rtol in rtols:
        found = jobs.run_case(case, choice.picks(wanted), rtol=rtol or None, refine=False, truth=truth)
        truth = None if case.general else found.truth
        yield case, judged(case, found.entries, found.truth, "")


def outside(*asked: Any) -> list[tuple[str, str, float, str]]:
    found = [row for _, each in rows(*asked) for row in each if row.verdict in ("outside", "crashed")]
    return [(row.profile, row.metric, row.value, row.why) for row in found]


@pytest.mark.parametrize(
    ("name", "variant", "factor", "rtol", "engine"),
    [*QUICK, pytest.param("red_body", "resolved", 6.0, 0.0, "pinocchio:law", marks=pytest.mark.slow)],
)
def test_a_right_motion_is_not_outside_at_another_horizon_or_tolerance(
    name: str, variant: str, factor: float, rtol: float, engine: str
) -> None:
    assert outside(name, variant, factor, [rtol], engine) == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "variant", "factor"), LONGER)
def test_no_engine_that_follows_the_law_is_outside_at_any_horizon(name: str, variant: str, factor: float) -> None:
    assert outside(name, variant, factor, [0.0], *FOLLOW) == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "variant"), EVERY)
def test_no_engine_that_follows_the_law_is_outside_at_any_tolerance(name: str, variant: str) -> None:
    assert outside(name, variant, 1.0, TOLERANCES, *FOLLOW[::2]) == []


@pytest.mark.parametrize(
    ("factor", "rtol", "wider", "growing"),
    [
        (1.0, 0.0, 1, 1),
        (1.0, 1e-10, 1, 1),
        (0.5, 0.0, 1, 1),
        (1.0, 1e-8, 10, 10),
        (1.5, 0.0, 1.5, 2.25),
        (1.5, 1e-8, 15, 22.5),
    ],
)
def test_limits_are_as_they_stand_but_for_what_was_asked_for(
    factor: float, rtol: float, wider: float, growing: float
) -> None:
    """Errors of a tolerance are as large as it, each step adds its own, and what a position is off by goes on."""
    ((case, found),) = rows("bouncing_ball", "listing", factor, [rtol], "reference:compiled")
    for row in found:
        stands = limit_for(limits_of(case), row.metric, row.engine, row.profile)
        if stands is None or (row.metric == "rate_residual" and np.isnan(row.limit)):  # its samples tell nothing
            continue
        times = 1.0 if row.metric in EXACT else growing if row.metric in GROWING else wider
        assert row.limit == pytest.approx(max(stands.value, min(stands.value * times, 1e-3)), rel=1e-9), row.metric


def judge_of(name: str, variant: str, rtol: float) -> run_verdicts.Judge:
    case = cases.load(name, variant)
    run = jobs.run_case(cases.load("bouncing_ball", "listing"), choice.picks(["reference:compiled"]), refine=False)
    entry = replace(run.entries[0], settings={"rtol": rtol})
    return run_verdicts.Judge(case, entry, run.truth, "run")


@pytest.mark.parametrize("rtol", [1e-6, 1e-3])
@pytest.mark.parametrize(("name", "variant"), [("soft_contact", "axis"), ("delta_tracking", "circle")])
def test_a_claim_of_a_small_number_is_not_hidden_by_a_loose_tolerance(name: str, variant: str, rtol: float) -> None:
    """A block that ends 1 % beside its 6.4 mm was within at 1e-6: what limits grow to was in metres, not parts."""
    judge_ = judge_of(name, variant, rtol)
    small = [claim for claim in judge_.claims.values() if 0.0 < claim.expected < 0.1 and judge_.limit(claim.metric)]
    assert small
    for claim in small:
        stands = limit_for(judge_.limits, claim.metric, "reference", "compiled")
        limit = judge_.limit(claim.metric)
        assert stands is not None
        assert limit is not None
        assert limit.value <= max(stands.value, 1e-3 * claim.expected), claim.metric


@pytest.mark.parametrize(("name", "stated"), [("bouncing_ball", False), ("delta_free", True)])
def test_a_tolerance_is_judged_where_its_errors_are_below_a_fault(name: str, stated: bool) -> None:
    """A hundred times the tolerance takes a fall through a pose of no return to 1e-2, and a ball to 1e-4."""
    judge_ = judge_of(name, cases.variants(name)[0], 1e-7)
    assert judge_.told("position", Word.OUTSIDE, "far")[0] == (Word.INFO if stated else Word.OUTSIDE)
    assert judge_.told("energy_residual", Word.OUTSIDE, "far")[0] == Word.OUTSIDE


@pytest.mark.parametrize("rtol", [1e-6, 1e-3])
def test_the_motion_of_a_scene_of_ones_own_is_not_outside_at_a_loose_tolerance(rtol: float) -> None:
    """Its steps are as long as the tolerance lets them be: the trapezoidal rule between them was 4 % off."""
    wall = RowLaw(a0=1e4, a1=50.0)
    rod = Body(name="rod", mass=1.0, com=(0.0, 0.0, -0.5), inertia=(0.1, 0.1, 0.01, 0.0, 0.0, 0.0))
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0), range=(-0.2, 2.0), law=wall)
    case = cases.from_scene(Scene(bodies=(rod,), joints=(hinge,)), q0=[1.0], t_end=2.0)
    found = jobs.run_case(case, choice.picks(["reference:compiled"]), rtol=rtol, refine=False)
    assert [row.metric for row in judged(case, found.entries, found.truth, "") if row.verdict == Word.OUTSIDE] == []


def test_an_engine_that_tells_its_tolerance_where_it_is_asked_for_alone_is_judged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its own settings have none: judging a run of a user's own engine threw a KeyError."""
    judge_ = judge_of("bouncing_ball", "listing", 1e-7)
    silent = SimpleNamespace(planned=lambda case, profile: {})
    monkeypatch.setattr(engines, "load", lambda name: silent)
    assert run_verdicts.looser(judge_.case, judge_.entry) == pytest.approx(100.0)


@pytest.mark.parametrize("name", ["bouncing_ball", "red_body", "sliding_block", "stacked_blocks"])
def test_a_fault_in_the_multipliers_is_outside_at_any_tolerance(name: str) -> None:
    """They follow from the state at every instant, however coarse that is: 1 % more passed at 1e-3."""
    case = cases.load(name)
    found = jobs.run_case(case, choice.picks(["reference:compiled"]), rtol=1e-3, refine=False)
    (entry,) = found.entries
    assert entry.run is not None
    wrong = replace(entry, run=replace(entry.run, lam=1.01 * entry.run.lam))
    words = {row.metric: row.verdict for row in judged(case, [wrong], found.truth, "")}
    assert words["law_residual"] == Word.OUTSIDE


@pytest.mark.parametrize(
    ("name", "variant"),
    [("bouncing_ball", "listing"), pytest.param("ball_maze", "solve", marks=pytest.mark.slow)],
)
def test_a_truth_has_both_sides_of_every_event_of_one_motion(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    truth, natural = truth_of(case), tight(case)
    assert truth.tier is Tier.C, "what it is held against is independent"
    assert truth.trajectory.events == natural.events
    events = np.unique([event.t for event in natural.events if 0.0 < event.t < case.t_end])  # rows may switch together
    sampled = truth.at(np.repeat(events, 2))
    for i, t in enumerate(events):
        before, behind = np.searchsorted(natural.t, t, side="left"), np.searchsorted(natural.t, t, side="right") - 1
        np.testing.assert_array_equal(sampled.lam[2 * i], natural.lam[before])
        np.testing.assert_array_equal(sampled.lam[2 * i + 1], natural.lam[behind])


def test_an_impulse_does_not_depend_on_the_side_of_a_release_on_which_a_sample_stands() -> None:
    case = cases.load("ball_maze", "outside")
    truth = truth_of(case)
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-9).run()
    inside, exact = aligned(truth, run, case, releases=True)
    theirs = with_collisions(exact, truth.trajectory.events)
    off = np.abs(with_collisions(run, run.events)[inside] - theirs).max() / np.abs(theirs).max()
    assert 0.0 < off < 1e-8


@pytest.mark.parametrize(("name", "variant"), [("soft_contact", "axis"), ("soft_contact", "delta")])
def test_the_sizes_that_a_case_names_are_no_larger_than_its_motion(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-6).run()
    units = np.array([coordinate.unit for coordinate in case.coordinates])
    assert any(coordinate.size for coordinate in case.coordinates)
    for coordinate in case.coordinates:
        like = units == coordinate.unit
        assert coordinate.size <= 1.1 * np.abs(run.q[:, like]).max()
        assert coordinate.rate <= 1.1 * np.abs(run.v[:, like]).max()


@pytest.mark.parametrize("variant", ["axis", "delta"])
def test_the_fixed_step_of_the_limits_is_that_of_the_engine(variant: str) -> None:
    case = cases.load("soft_contact", variant)
    p = numbers(case.parameters)
    rate = fastest(p, p["flange_mass"] if variant == "axis" else p["m3"])
    assert pytest.approx(engines.load("mujoco").prepare(case).settings["dt"] * rate) == STEP


def test_a_ball_that_hardly_moves_is_allowed_the_tolerance_of_its_height() -> None:
    """1e-9 over 1 - cos(1e-3) for a swing of 1e-3 rad; nothing beyond the default where the ball goes far."""
    given = {v: limit_for(limits_of(cases.load("ball_maze", v)), "energy_drift", "pinocchio", "law") for v in MAZES}
    allowed = {variant: limit.value for variant, limit in given.items() if limit is not None}
    assert allowed.pop("inside") == pytest.approx(1e-9 / (1.0 - np.cos(1e-3)), rel=1e-6)
    assert set(allowed.values()) == {1e-6}
