"""Stress suites: what is drawn, how a run ends in a row whatever it does, and how a failure is made small."""

from __future__ import annotations

import itertools
import json
import math
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from unpacked import numbers

from crossbody import cases, engines
from crossbody.cases import CaseUnsupported, Event, InvalidValue, Mode, Outcome, SceneError, Trajectory, UnknownName
from crossbody.reports import suites
from crossbody.reports.judging.verdict import Word
from crossbody.reports.runs.choice import Pick
from crossbody.reports.suites import _linear_arcs as linear_arcs
from crossbody.reports.suites.axis import Levels, Linear, Log, Whole, decades
from crossbody.reports.suites.contract import Family, Ladder, Suite
from crossbody.reports.sweep import draw
from crossbody.reports.sweep.bounds import Overdue, bounded, overheard
from crossbody.reports.sweep.execute import COLUMNS, SKIPPED, Tried, _verdict, execute, row
from crossbody.reports.sweep.map import MAP, stability_map, summary, unrun, varied
from crossbody.reports.sweep.measure import Asked, Error, at_the_end, error, instants, lasting, residual
from crossbody.reports.sweep.minimise import failures, shrink
from crossbody.reports.sweep.pools import together
from crossbody.reports.sweep.spec import Spec

REFERENCE = Pick(engine="reference", profile="compiled")
AXES = {"a0": Log(1e2, 1e6), "mass": Linear(0.5, 2.0)}
FAMILY = Family(case="bouncing_ball", variant="linear", axes=AXES, fixed={"t_end": 0.6})


def drawn(family: Family = FAMILY, runs: int = 6, seed: int = 0, *picks: Pick) -> list[Spec]:
    suite = Suite(families=(family,))
    return draw.specs([("one", suite)], {"one": picks or (REFERENCE,)}, runs, seed, share=False)


@pytest.mark.parametrize("axis", [Linear(-2.0, 3.0), Log(1e-6, 1e6), Whole(2, 9), Levels((1, 5)), decades(0, 3)])
def test_an_axis_stays_inside_and_reaches_both_ends(axis: Any) -> None:
    values = [float(axis.at(u)) for u in np.linspace(0.0, 1.0, 1001)]
    low, high = (axis.values[0], axis.values[-1]) if isinstance(axis, Levels) else (axis.low, axis.high)
    assert min(values) == low
    assert max(values) == pytest.approx(high, rel=1e-12)
    assert np.all(np.diff(values) >= 0.0)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Linear(1.0, 1.0), "below its high end"),
        (lambda: Linear(0.0, math.inf), "finite"),
        (lambda: Log(0.0, 1.0), "use Linear"),
        (lambda: Levels(()), "at least one"),
        (lambda: Levels((1, 1)), "each once"),
        (lambda: Ladder(rtol=(1e-3,), dt=(1e-2, 1e-3)), "as many"),
        (lambda: Ladder(rtol=(1e-3, 1e-2), dt=(1e-2, 1e-3)), "must fall"),
        (lambda: replace(FAMILY, grid={"a0": Levels((1.0,))}), "a0 is given twice"),
        (lambda: replace(FAMILY, fixed={"mass": 1.0}), "mass is given twice"),
        (lambda: Family(case="bouncing_ball", variant="linear"), "needs an axis"),
        (lambda: replace(FAMILY, share=0), "share is 0"),
        (lambda: Suite(families=()), "at least one family"),
        (lambda: Suite(families=(FAMILY,), runs=0), "one run"),
        (lambda: drawn(runs=0), "at least 1"),
        (lambda: checked(replace(FAMILY, fixed={"t_end": -1.0})), "t_end is -1"),
        (lambda: checked(Family(case="bouncing_ball", variant="linear", grid={"mass": Levels((-1.0,))})), "mass is -1"),
    ],
)
def test_contradictory_grids_are_one_sentence(make: Callable[[], Any], says: str) -> None:
    with pytest.raises(InvalidValue, match=says) as error:
        make()
    assert "\n" not in str(error.value)


def checked(family: Family) -> None:
    draw.check("one", Suite(families=(family,)))


@pytest.mark.parametrize(
    "family",
    [
        replace(FAMILY, case="bouncing_bal"),
        replace(FAMILY, variant="linea"),
        replace(FAMILY, axes={"stiffness": Log(1.0, 2.0)}),
        replace(FAMILY, fixed={"t_ende": 1.0}),
    ],
)
def test_names_that_do_not_exist_are_told_before_anything_runs(family: Family) -> None:
    with pytest.raises(UnknownName):
        checked(family)


@pytest.mark.parametrize("name", suites.names())
def test_every_suite_can_be_drawn_and_says_what_it_stresses(name: str) -> None:
    suite = suites.load(name)
    draw.check(name, suite)
    assert suites.summary(name)
    for place, family in enumerate(suite.families):
        scenes = list(draw.scenes(name, family, place, 6, 0))
        assert scenes
        built = 0
        for scene in scenes:
            try:
                cases.load(family.case, family.variant, **scene.parameters)
                built += 1
            except cases.CrossbodyError:
                continue  # an edge of the workspace may lie just outside it
        assert built >= len(scenes) // 2


def test_a_suite_of_ones_own_is_run_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(
        "from crossbody.reports.suites.axis import Log\nfrom crossbody.reports.suites.contract import Family, Suite\n"
        "SUITE = Suite(families=(Family(case='bouncing_ball', variant='linear', axes={'a0': Log(1.0, 2.0)}),))\n"
    )
    assert suites.load(str(path)).runs == 200
    path.write_text("SUIT = 1\n")
    with pytest.raises(SceneError, match="SUITE"):
        suites.load(str(path))
    with pytest.raises(UnknownName, match="damping"):
        suites.load("dampin")
    with pytest.raises(UnknownName, match="suite file"):
        suites.load(str(tmp_path / "nowhere.py"))


def test_the_longer_sweep_begins_with_the_shorter_one_and_engines_share_draws() -> None:
    short, long = drawn(runs=5), drawn(runs=11)
    assert [s.parameters for s in short] == [s.parameters for s in long[:5]]
    assert [s.seed for s in short] == [s.seed for s in long[:5]]
    both = drawn(FAMILY, 5, 0, REFERENCE, Pick(engine="mujoco", profile="matched"))
    assert [s.parameters for s in both[:5]] == [s.parameters for s in both[5:]] == [s.parameters for s in short]
    assert [s.parameters for s in drawn(seed=1)] != [s.parameters for s in drawn(seed=0)]


def test_families_share_the_runs_of_their_suite_and_other_engines_make_few() -> None:
    suite = Suite(families=(FAMILY, replace(FAMILY, share=3)))
    picks = (REFERENCE, Pick(engine="mujoco", profile="matched"))
    specs = draw.specs([("one", suite)], {"one": picks}, 2000, 0, share=True)
    counts = {(s.engine, s.draw // 1_000_000): 0 for s in specs}
    for s in specs:
        counts[s.engine, s.draw // 1_000_000] += 1
    assert counts == {("reference", 0): 500, ("reference", 1): 1500, ("mujoco", 0): 3, ("mujoco", 1): 4}


def test_a_grid_is_whole_once_and_its_first_part_is_spread() -> None:
    grid = {"a0": Levels((1e2, 1e3, 1e4)), "mass": Levels((1.0, 2.0))}
    ladder = Ladder(rtol=(1e-3, 1e-6), dt=(1e-2, 1e-3))
    family = Family(case="bouncing_ball", variant="linear", grid=grid, ladder=ladder)
    specs = drawn(family, runs=1000)
    seen = {(s.parameters["a0"], s.parameters["mass"], s.rung) for s in specs}
    assert len(specs) == len(seen) == 12
    assert len({s.parameters["a0"] for s in specs[:6]}) > 1


class FakeRun(engines.Run):
    """A run that does what it is told."""

    engine, profile, settings = "fake", "x", {"dt": 1e-3}

    def __init__(self, does: Callable[[], Trajectory]) -> None:
        self.does = does

    def run(self) -> Trajectory:
        return self.does()

    def audit(self) -> Mapping[str, Any]:
        return {}


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], Trajectory]], Spec]:
    """An engine that does what it is told, and a spec for it."""

    class Fake(engines.Engine):
        does: Callable[[], Trajectory]

        def prepare(self, case: Any, profile: str, **settings: Any) -> FakeRun:
            for name in settings:
                if name not in ("dt", "max_steps"):
                    raise UnknownName("setting of fake", name, ("dt", "max_steps"))
            return FakeRun(self.does)

    engine = Fake()
    monkeypatch.setattr(engines, "load", lambda name: engine)

    def made(does: Callable[[], Trajectory]) -> Spec:
        engine.does = does
        return drawn(FAMILY, 1, 0, Pick(engine="fake", profile="x"))[0]

    return made


def exact(**changed: Any) -> Trajectory:
    case = cases.load("bouncing_ball", "linear", **{str(k): v for k, v in drawn()[0].parameters.items()})
    assert case.closed_form is not None
    return replace(case.closed_form(np.linspace(0.0, case.t_end, 50)), **changed)


def raised() -> Trajectory:
    raise RuntimeError("the solver fell over")


def unsupported() -> Trajectory:
    raise CaseUnsupported("it has no such thing")


def warned() -> Trajectory:
    warnings.warn("beware", RuntimeWarning, stacklevel=1)
    return exact()


def endless() -> Trajectory:
    while True:
        time.sleep(0.001)


@pytest.mark.parametrize(
    ("does", "outcome", "verdict", "says"),
    [
        (exact, "finished", "not judged", ""),
        (raised, "exception", "outside", "RuntimeError: the solver fell over"),
        (unsupported, "skipped", "skipped", "no such thing"),
        (warned, "finished", "outside", "leaked: RuntimeWarning: beware"),
        (lambda: exact(q=np.full((50, 1), np.nan)), "finished", "outside", "q is not finite"),
        (lambda: exact(outcome=Outcome.DIVERGED, message="gone"), "diverged", "not judged", "gone"),
        (endless, "time_limit", "not judged", "time limit"),
    ],
)
def test_a_run_ends_in_one_row_whatever_it_does(
    fake: Callable[..., Spec], does: Callable[[], Trajectory], outcome: str, verdict: str, says: str
) -> None:
    row = execute(replace(fake(does), time_limit=0.2))
    assert (row["outcome"], row["verdict"]) == (outcome, verdict)
    assert says in row["why"]
    assert set(COLUMNS) < set(row)


def test_a_run_that_stops_short_but_says_finished_is_outside(fake: Callable[..., Spec]) -> None:
    spec = replace(fake(exact), parameters={**drawn()[0].parameters, "t_end": 9.0})
    row = execute(spec)
    assert row["verdict"] == "outside"
    assert "says finished at t = 0.6 s of 9 s" in row["why"]


def test_the_error_of_a_wrong_run_is_seen(fake: Callable[..., Spec]) -> None:
    good, off = execute(fake(exact)), execute(fake(lambda: exact(q=1.01 * exact().q)))
    assert good["error"] < 1e-13
    assert off["error"] == pytest.approx(0.01, rel=1e-6)
    missing = execute(fake(lambda: exact(events=())))
    assert "-1 contacts" in missing["why"] or "-2 contacts" in missing["why"]
    assert missing["error"] < 1e-13


@pytest.mark.parametrize("seed", range(4))
def test_one_wrong_coordinate_of_several_is_the_error_of_a_run(seed: int) -> None:
    rng = np.random.default_rng(seed)
    case = cases.load("newtons_cradle", "sliders", n=int(rng.integers(2, 6)))
    assert case.closed_form is not None
    run = case.closed_form(instants(case.t_end))
    asked = Asked(limit=1.0, near=lambda: case)
    assert error(case, run, asked).value < 1e-13
    for k in range(run.q.shape[1]):
        q = run.q.copy()
        q[:, k] += 1e-3 * np.abs(run.q).max()
        assert error(case, replace(run, q=q), asked).value == pytest.approx(1e-3, rel=1e-6), k


@pytest.mark.parametrize("at", [0, 1, 7, -2, -1])
def test_one_wrong_sample_is_the_error_of_a_run_wherever_it_is(at: int) -> None:
    case = cases.load("newtons_cradle", "sliders", n=3)
    assert case.closed_form is not None
    run = case.closed_form(instants(case.t_end))
    q = run.q.copy()
    q[at, 1] += 1e-3 * np.abs(run.q).max()
    assert error(case, replace(run, q=q), Asked(limit=1.0, near=lambda: case)).value == pytest.approx(1e-3, rel=1e-6)


def test_within_is_a_run_that_ended_well_with_an_error_that_is_known_and_small() -> None:
    values, open_, tiers = (math.nan, math.inf, 1e-3, 1e-9), (math.nan, 1e-3, 1e-9), ("", "C")
    for value, left_open, tier, outcome in itertools.product(values, open_, tiers, Outcome):
        ended = Tried(outcome=outcome.value)
        said = _verdict(drawn()[0], ended, Error(value=value, tier=tier), 1e-6, left_open, [])[0]
        sound = outcome is Outcome.FINISHED and not left_open > 1e-5
        assert (said == Word.WITHIN) == (sound and tier == "C" and value == 1e-9)


@pytest.mark.parametrize("seed", range(40))
def test_exact_arcs_find_dips_that_lie_between_the_places_they_look_at(seed: int) -> None:
    """A condition that dips below zero by 1e-6 of its size, in whichever part of a step, beside one that holds."""
    rng = np.random.default_rng(seed)
    w, phase, depth = rng.uniform(1.0, 20.0, 2), rng.uniform(0.0, 2.5), 10.0 ** rng.uniform(-6.5, -4.5)
    F = np.zeros((5, 5))
    F[:2, 2:4], F[2:4, :2] = np.eye(2), -np.diag(w**2)
    x = np.array([np.cos(phase), 0.3, -w[0] * np.sin(phase), 0.0, 1.0])
    functionals = np.array([[1.0, 0.0, 0.0, 0.0, 1.0 - depth], [0.0, 1.0, 0.0, 0.0, -2.0]])
    step = 1.0 / (linear_arcs.STEPS * w.max())
    states = linear_arcs._powers(F, step) @ x
    worst = (states @ functionals.T).max(axis=1)
    wanted = (np.arccos(depth - 1.0) - phase) / w[0]
    found = linear_arcs.LinearArcs._fall(None, F, states, functionals, worst, step)  # type: ignore[arg-type]
    if wanted < (linear_arcs.BLOCK - 1) * step:
        assert found == pytest.approx(wanted, abs=1e-8)
    elif wanted > (linear_arcs.BLOCK + 1) * step:
        assert found == np.inf


def histories(rng: np.random.Generator) -> tuple[list[Event], list[Event]]:
    """Events of rows that share instants, and the same with touches that are over at once between and inside them."""
    right, told, free = [], [], [mode for mode in Mode if mode not in (Mode.STICK, Mode.SLIP)]
    for i in range(rng.integers(1, 5)):
        mode = Mode.FREE
        for t in np.flatnonzero(rng.random(6) < 0.6).astype(float):
            after = Mode(rng.choice([one for one in free if one != mode]))
            through = Mode.CONTACT not in (mode, after) and rng.random() < 0.5
            briefly = after != Mode.CONTACT and rng.random() < 0.5
            way = [mode, *[Mode.CONTACT] * through, after, *[Mode.CONTACT, after] * briefly]
            order = np.sort(rng.random(len(way) - 1))
            steps = zip(order, pairwise(way), strict=True)
            told += [(t, k, Event(t=t, contact=i, before=one, after=two)) for k, (one, two) in steps]
            right.append((t, order[0], Event(t=t, contact=i, before=mode, after=after)))
            mode = after
    return [one[2] for one in sorted(right, key=lambda e: e[:2])], [one[2] for one in sorted(told, key=lambda e: e[:2])]


def test_touches_that_are_over_at_once_leave_no_event_and_others_stay() -> None:
    run = exact()
    for seed in range(300):
        right, told = histories(np.random.default_rng(seed))
        assert lasting(replace(run, events=tuple(told))).events == tuple(right), seed


def test_a_row_says_how_long_its_run_took(fake: Callable[..., Spec]) -> None:
    def slow() -> Trajectory:
        time.sleep(0.05)
        return exact()

    assert 50.0 <= execute(fake(slow))["wall_ms"] < 5e3
    assert execute(fake(raised))["wall_ms"] == 0.0


@pytest.mark.parametrize("second", [0, 1, 2, 3, 7])
def test_the_independent_integrator_is_asked_of_every_so_many_draws(second: int) -> None:
    family = replace(FAMILY, second=second)
    asked = [scene.second for scene in draw.scenes("one", family, 0, 10, 0)]
    assert sum(asked) == (math.ceil(10 / second) if second else 0)
    assert asked[0] == (second > 0)
    assert len({b - a for a, b in pairwise(np.flatnonzero(asked))}) <= 1


def test_a_release_without_a_trace_in_the_motion_is_rounding_and_one_with_it_is_an_error(
    fake: Callable[..., Spec],
) -> None:
    """A touching gap that stands still lets go whenever rounding says so."""

    def later(by: float) -> Trajectory:
        run = exact()
        ends = {Mode.FREE, Mode.BALLISTIC}
        moved = (replace(event, t=event.t + by) if event.after in ends else event for event in run.events)
        return replace(run, events=tuple(moved))

    assert execute(fake(lambda: later(1e-3)))["error"] < 1e-13
    t = exact().t
    moved = execute(fake(lambda: replace(later(1e-3), q=np.interp(t - 1e-3, t, exact().q[:, 0])[:, None])))
    assert moved["error"] > 1e-3


def test_a_truth_is_asked_for_no_longer_than_it_is_sharper_than_the_tolerance(
    fake: Callable[..., Spec], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A truth whose neighbours part early excuses what comes after, and nothing before; a sharp one excuses nothing."""
    half = 0.3

    def late() -> Trajectory:
        run = exact()
        return replace(run, q=np.where(run.t[:, None] > half, 2.0, 1.0) * run.q)

    assert execute(fake(late))["error"] > 0.1
    real = cases.load("bouncing_ball", "linear", **drawn()[0].parameters)

    def moved(times: Any) -> Trajectory:
        run = real.closed_form(times)  # type: ignore[misc]
        return replace(run, q=np.where(run.t[:, None] > half, 3.0, 1.0) * run.q)

    monkeypatch.setattr("crossbody.reports.sweep.execute._beside", lambda *_: replace(real, closed_form=moved))
    row = execute(fake(late))
    assert row["error"] < 1e-13
    assert half < row["until"] < half + 0.02
    assert "diverges" in row["why"]
    early = execute(fake(lambda: exact(q=1.01 * exact().q)))
    assert early["error"] == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize("steps", [1, 100, 10_000, 1_000_000])
@pytest.mark.parametrize(("times", "excused"), [(0.5, False), (2.0, True)])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_a_truth_must_be_known_to_falls_with_the_root_of_the_steps(
    steps: int, times: float, excused: bool, sign: float
) -> None:
    """So many errors of the size of the tolerance add up to the limit: a neighbour that parts by more excuses."""
    case, limit = cases.load("bouncing_ball", "linear", t_end=0.4), 1e-2  # it falls, and touches nothing
    assert case.closed_form is not None
    motion = case.closed_form(np.linspace(0.0, case.t_end, 50))
    late = motion.t[:, None] > 0.2
    apart = times * limit / math.sqrt(max(100, steps)) * float(np.abs(motion.q).max())

    def moved(t: Any) -> Trajectory:
        run = case.closed_form(t)  # type: ignore[misc]
        return replace(run, q=run.q + sign * apart * (run.t[:, None] > 0.2))

    asked = Asked(limit=limit, near=lambda: replace(case, closed_form=moved))
    found = error(case, replace(motion, q=np.where(late, 2.0, 1.0) * motion.q, steps=steps), asked)
    assert (found.value < 1e-13) == excused


@pytest.mark.parametrize("by", [-1e-2, 1e-2])
def test_a_truth_whose_touch_comes_earlier_or_later_beside_it_excuses_that_touch(by: float) -> None:
    case = cases.load("bouncing_ball", "linear", t_end=0.6)
    assert case.closed_form is not None
    motion = case.closed_form(np.linspace(0.0, case.t_end, 50))
    touches = [event.t for event in motion.events if event.before == Mode.FREE]

    def shifted(t: Any) -> Trajectory:
        run = case.closed_form(t)  # type: ignore[misc]
        return replace(run, events=tuple(replace(event, t=event.t + by) for event in run.events))

    near = 1.0 + 3e-4
    wrong = replace(
        motion, q=np.where(motion.t[:, None] > touches[0] + 0.02, 2.0, near) * motion.q,
        events=tuple(replace(event, t=event.t + 5.0 * abs(by)) for event in motion.events),
    )  # fmt: skip
    found = error(case, wrong, Asked(limit=1e-3, near=lambda: replace(case, closed_form=shifted)))
    assert found.until == pytest.approx(touches[0] + min(by, 0.0), abs=1e-12)
    assert found.value == pytest.approx(near - 1.0, rel=1e-6)


def test_a_slow_touch_does_not_set_the_clock_of_what_moves_fast() -> None:
    """It is known to microseconds only; the other masses, at a metre per second, agree at every instant.

    A clock that is off by a microsecond would make 1e-6; springs as stiff as these make 1e-9 of rounding.
    """
    law = {"a0": 40756072.9447183, "zeta": 0.8239943821405218, "collisions": "resolved"}
    family = Family(
        case="newtons_cradle", variant="sliders", fixed={"n": 4, "lifted": 3, "gap": 0.042105817424794335, **law},
        ladder=Ladder(rtol=(1e-12,), dt=(1e-4,)), second=1,
    )  # fmt: skip
    row = execute(drawn(family, 1)[0])
    assert row["tier"].startswith("C")
    assert row["error"] < 1e-8


@pytest.mark.parametrize("near", [1.0 - 1e-6, 1.0 + 1e-6, 1.0 + 1e-8])
@pytest.mark.parametrize(
    ("a0", "zeta"),
    [(2.1e4, 0.4), (6.5e4, 0.4), (1e8, 0.4), (89413.15067765993, 0.36266), (27958.803771727715, 0.70499)],
)
def test_a_ball_a_millionth_above_its_threshold_leaves_and_one_below_stays(a0: float, zeta: float, near: float) -> None:
    """The contact force dips below 0 by a millionth of the weight, between two nodes of a step or right behind one."""
    from crossbody.cases import closed_forms as cf

    a1 = 2.0 * zeta * math.sqrt(a0)
    speed = near * cf.threshold_speed(a0, a1, 9.81)
    fixed = {"height": 0.0, "t_end": 0.5, "a0": a0, "a1": a1, "speed": speed}
    row = execute(replace(drawn()[0], parameters=fixed))
    assert row["verdict"] == "within", row["why"]
    assert (row["events"] > 1) == (near > 1.0)


@pytest.mark.parametrize(
    ("n", "lifted", "zeta"),
    [(5, 2, 0.8), (8, 3, 0.8), (12, 6, 0.28), (11, 1, 0.31945957263363317), (12, 9, 0.21657891419741918)],
)
def test_a_row_that_has_collapsed_passes_an_impulse_on_as_one_that_touches(n: int, lifted: int, zeta: float) -> None:
    """Inelastic collapse: endless collisions in a finite time, then the next strike on what stands together."""
    case = cases.load("newtons_cradle", "sliders", n=n, lifted=lifted, zeta=zeta, gap=1e-3)
    run = engines.load("reference").prepare(case, "compiled").run()
    assert case.closed_form is not None
    truth = case.closed_form(run.t)
    # Collisions end at rates of 1e-9 of the fastest, 1 m/s: more is not known of a rate, nor of how far it leads.
    assert np.max(np.abs(run.v[-1] - truth.v[-1])) < 1e-9
    assert np.max(np.abs(run.q - truth.q)) < 1e-9 * run.t[-1]
    assert run.v[-1].sum() == pytest.approx(lifted, rel=1e-12)  # momentum: equal masses, 1 m/s


@pytest.mark.parametrize("draw", [0, 4, 7])
def test_an_exact_motion_to_a_nearer_horizon_is_the_beginning_of_it(draw: int) -> None:
    """Wherever the horizon lies between two events, and however many blocks are searched before it."""
    path = str(Path(suites.__file__).with_name("_springs_and_walls.py"))
    whole = cases.load(path, n=1, walls=1, draw=draw, a0=1e5, zeta=0.5, stiffness=1.0, t_end=2.0)
    assert whole.closed_form is not None
    events = whole.closed_form(np.array([2.0])).events
    free = [(a.t, b.t) for a, b in pairwise(events) if b.before is Mode.FREE]
    assert free
    for before, after in free[:2]:
        for part in (0.05, 0.95):
            t_end = before + part * (after - before)
            near = cases.load(path, **{**whole.parameters, "t_end": t_end})
            assert near.closed_form is not None
            run = near.closed_form(np.array([t_end]))
            assert run.outcome is Outcome.FINISHED
            assert run.events == tuple(event for event in events if event.t <= before)


@pytest.mark.parametrize("spec", drawn(), ids=str)
def test_the_reference_is_within_on_drawn_balls(spec: Spec) -> None:
    row = execute(spec)
    assert (row["verdict"], row["outcome"]) == ("within", "finished"), row["why"]
    assert row["tier"].startswith("A")
    assert 0.0 <= row["error"] < 1e-8
    assert 0.0 <= row["residual"] < 1e-6


def test_a_bound_on_steps_is_an_outcome() -> None:
    family = replace(FAMILY, axes={"height": Linear(0.1, 0.2)}, fixed={"a1": 0.0, "t_end": 5.0}, max_steps=5)
    row = execute(drawn(family, 1)[0])
    assert row["outcome"] == "step_limit"
    assert row["verdict"] == "outside"
    assert execute(replace(drawn(family, 1)[0], finishes=False))["verdict"] == "not judged"


def test_only_the_end_gives_the_end_of_the_whole_run() -> None:
    family = replace(FAMILY, ends=True)
    many = together(drawn(family, 20))
    single = [execute(spec) for spec in drawn(FAMILY, 20)]
    assert [row["outcome"] for row in many] == [row["outcome"] for row in single]
    assert all(row["error"] < 1e-8 and row["verdict"] == "within" for row in many)
    assert [row["parameters"] for row in many] == [row["parameters"] for row in single]
    alone = [together([spec])[0] for spec in drawn(family, 20)]
    for a, b in zip(many, alone, strict=True):
        assert a["error"] == b["error"]
        assert a["steps"] == b["steps"]


def test_a_scene_that_cannot_be_built_is_refused_with_its_sentence() -> None:
    spec = replace(drawn()[0], parameters={"mass": -1.0})
    assert execute(spec)["outcome"] == "refused"
    assert "mass is -1" in execute(spec)["why"]
    assert together([replace(spec, ends=True)])[0]["outcome"] == "refused"


@pytest.mark.parametrize("stream", [1, 2])
def test_what_a_library_writes_to_the_process_is_heard(stream: int, capfd: pytest.CaptureFixture[str]) -> None:
    import os

    heard: list[str] = []
    with overheard(heard):
        os.write(stream, b"from below\n")
    os.write(stream, b"behind\n")
    assert heard == ["from below"]
    assert list(capfd.readouterr()) == ["behind\n" if each == stream else "" for each in (1, 2)]


TRACED = """
import cProfile, contextlib, sys, time
from crossbody.reports.sweep.bounds import Overdue, bounded

def spin(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass

for seconds, spent in ((60.0, 0.0), (0.02, 5.0), (0.01, 0.01), (0.002, 0.002)):
    for _ in range(20 if spent < 1.0 else 1):
        with contextlib.suppress(Overdue), bounded(seconds):
            spin(spent)
        cProfile.Profile().runcall(spin, 0.0)
print("through")
"""


def test_a_bound_on_time_leaves_the_interpreter_as_it_was() -> None:
    """Where a mark of an exception stays that never comes, CPython 3.11 hangs at the next call that is traced."""
    ended = subprocess.run([sys.executable, "-c", TRACED], capture_output=True, text=True, timeout=60)
    assert ended.stdout == "through\n", ended.stderr


def test_a_bound_on_time_leaves_nothing_behind() -> None:
    with pytest.raises(Overdue), bounded(0.05):
        endless()
    for _ in range(200):
        with bounded(10.0):
            pass
    time.sleep(0.1)


@pytest.mark.parametrize(("needs", "left"), [({"a"}, {"a": 8.0}), ({"a", "b"}, {"a": 8.0, "b": 3.0}), (set(), {})])
def test_a_failure_keeps_only_what_it_needs(needs: set[str], left: Mapping[str, float]) -> None:
    given = {"a": 8.123, "b": 3.03, "c": 5.0, "name": "word"}
    own = {"a": 1.0, "b": 1.0, "c": 1.0, "name": "other"}

    def fails(parameters: Mapping[str, Any]) -> bool:
        full = {**own, **parameters}
        return all(float(full[name]) > 0.9 * float(given[name]) for name in needs)

    small, tries = shrink(given, own, fails)
    assert set(small) == set(left)
    assert all(small[name] == pytest.approx(value, rel=0.1) for name, value in left.items())
    assert fails(small)
    assert tries < 60


@pytest.mark.parametrize("seed", range(40))
def test_a_parameter_is_moved_to_within_half_of_the_way_that_it_may_go(seed: int) -> None:
    """As a part of the way to its default, of its logarithm where both are above 0; numbers keep two digits."""
    rng = np.random.default_rng(seed)
    ratio = bool(rng.integers(2))
    a, b = 10.0 ** rng.uniform(-3.0, 3.0, 2) if ratio else rng.uniform(-9.0, 9.0, 2) * (1.0, -1.0)
    scaled: Callable[[float], float] = math.log if ratio else float
    needs = float(rng.uniform(0.0, 1.0))

    def part(x: float) -> float:
        return (scaled(x) - scaled(b)) / (scaled(a) - scaled(b))

    small, tries = shrink({"x": a}, {"x": b}, lambda given: "x" in given and part(given["x"]) >= needs)
    rounding = 0.06 if ratio else 0.06 * abs(small["x"])
    wanted = next((0.5**k for k in range(6, -1, -1) if 0.5**k >= needs), 1.0)
    assert needs <= part(small["x"])
    assert part(small["x"]) <= 2.0 * wanted * (wanted < 1.0) + (wanted == 1.0) + rounding / abs(scaled(a) - scaled(b))
    assert tries < 20


def test_a_failure_that_does_not_repeat_stays_as_it_came() -> None:
    assert shrink({"a": 2.0}, {"a": 1.0}, lambda _: False) == ({"a": 2.0}, 1)


def test_the_command_of_a_row_repeats_its_run(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    import shlex

    from crossbody.reports.cli import main

    row = execute(drawn()[0])
    words = shlex.split(row["command"])
    with pytest.raises(SystemExit):
        main([*words[1:], "--set-engine", "rtol=1e-8", "--json", "--out", str(tmp_path / "out")])
    told = json.loads(capsys.readouterr().out)
    assert {line["engine"] for line in told} == {"reference", "truth"}
    assert "rtol=1e-08" in told[0]["settings"]


def test_the_map_has_a_cell_for_every_stiffness_and_rung_with_the_worst_of_each() -> None:
    ladder = Ladder(rtol=(1e-3, 1e-6), dt=(1e-2, 1e-3))
    family = Family(
        case="bouncing_ball", variant="linear", ladder=ladder, fixed={"t_end": 0.5, "height": 0.2},
        grid={"a0": Levels((1e2, 1e6)), "a1": Levels((0.0, 10.0))},
    )  # fmt: skip
    specs = [replace(spec, suite="stiffness") for spec in drawn(family, 100)]
    rows = pd.DataFrame([execute(spec) for spec in specs])
    cells = stability_map(rows)
    assert len(cells) == 4
    assert (cells["runs"] == 2).all()
    for cell in cells.to_dict(orient="records"):
        stiff = rows["parameters"].map(json.loads).map(lambda given: given["a0"]) == cell["a0"]
        mine = rows[stiff & (rows["settings"] == json.dumps({"rtol": cell["setting"]}))]
        assert cell["worst_error"] == mine["error"].max()
    line = summary(rows).iloc[0]
    assert line["runs"] == line["finished"] == 8
    assert not len(failures(rows))


def test_a_map_of_engines_that_fail_has_crosses_without_a_colour(tmp_path: Path) -> None:
    """As it is read back from the folder, where an error that is not known is none."""
    from crossbody.reports.maps.figure import stress_map

    cells = pd.DataFrame(
        [("mujoco", "matched", "dt", 1e-3, a0, 4, finished, error, math.nan, "diverged 2")
         for a0, finished, error in ((1e2, 4, 1e-3), (1e8, 2, 2.0), (1e10, 0, math.nan), (1e12, 0, math.nan))],
        columns=list(MAP),
    )  # fmt: skip
    cells.to_json(tmp_path / "cells.json")
    for known in (cells, pd.read_json(tmp_path / "cells.json"), cells.astype(object).where(cells.notna(), None)):
        field, failed = stress_map(known)["data"]
        assert list(numbers(field["x"])) == [1e2, 1e8]
        np.testing.assert_allclose(numbers(field["marker"]["color"]), [-3.0, math.log10(2.0)])
        assert list(numbers(failed["x"])) == [1e8, 1e10, 1e12]
        assert "0 of 4 finished; diverged 2" in failed["text"][1]


def test_the_colour_of_an_error_ends_where_the_scale_does() -> None:
    from crossbody.reports.maps.figure import BEST, WORST, stress_map

    cells = pd.DataFrame(
        [("reference", "compiled", "rtol", 1e-9, a0, 4, 4, error, 0.0, "")
         for a0, error in ((1e2, 0.0), (1e4, 1e-6), (1e6, math.inf))],
        columns=list(MAP),
    )  # fmt: skip
    field, _ = stress_map(cells)["data"]
    np.testing.assert_allclose(numbers(field["marker"]["color"]), [BEST, -6.0, WORST])


@pytest.mark.parametrize("name", suites.names())
def test_no_suite_calls_a_motion_right_that_is_visibly_wrong(name: str) -> None:
    """An error of a hundred-millionth may pass, one of a ten-thousandth at the default tolerance never."""
    suite = suites.load(name)
    specs = draw.specs([(name, suite)], {name: (REFERENCE,)}, len(suite.families), 0, share=False)
    assert len(specs) >= len(suite.families)
    for spec in specs:
        wrong = Error(value=1e-4, tier="C", until=1.0)
        told = row(replace(spec, rung=-1), Tried(outcome=Outcome.FINISHED.value), wrong, [])
        assert told["verdict"] == "outside", spec


def test_an_account_alone_is_a_word_of_its_own() -> None:
    spec = drawn()[0]
    errors = {"truth": Error(value=1e-9, tier="C"), "account": Error(), "wrong": Error(value=1e-3, tier="C")}
    ended = Tried(outcome=Outcome.FINISHED.value)
    words = {text: _verdict(spec, ended, error, 1e-6, 1e-9, [])[0] for text, error in errors.items()}
    assert words == {"truth": Word.WITHIN, "account": Word.LEDGER, "wrong": Word.OUTSIDE}


@pytest.mark.parametrize("account", ["contact", "input", "dissipated"])
@pytest.mark.parametrize("place", [1, 25, 49])
def test_an_account_is_as_open_as_its_worst_sample(account: str, place: int) -> None:
    run = exact()
    assert run.ledger is not None
    assert residual(run) < 1e-12
    booked = getattr(run.ledger, account).copy()
    turned = max(float(run.energy[:, 0].max()), float(np.ptp(run.energy[:, 1])), float(np.ptp(run.ledger.contact)))
    booked[place] += 1e-3 * turned
    wrong = replace(run, ledger=replace(run.ledger, **{account: booked}))
    assert residual(wrong) == pytest.approx(1e-3, rel=2e-3)


@pytest.mark.parametrize(("q", "v"), [(0.0, 0.0), (1e-3, 0.0), (0.0, 1e-3), (2e-3, 1e-3), (1e-3, 2e-3)])
def test_an_end_is_wrong_by_its_place_and_by_its_speed(q: float, v: float) -> None:
    """Each over its largest, and the worse of both."""
    case = cases.load("bouncing_ball", "linear", **{str(k): x for k, x in drawn()[0].parameters.items()})
    assert case.closed_form is not None
    run = case.closed_form(instants(case.t_end))
    place, speed = run.q[-1] + q * np.abs(run.q).max(), run.v[-1] + v * np.abs(run.v).max()
    assert at_the_end(case, place, speed).value == pytest.approx(max(q, v), abs=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_what_was_varied_and_what_did_not_run_is_said_with_its_reason(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a0, push, why = 10.0 ** rng.uniform(0, 6, 8), rng.choice(["", "x 1", "y 2"], 8), ["No law.", "Not installed."]
    rows = pd.DataFrame(
        {"suite": "s", "engine": "e", "profile": f"p{k % 3}", "outcome": SKIPPED if k % 3 else "finished",
         "why": why[k % 3 - 1] if k % 3 else "",
         "parameters": json.dumps({"a0": a0[k], "push": str(push[k]), "t_end": 1.0})}
        for k in range(8)
    )  # fmt: skip
    (said,) = varied(rows)
    assert f"a0 from {a0.min():.3g} to {a0.max():.3g}" in said
    assert (f"push ({len(set(push))} values)" in said) == (len(set(push)) > 1)
    assert "t_end" not in said
    assert unrun(rows) == [f"{SKIPPED}: e:p1 3. No law.", f"{SKIPPED}: e:p2 2. Not installed."]


def test_a_case_of_the_library_is_a_suite_of_its_own_and_another_name_is_told(tmp_path: Path) -> None:
    suite = suites.load("bouncing_ball", {"t_end": 0.5})
    assert {family.case for family in suite.families} == {"bouncing_ball"}
    assert all("a0" in family.axes and family.fixed["t_end"] == 0.5 for family in suite.families)
    with pytest.raises(UnknownName, match=r"no suite or case 'bouncing_bal'.*Did you mean 'bouncing_ball'"):
        suites.load("bouncing_bal")


def test_a_file_is_run_by_the_engine_that_has_its_friction_too(tmp_path: Path) -> None:
    ball = '<body><freejoint/><geom name="b" size=".1"/></body>'
    (tmp_path / "ball.xml").write_text(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
    assert "mujoco:as_is" in suites.load(str(tmp_path / "ball.xml")).engines
