"""The parts of an engine's error: laws on made-up engines whose converged motion is known, and two real ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from places import ROBOTS
from scipy.spatial.transform import Rotation

from crossbody import cases, engines
from crossbody.cases import Case, Event, Mode, Tier, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Scene
from crossbody.engines.mujoco._build import MAX_IMPEDANCE, without_regularisation
from crossbody.reports import metrics
from crossbody.reports.judging import run_verdicts
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.parts import (
    LEAST_RATIO,
    Events,
    NotMeasuredError,
    Positions,
    Split,
    Study,
    extrapolated,
    observed,
    remaining,
    settled,
    splits,
)
from crossbody.reports.judging.reach import BUDGET
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.verdict import Verdict, Word
from crossbody.reports.measuring.truth import Truth, from_run, taken
from crossbody.reports.runs import choice, jobs, refined

NEAR = 1e-5  # s, between which velocities are differences
BIPED = ROBOTS / "agility_cassie" / "cassie.xml"


def motion(q: Any, t: Any, v: Any) -> Trajectory:
    """A run without rows."""
    nothing = np.zeros((len(t), 0))
    return Trajectory(
        t=t, q=q, v=v, gap=nothing, lam=nothing, energy=np.zeros((len(t), 2)), mode=nothing.astype(np.int8),
    )  # fmt: skip


@pytest.fixture(scope="module")
def case() -> Case:
    """Two coordinates without rows, of size 1."""
    from crossbody.cases.scene import Body, Joint, Scene

    bodies = tuple(Body(name=x, mass=1.0, com=(0.0,) * 3, inertia=(1.0,) * 3 + (0.0,) * 3) for x in "ab")
    joints = tuple(Joint(name=f"j{x}", body=x, type="slide", axis=(1.0, 0.0, 0.0)) for x in "ab")
    return cases.from_scene(Scene(bodies=bodies, joints=joints), t_end=2.0)


def wave(case: Case, dt: float, model: float, step: Callable[[Any], Any], order: float) -> Trajectory:
    """A run at a step: the truth, a model error that grows, a step error of some order with a smooth shape."""
    t = np.linspace(0.0, case.t_end, round(case.t_end / dt) + 1)

    around = np.concatenate([t, t + NEAR, t - NEAR])
    shape = np.stack([around**2, -np.sin(2.0 * around)], axis=1)
    exact = np.stack([np.cos(3.0 * around), np.sin(3.0 * around)], axis=1)
    q, later, earlier = np.split(exact + model * shape + dt**order * step(around), 3)
    return motion(q, t, (later - earlier) / (2.0 * NEAR))


def smooth(t: Any) -> Any:
    return np.stack([np.cos(5.0 * t) - 1.0, t], axis=1)


def study(case: Case, steps: list[float], model: float, order: float, shape: Callable[[Any], Any] = smooth) -> Study:
    runs = tuple(wave(case, dt, model, shape, order) for dt in steps)
    return Study(setting="dt", sizes=tuple(steps), runs=runs)


def split(case: Case, truth: Truth, run: Trajectory, made: Study) -> Split:
    return splits(case, truth, run, made)["position"]


@pytest.mark.parametrize("seed", range(6))
def test_an_error_of_attitude_is_its_angle_however_a_body_is_turned(seed: int) -> None:
    """In the metric and in the parts of an error; a quaternion of the other sign is the same attitude."""
    body = Body(name="a", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    free = cases.from_scene(Scene(bodies=(body,), joints=(Joint(name="free", body="a", type="free"),)), t_end=2.0)
    rng, t, still = np.random.default_rng(seed), np.linspace(0.0, 2.0, 41), np.zeros((41, 3))
    way, off = rng.normal(size=(2, 3))
    exact = Rotation.from_quat(rng.normal(size=4)) * Rotation.from_rotvec(np.outer(t, way))
    wrong = exact * Rotation.from_rotvec(1e-3 * np.outer(t, off / np.linalg.norm(off)))
    ours, theirs = (
        np.hstack([still, sign * x.as_quat(scalar_first=True)]) for x, sign in ((exact, 1.0), (wrong, -1.0))
    )
    v = np.hstack([still, np.tile(way, (41, 1))])
    truth, run = from_run(motion(ours, t, v), Tier.A, ""), motion(theirs, t, v)
    positions = Positions(free, truth, run)
    assert positions.sizes(positions.whole).max() == pytest.approx(2e-3, rel=1e-9)
    assert metrics.load("position").measure(truth, run, free) == pytest.approx(2e-3, rel=1e-9)


STEPS = [0.02, 0.01, 0.005]


@pytest.mark.parametrize("agreed", [0.0, 1e-9, 1e-4])
def test_the_models_part_is_known_no_better_than_the_truth(case: Case, agreed: float) -> None:
    truth = from_run(wave(case, 1e-3, 0.0, smooth, 1e3), Tier.C, "")
    made = study(case, STEPS, 1e-3, 4.0)
    sharp = split(case, truth, made.runs[0], made)
    found = split(case, replace(truth, agreement={"position": agreed}), made.runs[0], made)
    assert found.known["step"] == sharp.known["step"]
    assert found.known["model"] == max(sharp.known["step"], agreed)


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("model", [0.0, 1e-3])
def test_parts_are_those_that_a_run_was_made_of_and_add_up(case: Case, order: float, model: float) -> None:
    truth = replace(from_run(wave(case, 1e-3, 0.0, smooth, 1e3), Tier.A, ""))
    made = study(case, STEPS, model, order)
    found = split(case, truth, made.runs[0], made)
    assert not found.missing
    assert f"Order {order:.2f}" in found.says
    assert found.largest["step"] == pytest.approx(2.0 * STEPS[0] ** order, rel=0.02)
    assert found.largest["model"] == pytest.approx(model * case.t_end**2, rel=0.02, abs=found.known["model"])
    whole = next(row.value for row in judged(case, [Entry(engine="x", profile="", run=made.runs[0])], truth, "")
                 if row.metric == "position")  # fmt: skip
    assert sum(found.there.values()) == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_differences_of_which_some_are_no_power_of_the_step_tell_no_order(seed: int) -> None:
    """However fast they fall: up to three tenths of them may be other than those of the next pair, times one factor."""
    rng = np.random.default_rng(seed)
    fall, last = rng.uniform(2.0, 16.0), rng.normal(size=(50, 2))
    aside = rng.normal(size=last.shape)
    aside -= last * np.sum(aside * last) / np.sum(last * last)
    aside *= fall * np.linalg.norm(last) / np.linalg.norm(aside)
    for other, told in ((0.2, True), (0.6, False), (3.0, False)):
        errors = [fall * last + other * aside + last, last, np.zeros_like(last)]
        if told:
            assert observed(errors, STEPS)[0] == pytest.approx(fall, rel=1e-9)
        else:
            with pytest.raises(NotMeasuredError, match="No order"):
                observed(errors, STEPS)


def test_a_limit_is_known_to_what_it_is_off_by(case: Case) -> None:
    """Over random mixtures of two orders, the converged motion is no farther from the right one than is said."""
    rng = np.random.default_rng(1)
    truth = from_run(wave(case, 1e-3, 0.0, smooth, 1e3), Tier.A, "")
    for _ in range(30):
        order, more, model = rng.integers(1, 5), 10.0 ** rng.uniform(-2, 1), 10.0 ** rng.uniform(-6, -2)
        runs = []
        for dt in STEPS:
            run = wave(case, dt, model, smooth, float(order))
            extra = more * dt ** (order + 1.0) * np.stack([np.sin(run.t), np.cos(4.0 * run.t)], axis=1)
            runs.append(replace(run, q=run.q + extra))
        made = Study(setting="dt", sizes=tuple(STEPS), runs=tuple(runs))
        found = split(case, truth, runs[0], made)
        if found.missing:
            continue
        right = model * case.t_end**2
        assert abs(found.largest["model"] - right) <= found.known["model"] + 1e-4 * right


@pytest.mark.parametrize("seed", range(20))
def test_the_limit_of_a_power_of_the_step_is_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limit, power, ratio = rng.normal(size=(5, 2)), rng.normal(size=(5, 2)), rng.uniform(LEAST_RATIO, 20.0)
    found, known = extrapolated([limit + ratio**k * power for k in (2, 1, 0)], ratio)
    np.testing.assert_allclose(found, limit, rtol=0.0, atol=1e-11)
    assert known < 1e-10


def test_without_an_order_nothing_is_extrapolated(case: Case) -> None:
    rng = np.random.default_rng(2)
    truth = from_run(wave(case, 1e-3, 0.0, smooth, 1e3), Tier.A, "")
    made = study(case, STEPS, 1e-3, 0.0, lambda t: 1e-3 * rng.normal(size=(len(t), 2)))
    entry = Entry(engine="x", profile="chatters", run=made.runs[0], study=made, settings={"dt": STEPS[0]})
    rows = {row.metric: row for row in judged(case, [entry], truth, "again")}
    for part in ("model", "step"):
        row = rows[f"position ({part})"]
        assert np.isnan(row.value)
        assert row.verdict is Word.INFO
        assert row.why.startswith("Not measured. No order between steps of 0.02, 0.01, 0.005 s")
        assert row.command.startswith("again --engine x:chatters")
        assert f"largest position ({part})" not in rows


@pytest.mark.parametrize("seed", range(10))
def test_an_error_that_falls_without_an_order_is_told_to_what_its_differences_sum_to(case: Case, seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = from_run(wave(case, 1e-3, 0.0, smooth, 1e3), Tier.A, "")
    steps = [0.02 / 2**k for k in range(5)]

    def uneven(t: Any) -> Any:
        return np.sin(np.outer(t, rng.uniform(5.0, 50.0, 2)) + rng.uniform(0.0, 6.0, 2))

    made = study(case, steps, 1e-3, 1.0, uneven)
    found = split(case, truth, made.runs[0], made)
    sizes = [np.abs(one.q[:: len(one.t) // 100] - other.q[:: len(other.t) // 100]).max()
             for one, other in pairwise(made.runs)]  # fmt: skip
    if found.missing:
        assert min(one / other for one, other in pairwise(sizes)) < 1.6
        return
    assert "No order" in found.says
    assert "sum to" in found.says
    most = 1.5 * steps[0] / LEAST_RATIO**3 / (LEAST_RATIO - 1.0)  # of differences by waves of size 1
    assert abs(found.largest["model"] - 1e-3 * case.t_end**2) <= found.known["model"] <= most


@pytest.mark.parametrize("order", [0.7, 1.0, 2.0])
@pytest.mark.parametrize("runs", [5, 7, 9])
def test_what_events_on_the_grid_of_a_step_leave_is_no_more_than_what_is_said(order: float, runs: int) -> None:
    """Errors are a power of the step, and as much again that each step draws for itself, of 2 to 20 coordinates."""
    rng, told = np.random.default_rng(runs), 0
    for _ in range(300):
        limit, smooth_, drawn = rng.normal(size=(3, 1, rng.integers(2, 21)))
        steps = 0.5 ** np.arange(runs)
        errors = [limit + h**order * (smooth_ + drawn * rng.uniform(size=limit.shape)) for h in steps]
        if np.isfinite(rest := remaining(errors)):
            told += 1
            assert np.abs(errors[-1] - limit).max() <= rest
    assert told > 200


@pytest.mark.parametrize("runs", [3, 5, 9])
def test_what_grows_or_stays_has_no_sum(runs: int) -> None:
    for ratio in (1.0, 0.7, 1.4):
        assert np.isnan(remaining([np.array([[ratio**-k]]) * (-1.0) ** k for k in range(runs)]))


@pytest.mark.parametrize(("seconds", "most"), [(0.5, 3), (1e3, 9)])
def test_steps_are_halved_until_the_parts_are_settled_or_there_is_no_time(
    case: Case, seconds: float, most: int
) -> None:
    """Of an engine whose events stand on the grid of its step."""
    rng, truth = np.random.default_rng(4), from_run(wave(case, 1e-3, 0.0, smooth, 1e3), Tier.A, "")

    def at(dt: float) -> Trajectory:
        return wave(case, dt, 1e-2, lambda t: np.sin(np.outer(t, rng.uniform(5.0, 50.0, 2))), 1.0)

    runs = tuple(at(dt) for dt in STEPS)
    few = Study(setting="dt", sizes=tuple(STEPS), runs=runs)
    found = refined._further(case, truth, runs[0], few, at, 1e-3, seconds)
    assert found.sizes == tuple(STEPS[0] / 2**k for k in range(len(found.sizes)))
    assert len(found.runs) == len(found.sizes)
    assert (len(found.sizes) == 3) == (seconds < 1.0)
    if seconds > 1.0:
        laid = Positions(case, truth, truth.compared(runs[0]))
        assert settled(laid, found)
        assert not settled(laid, replace(found, sizes=found.sizes[:-1], runs=found.runs[:-1]))
        told = split(case, truth, runs[0], found)
        assert abs(told.largest["model"] - 1e-2 * case.t_end**2) <= told.known["model"]


def test_what_differs_by_rounding_alone_has_no_order_and_is_converged(case: Case) -> None:
    truth = from_run(wave(case, 1e-3, 0.0, smooth, 1e3), Tier.A, "")
    rng = np.random.default_rng(3)
    made = study(case, STEPS, 1e-4, 0.0, lambda t: 1e-13 * np.sin(np.outer(t, rng.uniform(100.0, 500.0, 2))))
    found = split(case, truth, made.runs[0], made)
    assert "rounding" in found.says
    assert found.largest["step"] < found.known["step"] < 1e-11
    assert found.largest["model"] == pytest.approx(4e-4, rel=1e-6)


def cubic(case: Case, t: Any, made: Any) -> Trajectory:
    """The truth (cos 3 t, sin 3 t) and an error that is a cubic of t (4, 2), with the rates of both."""
    powers = np.stack([t**k for k in range(4)], axis=1)
    rates = np.stack([k * t ** max(k - 1, 0) for k in range(4)], axis=1)
    exact, turned = np.stack([np.cos(3.0 * t), np.sin(3.0 * t)], axis=1), np.array([-3.0, 3.0])
    return motion(exact + powers @ made, t, turned * exact[:, ::-1] + rates @ made)


@pytest.mark.parametrize("seed", range(5))
def test_an_error_that_is_a_cubic_is_laid_exactly_between_samples(case: Case, seed: int) -> None:
    """A Hermite cubic of each step is the cubic itself, wherever the samples of either run stand."""
    rng = np.random.default_rng(seed)
    own, other = (np.sort([0.0, *rng.uniform(0.0, 2.0, n), 2.0]) for n in (150, 12))
    made = 1e-3 * rng.normal(size=(4, 2))
    right = cubic(case, own, 0.0 * made)
    truth = replace(from_run(right, Tier.A, "made up"), at=lambda t: cubic(case, t, 0.0 * made))
    whole = Positions(case, truth, right)
    error = np.stack([whole.t**k for k in range(4)], axis=1) @ made
    assert whole(cubic(case, other, made)) == pytest.approx(error / whole.scale, abs=1e-12)


@pytest.mark.parametrize("stretch", [0.8, 1.25])
def test_a_run_whose_clock_alone_is_another_has_no_error_between_its_samples(stretch: float) -> None:
    """Its rates are those of its own clock."""
    ball = cases.load("bouncing_ball", "linear", t_end=1.0)
    assert ball.closed_form is not None
    truth = replace(from_run(ball.closed_form(np.linspace(0.0, 1.0, 301)), Tier.A, "exact"), at=ball.closed_form)
    few = ball.closed_form(np.linspace(0.0, 1.0, 12))
    last = max(event.t for event in few.events if event.before == Mode.FREE)

    def when(t: Any) -> Any:
        return stretch * np.minimum(t, last) + np.maximum(t - last, 0.0)

    v = np.where(few.t[:, None] <= last, few.v / stretch, few.v)
    events = tuple(replace(event, t=float(when(event.t))) for event in few.events)
    whole = Positions(ball, truth, truth.trajectory)
    falls = whole.t <= few.t[few.t < np.sqrt(2.0 / 9.81)].max()
    assert np.abs(whole(replace(few, t=when(few.t), v=v, events=events))[falls]).max() < 1e-9


@pytest.mark.parametrize("late", [0.95, 1.0, 1.05])
def test_parts_of_a_run_with_another_clock_are_those_of_what_is_compared(late: float) -> None:
    """It is compared up to where the truth is trusted, by its own clock: parts add up to its error until then."""
    ball = cases.load("bouncing_ball", "linear", t_end=1.0)
    assert ball.closed_form is not None
    truth = replace(
        from_run(ball.closed_form(np.linspace(0.0, 1.0, 301)), Tier.A, "exact"), at=ball.closed_form, trusted=0.7
    )
    exact = truth.trajectory
    run = replace(
        exact, t=late * exact.t, q=exact.q + 0.01 * exact.t[:, None],
        events=tuple(replace(event, t=late * event.t) for event in exact.events),
    )  # fmt: skip
    whole = metrics.load("position").measure(truth, truth.compared(run), ball)
    found = splits(ball, truth, run, Study(), own=replace(truth))["position"]
    assert sum(found.there.values()) == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_parts_are_compared_up_to_where_the_clocks_of_all_runs_end(seed: int) -> None:
    """A run that touches late ends before the horizon by the truth's clock, though it goes as far as any other."""
    ball = cases.load("bouncing_ball", "linear", t_end=1.0)
    assert ball.closed_form is not None
    truth = replace(from_run(ball.closed_form(np.linspace(0.0, 1.0, 301)), Tier.A, "exact"), at=ball.closed_form)
    draw = np.random.default_rng(seed)
    lates = draw.uniform(-0.02, 0.02) + draw.choice([-1.0, 1.0]) * 0.1 * np.array([0.4, 0.2, 0.1])

    def late(by: float) -> Trajectory:
        exact = ball.closed_form(np.linspace(0.0, 1.0 / (1.0 + by), 301))  # type: ignore[misc]
        events = tuple(replace(event, t=(1.0 + by) * event.t) for event in exact.events)
        return replace(exact, t=(1.0 + by) * exact.t, q=exact.q + 0.01 * by * exact.t[:, None], events=events)

    runs = tuple(map(late, lates))
    for one in runs:
        found = splits(ball, truth, one, Study(setting="dt", sizes=(0.4, 0.2, 0.1), runs=runs))["position"]
        assert not found.missing
        assert {"model", "step"} <= found.there.keys()


def test_a_run_of_a_study_that_stops_early_tells_no_parts(case: Case) -> None:
    truth, made = from_run(wave(case, 0.005, 0.0, smooth, 1.0), Tier.A, ""), study(case, STEPS, 1e-4, 1.0)
    short = taken(made.runs[1], np.flatnonzero(made.runs[1].t <= 1.0))
    found = split(case, truth, made.runs[0], replace(made, runs=(made.runs[0], short, made.runs[2])))
    assert "ends too early, at t = 1 s" in found.missing["step"]


def test_without_the_instant_of_one_event_there_are_no_parts_of_their_errors() -> None:
    ball = cases.load("bouncing_ball", "linear", t_end=1.0)
    assert ball.closed_form is not None
    truth = replace(from_run(ball.closed_form(np.linspace(0.0, 1.0, 301)), Tier.A, "exact"), at=ball.closed_form)
    run = truth.trajectory
    assert Events(ball, truth, run).whole.size
    for k in range(len(run.events)):
        if Mode.FREE in (run.events[k].before, run.events[k].after) and run.events[k].before != Mode.BALLISTIC:
            lost = (*run.events[:k], replace(run.events[k], t=np.nan), *run.events[k + 1 :])
            assert not Events(ball, truth, replace(run, events=lost)).whole.size, k


def bouncing(touches: Sequence[float]) -> Trajectory:
    """A motion that touches for a hundredth of a second at some instants."""
    t = np.sort([0.0, 1.0, *touches, *(touch + 0.01 for touch in touches)])
    wide = np.zeros((len(t), 1))
    events = (
        Event(t=touch + late, contact=0, before=before, after=after)
        for touch in touches
        for late, before, after in ((0.0, Mode.FREE, Mode.CONTACT), (0.01, Mode.CONTACT, Mode.FREE))
    )
    return Trajectory(t=t, q=wide, v=wide, gap=wide, lam=wide, energy=np.zeros((len(t), 2)),
                      mode=wide.astype(np.int8), events=tuple(events))  # fmt: skip


def test_instants_that_runs_share_with_others_of_the_truth_are_no_parts_of_an_error() -> None:
    """As many they may be: by how far they are apart nothing is off."""
    ball = cases.load("bouncing_ball", "linear", t_end=1.0)
    truth = from_run(bouncing([0.2, 0.5, 0.8]), Tier.A, "made up")
    events = Events(ball, truth, bouncing([0.21, 0.51]))
    assert events.whole[:2].ravel() == pytest.approx([0.01, 0.01])
    assert events(bouncing([0.2, 0.5])).ravel() == pytest.approx(0.0)
    with pytest.raises(NotMeasuredError):
        events(bouncing([0.2, 0.8]))
    own = from_run(bouncing([0.2, 0.49, 0.8]), Tier.A, "made up")
    assert events.against(own).ravel() == pytest.approx([0.01, 0.02, 0.01, 0.02])


def test_what_a_run_touches_behind_the_time_to_which_its_truth_is_known_is_no_event_of_it() -> None:
    """Runs of a study end there, or go on: the same engine had other events than itself."""
    ball = cases.load("bouncing_ball", "linear", t_end=1.0)
    truth = replace(from_run(bouncing([0.2, 0.5]), Tier.A, "made up"), trusted=0.55)
    short, long = bouncing([0.21]), bouncing([0.21, 0.9])
    assert np.array_equal(Events(ball, truth, long)(short), Events(ball, truth, short).whole)


def test_turns_are_told_by_their_vectors() -> None:
    """A body that turns too fast about one axis by its model and about another by its step."""
    from crossbody.cases.scene import Body, Joint, Scene

    body = Body(name="b", mass=1.0, com=(0.0,) * 3, inertia=(1.0,) * 3 + (0.0,) * 3)
    scene = Scene(bodies=(body,), joints=(Joint(name="j", body="b", type="ball"),))
    case = cases.from_scene(scene, t_end=1.0)

    def turning(dt: float, off: float, step: float) -> Trajectory:
        t = np.linspace(0.0, 1.0, round(1.0 / dt) + 1)
        w = np.stack([1.0 + 0.0 * t, off * t, step * dt * t], axis=1) * t[:, None]
        angle = np.linalg.norm(w, axis=1, keepdims=True)
        axis = w / np.where(angle > 0.0, angle, 1.0)
        return motion(np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * axis], axis=1), t, w)

    truth = from_run(turning(1e-3, 0.0, 0.0), Tier.A, "")
    runs = tuple(turning(dt, 1e-3, 0.2) for dt in STEPS)
    found = split(case, truth, runs[0], Study(setting="dt", sizes=tuple(STEPS), runs=runs))
    sine = 2.0 * np.sin(0.5)  # of a small change across the axis of a turn by 1 rad
    assert found.largest["model"] == pytest.approx(1e-3 * sine, rel=0.02)
    assert found.largest["step"] == pytest.approx(0.2 * STEPS[0] * sine, rel=0.02)


SOFT = """
<mujoco><option timestep="0.002"/><worldbody><body name="rod" pos="0 0 1"><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1" contype="0" conaffinity="0"/>
<body name="tip" pos=".3 0 0"><joint name="slide" type="slide" axis="0 0 1"/>
<geom type="sphere" size=".03" mass=".5" contype="0" conaffinity="0"/></body></body></worldbody>
<equality><joint joint1="slide" solref="{solref}"/></equality></mujoco>
"""


def rows_of(path: str, **settings: Any) -> dict[str, Verdict]:
    case = cases.load(path, t_end=0.5)
    result = jobs.run_case(case, choice.picks(["mujoco:as_is"]), settings=settings)
    return {row.metric: row for row in judged(case, result.entries, result.truth, "crossbody run")}


@pytest.mark.parametrize("solref", [".02 1", ".002 1"])
def test_softness_is_an_error_of_the_model_at_any_step(tmp_path: Path, solref: str) -> None:
    """The time constant that MuJoCo raises to two steps is raised to two of the file's, whatever the step."""
    path = tmp_path / "soft.xml"
    path.write_text(SOFT.format(solref=solref), encoding="utf-8")
    one, two = rows_of(str(path)), rows_of(str(path), dt=0.0005)
    for rows in (one, two):
        parts = [rows[f"position ({part})"] for part in ("importer", "model", "step")]
        assert sum(part.value for part in parts) == pytest.approx(rows["position"].value, rel=1e-9)
        assert abs(parts[0].value) < parts[0].known
        assert not {Word.OUTSIDE, Word.EXPECTED} & {row.verdict for row in rows.values()}, "softness is told"
    models = [rows["largest position (model)"] for rows in (one, two)]
    assert abs(models[0].value - models[1].value) <= models[0].known + models[1].known
    assert models[0].value > 10.0 * models[0].known
    steps = [rows["largest position (step)"].value for rows in (one, two)]
    assert steps[0] / steps[1] == pytest.approx(4.0, rel=0.15)


@pytest.fixture(scope="module")
def ball() -> tuple[Case, Any]:
    case = cases.load("bouncing_ball", "linear")
    return case, jobs.run_case(case, choice.picks(["mujoco:matched"]))


@pytest.mark.parametrize(
    ("metric", "factor", "told"),
    [("position", 0.5, True), ("position", 2.0, True), ("event_times", 0.5, True), ("event_times", 2.0, False)],
)
def test_parts_that_are_not_the_whole_error_are_outside(
    ball: tuple[Case, Any], monkeypatch: pytest.MonkeyPatch, metric: str, factor: float, told: bool
) -> None:
    """But those of instants may be more than what slow guards leave of it."""

    def off(*given: Any) -> dict[str, Split]:
        found = splits(*given)
        there = {part: factor * value for part, value in found[metric].there.items()}
        return {**found, metric: replace(found[metric], there=there)}

    case, result = ball
    monkeypatch.setattr(run_verdicts, "splits", off)
    rows = {row.metric: row for row in judged(case, result.entries, result.truth, "crossbody run")}
    outside = {name for name, row in rows.items() if row.verdict is Word.OUTSIDE}
    assert outside == ({f"{metric} (parts)"} if told else set())


def test_another_mass_is_an_error_of_the_importer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A reader that takes one body for heavier than it is: its share does not shrink with the step."""
    from crossbody.engines.mujoco import _model

    own = _model._from_file

    def wrong(case: Case) -> Any:
        model = own(case)
        model.body_mass[2] *= 1.5
        return model

    path = tmp_path / "soft.xml"
    path.write_text(SOFT.format(solref="-1e4 -200"), encoding="utf-8")
    case = cases.load(str(path), t_end=0.5)
    right = jobs.run_case(case, choice.picks(["mujoco:as_is"]))
    monkeypatch.setattr(_model, "_from_file", wrong)
    run = engines.load("mujoco").prepare(case, "as_is").run()
    assert right.entries[0].study is not None
    found = splits(case, right.truth, run, right.entries[0].study)["position"]
    before = splits(case, right.truth, right.entries[0].run, right.entries[0].study)["position"]
    assert found.largest["importer"] > 1e-2
    words = {
        (row.engine, row.metric): row.verdict
        for entry in right.entries
        for row in judged(case, [replace(entry, run=run)], right.truth, "crossbody run")
    }
    assert words["mujoco", "largest position (importer)"] == Word.OUTSIDE
    assert words["mujoco", "position"] == Word.INFO
    assert before.largest["importer"] < before.known["importer"]
    for part in ("model", "step"):
        assert found.largest[part] == pytest.approx(before.largest[part], rel=1e-6)


BOUNCING = """
<mujoco><option timestep="0.001"/><default><geom condim="1"/></default><worldbody>
<geom type="plane" size="2 2 .1" solref=".01 1"/>
<body pos="0 0 .5"><freejoint/><geom name="solid" type="sphere" size=".1" mass="1"/></body>
<body pos=".5 0 .5"><freejoint/><geom type="box" size=".1 .1 .1" euler="20 30 0" mass="1" priority="1"
solref=".03 .5" solimp=".8 .9 .01"/></body></worldbody></mujoco>
"""


def test_contacts_of_the_scene_are_as_soft_as_those_of_its_file(tmp_path: Path) -> None:
    """Constants that are mixed, or ruled by priority, reach the model that is built from the scene."""
    path = tmp_path / "bouncing.xml"
    path.write_text(BOUNCING, encoding="utf-8")
    case, engine = cases.load(str(path), t_end=0.6), engines.load("mujoco")
    own, built = (engine.prepare(case, "as_is", reader=reader).run() for reader in ("file", "scene"))
    assert len(own.events) == len(built.events) > 0
    assert np.abs(own.q - built.q).max() < 1e-12


def test_a_published_biped_is_soft_by_its_file_and_converges_where_it_is_stiff() -> None:
    """Its equalities take it 4.6e-3 rad off the rigid motion at every step; stiff, Euler's error is g dt t / 2.

    Started where its keyframe stands, off its own loops, it is 4.2e-2 away at the end (the root of the sum of squares).
    """
    if not BIPED.is_file():
        pytest.skip(f"The robot's file {BIPED} is not here.")
    case = cases.load(str(BIPED), "home", t_end=0.5, without="friction,contacts", assemble=True)
    times = np.linspace(0.0, case.t_end, 51)
    rigid = engines.load("reference").prepare(case, "compiled", rtol=1e-10, samples=times).run()

    def off(dt: float, how: str) -> Any:
        """Differences to the rigid motion (instants, coordinates)."""
        scene: Any = engines.load("mujoco").prepare(case, "as_is", dt=dt)
        model, data = scene.scene.model, scene.scene.data
        if how == "stiff":
            model.eq_solimp[:, :2] = MAX_IMPEDANCE
            without_regularisation(model)
        scene.scene.start()
        if how == "keyframe":
            data.qpos[:] = model.key_qpos[0]
        model.opt.timestep, found = dt, []
        for q in rigid.q[1:]:
            mujoco.mj_step(model, data, nstep=round(0.01 / dt))
            found.append(data.qpos - q)
        return np.array(found)

    soft, stiff = ({dt: np.abs(off(dt, how)).max() for dt in (1e-3, 1e-4, 2e-5)} for how in ("soft", "stiff"))
    start = {dt: np.linalg.norm(off(dt, "keyframe")[-1]) for dt in (1e-3, 1e-4)}
    print(f"\nsoft {soft}\nstiff {stiff}\nfrom the keyframe {start}")
    assert soft[1e-4] == pytest.approx(soft[2e-5], rel=0.01)
    assert soft[2e-5] == pytest.approx(4.6e-3, rel=0.05)
    assert start[1e-3] == pytest.approx(start[1e-4], rel=0.01)
    assert start[1e-4] == pytest.approx(4.15e-2, rel=0.02)
    for dt, error in stiff.items():
        assert error == pytest.approx(9.81 * dt * case.t_end / 2.0, rel=0.05)


def test_a_study_that_would_take_too_long_is_left_out_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    rod = Scene(
        bodies=(Body(name="rod", mass=1.0, com=(0.0, 0.0, -0.5), inertia=(0.1, 0.1, 0.01, 0.0, 0.0, 0.0)),),
        joints=(Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0)),),
    )
    pick, swing = choice.Pick(engine="mujoco", profile="matched"), case_of(rod, q0=[1.0], t_end=0.1)
    told = [jobs.run_case(swing, [pick], truth=None).entries[0].study]
    monkeypatch.setattr(refined, "OF_STUDIES", 0.0)
    told.append(jobs.run_case(swing, [pick], truth=None).entries[0].study)
    assert [study is not None and len(study.runs) > 1 for study in told] == [True, False]
    assert told[1] is not None
    assert "The runs with other dt that are needed would take about" in told[1].why


def test_a_study_has_as_many_steps_as_there_is_time_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refined, "_cost", lambda setting, sizes, size, once: float(len(sizes)))
    rod = Scene(
        bodies=(Body(name="rod", mass=1.0, com=(0.0, 0.0, -0.5), inertia=(0.1, 0.1, 0.01, 0.0, 0.0, 0.0)),),
        joints=(Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0)),),
    )
    pick, swing = choice.Pick(engine="mujoco", profile="matched"), case_of(rod, q0=[1.0], t_end=0.1)
    for seconds, count in ((10.0, 6), (4.5, 4), (3.0, 3), (2.9, 0)):
        monkeypatch.setattr(refined, "OF_STUDIES", seconds / BUDGET)
        told = jobs.run_case(swing, [pick], truth=None).entries[0].study
        assert told is not None
        assert len(told.runs) == count
