"""Rows stand where multipliers are largest, and lift-off of stiff rows is located to the tolerance."""

from functools import cache

import numpy as np
import pytest
from mechanisms import ball, flyby, oscillator, sliders
from scipy.integrate import solve_ivp

from crossbody import cases, engines
from crossbody.cases import Mode
from crossbody.reference import simulate

SCENES = {
    "cubic": (ball(), [1.0], [0.0], 0.8),
    "arcs": (ball(a0=1e4, a1=20.0, a2=0.0), [0.3], [0.0], 0.5),
    "without damping": (oscillator(-0.5, a1=0.0), [1.0], [0.0], 4.0),
    "passing a circle": (flyby(1.0, a0=1e4, a1=5.0), [-2.0, 0.3], [3.0, 0.0], 1.0),
    "three in a row": (
        sliders(4, a0=1e4, a1=5.0, masses=[1.0, 3.0, 2.0, 1.0]),
        [0.0, 0.1, 0.2, 0.3],
        [1, 0, 0, 0],
        0.8,
    ),
}


@cache
def largest(name):
    """Largest multipliers of a scene on a fine grid."""
    system, q0, v0, t_end = SCENES[name]
    return simulate(system, q0, v0, t_end, rtol=1e-11, samples=np.linspace(0.0, t_end, 10_001)).lam.max(axis=0)


@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
@pytest.mark.parametrize("shortcuts", [True, False])
@pytest.mark.parametrize("name", SCENES)
def test_the_largest_multiplier_written_is_the_largest_of_the_motion(name, shortcuts, rtol):
    system, q0, v0, t_end = SCENES[name]
    run = simulate(system, q0, v0, t_end, rtol=rtol, shortcuts=shortcuts)
    assert (np.diff(run.t) >= 0.0).all()
    grid = 1e4 * (t_end / 2e4) ** 2  # the grid itself misses a0 (dt / 2)^2 / 2 of a peak
    assert run.lam.max(axis=0) == pytest.approx(largest(name), rel=30.0 * rtol + grid)


@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
@pytest.mark.parametrize("name", ["cubic", "without damping", "three in a row"])
def test_every_contact_has_its_own_peak(name, rtol):
    system, q0, v0, t_end = SCENES[name]
    fine = simulate(system, q0, v0, t_end, rtol=1e-11, samples=np.linspace(0.0, t_end, 10_001))
    run = simulate(system, q0, v0, t_end, rtol=rtol)
    touched, contacts = {}, 0
    for event in run.events:
        if event.after is Mode.CONTACT:
            touched[event.contact] = event.t
        elif event.before is Mode.CONTACT:
            ends = touched.pop(event.contact), event.t
            if ends[0] == ends[1]:
                continue  # touched without pressing
            here, there = (r.lam[(r.t >= ends[0]) & (r.t <= ends[1]), event.contact] for r in (run, fine))
            assert here.max() == pytest.approx(there.max(), rel=30.0 * rtol + 1e-3)
            assert here.max() >= there.max() * (1.0 - 30.0 * rtol)
            contacts += 1
    assert contacts


def pressed(a0, a1, speed, until):
    """Largest multiplier of a mass of 1 kg that comes to a row, falling at 9.81 m/s^2: q = A exp(-d t) sin(w t)."""
    d, w = a1 / 2.0, np.sqrt(a0 - a1**2 / 4.0)
    low, high = 0.0, until
    for _ in range(12):  # a grid around the largest of the grid before
        t = np.linspace(low, high, 201)
        fall, swing = np.exp(-d * t), (np.cos(w * t), np.sin(w * t))
        # q'' = -a1 q' - a0 q, from q = 0 and q' = -speed
        lam = fall * speed * (a1 * swing[0] + (a0 - d * a1) / w * swing[1]) + 9.81
        k = int(np.argmax(lam))
        low, high = t[max(k - 1, 0)], t[min(k + 1, 200)]
    return lam.max()


@pytest.mark.parametrize("seed", range(40))
def test_what_presses_most_in_a_bounce_is_written_down(seed):
    """Wherever the peak stands in a step, just behind its start too: lam = q'' + 9.81 is known in closed form."""
    draw = np.random.default_rng(seed)
    for _ in range(8):
        a0, rtol, height = (
            10.0 ** draw.uniform(2.0, 6.0),
            10.0 ** draw.uniform(-11.0, -5.0),
            10.0 ** draw.uniform(-2, 0.5),
        )
        a1, speed = 2.0 * np.sqrt(a0) * draw.uniform(0.0, 0.95), np.sqrt(2.0 * 9.81 * height)
        fall = speed / 9.81
        run = simulate(
            ball(a0=a0, a1=a1, a2=0.0), [height], [0.0], fall + 8.0 / np.sqrt(a0), rtol=rtol, shortcuts=False
        )
        touch = next(event.t for event in run.events if event.before is Mode.FREE)
        ends = next((event.t for event in run.events if event.before is Mode.CONTACT), run.t[-1])
        inside = (run.t >= touch) & (run.t <= ends)
        assert run.lam[inside, 0].max() == pytest.approx(pressed(a0, a1, speed, ends - touch), rel=10.0 * rtol), rtol


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_a_vibration_that_decays_has_one_peak(rtol):
    """lam = 9.81 + 9 cos 100 t, and less from period to period: only the first peak is the largest of its contact."""
    system = ball(a0=1e4, a1=2.0, a2=0.0)
    run = simulate(system, [-0.0009], [-0.02], 1.0, rtol=rtol, shortcuts=False)
    assert not [event for event in run.events if event.before is Mode.CONTACT]
    assert len(run.t) == run.steps + 1 + 1


@pytest.mark.parametrize(("variant", "rtol"), [("inside", 1e-6), ("balanced", 1e-9)])
def test_what_is_written_down_does_not_choose_the_method(variant, rtol):
    """Rows at peaks cost right-hand sides, which do not count where two methods are compared."""
    case, reference = cases.load("ball_maze", variant=variant), engines.load("reference")
    natural, ends = (reference.prepare(case, "compiled", rtol=rtol, **more).run() for more in ({}, {"samples": 2}))
    assert natural.counts["implicit_steps"] == ends.counts["implicit_steps"] > 0
    assert natural.steps == ends.steps
    assert natural.q[-1] == pytest.approx(ends.q[-1], rel=1e-12, abs=1e-15)


def sliding_off(angle, rate):
    """Time at which a point that slides on a rigid circle of radius 1 lets go of it."""

    def lets_go(t, y):
        return 9.81 * np.cos(y[0]) - y[1] ** 2

    lets_go.terminal = True
    found = solve_ivp(
        lambda t, y: [y[1], 9.81 * np.sin(y[0])], (0.0, 10.0), [angle, rate], method="DOP853", rtol=1e-12, atol=1e-14,
        events=lets_go,
    )  # fmt: skip
    return found.t_events[0][0]


@pytest.mark.parametrize("zeta", [0.3, 1.0])
@pytest.mark.parametrize("rtol", [1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize(("angle", "rate"), [(0.1, 0.3), (0.3, 0.8)])
def test_a_stiff_row_lets_go_where_its_multiplier_vanishes(angle, rate, rtol, zeta):
    """a0 = 1e8: a gap known to 1e-9 is a multiplier known to 0.1, of 10. The law keeps it at 0 all along."""
    start = [np.sin(angle), np.cos(angle)], [rate * np.cos(angle), -rate * np.sin(angle)]
    when = sliding_off(angle, rate)
    run = simulate(flyby(1.0, 9.81, a0=1e8, a1=2e4 * zeta), *start, 1.05 * when, rtol=rtol)
    assert run.outcome.ok, run.message
    assert run.counts["implicit_steps"] > 0.5 * run.steps
    released = next(event.t for event in run.events if event.before is Mode.CONTACT)
    assert released == pytest.approx(when, abs=max(2e-6, rtol))


def test_bounces_that_accumulate_write_no_more_rows_than_their_steps_ask_for():
    """A flight in closed form is cut by its length: shapes that nobody can see cost nothing."""
    system = ball(a0=1e4, a1=20.0, a2=0.0, b0=1e6, b1=200.0)
    arcs, steps = (simulate(system, [0.3], [0.0], 3.0, shortcuts=shortcuts) for shortcuts in (True, False))
    assert len(arcs.events) == len(steps.events) > 30
    assert len(arcs.t) < 3 * len(steps.t)
    assert arcs.counts["rhs"] < 0.5 * steps.counts["rhs"]
    first = np.searchsorted(arcs.t, arcs.events[0].t)
    assert first == 16
