"""Which rows are active at one instant: the same in every order of the rows and in every machine, without cycles."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from springs import beside, inside, mirrored

from crossbody import cases, engines
from crossbody.cases import Mode
from crossbody.reference import simulate


def _active(run, order=None):
    """Rows in contact once the start has settled, in their own order."""
    modes = np.full(run.mode.shape[1], Mode.FREE)
    for event in run.events:
        if event.t == 0.0:
            modes[event.contact] = event.after
    rows = np.flatnonzero(modes == Mode.CONTACT)
    return sorted(rows.tolist() if order is None else np.asarray(order)[rows].tolist())


def _starts(seeds, solvers, drawn=inside):
    for seed in seeds:
        x, a0, a1 = drawn(seed)
        rows = range(len(x.H))
        first = simulate(beside(x, a0, a1, list(rows)), x.q0, x.v0, 1e-6, rtol=1e-9)
        for order in permutations(rows):
            again = simulate(beside(x, a0, a1, list(order)), x.q0, x.v0, 1e-6, rtol=1e-9)
            assert _active(again, order) == _active(first), f"{seed}: rows in the order {order}"
        for solver in solvers:
            other = simulate(beside(x, a0, a1, list(rows)), x.q0, x.v0, 1e-6, rtol=1e-9, solver=solver)
            assert _active(other) == _active(first), f"{seed}: {solver}"


def test_a_start_inside_several_walls_settles_the_same_in_every_order_and_machine():
    _starts(range(2), ["cvode", "ida"])
    _starts(range(2, 12), ["cvode"])


def test_a_start_on_a_mirror_settles_the_same_in_every_order_and_machine():
    """Rows that change the acceleration equally: none of them may be taken because it comes first."""
    _starts(range(2), ["cvode", "ida"], mirrored)


@pytest.mark.slow
def test_two_thousand_starts_inside_several_walls_settle_the_same():
    _starts(range(12, 2012), ["cvode"])


DAMPED = [
    (zeta, n, rtol)
    for zeta in (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.3, 1.6, 2.0)
    for n in range(2, 11)
    for rtol in (1e-6, 1e-9)
]


def _swings(zeta, n, rtol, solver="compiled"):
    case = cases.load("newtons_cradle", variant="pendulums", zeta=zeta, n=n)
    run = engines.load("reference").prepare(case, solver, rtol=rtol).run()
    assert run.outcome.ok, f"zeta {zeta}, n {n}, rtol {rtol}: {run.message}"


@pytest.mark.parametrize(("zeta", "n", "rtol"), [(0.3, 5, 1e-9), (0.5, 5, 1e-9), (0.3, 5, 1e-6), (1.0, 7, 1e-6)])
def test_pendulums_that_swing_together_do_not_cycle(zeta, n, rtol):
    _swings(zeta, n, rtol)


@pytest.mark.parametrize("solver", ["cvode", "ida"])
def test_pendulums_that_collapse_do_not_cycle_in_the_other_solvers(solver):
    _swings(1.0, 7, 1e-6, solver)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize(("zeta", "n", "rtol"), DAMPED)
def test_no_damped_cradle_cycles(zeta, n, rtol, solver):
    _swings(zeta, n, rtol, solver)
