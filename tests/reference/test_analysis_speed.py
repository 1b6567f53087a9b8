"""What a linear model costs, in right-hand sides of the same mechanism, timed side by side in one run."""

from __future__ import annotations

import time

import numpy as np
import pytest
from numba import njit

from crossbody.reference import delta
from crossbody.reference.delta.kernels.robot import solve
from crossbody.reference.linear import _many, _pattern, poses

ROBOT = delta.LIGHT


@njit
def right_hand_sides(q, u, p, law, idx, vd, lam, hd):
    v, w = np.zeros(9), np.zeros(18)
    for i in range(len(q)):
        solve(0.0, q[i], v, u, p, w, law, idx, 6, vd, lam, hd)


def timed(*calls, repeats=12):
    """Best time of each, turn and turn about, s."""
    best = np.full(len(calls), np.inf)
    for _ in range(repeats):
        for k, call in enumerate(calls):
            start = time.perf_counter()
            call()
            best[k] = min(best[k], time.perf_counter() - start)
    return best


def poses_of(count):
    z = np.random.default_rng(1).uniform([-0.1, -0.1, 0.4], [0.1, 0.1, 0.7], (count, 3))
    return delta.inverses(ROBOT, z)[0]


def scene(count):
    system, q = delta.system(ROBOT, p=20.0), poses_of(count)
    rest = (
        np.zeros(6),
        np.array(system.p),
        np.array(system.alpha),
        np.arange(6),
        np.zeros(9),
        np.zeros(6),
        np.zeros(6),
    )
    return system, q, lambda: right_hand_sides(q, *rest)


@pytest.mark.bench
def test_one_linearisation_costs_at_most_forty_right_hand_sides():
    """Short batches, often: the best of each was not interrupted. What any batch costs is taken out."""
    system, q, rhs = scene(60)
    X = _many.states(system, q, None, None)
    at = _many.first(system, X, None, 0.0)
    pattern = _pattern.coloured(_pattern.observed(at))
    base, few, many = timed(
        rhs, lambda: _many._evaluated(at, X[:10], pattern, 1), lambda: _many._evaluated(at, X, pattern, 1), repeats=400
    )  # fmt: skip
    assert (many - few) / 50 <= 40.0 * base / 60


@pytest.mark.bench
def test_a_map_of_a_hundred_thousand_poses():
    """Trim, minimal model and poles: at most one and a half times that bound, of processor time."""
    system, q, rhs = scene(100_000)
    base = timed(rhs, repeats=3)[0]
    start = time.process_time()
    found = poses(system, q, [0, 1, 2])
    assert time.process_time() - start <= 1.5 * 40.0 * base
    assert found.well_posed.all()
