"""A fault at one sample, or of one size everywhere, is a number that is known beforehand, in every metric."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from crossbody.cases import Case, Event, Mode, Tier, Trajectory, load
from crossbody.cases._delta import pose
from crossbody.reports import metrics
from crossbody.reports.judging.truth import Truth, from_run, sample_times
from crossbody.reports.metrics._align import matched
from crossbody.reports.metrics._contacts import contacts

OFF = 1e-3
Fault = Callable[[Trajectory, int, Trajectory], tuple[Trajectory, float]]
"""(run, sample, truth) -> the run with a fault there, and what the metric must say."""


def exact(case: Case) -> Truth:
    """The closed form, sampled; nothing is integrated."""
    motion = case.closed_form
    assert motion is not None
    times = sample_times(motion(np.zeros(1)), case.t_end, grid=801, inside=21)
    return replace(from_run(motion(times), Tier.A, "closed form"), at=motion)


@pytest.fixture(scope="module")
def ball() -> tuple[Case, Truth]:
    case = load("bouncing_ball", "linear")
    return case, exact(case)


def measure(name: str, case: Case, truth: Truth, run: Trajectory) -> float:
    value = metrics.load(name).measure(truth, run, case)
    assert value is not None
    return value


def bumped(name: str, column: int = 0, scale: Callable[[Trajectory], float] = lambda run: 1.0) -> Fault:
    def fault(run: Trajectory, k: int, truth: Trajectory) -> tuple[Trajectory, float]:
        values = getattr(run, name).copy()
        values[k, column] += OFF
        return replace(run, **{name: values}), OFF / scale(truth)

    return fault


def booked(name: str, sign: float) -> Fault:
    """A fault in one account of the ledger."""

    def fault(run: Trajectory, k: int, truth: Trajectory) -> tuple[Trajectory, float]:
        assert run.ledger is not None
        account = getattr(run.ledger, name).copy()
        account[k] += sign * OFF
        return replace(run, ledger=replace(run.ledger, **{name: account})), OFF / truth.energy[:, 0].max()

    return fault


def pulsed(run: Trajectory, k: int, _truth: Trajectory) -> tuple[Trajectory, float]:
    """A pulse that is taken back at once: its impulse is wrong at one sample alone."""
    lam, dt = run.lam.copy(), np.diff(run.t)
    assert dt[k - 1 : k + 3].min() > 0.0
    lam[k, 0] += OFF
    lam[k + 1, 0] -= OFF * (dt[k - 1] + dt[k]) / (dt[k] + dt[k + 1])
    total = np.sum(0.5 * dt * (run.lam[1:, 0] + run.lam[:-1, 0]))
    # Half of the way to the next sample belongs to the second pulse.
    first = 0.5 * dt[k - 1] * OFF
    second = first + 0.5 * dt[k] * (OFF + lam[k + 1, 0] - run.lam[k + 1, 0])
    return replace(run, lam=lam), max(abs(first), abs(second)) / total


def pulling(run: Trajectory, k: int, _truth: Trajectory) -> tuple[Trajectory, float]:
    """A row that is closed pulls."""
    lam, mode = run.lam.copy(), run.mode.copy()
    lam[k, 0], mode[k, 0] = -OFF * lam.max(), Mode.CONTACT
    return replace(run, lam=lam, mode=mode), OFF


def pressing(run: Trajectory, k: int, _truth: Trajectory) -> tuple[Trajectory, float]:
    """A row that is open pushes."""
    lam, mode = run.lam.copy(), run.mode.copy()
    lam[k, 0], mode[k, 0] = OFF * lam.max(), Mode.FREE
    return replace(run, lam=lam, mode=mode), OFF


def begun(name: str) -> Fault:
    """A start beside the case's."""

    def fault(run: Trajectory, k: int, truth: Trajectory) -> tuple[Trajectory, float]:
        return bumped(name, scale=lambda motion: np.abs(getattr(motion, name)).max())(run, 0, truth)

    return fault


AT_ONE: dict[str, Fault] = {
    "position": bumped("q", scale=lambda run: np.abs(run.q).max()),
    "velocity": bumped("v", scale=lambda run: np.abs(run.v).max()),
    "gap_error": bumped("gap", scale=lambda run: np.abs(run.gap).max()),
    "energy_drift": bumped("energy", 1, scale=lambda run: run.energy[:, 0].max()),
    "energy_integrator": booked("input", 1.0),
    "lam_impulse_path": pulsed,
    "complementarity": pulling,
    "complementarity of an open row": pressing,
    "start_error": begun("q"),
    "start_error in velocity": begun("v"),
}


@pytest.mark.parametrize("name", AT_ONE)
@pytest.mark.parametrize("place", [0.1, 0.5, 0.9])
def test_a_fault_at_one_sample_counts_in_full(name: str, place: float, ball: tuple[Case, Truth]) -> None:
    case, truth = ball
    times = case.t_end * np.linspace(0.0, 1.0, 2001)
    run = truth.at(times)
    run, wanted = AT_ONE[name](run, int(place * len(run.t)), truth.trajectory)
    metric = name.split()[0]
    value, floor = measure(metric, case, truth, run), measure(metric, case, truth, truth.at(times))
    assert value == pytest.approx(wanted, rel=1e-6, abs=2.0 * floor)
    assert wanted > 10.0 * floor


@pytest.mark.parametrize("account", ["dissipated", "contact"])
def test_every_account_counts(account: str, ball: tuple[Case, Truth]) -> None:
    case, truth = ball
    run, wanted = booked(account, 1.0)(truth.trajectory, 300, truth.trajectory)
    assert measure("energy_integrator", case, truth, run) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("after", [Mode.CONTACT, Mode.BALLISTIC])
def test_one_late_touch_or_release_counts_in_full(after: Mode, ball: tuple[Case, Truth]) -> None:
    case, truth = ball
    events = list(truth.trajectory.events)
    k = [i for i, event in enumerate(events) if event.after is after][1]
    events[k] = replace(events[k], t=events[k].t + 1e-5)
    run = replace(truth.trajectory, events=tuple(events))
    assert measure("event_times", case, truth, run) == pytest.approx(1e-5, rel=1e-6)


def test_an_event_without_an_instant_is_no_number(ball: tuple[Case, Truth]) -> None:
    case, truth = ball
    events = truth.trajectory.events
    for k in range(len(events)):
        lost = replace(truth.trajectory, events=(*events[:k], replace(events[k], t=np.nan), *events[k + 1 :]))
        assert np.isnan(measure("event_times", case, truth, lost))


@pytest.mark.parametrize("place", [0.1, 0.5, 0.9])
def test_every_sample_and_every_event_counts_in_the_residual_of_the_modes(
    place: float, ball: tuple[Case, Truth]
) -> None:
    case, truth = ball
    run = truth.trajectory
    mode, events = run.mode.copy(), run.events
    k, j = int(place * len(run.t)), int(place * len(events))
    mode[k] = Mode.COLLISION
    assert measure("mode_residual", case, truth, run) == 0.0
    assert measure("mode_residual", case, truth, replace(run, mode=mode)) == 1.0
    assert measure("mode_residual", case, truth, replace(run, events=(*events[:j], *events[j + 1 :]))) >= 1.0
    assert measure("mode_residual", case, truth, replace(run, events=events[::-1])) >= 1.0
    other = replace(events[j], before=Mode.COLLISION)
    assert measure("mode_residual", case, truth, replace(run, events=(*events[:j], other, *events[j + 1 :]))) == 1.0


@pytest.mark.parametrize(("name", "left"), [("touch_count", Mode.CONTACT), ("release_count", Mode.BALLISTIC)])
def test_a_contact_less_is_counted(name: str, left: Mode, ball: tuple[Case, Truth]) -> None:
    case, truth = ball
    events = truth.trajectory.events
    last = max(i for i, event in enumerate(events) if event.after is left)
    kept = (*events[:last], *events[last + 1 :]) if left is Mode.BALLISTIC else events[:last]
    assert measure(name, case, truth, replace(truth.trajectory, events=kept)) == -1.0


@pytest.mark.parametrize("factor", [0.5, 1.0 + 1e-4, 2.0])
def test_a_factor_on_every_force_is_the_residual_of_the_law(factor: float, ball: tuple[Case, Truth]) -> None:
    case, truth = ball
    run = replace(truth.trajectory, lam=factor * truth.trajectory.lam)
    assert measure("law_residual", case, truth, run) == pytest.approx(abs(factor - 1.0), rel=1e-6)


@pytest.mark.parametrize("factor", [0.9, 1.01, 1.1])
def test_a_factor_on_every_velocity_is_the_residual_of_the_rates(factor: float, ball: tuple[Case, Truth]) -> None:
    case, truth = ball
    run = truth.at(np.linspace(0.0, 0.4, 401))  # the first fall, on which the trapezoidal rule is exact
    run = replace(run, v=factor * run.v)
    assert measure("rate_residual", case, truth, run) == pytest.approx(abs(factor - 1.0), rel=1e-9)


@pytest.mark.parametrize("k", [3, 100, -1])
def test_the_largest_gap_of_a_closure_is_its_drift(k: int) -> None:
    case = load("bouncing_ball", "bilateral", a2=0.0)
    truth = exact(case)
    gap = 0.0 * truth.trajectory.gap
    gap[k] = -OFF
    assert measure("constraint_drift", case, truth, replace(truth.trajectory, gap=gap)) == OFF


@pytest.mark.parametrize("ball_", [0, 2, 4])
def test_momentum_that_appears_at_one_sample_counts(ball_: int) -> None:
    case = load("newtons_cradle", "sliders")
    truth = exact(case)
    v = truth.trajectory.v.copy()
    before = measure("momentum", case, truth, truth.trajectory)
    v[len(v) // 2, ball_] += OFF * np.abs(v[0]).sum()  # equal masses
    assert before < 1e-14
    assert measure("momentum", case, truth, replace(truth.trajectory, v=v)) == pytest.approx(OFF, rel=1e-9)


def test_the_flange_is_held_against_its_path_once_it_has_settled() -> None:
    from crossbody.reference.delta import scene

    case = load("delta_tracking", "circle")
    path, t = scene.path_of(case.parameters), np.linspace(0.0, case.t_end, 61)
    assert path is not None
    p = {name: float(x) for name, x in case.parameters.items() if not isinstance(x, str)}
    on = path(t)[0]

    def run(k: int | None) -> Trajectory:
        way = on.copy()
        if k is not None:
            way[k, 2] += OFF
        q, nothing = np.array([pose.pose(p, z) for z in way]), np.zeros((len(t), 6))
        energy, mode = np.zeros((len(t), 2)), nothing.astype(np.int8)
        return Trajectory(t=t, q=q, v=0.0 * q, gap=nothing, lam=nothing, energy=energy, mode=mode)

    truth = from_run(run(None), Tier.D, "the path")
    found = [measure("tracking_error", case, truth, run(k)) for k in (None, 5, 45, 60)]
    assert found == pytest.approx([0.0, 0.0, OFF, OFF], abs=1e-9)


def test_a_touch_of_another_row_ends_the_matching() -> None:
    case = load("newtons_cradle", "sliders")
    truth = exact(case)
    first, second = contacts(truth.trajectory)[:2]
    swapped = {first.row: second.row, second.row: first.row}
    events = tuple(replace(e, contact=swapped.get(e.contact, e.contact)) for e in truth.trajectory.events)
    assert isinstance(events[0], Event)
    assert matched(truth, replace(truth.trajectory, events=events)) == []
