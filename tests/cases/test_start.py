"""A start off the rows that are always on is refused, and the one that is offered instead is admitted."""

from __future__ import annotations

import re
from importlib import import_module

import numpy as np
import pytest
from linear_rows import linear_rows
from mechanisms import ball, flyby

from crossbody import cases, engines
from crossbody.cases import InvalidValue, Outcome, SceneError
from crossbody.engines.equations import system_of
from crossbody.reference import Options, ensemble, prepare, simulate

SOLVERS = ("compiled", "cvode", "ida")
OFFER = re.compile(r"q0 = (\[.*?\]), v0 = (\[.*?\])")


def _pendulum():
    return flyby(1.0, 9.81, a0=25.0, a1=10.0, unilateral=False)


def _offered(message):
    return [np.array(eval(numbers)) for numbers in OFFER.search(message).groups()]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("q", "v"), [([1.2, 0.3], [0.0, 0.0]), ([1.0, 0.0], [0.5, 0.0]), ([0.7, 0.8], [1.0, 2.0])])
def test_the_start_that_is_offered_is_admitted(solver, q, v):
    with pytest.raises(SceneError, match="row 0, which is always on") as caught:
        simulate(_pendulum(), q, v, 0.1, solver=solver)
    q0, v0 = _offered(str(caught.value))
    assert abs(np.hypot(*q0) - 1.0) < 1e-14
    assert abs(q0 @ v0) < 1e-14
    assert simulate(_pendulum(), q0, v0, 0.1, solver=solver).outcome is Outcome.FINISHED
    assert simulate(_pendulum(), q, v, 0.1, solver=solver, consistent=False).outcome is Outcome.FINISHED


@pytest.mark.parametrize("seed", range(50))
def test_linear_rows_are_met_by_the_least_change(seed):
    """Against the closed form of weighted least squares by a dense solve, with masses over six decades."""
    draw = np.random.default_rng(seed)
    n = int(draw.integers(2, 7))
    nc = int(draw.integers(1, n))
    root = draw.standard_normal((n, n)) * 10.0 ** draw.uniform(-1.5, 1.5, n)[:, None]
    M, H, c = root @ root.T + 1e-3 * np.eye(n), draw.standard_normal((nc, n)), draw.standard_normal(nc)
    system = linear_rows(M, H, c, 100.0, 20.0, unilateral=False)
    q, v = draw.standard_normal(n), draw.standard_normal(n)
    with pytest.raises(SceneError, match="off row"):
        prepare(system, q, v, Options(t_end=1.0))
    q0, v0 = system.project(q, v)
    saddle = np.block([[M, H.T], [H, np.zeros((nc, nc))]])
    nearest = [np.linalg.solve(saddle, np.concatenate([M @ x, b]))[:n] for x, b in ((q, -c), (v, np.zeros(nc)))]
    scale = np.linalg.cond(M) * 1e-14
    np.testing.assert_allclose(q0, nearest[0], atol=max(scale, 1e-10), rtol=0.0)
    np.testing.assert_allclose(v0, nearest[1], atol=max(scale, 1e-10), rtol=0.0)
    prepare(system, q0, v0, Options(t_end=1.0, rtol=1e-14))


@pytest.mark.parametrize("rtol", [1e-12, 1e-9, 1e-6, 1e-3])
def test_what_the_tolerance_explains_is_admitted(rtol):
    part = min(1e3 * rtol, 1e-3)
    for off, refused in ((0.1 * part, False), (10.0 * part, True)):
        for q, v in (([1.0 + off, 0.0], [0.0, 0.0]), ([1.0, 0.0], [off, 1.0])):
            assert _refuses(q, v, rtol) is refused


def _refuses(q, v, rtol):
    try:
        prepare(_pendulum(), q, v, Options(t_end=1.0, rtol=rtol))
    except SceneError:
        return True
    return False


def test_rows_that_depend_on_each_other_have_a_start():
    system = linear_rows(np.eye(3), [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [1.0, 2.0], 100.0, 20.0, unilateral=False)
    q, v = system.project([0.3, 0.4, 0.5], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(q, [-1.0, 0.4, 0.5], atol=1e-15)
    np.testing.assert_allclose(v, [0.0, 2.0, 3.0], atol=1e-15)


def test_rows_that_cannot_be_met_have_no_start():
    system = linear_rows(np.eye(2), [[1.0, 0.0], [1.0, 0.0]], [1.0, 2.0], 100.0, 20.0, unilateral=False)
    with pytest.raises(SceneError, match="No start on the rows"):
        simulate(system, [0.0, 0.0], [0.0, 0.0], 1.0)
    with pytest.raises(SceneError, match="No state on the rows"):
        system.project([0.0, 0.0])


def test_a_row_that_holds_a_rate_asks_nothing_of_the_gap():
    rate = linear_rows(np.eye(2), [[1.0, 0.0]], [0.7], 0.0, 20.0, unilateral=False)
    assert simulate(rate, [0.0, 0.0], [0.0, 1.0], 0.1).outcome is Outcome.FINISHED
    with pytest.raises(SceneError, match="h' = 1,"):
        simulate(rate, [0.0, 0.0], [1.0, 1.0], 0.1)


def test_unilateral_rows_may_start_anywhere():
    assert simulate(ball(), [-0.1], [3.0], 0.1).outcome is Outcome.FINISHED


def test_every_start_of_an_ensemble_is_looked_at():
    q, v = np.tile([1.0, 0.0], (5, 1)), np.zeros((5, 2))
    q[3] = [1.1, 0.0]
    with pytest.raises(SceneError, match="of run 3 is off row 0"):
        ensemble(_pendulum(), q, v, 0.1, threads=1)
    found = ensemble(_pendulum(), q, v, 0.1, threads=1, consistent=False)
    assert all(outcome is Outcome.FINISHED for outcome in found.outcome)


def test_the_option_is_a_flag():
    with pytest.raises(InvalidValue, match="consistent"):
        Options(t_end=1.0, consistent="no")


def test_a_case_may_start_off_its_rows():
    run = engines.load("reference").prepare(cases.load("bouncing_ball", variant="bilateral"), rtol=1e-6).run()
    assert abs(run.gap[0, 0]) > 5e-4
    assert abs(run.gap[-1, 0]) < 1e-6


ALL = [
    (name, variant) for name in cases.names() for variant in import_module(f"crossbody.cases.library.{name}").VARIANTS
]


@pytest.mark.parametrize(("name", "variant"), ALL)
def test_shipped_cases_start_on_their_rows_or_say_that_they_do_not(name, variant):
    case = cases.load(name, variant=variant)
    prepare(system_of(case), case.q0, case.v0, Options(t_end=case.t_end, rtol=1e-13, consistent=case.consistent))
    assert case.consistent == ((name, variant) != ("bouncing_ball", "bilateral"))


def test_a_tolerance_that_is_a_flag_is_the_number_1():
    """An array of flags has no sum with a part of a tolerance."""
    system = ball()
    runs = [simulate(system, [1.0], [0.0], 0.1, rtol=1e-3, atol=atol) for atol in (True, 1.0)]
    assert np.array_equal(*(run.q for run in runs))
