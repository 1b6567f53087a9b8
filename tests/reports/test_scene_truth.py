"""How tightly a scene's truth is followed, and what an unstable motion makes of errors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from four_bars import four_bar
from friction_scenes import rod_on_floor
from hypothesis import given
from hypothesis import strategies as st

from crossbody import cases, engines
from crossbody.cases import Case, Event, Mode, Outcome, Tier, Trajectory
from crossbody.cases.scene import Body, Joint, RowLaw, Scene
from crossbody.reports import metrics
from crossbody.reports.judging import truth as judging
from crossbody.reports.judging.reach import BEFORE, LEAST, MANY, SHORT, SHORTEST, cut_short, followed, motion, tight
from crossbody.reports.judging.run_verdicts import Entry, verdicts
from crossbody.reports.judging.told import runs_of, sentence
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.truth_row import truth_row
from crossbody.reports.judging.verdict import Word
from crossbody.reports.measuring.truth import Truth, from_run, shortened
from crossbody.reports.runs.choice import picks
from crossbody.reports.runs.jobs import run_case

INERTIA = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)


@pytest.fixture(autouse=True)
def one_witness(monkeypatch: pytest.MonkeyPatch) -> None:
    """CVODE alone: what is asked here does not depend on who the witness is."""
    monkeypatch.setattr("crossbody.reports.judging.truth._witness", lambda case, limit: "not asked")


def pendulum(length: float, above: bool, q0: float, t_end: float = 1.0) -> Case:
    """A point mass on a rod, as good as without inertia of its own, that stands or hangs at q = 0."""
    rod = Body(name="rod", mass=1.0, com=(0.0, 0.0, length if above else -length), inertia=INERTIA)
    joint = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0))
    return cases.from_scene(Scene(bodies=(rod,), joints=(joint,)), q0=[q0], t_end=t_end)


@pytest.mark.parametrize("start", [1e-5, 1e-8, 0.0])
@pytest.mark.parametrize("seed", range(2))
def test_errors_grow_as_the_closed_form_of_an_upright_pendulum_has_it(seed: int, start: float) -> None:
    """q'' = k^2 q: an error dv of the start becomes dv sinh(k T)/k, that of free flight dv T, also about a balance."""
    rng = np.random.default_rng(seed)
    length, t_end = rng.uniform(0.3, 1.0), rng.uniform(0.5, 1.5)
    k = np.sqrt(9.81 * length / (length**2 + INERTIA[0]))
    truth = truth_of(pendulum(length, True, start, t_end))
    assert truth.grows == pytest.approx(np.sinh(k * t_end) / (k * t_end), rel=1e-3)
    assert truth_of(pendulum(length, False, start, t_end)).grows == 1.0


def test_a_neighbour_that_gets_less_far_tells_of_growth_up_to_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an upright pendulum's neighbours that are followed to T/2: sinh(k T/2)/(k T)."""

    def halved(case: Case, rtol: float, **settings: Any) -> Trajectory:
        if "time_limit" not in settings:
            return motion(case, rtol, **settings)
        run = motion(replace(case, t_end=0.5 * case.t_end), rtol, samples=settings["samples"][:101])
        return replace(run, outcome=Outcome.TIME_LIMIT)

    monkeypatch.setattr("crossbody.reports.judging.truth.motion", halved)
    k, t_end = np.sqrt(9.81 * 0.5 / (0.5**2 + INERTIA[0])), 2.0
    grows = truth_of(pendulum(0.5, True, 1e-4, t_end)).grows
    assert grows == pytest.approx(np.sinh(0.5 * k * t_end) / (k * t_end), rel=1e-3)


def double_pendulum(angle: float, t_end: float) -> Case:
    """Two equal rods that start at rest, both turned by an angle from hanging, rad."""
    bodies = tuple(
        Body(name=name, parent=parent, position=(0, 0, -1.0 if parent else 0.0), mass=1.0, com=(0, 0, -1.0),
             inertia=(0.01, 0.01, 0.01, 0, 0, 0))
        for name, parent in (("upper", ""), ("lower", "upper"))
    )  # fmt: skip
    joints = tuple(Joint(name=name, body=name, type="hinge", axis=(0, 1, 0)) for name in ("upper", "lower"))
    return cases.from_scene(Scene(bodies=bodies, joints=joints), q0=[angle, 0.0], t_end=t_end)


def test_a_chaotic_motion_is_trusted_as_far_as_neighbouring_motions_say() -> None:
    case = double_pendulum(2.5, 30.0)
    truth = truth_of(case)
    assert truth.horizon is not None
    assert 1.0 < truth.horizon.until < 30.0
    row = truth_row(case, truth, "")[0]
    assert (row.verdict, row.compared) == ("within", truth.horizon.until / 30.0)
    rows = {row.metric: row for row in verdicts(case, Entry(
        engine="reference", profile="compiled", run=engines.load("reference").prepare(case, "compiled").run(),
    ), truth, "")}  # fmt: skip
    assert rows["position"].verdict == "within"
    assert rows["position"].compared == pytest.approx(row.compared, rel=1e-2)


def test_what_errors_have_grown_to_does_not_shrink_again() -> None:
    """Swings past the top and back: errors come and go, and the largest so far is what a limit must allow."""
    case = double_pendulum(2.5, 5.0)
    t, grown = judging._growing(case, tight(case), 60.0)
    assert grown[0] == 1.0
    assert (np.diff(grown) >= 0.0).all()
    assert (np.diff(grown) > 0.0).any() and (np.diff(grown) == 0.0).any()  # noqa: PT018 - both, or it shows nothing
    assert t[-1] == case.t_end


@pytest.mark.parametrize("seed", range(60))
def test_the_horizon_is_the_first_reason_of_all(seed: int) -> None:
    """What the law leaves open, rows that depend on each other and switch otherwise, and errors that have grown."""
    rng, case = np.random.default_rng(seed), pendulum(0.5, False, 0.1)
    touches = np.cumsum(rng.uniform(0.05, 0.1, 5))
    ends = touches + rng.uniform(0.01, 0.04, 5)
    k, late = int(rng.integers(5)), rng.choice([-1.0, 1.0]) * rng.choice([1e-8, 1e-3])
    released, told = bool(rng.integers(2)), bool(rng.integers(2))

    def run(moved: float) -> Trajectory:
        on, off = touches.copy(), ends.copy()
        (off if released else on)[k] += moved
        events = [e for a, b in zip(on, off, strict=True) for e in (
            Event(t=a, contact=0, before=Mode.FREE, after=Mode.CONTACT),
            Event(t=b, contact=0, before=Mode.CONTACT, after=Mode.FREE),
        )]  # fmt: skip
        empty = engines.load("reference").prepare(case, "compiled").run()
        row = np.zeros((len(empty.t), 1))
        return replace(
            empty, events=tuple(events), counts={"redundant": int(told)}, gap=row, lam=row, mode=row.astype(np.int8),
            ledger=None,
        )  # fmt: skip

    until, parted = rng.choice([np.inf, 0.2]), rng.choice([np.inf, 0.9])
    first = replace(run(0.0), determined_until=float(until))
    truth = replace(from_run(first, Tier.C, ""), parted=float(parted))
    t = np.linspace(0.0, 1.0, 201)
    grown = np.where(t > 0.4, 2.0 * judging.MULTIPLIED, 1.0)
    found = judging._horizon(case, truth, run(late), t, grown)
    moved = (ends if released else touches)[k]
    reasons = [
        until,
        min(moved, moved + late) if told and abs(late) > 1e-6 else np.inf,
        t[t <= 0.4][-1] if parted < 1.0 else np.inf,
    ]
    if min(reasons) < 1.0:
        assert found is not None
        assert found.until == pytest.approx(min(reasons), abs=1e-12)
        words = ("sliding", "opens", "neighbouring")
        assert words[np.argmin(reasons)] in found.why
    else:
        assert found is None


def test_sources_that_part_where_neighbouring_motions_do_not_are_no_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault in one of them grows as no motion does."""
    from crossbody.reports.judging import truth as module

    right = module.held_against

    def wrong(truth: Truth, second: Trajectory, case: Case, rtol: float) -> Truth:
        return right(truth, replace(second, q=second.q * (1.0 + 1e-2 * second.t[:, None])), case, rtol)

    monkeypatch.setattr(module, "held_against", wrong)
    for case in (double_pendulum(0.5, 2.0), double_pendulum(2.5, 30.0)):
        found = truth_of(case)
        assert found.horizon is None
        assert truth_row(case, found, "")[0].verdict == "outside"


@pytest.mark.parametrize("seed", range(3))
def test_numbers_of_events_agree_up_to_where_a_truth_ends(seed: int) -> None:
    """The end lies between two events: one that comes a little later in a run counts in both or in neither."""
    case = cases.load("bouncing_ball", "elastic")
    truth, rng = truth_of(case), np.random.default_rng(seed)
    for event in truth.trajectory.events:
        short = shortened(replace(truth, trusted=event.t + rng.choice([-1e-7, 0.0, 1e-7])))
        assert 0.9 * event.t - 1e-6 <= short.trusted <= event.t + 1e-6
        gaps = [abs(short.trusted - e.t) for e in truth.trajectory.events]
        assert min(gaps) > 1e-6


def test_a_limit_is_as_wide_as_the_motion_makes_errors_large() -> None:
    case = pendulum(0.4, True, 1e-5, 1.5)
    truth = truth_of(case)
    for size, word in ((0.5, "within"), (2.0, "outside")):
        t = np.linspace(0.0, case.t_end, 301)
        exact = truth.at(t)
        off = size * 1e-6 * truth.grows * np.abs(exact.q).max()
        run = engines.load("reference").prepare(case, "compiled", samples=t).run()
        shifted = replace(run, q=exact.q + off)
        rows = {row.metric: row for row in verdicts(case, Entry(engine="some", profile="one", run=shifted), truth, "")}
        assert rows["position"].verdict == word
        assert "free flight" in rows["position"].why or word == "within"
        assert rows["position"].limit == pytest.approx(1e-6 * truth.grows)


def test_no_limit_grows_so_wide_that_a_fault_of_a_per_cent_passes() -> None:
    case = pendulum(0.4, True, 1e-5, 1.0)
    truth = replace(truth_of(case), grows=1e9)
    run = engines.load("reference").prepare(case, "compiled").run()
    rows = verdicts(case, Entry(engine="some", profile="one", run=replace(run, q=1.01 * run.q)), truth, "")
    assert {row.metric: row.verdict for row in rows}["position"] == "outside"


@pytest.mark.parametrize("joint", ["finger", "elbow"])
def test_a_fault_of_a_per_cent_is_seen_beside_a_far_body_and_a_fast_wheel(joint: str) -> None:
    """A finger that slides by millimetres, a kilometre from the origin, and a joint beside one that turns for ever."""
    size = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)
    bodies = tuple(
        Body(name=name, parent="" if name == "base" else "base", mass=1.0, inertia=size)
        for name in ("base", "finger", "wheel", "elbow")
    )
    types = {"base": "free", "finger": "slide", "wheel": "hinge", "elbow": "hinge"}
    joints = tuple(Joint(name=name, body=name, type=kind) for name, kind in types.items())
    q0, v0 = np.zeros(10), np.zeros(9)
    q0[:4], v0[6:] = (1e3, 0.0, 0.0, 1.0), (5e-3, 1e4, 1e-2)
    case = cases.from_scene(Scene(bodies=bodies, joints=joints, gravity=(0.0, 0.0, 0.0)), q0=q0, v0=v0, t_end=1.0)
    run = engines.load("reference").prepare(case, "compiled").run()
    truth, at = from_run(run, Tier.D, "itself"), {"finger": 7, "elbow": 9}[joint]
    wrong = run.q.copy()
    wrong[:, at] *= 1.01
    assert metrics.load("position").measure(truth, replace(run, q=wrong), case) > 1e-5


@pytest.mark.parametrize("a0", [1e4, 1e9])
def test_a_truth_is_followed_no_tighter_than_rounding_allows(a0: float) -> None:
    """At the tolerance that is chosen steps are those of the method; one that is chosen looser would stall tighter."""
    case, reference = four_bar(0, RowLaw(a0=a0, a1=2.0 * np.sqrt(a0)), t_end=0.02), engines.load("reference")
    found = followed(case).case
    coarse = reference.prepare(case, "compiled", rtol=1e-9).run().steps
    most = MANY * max(coarse, LEAST)
    assert (found.tight > case.tight) == (a0 > 1e6)
    if found.tight <= 10.0 * case.tight:
        assert reference.prepare(case, "compiled", rtol=found.tight).run().steps <= most
    if found.tight > case.tight:
        stalled = reference.prepare(case, "compiled", rtol=found.tight / 10.0, max_steps=most).run()
        assert stalled.outcome is Outcome.STEP_LIMIT


def test_a_motion_that_takes_too_long_is_compared_as_far_as_it_is_followed() -> None:
    """It says so, at the part of the horizon that was reached, and is the truth of the shorter horizon."""
    case = pendulum(1.0, False, 1.0, 2000.0)
    found = run_case(case, picks(("mujoco:matched",)), refine=False, budget=0.05)
    reached = found.case.t_end
    assert 0.0 < reached < 2000.0
    assert found.truth.part == reached / 2000.0
    (row,) = truth_row(found.case, found.truth, "")
    assert row.compared == found.truth.part
    assert f"Followed to {reached:.4g} s of 2000 s" in row.why
    assert "of the horizon (more takes longer than --budget allows)" in sentence(runs_of([row.row()]))
    assert found.entries[0].run is not None
    assert found.entries[0].run.t[-1] <= reached
    own = followed(replace(case, t_end=reached)).motion
    np.testing.assert_array_equal(found.truth.trajectory.q[-1], own.q[-1])


@pytest.mark.parametrize(("order", "times"), [(8.0, 1.0), (3.5, 10.0), (1.5, 1000.0)])
def test_digits_are_left_where_they_would_cost_nearly_all_of_a_motion(
    order: float, times: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run of a method of that order gets as far in its budget as its steps are long."""
    case = pendulum(1.0, False, 1.0, 10.0)

    def ended(case: Case, rtol: float, **settings: Any) -> Trajectory:
        run, until = motion(replace(case, t_end=1e-3), 1e-6), min(2.0 * (rtol / 1e-9) ** (1.0 / order), case.t_end)
        late = until < case.t_end and "time_limit" in settings
        return replace(run, t=until * run.t / run.t[-1], outcome=Outcome.TIME_LIMIT if late else Outcome.FINISHED)

    monkeypatch.setattr("crossbody.reports.judging.reach.motion", ended)
    monkeypatch.setattr("crossbody.reports.judging.reach.tight", lambda case, **more: ended(case, case.tight, **more))
    found = followed(case, 5.0)
    assert found.case.tight == pytest.approx(times * case.tight)
    assert found.part == pytest.approx(min(0.2, 0.2 * (found.case.tight / 1e-9) ** (1.0 / order)), rel=0.1)
    assert found.why


def test_a_motion_is_compared_up_to_where_the_law_has_none_further() -> None:
    """Painleve's rod, which no force holds open: what engines do before is judged."""
    case = cases.from_scene(rod_on_floor(1.6), q0=[0.0, 0.5 * np.cos(0.5) + 0.05, -0.5], v0=[1.5, 0.0, 0.0], t_end=0.3)
    whole = engines.load("reference").prepare(case, "compiled").run()
    found = run_case(case, picks(("reference:compiled", "mujoco:default")), refine=False)
    assert whole.outcome is Outcome.PAINLEVE
    assert 0.9 * whole.t[-1] < found.case.t_end < whole.t[-1]
    (row,) = truth_row(found.case, found.truth, "")
    assert row.verdict == Word.WITHIN
    assert ("(rigid bodies with dry friction have no motion beyond this instant (Painleve))") in sentence(
        runs_of([row.row()])
    )
    ended = [entry.run.outcome for entry in found.entries if entry.run is not None]
    assert ended[0] is Outcome.FINISHED


def test_a_truth_by_itself_keeps_its_horizon() -> None:
    """What asks for the truth of a case compares runs of that case, which are no shorter for it."""
    case = cases.from_scene(rod_on_floor(1.6), q0=[0.0, 0.5 * np.cos(0.5) + 0.05, -0.5], v0=[1.5, 0.0, 0.0], t_end=0.3)
    truth, whole = truth_of(case), engines.load("reference").prepare(case, "compiled", rtol=case.tight).run()
    assert truth.part == 1.0
    assert truth.trajectory.outcome is Outcome.PAINLEVE
    assert truth.trajectory.t[-1] == pytest.approx(whole.t[-1], rel=1e-9)


@pytest.mark.parametrize("outcome", [*SHORT, Outcome.STEP_LIMIT, Outcome.MODE_CYCLE, Outcome.FINISHED])
@given(reached=st.floats(0.0, 1.0), t_end=st.floats(1e-3, 1e3))
def test_a_horizon_is_cut_at_two_digits_below_what_was_reached(outcome: Outcome, reached: float, t_end: float) -> None:
    case = pendulum(1.0, False, 1.0, t_end)
    run = engines.load("reference").prepare(replace(case, t_end=1e-6), "compiled").run()
    until = np.array([0.0, reached * t_end])
    found = cut_short(case, replace(run, t=until, outcome=outcome))
    if outcome not in SHORT or (1.0 - BEFORE) * until[-1] < SHORTEST * t_end:
        assert found is case
        return
    assert found.t_end == float(f"{found.t_end:.2g}")
    assert 0.9 * until[-1] < found.t_end < until[-1]
