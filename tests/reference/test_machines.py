"""The state machines: the four defects of the edge machine, the same starts under the level machine."""

import numpy as np
import pytest
from gusty import gusty
from many_contacts import constant, tower
from mechanisms import ball, sliders

from crossbody.cases import Mode, Outcome
from crossbody.reference import System, simulate


def test_start_below_the_surface():
    edge, level = (simulate(ball(), [-0.01], [0.0], 1.0, fsm=fsm) for fsm in ("edge", "level"))
    assert edge.q[-1, 0] < -4.0
    assert not edge.events
    assert [e.after for e in level.events] == [Mode.CONTACT]
    assert abs(level.q[-1, 0]) < 1e-3


def test_exit_above_the_surface_keeps_the_label_ballistic():
    edge, level = (simulate(ball(a1=0.0), [1.0], [0.0], 2.0, fsm=fsm) for fsm in ("edge", "level"))
    assert [e.after for e in edge.events] == [Mode.CONTACT, Mode.BALLISTIC] * 2
    assert [e.after for e in level.events] == [Mode.CONTACT, Mode.FREE] * 2
    assert edge.q[-1, 0] == pytest.approx(level.q[-1, 0], abs=1e-7)


def test_pulled_at_the_instant_of_touching():
    # An updraught holds at the touch, so that lam would be negative; it ends while the ball is below.
    inputs = ([0.0, 0.09, 0.104], [[9.81], [30.0], [0.0]])
    runs = {f: simulate(gusty(), [0.1], [-1.0], 1.0, fsm=f, inputs=inputs) for f in ("edge", "level")}
    assert runs["edge"].q[-1, 0] < -1.0, "nothing becomes true any more: it tunnels"
    assert runs["level"].q[:, 0].min() > -0.05
    assert Mode.BALLISTIC in [e.after for e in runs["level"].events]


def test_contact_shorter_than_a_step():
    from mechanisms import oscillator

    wall = -1.0 + 1e-7
    runs = {f: simulate(oscillator(wall), [1.0], [0.0], 5.0, fsm=f, rtol=1e-5, atol=1e-5) for f in ("edge", "level")}
    assert not runs["edge"].events
    assert runs["level"].events[0].after is Mode.CONTACT


@pytest.mark.parametrize("a1", [0.0, 4.0])
def test_memoryless_makes_no_energy(a1):
    run = simulate(ball(a0=400.0, a1=a1, a2=0.0), [0.2], [0.0], 3.0, fsm="memoryless", rtol=1e-11)
    assert run.outcome is Outcome.FINISHED
    assert run.total_energy.max() <= run.total_energy[0] * (1.0 + 1e-9)
    assert np.all(run.lam >= -1e-9)


def test_touching_at_rest_is_free_unless_pressed():
    floating = simulate(ball(gravity=0.0), [0.0], [0.0], 1.0)
    pressed = simulate(ball(), [0.0], [0.0], 1.0)
    assert not floating.events
    assert [(e.t, e.after) for e in pressed.events] == [(0.0, Mode.CONTACT)]
    assert pressed.lam[-1, 0] == pytest.approx(9.81, rel=1e-12)


def test_several_contacts_at_one_instant_give_the_block_answer():
    run = simulate(sliders(5), np.zeros(5), [1.0, 0, 0, 0, 0], 1.0, rtol=1e-11)
    assert run.outcome is Outcome.FINISHED
    assert run.v[-1] == pytest.approx([-0.6, 0.4, 0.4, 0.4, 0.4], abs=1e-9)


def test_events_at_one_instant_share_their_time():
    # Two outer masses close on the middle one symmetrically.
    run = simulate(sliders(3), [-1.0, 0.0, 1.0], [1.0, 0.0, -1.0], 1.5, rtol=1e-10)
    first, second = run.events[:2]
    assert (first.contact, second.contact) == (0, 1)
    assert first.t == second.t == pytest.approx(1.0, abs=1e-12)
    assert run.v[-1] == pytest.approx([-1.0, 0.0, 1.0], abs=1e-9)


@pytest.mark.parametrize(("n", "lifted"), [(3, 1), (5, 1), (5, 2)])
def test_rows_without_memory_that_rest_on_each_other_do_not_flicker(n: int, lifted: int) -> None:
    """Held at h = 0 by their neighbours, they round to either side of it: touching balls move on as one block."""
    start = [0.0] * n, [1.0] * lifted + [0.0] * (n - lifted)
    run = simulate(sliders(n, a0=1e6, a1=0.0), *start, 0.01, fsm="memoryless")
    block = 2.0 * lifted / n
    assert run.outcome.ok, run.message
    np.testing.assert_allclose(run.v[-1], [block - 1.0] * lifted + [block] * (n - lifted), atol=1e-9)


SOLVERS = ("compiled", "cvode", "ida")


@pytest.mark.parametrize("solver", SOLVERS)
def test_an_elastic_touch_without_load_is_one_contact(solver: str) -> None:
    """Its multiplier begins and ends at zero, where rounding has any sign: it neither comes free there nor flickers."""
    for seed in range(40):
        rng = np.random.default_rng([19, seed])
        a0, masses, start = 10.0 ** rng.uniform(1.0, 8.0), rng.uniform(0.1, 9.0, 2), np.sort(rng.normal(size=2))
        speed = rng.uniform(0.1, 3.0)
        system, v0 = sliders(2, a0=a0, a1=0.0, masses=masses.tolist()), np.array([speed, -rng.uniform() * speed])
        time = (start[1] - start[0]) / (v0[0] - v0[1])
        run = simulate(system, start, v0, 2.0 * time + np.pi / a0**0.5, solver=solver, collisions="resolved")
        assert run.outcome.ok, (seed, run.message)
        assert [e.after for e in run.events].count(Mode.CONTACT) == 1, seed
        assert run.events[0].t == pytest.approx(time, rel=1e-9)
        assert run.events[-1].after is Mode.FREE
        assert run.v[-1] == pytest.approx(2.0 * (masses @ v0) / masses.sum() - v0, abs=1e-6 * speed), seed


@pytest.mark.parametrize("collisions", ["sequential", "resolved"])
@pytest.mark.parametrize("solver", SOLVERS)
def test_bodies_that_touch_and_fall_side_by_side_do_not_meet(solver: str, collisions: str) -> None:
    """Rounding opens and closes their gaps, and presses: with stiff laws and weak ones, in weak fields and strong."""
    for seed in range(8):
        rng = np.random.default_rng([20, seed])
        gravity, b0, n = 10.0 ** rng.uniform(0.0, 6.0), 10.0 ** rng.uniform(0.0, 8.0), int(rng.integers(2, 6))
        falling = tower(rng.uniform(0.1, 7.0, n).tolist(), gravity, b0, zeta=rng.choice([0.0, 0.3]))
        height = rng.uniform(1.0, 30.0)
        time = np.sqrt(height / gravity)
        start = [height] * n, [-0.1 * height / time] * n
        run = simulate(falling, *start, time, solver=solver, collisions=collisions)
        assert run.outcome.ok, (seed, run.message)
        assert not run.events, seed
        assert run.q[-1] == pytest.approx(np.full(n, 0.4 * height), rel=1e-6)


def pushed_to_a_wall(rng: np.random.Generator, forces: list[float], balls: int, damping: float) -> System:
    """Balls that touch each other and a wall, the first of them pushed to it by forces, and one far away."""
    n, H = balls + 1, np.eye(balls + 1) - np.eye(balls + 1, k=-1)
    base = constant(
        np.diag(rng.uniform(0.2, 5.0, n)), H, [0.0] * balls + [5.0], np.resize([*np.negative(forces), *[0.0] * n], n),
        zeta=0.3, b0=1e8,
    )  # fmt: skip
    kernels = {name: getattr(base, name) for name in ("dynamics", "gaps", "rows", "energy")}
    a0 = np.full(n, 10.0 ** rng.uniform(0.0, 4.0))
    return System(n=n, parameters=base.p, a0=a0, a1=damping, b0=1e8, b1=6e3, **kernels)


@pytest.mark.parametrize("solver", SOLVERS)
def test_gaps_and_rates_that_count_as_none_decide_nothing(solver: str) -> None:
    """What the laws of rows at rest make of them presses no other row, however stiff and damped they are."""
    for seed in range(20):
        rng = np.random.default_rng([21, seed])
        balls, speed = int(rng.integers(2, 5)), rng.uniform(1.0, 5.0)
        pressed = int(rng.integers(1, balls))
        forces, damping = rng.uniform(0.1, 1.0, pressed).tolist(), 10.0 ** rng.uniform(0.0, 4.0)
        system = pushed_to_a_wall(rng, forces, balls, damping)
        q0 = np.append(np.cumsum(rng.uniform(-4e-15, 4e-15, balls)), 0.0)
        v0 = np.append(np.cumsum(rng.uniform(-4e-10, 4e-10, balls)), 1.0) * speed
        run = simulate(system, q0, v0, 0.01, solver=solver, collisions="sequential")
        assert run.outcome.ok, (seed, run.message)
        assert sorted((e.contact, e.after) for e in run.events) == [(i, Mode.CONTACT) for i in range(pressed)], seed


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_row_is_pressed_however_much_stronger_another_is(solver: str) -> None:
    for seed in range(20):
        rng = np.random.default_rng([22, seed])
        pressed = int(rng.integers(2, 5))
        forces = [1.0, *(10.0 ** rng.uniform(-8.0, -6.0, pressed - 1)).tolist()]
        run = simulate(
            pushed_to_a_wall(rng, forces, pressed + 1, 10.0 ** rng.uniform(-1.0, 1.0)), np.zeros(pressed + 2),
            [0.0] * (pressed + 1) + [1e-3], 0.01, solver=solver, collisions="sequential",
        )  # fmt: skip
        assert run.outcome.ok, (seed, run.message)
        assert sorted((e.contact, e.after) for e in run.events) == [(i, Mode.CONTACT) for i in range(pressed)], seed
        sums = np.cumsum(forces[::-1])[::-1]
        np.testing.assert_allclose(run.lam[-1, :pressed], sums, rtol=1e-6)
