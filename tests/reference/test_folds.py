"""A loop that folds flat ends ill posed, within a bounded number of steps; one that only comes close runs through."""

import numpy as np
import pytest
from four_bar import assembled, four_bar

from crossbody.cases import Outcome
from crossbody.reference import System, kernels, simulate
from crossbody.reference.sundials.equations import Equations
from crossbody.reference.sundials.folds import PROBE, TURN, Folds


@kernels.dynamics
def _free(t, q, v, u, p, M, f, w):
    M[0, 0], f[0] = 1.0, -1.0


@kernels.gaps
def _twice(t, q, v, p, h, hd):
    h[0], h[1], hd[0], hd[1] = q[0], q[0], v[0], v[0]


@kernels.rows
def _both(t, q, v, p, w, idx, na, H, h, Hdv):
    for j in range(na):
        H[j, 0], h[j], Hdv[j] = 1.0, q[0], 0.0


def one_coordinate_held_twice():
    """Two rows that say the same."""
    return System(n=1, dynamics=_free, gaps=_twice, rows=_both, unilateral=False, a0=[400.0] * 2, a1=40.0)


@kernels.dynamics
def _still(t, q, v, u, p, M, f, w):
    for i in range(3):
        M[i, 0], f[i] = 1.0, 0.0


@kernels.gaps
def _closing_gaps(t, q, v, p, h, hd):
    h[0], hd[0] = q[0], v[0]
    h[1], hd[1] = q[0] + (1.0 - q[2]) * q[1], v[0] + (1.0 - q[2]) * v[1] - v[2] * q[1]


@kernels.rows
def _closing_rows(t, q, v, p, w, idx, na, H, h, Hdv):
    for j in range(na):
        H[j, 0], H[j, 1], H[j, 2] = 1.0, 0.0, 0.0
        h[j], Hdv[j] = q[0], 0.0
        if idx[j] == 1:
            H[j, 1], H[j, 2] = 1.0 - q[2], -q[1]
            h[j], Hdv[j] = q[0] + (1.0 - q[2]) * q[1], -2.0 * v[1] * v[2]


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize(("left", "outcome"), [(4e-4, Outcome.ILL_POSED), (2.5e-3, Outcome.FINISHED)])
def test_rows_are_flat_at_a_thousandth_of_their_start_though_they_never_turn_over(left, outcome, solver):
    """x = 0 and x + s y = 0 with s falling evenly: pivot and least singular value go as s, and s ends above 0."""
    system = System(
        n=3, mass_block=1, dynamics=_still, gaps=_closing_gaps, rows=_closing_rows, unilateral=False, a0=[1.0] * 2,
        a1=2.0,
    )  # fmt: skip
    run = simulate(system, [0.0] * 3, [0.0, 0.0, 1.0], 1.0 - left, rtol=1e-6, solver=solver, max_step=0.1)
    assert run.outcome is outcome, run.message


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-11])
@pytest.mark.parametrize(
    ("lengths", "ground", "start", "fold"),
    [((1.0, 2.0, 1.0), 2.0, (1.0, 0.0, -2.1), 1.0), ((1.0, 2.0, 1.5), 1.5, (2.0, 0.0, -1.0), None)],
    ids=["parallelogram", "unequal"],
)
def test_a_linkage_that_folds_flat_is_ill_posed_there(lengths, ground, start, fold, rtol):
    system = four_bar(lengths, ground)
    q, v = assembled(system, start[0], start[1:])
    run = simulate(system, q, -v, 8.0, rtol=rtol, max_steps=2000)
    assert run.outcome is Outcome.ILL_POSED
    assert run.steps < 500
    assert "Rows [0, 1]" in run.message
    assert "condition" in run.message
    assert "t = " in run.message
    if fold is not None and rtol < 1e-8:  # the crank of a parallelogram turns evenly
        assert run.t[-1] == pytest.approx(fold, abs=5e-3)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize(("lengths", "ground"), [((1.0, 2.0, 2.0), 2.5), ((1.0, 2.0, 1.0), 2.001)])
def test_a_linkage_that_cannot_fold_runs_through(lengths, ground, rtol):
    """The second one comes to 3 % of its largest pivot."""
    system = four_bar(lengths, ground)
    q, v = assembled(system, 1.0, (0.2, -1.5) if ground == 2.5 else (0.0, -1.0))
    run = simulate(system, q, -v, 8.0, rtol=rtol, ledger=True)
    assert run.outcome.ok, run.message
    assert np.abs(run.gap).max() < 1e-2 * rtol + 1e3 * rtol * (rtol > 1e-4)


@pytest.mark.parametrize("rtol", [1e-3, 1e-7])
@pytest.mark.parametrize(
    ("solver", "lengths", "ground", "start"),
    [
        ("cvode", (1.0, 2.0, 1.0), 2.0, (1.0, 0.0, -2.1)),  # uniform: one step passes many folds
        ("cvode", (1.0, 2.0, 1.5), 1.5, (2.0, 0.0, -1.0)),
        ("ida", (1.0, 2.0, 1.5), 1.5, (2.0, 0.0, -1.0)),
    ],
)
def test_other_solvers_end_at_the_fold_too(solver, lengths, ground, start, rtol):
    system = four_bar(lengths, ground)
    q, v = assembled(system, start[0], start[1:])
    run = simulate(system, q, -v, 8.0, rtol=rtol, solver=solver, max_steps=2000)
    assert run.outcome is Outcome.ILL_POSED, run.message
    assert run.q[-1, 0] > 0.0  # flat where the crank lies along the ground, for the first time
    assert "Rows [0, 1] have " in run.message
    assert "condition" in run.message or "singular" in run.message
    assert "t = " in run.message


@pytest.mark.parametrize("solver", ["cvode", "ida"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-5])
def test_other_solvers_run_through_where_nothing_folds(rtol, solver):
    system = four_bar((1.0, 2.0, 2.0), 2.5)
    q, v = assembled(system, 1.0, (0.2, -1.5))
    run = simulate(system, q, -v, 8.0, rtol=rtol, solver=solver)
    assert run.outcome.ok, run.message


@pytest.mark.parametrize("solver", ["compiled", "cvode", "ida"])
def test_rows_that_outnumber_the_coordinates_are_called_singular(solver):
    q = np.zeros(1)
    run = simulate(one_coordinate_held_twice(), q, q, 0.1, solver=solver)
    assert run.outcome is Outcome.ILL_POSED
    assert "Rows [0, 1] have a singular H M^-1 H^T, of rank 1, near t = 0" in run.message


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_linkages_fold_where_their_lengths_say(seed):
    """Crank, coupler and rocker fold flat on the way of a full turn where longest + shortest = the two others."""
    rng = np.random.default_rng(seed)
    crank, coupler, rocker = rng.uniform(0.5, 2.0, 3)
    ground = crank + coupler - rocker if seed % 2 else np.inf
    slack = 1.0
    if not np.isfinite(ground) or ground <= 0.05:  # a crank that turns: the shortest, with room to spare
        crank, (coupler, rocker), ground, slack = 0.5, rng.uniform(1.5, 2.0, 2), 1.2, 0.0
    system = four_bar((crank, coupler, rocker), ground)
    q, v = assembled(system, 2.0, (0.3, -1.5))
    if np.abs(system.gap(q)[0]).max() > 1e-9:
        pytest.skip("these lengths cannot be assembled at that angle")
    run = simulate(system, q, -v, 2.0 * np.pi, rtol=1e-8, max_steps=5000)
    if slack:
        assert run.outcome is Outcome.ILL_POSED
    else:
        assert run.outcome.ok, run.message


@kernels.gaps
def _turning_gaps(t, q, v, p, h, hd):
    s, c = np.sin(q[2]), np.cos(q[2])
    h[0], hd[0] = c * q[0] + s * q[1], c * v[0] + s * v[1] + (c * q[1] - s * q[0]) * v[2]
    h[1], hd[1] = c * q[1] - s * q[0], c * v[1] - s * v[0] - (c * q[0] + s * q[1]) * v[2]


@kernels.rows
def _turning_rows(t, q, v, p, w, idx, na, H, h, Hdv):
    for j in range(na):
        s, c = np.sin(q[2]), np.cos(q[2])
        if idx[j] == 1:
            s, c = c, -s
        H[j, 0], H[j, 1], H[j, 2] = c, s, c * q[1] - s * q[0]
        h[j], Hdv[j] = c * q[0] + s * q[1], 0.0


@pytest.mark.parametrize("turned", [0.1, 0.7, 3.0, 12.0])
def test_rows_are_looked_at_as_often_as_they_turn(turned):
    """Two rows about the origin turn by sqrt(2) times the angle: over every part of a step by no more than TURN."""
    system = System(
        n=3, mass_block=1, dynamics=_still, gaps=_turning_gaps, rows=_turning_rows, unilateral=False, a0=[1.0] * 2,
        a1=2.0,
    )  # fmt: skip
    watching, looks = Folds(Equations(system)), []

    def state(t):
        looks.append(t)
        return np.array([0.0, 0.0, turned * t]), np.zeros(3)

    watching.begin(0.0, np.zeros(3), np.zeros(3))
    for step in range(3):
        looks.clear()
        watching.check(float(step), step + 1.0, state)
        parts = len({t for t in looks if t > step + 2.0 * PROBE})
        assert parts == pytest.approx(np.ceil(np.sqrt(2.0) * turned / TURN), rel=0.1, abs=1.0)
