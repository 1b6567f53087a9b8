"""Ratios of run times, taken in one run."""

from __future__ import annotations

import time

import numpy as np
import pytest
from numba import njit

from crossbody.reference import delta
from crossbody.reference.delta.kernels import kinematics as kinematics
from crossbody.reference.delta.kernels import robot as kernels
from crossbody.reference.delta.kinematics import MOTORS, OTHERS

pytestmark = pytest.mark.bench
solve, update = kernels.solve, kinematics.update
N = 20_000


@njit
def yardstick(n, x, A, L, b, c):
    """A fixed scalar kernel: 18 sines and cosines, a 6 x 6 Cholesky solve, 300 multiply-adds."""
    total = 0.0
    for step in range(n):
        for i in range(9):
            c[i], c[9 + i] = np.cos(x[i]), np.sin(x[i])
        for j in range(6):
            for i in range(j, 6):
                value = A[i, j]
                for k in range(j):
                    value -= L[i, k] * L[j, k]
                L[i, j] = np.sqrt(value) if i == j else value / L[j, j]
        for i in range(6):
            value = c[i]
            for k in range(i):
                value -= L[i, k] * b[k]
            b[i] = value / L[i, i]
        for i in range(5, -1, -1):
            value = b[i]
            for k in range(i + 1, 6):
                value -= L[k, i] * b[k]
            b[i] = value / L[i, i]
        for k in range(50):
            for i in range(6):
                b[i] += c[i] * A[i, k % 6]
        x[step % 9] += 1e-9
        total += b[0]
    return total


@njit
def right_sides(n, q, v, u, p, w, law, idx, vd, lam, hd):
    bad = 0
    for step in range(n):
        bad += solve(0.0, q, v, u, p, w, law, idx, 6, vd, lam, hd)
        q[step % 9] += 1e-9
    return bad


@njit
def updates(n, p, y, x, z, Jy, X, tau):
    bad = 0
    for step in range(n):
        y[0] += 1e-3 if step % 2 else -1e-3
        bad += update(p, y, x, z, Jy, X, tau) < 0
    return bad


def best(function, *arguments):
    """Shortest of several runs, seconds a call."""
    function(1, *arguments)
    spans = []
    for _ in range(9):
        start = time.perf_counter()
        function(N, *arguments)
        spans.append(time.perf_counter() - start)
    return min(spans) / N


def pose():
    return delta.inverse(delta.LIGHT, (0.1, -0.05, 0.55))


def fixed():
    return best(yardstick, np.linspace(0.1, 1, 9), 6 * np.eye(6) + 1.0, np.zeros((6, 6)), np.zeros(6), np.zeros(18))


def test_right_side_with_lam_costs_at_most_two_and_a_half_yardsticks():
    law, idx = np.tile([25.0, 10.0, 0.0], (6, 1)), np.arange(6)
    buffers = np.zeros(18), law, idx, np.zeros(9), np.zeros(6), np.zeros(6)
    cost = best(right_sides, pose(), np.zeros(9), np.zeros(6), delta.LIGHT.array(), *buffers)
    print(f"right-hand side {1e9 * cost:.0f} ns, yardstick {1e9 * fixed():.0f} ns")
    assert cost < 2.5 * fixed()


def test_control_update_costs_at_most_ten_microseconds_of_this_machine():
    """10 us compiled, 20 us from Python, told in yardsticks of 0.5 us."""
    q = pose()
    buffers = q[MOTORS].copy(), q[OTHERS].copy(), np.zeros(3), np.zeros((3, 3)), np.zeros((6, 3)), np.zeros(3)
    p = delta.LIGHT.array()
    compiled = best(updates, p, *buffers)

    def called(n):
        for _ in range(n):
            update(p, *buffers)

    python = best(called)
    print(f"control update {1e6 * compiled:.2f} us compiled, {1e6 * python:.2f} us from Python")
    assert compiled < 20 * fixed()
    assert python < 40 * fixed()


def mean_error(case, run):
    """Largest error of the flange against the reference at 1e-13, m."""
    from crossbody import engines
    from crossbody.reference.delta import scene

    _, first = np.unique(run.t, return_index=True)
    exact = engines.load("reference").prepare(case, rtol=1e-13, samples=run.t[first]).run()
    robot = scene.robot_of(case.parameters)
    return np.abs(delta.flanges(robot, run.q[first]) - delta.flanges(robot, exact.q)).max()


def cheapest(case, name, profile, knob, settings, error):
    """The coarsest setting whose error is small enough: prepared, and its error."""
    from crossbody import engines

    for value in settings:
        run = engines.load(name).prepare(case, profile, **{knob: value})
        found = mean_error(case, run.run())
        if found <= error:
            return run, found
    raise AssertionError(f"{name}:{profile} does not come below {error:g} m")


PEERS = {
    "pinocchio": ("law", "rtol", (1e-7, 3e-8, 1e-8, 3e-9, 1e-9, 3e-10, 1e-10), 20.0),
    "mujoco": ("matched", "dt", (1.6e-2, 1.2e-2, 8e-3, 6e-3, 4e-3, 3e-3, 2e-3, 1e-3), 15.0),
}


@pytest.mark.parametrize("name", PEERS)
def test_impulse_at_a_nanometre_is_faster_than_the_peers(name):
    """Each at the coarsest setting with 1e-9 m achieved, interleaved, the best of several; the reference unsampled."""
    from crossbody.cases import load

    pytest.importorskip(name)
    case = load("delta_impulse")
    profile, knob, settings, factor = PEERS[name]
    peer, theirs = cheapest(case, name, profile, knob, settings, 1e-9)
    own, mine = cheapest(case, "reference", "compiled", "rtol", (1e-6, 1e-7, 3e-8, 1e-8, 1e-9), 1e-9)
    spans = {"own": [], "peer": []}
    for _ in range(9):
        spans["own"].append(own.run().wall_s)
        spans["peer"].append(peer.run().wall_s)
    ratio = min(spans["peer"]) / min(spans["own"])
    print(
        f"{name} {1e3 * min(spans['peer']):.2f} ms ({knob} {peer.settings[knob]:g}, {theirs:.1e} m), reference "
        f"{1e3 * min(spans['own']):.3f} ms (rtol {own.settings['rtol']:g}, {mine:.1e} m): {ratio:.1f} times"
    )
    assert ratio > factor
