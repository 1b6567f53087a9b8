"""IDA on closed loops at index 1: about the steps that the library needs on its own, and no failure when tight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from four_bar import assembled, four_bar
from mechanisms import ball
from sksundae.ida import IDA

from crossbody.reference import System, delta, simulate
from crossbody.reference.sundials.equations import Equations
from crossbody.reference.sundials.quiet import quiet

T_END = 0.3
ROBOT = delta.system(delta.LIGHT)
POSE = np.array(delta.inverse(delta.LIGHT, (0.05, 0.0, 0.6)))


def direct_steps(rtol: float) -> int:
    """Steps of the bare library from the same rest, every component held to the same tolerance."""
    e, n, nc = Equations(ROBOT), ROBOT.n, ROBOT.nc
    e.activate([5] * nc)

    def residual(t: float, y: Any, yp: Any, out: Any) -> None:
        q, v, vd = y[:n].copy(), y[n : 2 * n].copy(), yp[n : 2 * n]
        M, f = e.terms(t, q, v)
        H, h, Hdv = e.rows(t, q, v)
        out[:n], out[n : 2 * n] = yp[:n] - v, M @ vd - f - H.T @ y[2 * n :]
        out[2 * n :] = H @ vd + Hdv + e.drive(h, H @ v)

    vd, lam = e.accelerate(0.0, POSE, np.zeros(n))
    places = list(range(2 * n, 2 * n + nc))
    with quiet():
        solver = IDA(residual, rtol=rtol, atol=1e-3 * rtol, algebraic_idx=places, max_num_steps=100_000)
        found = solver.solve(
            np.array([0.0, T_END]), np.concatenate([POSE, np.zeros(n), lam]),
            np.concatenate([np.zeros(n), vd, np.zeros(nc)]),
        )  # fmt: skip
    assert found.status >= 0
    return len(found.t)


@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
def test_a_closed_loop_takes_no_more_steps_than_the_bare_library(rtol: float) -> None:
    run = simulate(ROBOT, POSE, np.zeros(9), T_END, rtol=rtol, solver="ida", samples=[T_END])
    assert run.outcome.ok, run.message
    assert run.steps <= 1.3 * direct_steps(rtol)  # a tenth of the tolerance is asked for, which costs 10^(1/6) = 1.5


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_a_closed_loop_released_at_rest_is_followed(rtol: float) -> None:
    run = simulate(ROBOT, POSE, np.zeros(9), T_END, rtol=rtol, solver="ida", samples=[0.0, T_END])
    truth = simulate(ROBOT, POSE, np.zeros(9), T_END, rtol=1e-13, samples=[0.0, T_END])
    assert run.outcome.ok, run.message
    np.testing.assert_allclose(run.q[-1], truth.q[-1], atol=100.0 * rtol)
    np.testing.assert_allclose(run.lam[-1], truth.lam[-1], rtol=0.0, atol=1e4 * rtol * np.abs(truth.lam).max())


def held() -> tuple[System, np.ndarray, np.ndarray]:
    """A ball a millimetre off the height that it is held at: it creeps back, and then nothing is left but rounding."""
    return ball(unilateral=False), np.array([1e-3]), np.zeros(1)


def parallelogram() -> tuple[System, np.ndarray, np.ndarray]:
    """Links that turn evenly, up to shortly before they fold flat."""
    system = four_bar((1.0, 2.0, 1.0), 2.0)
    q, v = assembled(system, 1.0, (0.0, -2.1))
    return system, q, -v


@pytest.mark.parametrize("rtol", [1e-6, 1e-12])
@pytest.mark.parametrize(("scene", "t_end"), [(held, 5.0), (parallelogram, 0.9)])
def test_rows_that_are_always_on_are_followed_at_every_tolerance(scene: Any, t_end: float, rtol: float) -> None:
    """A difference of velocities over a short step, in place of a force, drowned the multiplier in its rounding."""
    system, q0, v0 = scene()
    options = {"samples": [t_end], "consistent": False, "max_steps": 5000}
    run = simulate(system, q0, v0, t_end, rtol=rtol, solver="ida", **options)
    assert run.outcome.ok, run.message
    truth = simulate(system, q0, v0, t_end, rtol=1e-13, **options)
    np.testing.assert_allclose(run.q[-1], truth.q[-1], atol=100.0 * rtol)
