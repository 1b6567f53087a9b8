"""Rest is stiff, bouncing is not: the implicit method takes over and hands back."""

from dataclasses import replace

import numpy as np
import pytest
from mechanisms import ball, flyby

from crossbody import cases, engines
from crossbody.cases import Mode
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Loop, RowLaw, Scene
from crossbody.reference import System, kernels, simulate
from crossbody.reference.core import algebra, esdirk
from crossbody.reference.systems import ball as ball_kernels


def test_order_conditions():
    A, b, c = esdirk.A + np.diag([0.0] + [esdirk.GAMMA] * 5), esdirk.B, esdirk.C
    embedded = b - esdirk.E
    assert A.sum(axis=1) == pytest.approx(c, abs=1e-15)
    assert A[-1] == pytest.approx(b, abs=0)
    three = [
        (lambda w: w.sum(), 1),
        (lambda w: w @ c, 1 / 2),
        (lambda w: w @ c**2, 1 / 3),
        (lambda w: w @ A @ c, 1 / 6),
    ]
    four = [(b @ c**3, 1 / 4), ((b * c) @ A @ c, 1 / 8), (b @ A @ c**2, 1 / 12), (b @ A @ A @ c, 1 / 24)]
    for condition, value in three:
        assert condition(b) == pytest.approx(value, abs=1e-15)
        assert condition(embedded) == pytest.approx(value, abs=1e-15)
    for value, wanted in four:
        assert value == pytest.approx(wanted, abs=1e-15)
    far = 1.0 - 1e8 * b @ np.linalg.solve(np.eye(6) + 1e8 * A, np.ones(6))
    assert abs(far) < 1e-6, "L-stable"


def test_a_linear_system_is_solved_whatever_rows_are_exchanged():
    """Rows of sizes that differ make the factors exchange some that hold parts of earlier columns."""
    rng = np.random.default_rng(31)
    for _ in range(300):
        n = int(rng.integers(1, 9))
        A, x = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-2.0, 2.0, (n, 1)), rng.normal(size=n)
        factors, pivot, solution = A.copy(), np.zeros(n, dtype=np.int64), A @ x
        assert algebra.factor_lu.py_func(factors, n, pivot) == 0
        algebra.solve_lu.py_func(factors, n, pivot, solution)
        assert solution == pytest.approx(x, abs=1e-13 * np.linalg.cond(A))


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_a_rest_that_is_held_by_many_rows_is_walked_through_in_long_steps(rtol):
    """Newton's method arrives at once in what is all but linear: an implicit step is seldom refused, or taken anew."""
    run = engines.load("reference").prepare(cases.load("ball_maze", variant="inside"), "compiled", rtol=rtol).run()
    assert run.counts["implicit_steps"] > 0.9 * run.steps
    assert run.counts["rejected"] < 0.25 * run.steps
    assert run.counts["rhs"] < 30 * run.steps


@pytest.mark.parametrize("seed", range(4))
def test_friction_that_turns_costs_no_more_than_the_order_says(seed):
    """A cube that tumbles: ten times the work for four digits more of a method of order 4, if slips that die out and
    turn are known as stiff, and what a turn makes of all forces to Newton's method."""
    case = cases.load("tossed_cube", "tumbles")
    case = replace(case, v0=case.v0 * np.random.default_rng(seed).uniform(0.7, 1.3, 6))
    coarse, fine = (engines.load("reference").prepare(case, "compiled", rtol=rtol).run() for rtol in (1e-5, 1e-9))
    assert fine.counts["implicit_steps"] > 50
    assert fine.counts["rhs"] < 10 * coarse.counts["rhs"]


@pytest.mark.parametrize("a0", [1e4, 1e6, 1e8, 1e10, 1e12])
def test_rest_costs_under_a_hundred_steps(a0):
    system = ball(a0=a0, a1=2.0 * a0**0.5, a2=0.0)
    rest = simulate(system, [0.0], [-1e-5], 1.0, rtol=1e-8, shortcuts=False)
    drop = simulate(system, [0.1], [0.0], 1.0, rtol=1e-8, shortcuts=False)
    for run in (rest, drop):
        assert run.outcome.ok
        assert run.steps < 100
        assert run.counts["implicit_steps"] > 0
        assert run.lam[-1, 0] == pytest.approx(9.81, rel=1e-6)


@pytest.mark.parametrize(("stiffness", "implicit"), [(4e4, False), (1e8, True)])
def test_the_implicit_method_is_tried_where_its_steps_may_pay(stiffness, implicit):
    """An arm whose two fingers are coupled: explicit steps that accuracy bounds near the row's limit are the longest.

    Twelve implicit ones in their place made the error of two seconds fifty times as large.
    """
    axis, damping, rod = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.02, 0.02, 0.002, 0.0, 0.0, 0.0)
    upper = Body(name="upper", mass=1.0, com=(0.0, 0.0, -0.2), inertia=rod)
    lower = Body(name="lower", parent="upper", position=(0.0, 0.0, -0.4), mass=1.0, com=upper.com, inertia=rod)
    hinges = [Joint(name=link.name, body=link.name, type="hinge", axis=axis) for link in (upper, lower)]
    fingers = [Body(name=name, parent="lower", position=lower.position, mass=0.1, inertia=(1e-4,) * 3 + (0.0,) * 3)
               for name in ("left", "right")]  # fmt: skip
    slides = [Joint(name=body.name, body=body.name, type="slide", axis=(sign, 0.0, 0.0), damping=damping)
              for body, sign in zip(fingers, (1.0, -1.0), strict=True)]  # fmt: skip
    law = RowLaw(a0=stiffness, a1=2.0 * stiffness**0.5)
    coupling = Loop(name="grip", type="joint", first="left", second="right", law=law)
    scene = Scene(bodies=(upper, lower, *fingers), joints=(*hinges, *slides), loops=(coupling,))
    case = case_of(scene, q0=[0.5, 0.5, 0.0, 0.0], t_end=0.5 if implicit else 2.0)
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-5 if implicit else 1e-9).run()
    assert run.outcome.ok
    assert (run.counts["implicit_steps"] > 0) is implicit


def test_hands_back_to_the_explicit_method_at_an_event():
    from gusty import gusty

    inputs = ([0.0, 1.0, 1.2], [[0.0], [15.0], [0.0]])
    run = simulate(gusty(1e8, 2e4), [1e-6], [0.0], 4.0, rtol=1e-8, inputs=inputs)
    assert run.outcome.ok
    assert 0 < run.counts["implicit_steps"] < run.steps


@pytest.mark.parametrize("p", [1e2, 1e3, 1e4])
def test_stiff_pendulum_agrees_with_the_explicit_method(p):
    system = flyby(1.0, 9.81, a0=p * p, a1=2.0 * p, unilateral=False)
    start = ([1.0, 0.0], [0.0, 0.0])
    stiff, explicit = (
        simulate(system, *start, 1.0, rtol=1e-9, implicit=implicit, samples=[1.0]) for implicit in (True, False)
    )
    assert stiff.outcome.ok
    assert stiff.q[-1] == pytest.approx(explicit.q[-1], abs=2e-7)


@pytest.mark.parametrize(("a0", "a1", "speed"), [(545271.8, 9649.98, 1.04e-6), (649807.8, 16074.0, 1.07e-6)])
def test_a_ball_at_rest_in_closed_form_does_not_creep(a0, a1, speed):
    """Rounding of the force that holds it, 1e-15 m/s^2, would be 1e-15 m/s after a second: 1e-9 of its impact."""
    run = simulate(ball(a0=a0, a1=a1, a2=0.0), [0.0], [-speed], 1.0, ledger=False)
    assert run.counts["exact_steps"] == run.steps == 1
    assert abs(run.q[-1, 0]) < 1e-20
    assert abs(run.v[-1, 0]) < 1e-20


@kernels.dynamics
def _lifted(t, q, v, u, p, M, f, w):
    M[0, 0], f[0] = p[0], -p[0] * p[1] * np.cos(3.0 * t)


@pytest.mark.parametrize("implicit", [True, False])
@pytest.mark.parametrize("zeta", [0.2, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("a0", [1e6, 1e8])
def test_a_body_at_rest_lifts_off_where_nothing_presses_it(a0, zeta, implicit):
    """At 3 t = pi/2, whatever the tolerance: a0 times what a gap at rest is off by must not drown the multiplier."""
    system = System(
        n=1, parameters=[1.0, 9.81], a0=[a0], a1=2.0 * zeta * a0**0.5, **ball_kernels.KERNELS | {"dynamics": _lifted}
    )
    for rtol in (1e-3, 1e-4, 1e-6):
        run = simulate(system, [0.002], [0.0], 0.6, rtol=rtol, implicit=implicit, ledger=False)
        lifted = [event.t for event in run.events if event.before is Mode.CONTACT][-1]
        assert lifted == pytest.approx(np.pi / 6.0, abs=2e-7)
