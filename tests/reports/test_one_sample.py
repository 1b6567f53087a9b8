"""An error at one place, of a size that is known beforehand, is the number that every metric says."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from known_errors import ERRORS, OFF, account, booked, changed, right, scene
from known_values import VALUES
from scipy.spatial.transform import Rotation

from crossbody import cases
from crossbody.cases import Case, Event, Inputs, Mode, Switch, Tier, Trajectory, load
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import contacts
from crossbody.cases.defaults import limits_of
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.parameters import of_numbers
from crossbody.reports import metrics
from crossbody.reports.measuring.alignment import matched
from crossbody.reports.measuring.impulse import with_collisions
from crossbody.reports.measuring.truth import Truth, from_run
from crossbody.reports.metrics import event_gap
from crossbody.reports.sweep.measure import residual

SEEDS = range(8)
"""Draws of sample, row, component and sign, and of which event."""


def measure(name: str, case: Case, truth: Truth | None, run: Trajectory) -> float:
    value = metrics.of(case)[name].measure(truth, run, case)
    assert value is not None
    return value


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_at_one_place_is_what_the_metric_says(name: str) -> None:
    which, known = ERRORS[name]
    metric = name.split()[0]
    case, truth = right(which)
    floor = abs(measure(metric, case, truth, truth.trajectory))
    for seed in SEEDS:
        run, wanted = known(scene(which, seed))
        assert floor < 0.05 * abs(wanted)
        assert measure(metric, case, truth, run) == pytest.approx(wanted, rel=1e-6, abs=2.0 * floor), seed


COLUMNS = {
    "position": "q", "velocity": "v", "start_error": "q", "gap_error": "gap", "gap_residual": "gap",
    "energy_residual": "energy", "contact_work": "contact", "law_residual": "lam", "lam_error": "lam",
    "lam_impulse": "lam", "lam_impulse_path": "lam", "angle_error": "q",
}  # fmt: skip
"""Metrics of several columns, each of which counts by itself, and what they are columns of."""


@pytest.mark.parametrize("name", COLUMNS)
def test_errors_of_two_columns_do_not_cancel(name: str) -> None:
    """The same error with the other sign in another column leaves the number as large as it was."""
    (which, known), signal = ERRORS[name], COLUMNS[name]
    case, truth = right(which)
    for seed in SEEDS:
        s = scene(which, seed)
        run, wanted = known(s)
        ledger = signal == "contact"
        off = (run.ledger.contact - s.run.ledger.contact) if ledger else getattr(run, signal) - getattr(s.run, signal)
        (k,), (column,) = (np.unique(at) for at in np.nonzero(off))
        other = s.one([i for i in range(off.shape[1]) if i != column])
        spoil = booked if ledger else changed
        run = spoil(run, signal, (k, other), -float(off[k, column]))
        assert measure(name, case, truth, run) >= abs(wanted) * (1.0 - 1e-6), seed


@pytest.mark.parametrize("name", VALUES)
def test_a_known_value_is_what_the_metric_says(name: str) -> None:
    which, known = VALUES[name]
    for seed in SEEDS:
        run, wanted = known(scene(which, seed))
        said = measure(name.split()[0], *right(which), run)
        assert said == pytest.approx(wanted, rel=1e-6, abs=1e-9), seed


@pytest.mark.parametrize("seed", range(10))
def test_a_collision_in_no_time_is_a_step_between_the_samples_of_its_instant(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.sort(np.repeat(rng.uniform(0.0, 1.0, 20), rng.choice([1, 2], 20)))
    row, late = rng.integers(2, size=t.size // 2), rng.choice(t[1:], t.size // 2)
    late += rng.choice([0.0, 1e-3], late.size) * (rng.random(late.size) < 0.5)  # between samples too
    blank = np.zeros((len(t), 2))
    events = [
        Event(t=x, contact=i, before=Mode.FREE, after=Mode.FREE, impulse=j + 1.0)
        for j, (x, i) in enumerate(zip(late, row, strict=True))
    ]
    run = Trajectory(t=t, q=blank, v=blank, gap=blank, lam=blank, energy=blank, mode=blank.astype(np.int8))
    wanted = np.zeros((len(t), 2))
    for event in events:
        same = np.flatnonzero(t == event.t)
        wanted[same[-1] if len(same) else int((t < event.t).sum()) :, event.contact] += event.impulse
    assert np.array_equal(with_collisions(run, events), wanted)


@pytest.mark.parametrize("seed", range(10))
def test_an_account_that_is_open_is_what_a_stress_run_says(seed: int) -> None:
    s = scene("block", seed)
    off = OFF * float(s.run.energy[:, 0].max())
    run, _ = account(s)
    assert run.ledger is not None
    works = (s.run.energy[:, 1], run.ledger.input, run.ledger.dissipated, *run.ledger.contact.T)
    scale = max(float(s.run.energy[:, 0].max()), *(float(np.ptp(work)) for work in works))
    assert residual(run) == pytest.approx(off / scale, rel=1e-2, abs=2.0 * residual(s.run))


def test_every_metric_is_held_against_a_known_error_or_value() -> None:
    judging = set(metrics.names())
    for name in cases.names():
        for case in (load(name, variant) for variant in cases.variants(name)):
            asked = {each.metric.split()[0] for each in (*limits_of(case), *case.claims)}
            judging |= asked & set(metrics.of(case))
    friction = {"cone_violation", "creep_speed", *(name for name in judging if name.startswith("friction_"))}
    elsewhere = {"divergence_time", "energy_switching", "tracking_error", "violated_modes", "slip_times", "stick_times"}
    assert judging - elsewhere - friction <= {name.split()[0] for name in (ERRORS | VALUES)}  # test_friction_metrics


@pytest.fixture(scope="module")
def ball() -> tuple[Case, Truth]:
    return right("linear ball")


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
    assert measure("mode_residual", case, truth, replace(run, events=(*events[:j], other, *events[j + 1 :]))) in (
        1.0,
        2.0,
    )


@pytest.mark.parametrize(("high", "counted"), [(1.5, 0.0), (3.5, 1.0)])
def test_a_touch_far_above_the_surface_is_none(high: float, counted: float) -> None:
    """MuJoCo's row of one bound was told as that of the other, a radian away, and only a law of soft rows was asked."""
    t, case = np.linspace(0.0, 1.0, 11), load("bouncing_ball", "elastic", t_end=1.0)
    gap = (1.0 - t + 0.1 * high - 0.5)[:, None]
    mode = np.where(t > 0.45, Mode.CONTACT, Mode.FREE)[:, None].astype(np.int8)
    gap[t > 0.55] = 0.0
    gap[(t > 0.25) & (t < 0.55)] = 0.1 * high
    gap[t < 0.25] = 0.1 * high + 0.1 * np.arange(3, 0, -1)[:, None]
    gap[t > 0.55, 0] = 0.1 * np.maximum(high - np.arange(1, 6), 0.0)
    run = Trajectory(
        t=t, q=gap, v=gap, gap=gap, lam=(mode == Mode.CONTACT).astype(float), energy=np.zeros((11, 2)), mode=mode,
        events=(Event(t=0.5, contact=0, before=Mode.FREE, after=Mode.CONTACT),),
    )  # fmt: skip
    assert measure("mode_contradicted", case, from_run(run, Tier.D, "made up"), run) == counted


def test_an_event_that_no_law_has_counts_though_its_samples_follow_it(ball: tuple[Case, Truth]) -> None:
    """A collision released below the surface was told as BALLISTIC: nothing but its name was another one."""
    case, truth = ball
    run = truth.trajectory
    for old, new in ((Mode.BALLISTIC, Mode.COLLISION_SEPARATION), (Mode.CONTACT, Mode.COLLISION)):
        events = tuple(
            replace(e, before=new if e.before == old else e.before, after=new if e.after == old else e.after)
            for e in run.events
        )
        named = replace(run, events=events, mode=np.where(run.mode == old, new, run.mode).astype(np.int8))
        ends = sum({e.before, e.after} == {Mode.CONTACT, Mode.BALLISTIC} for e in run.events)
        assert measure("mode_residual", case, truth, named) == ends > 0


@pytest.mark.parametrize("factor", [0.5, 1.0 + 1e-4, 2.0])
def test_a_factor_on_every_force_is_the_residual_of_the_law(factor: float, ball: tuple[Case, Truth]) -> None:
    case, truth = ball
    run = replace(truth.trajectory, lam=factor * truth.trajectory.lam)
    assert measure("law_residual", case, truth, run) == pytest.approx(abs(factor - 1.0), rel=1e-6)


@pytest.mark.parametrize("seed", range(40))
def test_an_instant_is_alone_where_nothing_else_happens(seed: int) -> None:
    """Events, switches, changes of the case's and of the run's inputs, and ticks, on instants that they share."""
    rng, case = np.random.default_rng(seed), load("bouncing_ball", "linear")
    grid = 0.01 * np.arange(1, 60)
    events, switches, given, own = (np.sort(rng.choice(grid, n)) for n in (12, 6, 6, 6))
    tick = float(rng.choice([0.0, 0.05]))
    run = replace(
        right("ball")[1].trajectory,
        events=tuple(Event(t=float(t), contact=0, before=Mode.CONTACT, after=Mode.FREE) for t in events),
        switches=tuple(Switch(t=float(t), variable=0, before=0, after=1) for t in switches),
        inputs=Inputs(names=("u",), times=np.unique(own), values=np.zeros((len(np.unique(own)), 1))),
    )
    told = replace(
        case, inputs=Inputs(names=("u",), times=np.unique(given), values=np.zeros((len(np.unique(given)), 1)))
    )
    system = SimpleNamespace(tick=tick, control=True)
    alone = event_gap._alone(run, told, system)  # type: ignore[arg-type]
    for t in events:
        others = np.concatenate([switches, given, own, np.arange(0.0, 1.0, tick) if tick else []])
        wanted = np.sum(np.abs(events - t) < 1e-9) == 1 and not (np.abs(others - t) < 1e-9).any()
        assert alone(float(t)) == wanted


LEFT_OUT = {"velocity": "v", "energy_drift": "energy", "contact_work": "contact", "lam_impulse_path": "lam"}
"""Metrics for which a sample at a strike says nothing, and the signals that they look at."""


@pytest.mark.parametrize(
    ("name", "which"),
    [(name, which) for name in LEFT_OUT for which in ("sliders", "pendulums", "blow")
     if (name, which) not in (("contact_work", "pendulums"), ("contact_work", "blow"))],
)  # fmt: skip
def test_samples_at_strikes_count_nowhere_and_those_beside_them_do(name: str, which: str) -> None:
    case, truth = right(which)
    run, strikes = truth.trajectory, np.array([e.t for e in truth.trajectory.events if e.impulse])
    far = np.abs(run.t[:, None] - strikes).min(axis=1)
    before = measure(name, case, truth, run)

    def off(rows: np.ndarray) -> float:
        by = 0.1 * rows[:, None]
        if LEFT_OUT[name] == "contact":
            assert run.ledger is not None
            wrong = replace(run, ledger=replace(run.ledger, contact=run.ledger.contact + by))
        else:
            wrong = replace(run, **{LEFT_OUT[name]: getattr(run, LEFT_OUT[name]) + by})
        return measure(name, case, truth, wrong)

    beside = np.zeros(len(far), dtype=bool)
    beside[int(np.argmin(np.where(far > 1e-6 * case.t_end, far, np.inf)))] = True
    if name != "lam_impulse_path":  # which adds up what acts at the samples beside it
        assert off(far <= 1e-9 * case.t_end) == before
    assert off(beside) > before + 1e-6


@pytest.mark.parametrize("k", range(6))
def test_of_rows_that_strike_at_once_one_may_strike_a_little_later(k: int) -> None:
    """A sample at that instant does not say on which side of the strike it stands, in the run as in the truth."""
    case, truth = right("pendulums")
    run, event = truth.trajectory, [e for e in truth.trajectory.events if e.impulse][k]
    behind = int(np.searchsorted(run.t, event.t, side="right"))
    later = event.t + 1e-3 * (run.t[behind] - event.t)
    rows = np.insert(np.arange(len(run.t)), behind, [behind - 1, behind - 1])
    t = np.insert(run.t, behind, [later, later])
    parts = {name: getattr(run, name)[rows] for name in ("q", "v", "gap", "lam", "energy", "mode")}
    events = sorted((replace(e, t=later) if e is event else e for e in run.events), key=lambda e: e.t)
    apart = replace(run, t=t, events=tuple(events), ledger=None, **parts)
    assert measure("lam_impulse_path", case, truth, apart) < 1e-9


@pytest.mark.parametrize("factor", [0.9, 1.01, 1.1])
def test_a_factor_on_every_velocity_is_the_residual_of_the_rates(factor: float, ball: tuple[Case, Truth]) -> None:
    case, truth = ball
    run = truth.at(np.linspace(0.0, 0.4, 401))  # the first fall, on which the trapezoidal rule is exact
    run = replace(run, v=factor * run.v)
    assert measure("rate_residual", case, truth, run) == pytest.approx(abs(factor - 1.0), rel=1e-9)


def spun(case: Case, rates: Floats, t: Floats) -> Trajectory:
    """A run in which everything moves at constant rates (nv,), and turns about axes that are fixed in itself."""
    at, row, parts = 0, 0, []
    for first in (*case.quaternions, len(case.q0)):
        parts.append(case.q0[at:first] + t[:, None] * rates[row : (row := row + first - at)])
        if first < len(case.q0):
            turn = Rotation.from_quat(case.q0[first : first + 4], scalar_first=True)
            turned = turn * Rotation.from_rotvec(t[:, None] * rates[row : row + 3])
            parts.append(turned.as_quat(scalar_first=True))
            at, row = first + 4, row + 3
    q, v, none = np.concatenate(parts, axis=1), np.tile(rates, (len(t), 1)), np.zeros((len(t), 0))
    return Trajectory(t=t, q=q, v=v, lam=none, gap=none, energy=np.zeros((len(t), 2)), mode=none.astype(np.int8))


@pytest.mark.parametrize("label", ["rolling_sphere:straight", "stacked_blocks:together", "tossed_cube:tumbles"])
@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_rates_of_what_turns_in_space_are_held_against_its_turns(label: str, seed: int) -> None:
    """Each rate by itself: with a factor on one the way is off by as much, with none or about other axes not at all."""
    rng, case = np.random.default_rng(seed), load(*label.split(":"))
    rates = rng.choice([-1.0, 1.0], len(case.v0)) * rng.uniform(1.0, 3.0, len(case.v0))
    run, factor, k = spun(case, rates, np.linspace(0.0, 2.0, 41)), rng.uniform(0.5, 1.5), rng.integers(len(rates))
    v = run.v.copy()
    v[:, k] *= factor
    assert measure("rate_residual", case, None, run) < 1e-12
    assert measure("rate_residual", case, None, replace(run, v=v)) == pytest.approx(abs(factor - 1.0), rel=1e-9)


def test_turns_that_samples_do_not_tell_are_left_out() -> None:
    """A sphere that turns by seven between two samples stands as if it turned by seven less than once round."""
    case = load("rolling_sphere", "straight")
    run = spun(case, np.array([1.0, 2.0, 0.0, 70.0, 0.0, 0.0]), np.linspace(0.0, 1.0, 11))
    assert measure("rate_residual", case, None, run) < 1e-12


def test_the_flange_is_held_against_its_path_once_it_has_settled() -> None:
    from crossbody.reference.delta import scene

    case = load("delta_tracking", "circle")
    path, t = scene.path_of(case.parameters), np.linspace(0.0, case.t_end, 61)
    assert path is not None
    p = of_numbers(case.parameters)
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


def test_a_touch_is_compared_with_one_of_its_own_row_in_whatever_order_rows_touch() -> None:
    case, truth = right("sliders")
    first, second = contacts(truth.trajectory)[:2]
    swapped = {first.row: second.row, second.row: first.row}
    events = tuple(replace(e, contact=swapped.get(e.contact, e.contact)) for e in truth.trajectory.events)
    run = replace(truth.trajectory, events=events)
    pairs = matched(truth, run)
    assert len(pairs) == len(contacts(truth.trajectory))
    assert all(a.row == b.row for a, b in pairs)
    assert max(abs(a.touch - b.touch) for a, b in pairs) >= second.touch - first.touch
    assert metrics.load("event_times").measure(truth, run, case) == max(abs(a.touch - b.touch) for a, b in pairs)


def test_a_row_that_comes_free_where_a_variable_changes_has_another_gap_behind() -> None:
    case, truth = right("linear ball")
    run = truth.trajectory
    k = next(i for i, e in enumerate(run.events) if e.before is Mode.BALLISTIC)
    t = run.events[k].t
    jumped = replace(
        run,
        gap=run.gap + np.where(run.t > t, 1.0, 0.0)[:, None],
        switches=(Switch(t=t, variable=0, before=0, after=1),),
    )
    late = replace(run, events=(*run.events[:k], replace(run.events[k], t=t + 1e-7), *run.events[k + 1 :]))
    assert measure("mode_times", case, replace(truth, trajectory=jumped), late) == 0.0
    assert measure("mode_times", case, replace(truth, trajectory=replace(jumped, switches=())), late) > 0.0


def pressed(release: float, step: float) -> Trajectory:
    """A row that bears 1 N from 0.2 s on until it lets go, at steps of a run; every jump from both sides."""
    grid = np.arange(0.0, 1.0 + 0.5 * step, step)
    t = np.sort(np.concatenate([grid[np.abs(grid - release) > 1e-9], [0.2], [release] * 2]))
    order = np.arange(len(t))
    on = (order >= np.searchsorted(t, 0.2, side="right") - 1) & (order <= np.searchsorted(t, release, side="left"))
    modes = (Mode.FREE, Mode.CONTACT, Mode.FREE)
    events = tuple(
        Event(t=at, contact=0, before=a, after=b) for at, a, b in zip((0.2, release), modes, modes[1:], strict=False)
    )
    column = np.linspace(0.0, 1.0, len(t))[:, None]
    return Trajectory(
        t=t, q=column, v=column, gap=column, lam=on[:, None].astype(float), energy=np.hstack([column, column]),
        mode=np.where(on, Mode.CONTACT, Mode.FREE)[:, None].astype(np.int8), events=events,
    )  # fmt: skip


@pytest.mark.parametrize("late", [-1e-4, 1e-7, 1e-5, 1e-3])
def test_a_release_that_is_late_has_the_impulse_of_that_time_and_not_of_half_a_step(late: float) -> None:
    """Where a multiplier jumps as a row lets go, its two sides stand for its two sides in the truth, however coarse."""
    case = load("bouncing_ball", "elastic", t_end=1.0)
    truth = from_run(pressed(0.6, 1e-3), Tier.D, "made up")
    said = measure("lam_impulse_path", case, truth, pressed(0.6 + late, 0.05))
    assert said == pytest.approx(abs(late) / 0.4, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_impulse_of_a_collision_in_no_time_is_held_against_that_of_one_that_takes_some(seed: int) -> None:
    """However few samples such a run has: the truth's force does not act at any of them."""
    rng, case = np.random.default_rng(seed), load("bouncing_ball", "elastic", t_end=1.0)
    whole, impulse = pressed(0.6, 1e-3), float(rng.uniform(0.1, 0.8))
    kept = np.searchsorted(whole.t, np.sort([0.0, *rng.uniform(0.0, 0.19, 3), 0.2, *rng.uniform(0.61, 1.0, 3)]))
    (touch, _) = whole.events
    run = replace(
        whole, **{name: getattr(whole, name)[kept] for name in ("t", "q", "v", "gap", "energy", "mode")},
        lam=np.zeros((len(kept), 1)), events=(replace(touch, impulse=impulse),),
    )  # fmt: skip
    said = measure("lam_impulse_path", case, from_run(whole, Tier.D, "made up"), run)
    assert said == pytest.approx(abs(impulse - 0.4) / 0.4, rel=1e-9)


@pytest.mark.parametrize("after", [Mode.CONTACT, Mode.FREE])
def test_a_gap_that_is_not_known_where_a_row_touches_or_lets_go_is_no_gap_of_zero(after: Mode) -> None:
    case, run = load("bouncing_ball", "elastic", t_end=1.0), pressed(0.6, 1e-2)
    (event,) = (event for event in run.events if event.after == after)
    gap = np.where(np.abs(run.t - event.t)[:, None] < 1e-9, np.nan, run.gap)
    blind = replace(run, gap=gap, events=(event,))
    assert np.isnan(measure("event_gap", case, from_run(run, Tier.D, "made up"), blind) or 0.0)


@pytest.mark.parametrize("name", ["ball", "box", "springs"])
def test_what_touches_is_known_without_modes(name: str) -> None:
    """Multipliers of a run that has none act where the truth's contacts are."""
    case, truth = right(name)
    unseen = replace(truth.trajectory, mode=np.full_like(truth.trajectory.mode, -1))
    assert measure("complementarity", case, truth, unseen) == measure("complementarity", case, truth, truth.trajectory)
