"""The second machine for friction, CVODE's: exact motions, and the compiled machine's motions of tossed bodies."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from friction_scenes import (
    G,
    account,
    drawn,
    linear,
    piled,
    point,
    random_problem,
    rod_on_floor,
    run,
    tossed,
)

from crossbody import cases, engines
from crossbody.cases import Mode, Outcome, Tier, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import RowLaw, Scene
from crossbody.cases.scene_contacts import PLACES
from crossbody.reference import simulate
from crossbody.reference.sundials.mode_problem import ModeProblem
from crossbody.reports.judging.truth import truth_of

QUICK = [
    ("sliding_block", "turns"), ("sliding_block", "askew"), ("rolling_sphere", "side_spin"), ("rocking_block", "falls"),
    ("dry_oscillator", "swings"),
]  # fmt: skip
NAMES = (
    "sliding_block", "rolling_sphere", "rocking_block", "block_on_belt", "stacked_blocks", "dry_oscillator"
)  # fmt: skip
OTHERS = [(name, variant) for name in NAMES for variant in cases.variants(name) if (name, variant) not in QUICK]
STATE, TIME = 1e-8, 1e-9
SOLIDS = [types for types in PLACES if "plane" not in types and types != ("sphere", "box")]


def events(run_: Trajectory) -> list[tuple[int, Mode, Mode]]:
    """Return what contacts change, those of one instant by their order."""
    return [(e.contact, e.before, e.after) for e in sorted(run_.events, key=lambda e: (round(e.t, 8), e.contact))]


def times(run_: Trajectory) -> np.ndarray:
    """Return when."""
    return np.sort([e.t for e in run_.events])


@pytest.mark.parametrize(("name", "variant"), [*QUICK, *(pytest.param(*one, marks=pytest.mark.slow) for one in OTHERS)])
def test_exact_motions(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    found = engines.load("reference").prepare(case, "cvode", rtol=1e-10).run()
    assert found.outcome.ok, found.message
    assert case.closed_form is not None
    exact = case.closed_form(found.t)
    assert np.abs(found.q - exact.q).max() < STATE
    assert np.abs(found.energy - exact.energy).max() < STATE
    assert events(found) == events(exact)
    assert np.abs(times(found) - times(exact)).max(initial=0.0) < TIME


def moved_alike(scene: Scene, q0: Any, v0: Any, _mu: float, t_end: float) -> tuple[Trajectory, Trajectory]:
    """Return the motions of both machines, which pass the same places and have the same events."""
    at = np.linspace(0.0, t_end, round(200 * t_end) + 1)
    one = run(scene, q0, v0, t_end, rtol=1e-11, samples=at)
    other = run(scene, q0, v0, t_end, rtol=1e-9, samples=at, solver="cvode")
    assert one.outcome is other.outcome is Outcome.FINISHED, other.message
    assert np.abs(one.q - other.q).max() < STATE
    assert events(one) == events(other)
    return one, other


@pytest.mark.parametrize("seed", [0, 2, *(pytest.param(k, marks=pytest.mark.slow) for k in range(3, 53))])
def test_both_machines_move_tossed_bodies_alike(seed: int) -> None:
    one, other = moved_alike(*tossed(seed), t_end=0.4)
    assert np.abs(times(one) - times(other)).max(initial=0.0) < 1e-8
    assert account(other) < 1e-7


@pytest.mark.parametrize(
    ("make", "kinds"),
    [(tossed, {"cylinder": (0.1, 0.15, 0.0)}),
     *(pytest.param(piled, kinds, marks=pytest.mark.slow) for kinds in (("sphere", "box"), *SOLIDS))],
)  # fmt: skip
def test_both_machines_move_cans_and_solids_alike(make: Any, kinds: Any) -> None:
    """They share the rows, and neither modes nor events."""
    one, _ = moved_alike(*(make(2, kinds, 1) if make is tossed else make(0, kinds)), t_end=0.3)
    assert len(one.events) > 1


@pytest.mark.parametrize("seed", [10232, *(pytest.param(k, marks=pytest.mark.slow) for k in (10292, 10293, 20003))])
def test_both_machines_part_rows_that_come_to_contradict_each_other(seed: int) -> None:
    """Boxes in a row land on more corners than can all follow their laws; joints rub in two of them."""
    scene, q0, v0, _, t_end = drawn(seed)
    at = np.linspace(0.0, t_end, 41)
    one = run(scene, q0, v0, t_end, rtol=1e-9, samples=at)
    other = run(scene, q0, v0, t_end, rtol=1e-8, samples=at, solver="cvode")
    assert one.outcome is other.outcome is Outcome.FINISHED, other.message
    assert np.abs(one.q - other.q).max() < 1e-6


@pytest.mark.parametrize("mu", [0.5, 2.0])
def test_a_rod_that_is_pushed_jams_in_both(mu: float) -> None:
    """Painleve's: at mu = 2 friction would press the end that slides into the floor."""
    scene = rod_on_floor(mu, law=RowLaw(a0=1e4, a1=200.0))
    q0, v0 = [0.0, 0.5 * np.cos(0.6) + 1e-3, 0.6], [-2.0, 0.0, 0.0]
    ends = [run(scene, q0, v0, 0.05, rtol=1e-8, solver=solver).outcome for solver in ("compiled", "cvode")]
    assert ends[0] is ends[1]


@pytest.mark.parametrize("seed", range(6))
def test_both_decide_alike_where_one_set_agrees(seed: int) -> None:
    rng, compared = np.random.default_rng(seed), 0
    for _ in range(6):
        made = linear(*random_problem(rng, most=2, rough=1.0))
        n = made.n
        one, other = (
            simulate(made, np.zeros(n), np.zeros(n), 1e-3, rtol=1e-9, samples=[1e-3], solver=solver)
            for solver in ("compiled", "cvode")
        )
        if one.outcome is Outcome.FINISHED and not one.counts.get("not_unique"):
            assert other.outcome is Outcome.FINISHED, other.message
            assert np.abs(one.v - other.v).max() < 1e-8
            assert np.array_equal(one.mode[-1], other.mode[-1])
            compared += 1
    assert compared > 0


@pytest.mark.parametrize("space", [False, True])
def test_what_begins_to_slide_by_itself_is_found_without_a_search(space: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """It goes where it is driven: a machine that guesses the other way finds its motion by its fallbacks alone."""
    for fallback in ("_swept", "_searched"):
        monkeypatch.setattr(ModeProblem, fallback, lambda *_: None)
    rng = np.random.default_rng(6)
    for _ in range(4):
        mu, alpha = rng.uniform(0.05, 0.6), rng.choice([-1.0, 1.0]) * rng.uniform(0.7, 1.2)
        n = 3 if space else 2
        found = simulate(point(mu, alpha, space=space), np.zeros(n), np.zeros(n), 0.01, rtol=1e-9, solver="cvode")
        assert found.outcome is Outcome.FINISHED, found.message
        fall = np.sin(alpha) - np.sign(alpha) * mu * np.cos(alpha)
        assert found.v[-1] == pytest.approx([0.01 * G * fall, *[0.0] * (n - 1)], rel=1e-8, abs=1e-10)


def test_a_truth_without_a_closed_form_has_this_witness() -> None:
    scene, q0, v0, _ = tossed(2)
    case = replace(case_of(scene, t_end=0.3, v0=v0), q0=q0)
    truth = truth_of(case)
    assert truth.tier is Tier.C, truth.source
    assert "cvode" in truth.source
    assert truth.trusted == np.inf, truth.source


@pytest.mark.slow
def test_a_contact_that_lets_go_as_it_reaches_its_bound_begins_in_no_direction() -> None:
    """A loaded cube comes to rest on two corners: force and bound of one vanish together."""
    case = replace(
        cases.load("tossed_cube", "loaded", mu=0.6, t_end=2.9e-3), limits=(),
        q0=[0.24646014, -0.04715175, 0.0524, 0.59864801, 0.37632499, 0.59864797, -0.37632521],
        v0=[-3.52459503e-7, -4.56710901e-7, 5.35536505e-7, 5.79357040e-13, 4.93827077e-6, 9.83987323e-6],
    )  # fmt: skip
    found = engines.load("reference").prepare(case, "cvode", rtol=1e-9).run()
    assert found.outcome is Outcome.FINISHED, found.message
    assert np.abs(found.v[-1, :3]).max() < 9.81 * case.t_end


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_a_contact_whose_load_and_bound_vanish_together_lets_go(seed: int) -> None:
    """A loaded cube rocks on its corners: rounding alone says whether the third one slides before it lifts."""
    rng = np.random.default_rng(seed)
    mu, rtol = float(rng.uniform(0.2, 2.0)) if seed else 0.6, float(10.0 ** rng.uniform(-10.0, -8.0))
    other_speeds = 1.0 + (0.05 if seed else 0.0) * rng.normal(size=6)
    case = replace(
        cases.load("tossed_cube", "loaded", mu=mu, t_end=4e-4), limits=(),
        q0=[0.2464601343293342, -0.04715175087348679, 0.052399998974870646, 0.5986480081449835, 0.37632501672784213,
            0.5986479737289963, -0.37632518873841053],
        v0=other_speeds * [
            -7.218975297828439e-07, -1.7761658894767812e-06, 2.7724070748776586e-07, 2.4037519976264005e-13,
            2.457304684151266e-05, 2.71094185781717e-05],
    )  # fmt: skip
    one, other = (engines.load("reference").prepare(case, solver, rtol=rtol).run() for solver in ("compiled", "cvode"))
    assert other.outcome is Outcome.FINISHED, other.message
    assert np.abs(one.q[-1] - other.q[-1]).max() < 10.0 * rtol
