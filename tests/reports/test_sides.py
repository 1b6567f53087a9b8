"""Where an instant of a run stands twice, and the truth's own event is near, each side is beside its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import Acts, Event, Mode, Switch, Tier, Trajectory
from crossbody.cases.defaults import shortest
from crossbody.reports import metrics
from crossbody.reports.measuring.alignment import aligned, instants
from crossbody.reports.measuring.impulse import true_impulse
from crossbody.reports.measuring.truth import Truth, from_run, sample_times

CASE = cases.load("sliding_block", "turns")
assert CASE.closed_form is not None
EVENTS = CASE.closed_form(np.zeros(1)).events
TURN = EVENTS[-1].t
TRUTH = replace(
    from_run(CASE.closed_form(sample_times(CASE.closed_form(np.zeros(1)), CASE.t_end)), Tier.A, "closed form"),
    at=CASE.closed_form, touches=CASE.law.touches, joined=True,
)  # fmt: skip


def turned(off: float, times: np.ndarray) -> Trajectory:
    """The exact motion at these instants, s, and on both sides of where it turns, which is told as later by `off`."""
    assert CASE.closed_form is not None
    told = TURN + off
    t = np.sort(np.concatenate([times[times != told], [told] * 2]))
    at = np.where((t >= TURN) & (t < told), np.nextafter(TURN, 0.0), t)
    at = np.where((t > told) & (t <= TURN), np.nextafter(TURN, CASE.t_end), at)
    run = CASE.closed_form(np.maximum.accumulate(np.where(t == told, TURN, at)))
    return replace(run, t=t, events=(*EVENTS[:-1], replace(EVENTS[-1], t=told)))


@pytest.mark.parametrize("seed", range(20))
def test_what_jumps_is_beside_a_run_on_both_sides(seed: int) -> None:
    """However near an event is, below what instants are judged to, and whatever the steps: impulses are the same."""
    draw = np.random.default_rng(seed)
    off = draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-16.0, np.log10(shortest(CASE.t_end)))
    apart = draw.uniform(0.0, CASE.t_end, draw.integers(5, 100))
    times = np.concatenate([[0.0, CASE.t_end], apart[np.abs(apart - TURN) > 1e-5]])
    run = turned(off, times)
    inside, exact = aligned(TRUTH, run, CASE)
    assert inside.all()
    np.testing.assert_allclose(exact.lam, run.lam, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(exact.mode, run.mode)
    np.testing.assert_array_equal(exact.t, run.t)
    assert metrics.load("lam_impulse").measure(TRUTH, run, CASE) < 1e-9
    known = [list(asked) for asked in instants(TRUTH, [run], CASE)]
    assert all(list(each) in known for each in asked_for(TRUTH, run))


def asked_for(truth: Truth, run: Trajectory) -> list[np.ndarray]:
    """The instants at which a truth is asked for a run."""
    asked = []
    assert CASE.closed_form is not None
    of = CASE.closed_form

    def at(t: np.ndarray) -> Trajectory:
        asked.append(t)
        return of(t)

    aligned(replace(truth, at=at), replace(run), CASE)
    return asked


def test_what_is_farther_than_instants_are_judged_to_is_where_it_is() -> None:
    """Between the two events both samples of the run are before, or behind, the truth's."""
    off = 3.0 * shortest(CASE.t_end)
    for late in (off, -off):
        _, exact = aligned(TRUTH, turned(late, np.linspace(0.0, CASE.t_end, 50)), CASE)
        at = np.flatnonzero(exact.t == TURN + late)
        assert np.ptp(exact.lam[at], axis=0).max() == 0.0


@pytest.mark.parametrize("seed", range(20))
def test_samples_between_two_events_are_beside_the_side_on_which_the_run_has_them(seed: int) -> None:
    """A sample of a grid at the very instant of an event is before it by rounding, or behind: a run tells which."""
    draw = np.random.default_rng(seed)
    off = draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-16.0, np.log10(shortest(CASE.t_end)))
    between = TURN + off * np.sort(draw.uniform(0.0, 1.0, draw.integers(1, 4)))
    times = np.concatenate([np.linspace(0.0, 0.9 * TURN, 20), [TURN], between, np.linspace(1.1 * TURN, CASE.t_end, 20)])
    run = turned(off, times)
    _, exact = aligned(TRUTH, run, CASE)
    np.testing.assert_allclose(exact.lam, run.lam, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(exact.mode, run.mode)
    assert metrics.load("lam_impulse").measure(TRUTH, run, CASE) < 1e-9


def pushed(at: np.ndarray, t: np.ndarray) -> Trajectory:
    """Rows that push with 1 N each from instants (n,) on, s, and slip then; told at times t, and on both sides."""
    t = np.sort(np.concatenate([t, *[at, at]]))
    again = np.append(False, t[1:] == t[:-1])
    on = (t[:, None] > at) | ((t[:, None] == at) & again[:, None])
    rest = np.ones((len(t), 1))
    return Trajectory(
        t=t, q=rest, v=rest, gap=0.0 * on, lam=on.astype(float), energy=np.hstack([rest, rest]),
        mode=np.where(on, Mode.SLIP, Mode.STICK).astype(np.int8),
        events=tuple(Event(t=x, contact=row, before=Mode.STICK, after=Mode.SLIP) for row, x in enumerate(at.tolist())),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_jumps_of_several_rows_that_are_nearer_to_each_other_than_a_run_is_to_its_truth(seed: int) -> None:
    """Each is beside its own."""
    draw = np.random.default_rng(seed)
    at = 0.5 + np.cumsum(draw.uniform(1e-9, 1e-8, 3))
    late, t = draw.choice([-1.0, 1.0]) * draw.uniform(1e-9, 1e-7), np.array([0.0, *draw.uniform(0.0, 0.4, 5), 1.0])
    truth = from_run(pushed(at, np.sort(np.append(t, 0.9))), Tier.A, "made up")
    run = pushed(at + late, np.sort(t))
    np.testing.assert_array_equal(aligned(truth, run, CASE)[1].lam, run.lam)


@pytest.mark.parametrize("seed", range(20))
def test_a_gap_that_is_of_another_edge_is_beside_a_run_on_both_sides(seed: int) -> None:
    """Its curvature jumps, and the force with it: a run tells both sides, an instant beside the truth's."""
    draw = np.random.default_rng(seed)
    off = draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-12.0, np.log10(shortest(CASE.t_end)))

    def switched(run: Trajectory, at: float) -> Trajectory:
        kink = Switch(t=at, variable=0, before=0, after=1, smooth=True)
        return replace(run, events=EVENTS[:-1], switches=(kink,))

    truth = replace(TRUTH, trajectory=switched(TRUTH.trajectory, TURN))
    apart = draw.uniform(0.0, CASE.t_end, 20)
    times = np.concatenate([[0.0, CASE.t_end], apart[np.abs(apart - TURN) > 1e-5]])
    run = switched(turned(off, times), TURN + off)
    inside, exact = aligned(truth, run, CASE, releases=True)
    np.testing.assert_allclose(exact.lam, run.lam[inside], rtol=1e-9, atol=1e-9)
    assert metrics.load("lam_impulse_path").measure(truth, run, CASE) < 1e-9 + 10.0 * abs(off) / CASE.t_end


@pytest.mark.parametrize("turn", [0.31, 0.5, 0.77])
def test_an_impulse_behind_a_turn_is_that_of_the_friction_that_turned(turn: float) -> None:
    """Of a slip that turns and slides on friction jumps to the other side: both sides of the instant are known."""
    t = np.sort(np.append(np.linspace(0.0, 1.0, 41), [turn, turn]))
    behind = (t > turn) | np.append(False, (t[1:] == turn) & (t[:-1] == turn))
    lam, rest = np.where(behind, -3.0, 2.0)[:, None], np.ones((len(t), 1))
    event = Event(t=turn, contact=0, before=Mode.SLIP, after=Mode.SLIP)
    whole = Trajectory(
        t=t, q=rest, v=rest, gap=0.0 * rest, lam=lam, energy=np.hstack([rest, rest]),
        mode=np.full((len(t), 1), Mode.SLIP, dtype=np.int8), events=(event,),
    )  # fmt: skip
    stepped = replace(whole, acts=Acts.BEFORE)
    found = true_impulse(stepped, whole, whole)[:, 0]
    np.testing.assert_allclose(found, np.where(t < turn, 2.0 * t, 2.0 * turn - 3.0 * (t - turn)), atol=1e-12)
