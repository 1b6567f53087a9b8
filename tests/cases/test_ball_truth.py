"""The exact motion of the linear ball, against plain integration with located events."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crossbody.cases import Mode, load
from crossbody.cases import closed_forms as cf
from crossbody.cases.closed_forms import LinearArc
from crossbody.cases.mechanisms import ball as _ball_truth
from crossbody.cases.mechanisms.ball import Ball, Motion

SCENES = {
    "underdamped": (Ball(mass=1.0, gravity=9.81, a0=1e4, a1=20.0), 1.0, 0.0),
    "undamped": (Ball(mass=2.0, gravity=9.81, a0=400.0, a1=0.0), 0.5, -1.0),
    "double pole": (Ball(mass=0.3, gravity=1.0, a0=400.0, a1=40.0), 1.0, -3.0),
    "overdamped": (Ball(mass=1.0, gravity=0.5, a0=400.0, a1=120.0), 0.2, -4.0),
    "thrown up": (Ball(mass=1.0, gravity=9.81, a0=1e4, a1=50.0), 0.1, 2.0),
    "starts inside": (Ball(mass=1.0, gravity=9.81, a0=1e4, a1=20.0), -0.05, 0.0),
    "starts inside, outward": (Ball(mass=1.0, gravity=9.81, a0=1e4, a1=200.0), -1e-3, 1.0),
    "starts inside, falls back": (Ball(mass=1.0, gravity=9.81, a0=1e4, a1=800.0), -5e-3, 0.3),
    "no gravity": (Ball(mass=1.0, gravity=0.0, a0=1e4, a1=50.0), 1.0, -2.0),
}


def brute(ball: Ball, h: float, v: float, t_end: float) -> tuple[list[tuple[float, int]], np.ndarray]:
    """The level machine by DOP853 in small steps, mode by mode: (time, mode after) and the final state."""
    t, mode, log = 0.0, Mode.FREE, []
    lam = lambda x: ball.gravity - ball.a1 * x[1] - ball.a0 * x[0]  # noqa: E731
    if h < 0:
        log.append((0.0, Mode.CONTACT))
        mode = Mode.CONTACT
        if lam((h, v)) < 0:
            log.append((0.0, Mode.BALLISTIC))
            mode = Mode.BALLISTIC
    x = np.array([h, v])
    while t < t_end:
        contact = mode == Mode.CONTACT
        guards = {
            Mode.FREE: [(lambda _t, x: x[0], -1)],
            Mode.CONTACT: [(lambda _t, x: lam(x), -1)],
            Mode.BALLISTIC: [(lambda _t, x: x[0], 1), (lambda _t, x: max(x[1], -lam(x)), -1)],
        }[mode]
        events = []
        for guard, direction in guards:

            def event(t, x, guard=guard):
                return guard(t, x)

            event.terminal, event.direction = True, direction
            events.append(event)
        found = solve_ivp(
            lambda _t, x, on=contact: [x[1], lam(x) - ball.gravity if on else -ball.gravity], (t, t_end), x,
            method="DOP853", rtol=1e-12, atol=1e-14, events=events, max_step=8e-3,
        )  # fmt: skip
        t, x = found.t[-1], found.y[:, -1]
        if found.status == 0:
            break
        if mode == Mode.CONTACT:
            mode = Mode.FREE if x[0] > 0 else Mode.BALLISTIC
        elif mode == Mode.BALLISTIC and len(found.t_events[0]):
            mode, x[0] = Mode.FREE, 1e-16
        else:
            mode = Mode.CONTACT
        log.append((t, mode))
    return log, x


@pytest.mark.parametrize("scene", SCENES)
def test_agrees_with_integration(scene: str) -> None:
    ball, h, v = SCENES[scene]
    motion, t_end = Motion(ball, h, v, 1.5), 1.5
    log, last = brute(ball, h, v, t_end)
    assert [e.after for e in motion.events] == [mode for _, mode in log]
    np.testing.assert_allclose([e.t for e in motion.events], [t for t, _ in log], atol=2e-10)
    end = motion(np.array([t_end]))
    np.testing.assert_allclose([end.q[0, 0], end.v[0, 0]], last, atol=1e-7)


@pytest.mark.parametrize("scene", SCENES)
def test_position_and_speed_are_continuous_and_lam_never_pulls(scene: str) -> None:
    motion = Motion(*SCENES[scene], 3.0)
    instants = np.array([e.t for e in motion.events])
    twice = motion(np.repeat(instants, 2)) if len(instants) else motion(np.zeros(2))
    scale = np.max(np.abs(twice.v), initial=1e-300)
    single = np.diff(instants, prepend=-1.0, append=9.0)
    lone = (single[1:] > 0) & (single[:-1] > 0)
    np.testing.assert_allclose(twice.q[0::2][lone], twice.q[1::2][lone], atol=1e-14)
    np.testing.assert_allclose(twice.v[0::2][lone], twice.v[1::2][lone], atol=1e-12 * scale)
    trace = motion(np.linspace(0, 3.0, 5000))
    assert trace.lam.min() >= -1e-9 * trace.lam.max()
    assert set(np.unique(trace.mode)) <= {Mode.FREE, Mode.CONTACT, Mode.BALLISTIC}


@pytest.mark.parametrize("scene", SCENES)
def test_work_of_the_floor_is_the_integral_of_lam_times_rate(scene: str) -> None:
    motion = Motion(*SCENES[scene], 1.0)
    edges = np.unique(np.concatenate(([0.0, 1.0], [e.t for e in motion.events])))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    work = 0.0
    for a, b in pairwise(edges):
        for lo, hi in pairwise(np.linspace(a, b, 21)):
            trace = motion(lo + (hi - lo) * (nodes + 1) / 2)
            work += (hi - lo) / 2 * float(weights @ (trace.lam * trace.v).ravel())
    assert motion(np.array([1.0])).ledger.contact[-1, 0] == pytest.approx(work, rel=1e-9, abs=1e-12)


def test_mass_drops_out() -> None:
    a, b = (Motion(Ball(mass=m, gravity=9.81, a0=1e4, a1=20.0), 1.0, 0.0, 5.0) for m in (1e-3, 1e3))
    assert a.events == b.events


@pytest.mark.parametrize("zeta", [0.0, 0.2, 1.0, 1.7])
def test_threshold_speed_decides_between_capture_and_release(zeta: float) -> None:
    a0 = 1e6
    a1 = 2 * zeta * 1e3
    speed = cf.threshold_speed(a0, a1, 9.81)
    for factor, captured in ((1 - 1e-9, True), (1 + 1e-9, False)):
        motion = Motion(Ball(mass=1.0, gravity=9.81, a0=a0, a1=a1), 0.0, -factor * speed, 1.0)
        assert motion.events[0].after == Mode.CONTACT
        assert (len(motion.events) == 1) is captured


def test_undamped_ball_gains_the_same_energy_at_every_bounce() -> None:
    case = load("bouncing_ball", "linear", a0=400.0, a1=0.0, t_end=20.0)
    assert case.closed_form is not None
    exits = [e.t for e in case.closed_form(np.zeros(1)).events if e.before == Mode.CONTACT]
    assert len(exits) >= 10
    gains = np.diff(case.closed_form(np.array([0.0, *exits])).total_energy)
    gain = next(c.expected for c in case.claims if c.metric == "energy_per_bounce")
    np.testing.assert_allclose(gains, gain, rtol=1e-11)


@pytest.mark.parametrize("zeta", [0.0, 0.3, 1 - 1e-13, 1.0, 1 + 1e-13, 2.0, 50.0])
def test_linear_arc_solves_its_equation(zeta: float) -> None:
    a0, a1 = 9.0, 6.0 * zeta
    arc = LinearArc(a0, a1, 1.5, -2.0)
    t = np.linspace(0.0, 4.0, 50)
    found = solve_ivp(
        lambda _t, x: [x[1], -a1 * x[1] - a0 * x[0]], (0, 4), [1.5, -2.0],
        method="DOP853", rtol=1e-13, atol=1e-15, t_eval=t,
    )  # fmt: skip
    np.testing.assert_allclose(arc(t), found.y[0], atol=1e-11)
    np.testing.assert_allclose(arc.rate(t), found.y[1], atol=1e-10)
    zero = arc.first_zero()
    crossings = np.flatnonzero(np.diff(np.sign(found.y[0])))
    assert (zero > t[-1]) == (len(crossings) == 0)
    if len(crossings):
        assert t[crossings[0]] <= zero <= t[crossings[0] + 1]
        assert abs(float(arc(zero))) < 1e-14


def test_endless_bouncing_ends_with_an_outcome(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_ball_truth, "MAX_ARCS", 100)
    motion = Motion(Ball(mass=1.0, gravity=9.81, a0=1e14, a1=0.0), 1e-10, 0.0, 1e4)
    assert motion(np.array([1.0])).outcome == "step_limit"
