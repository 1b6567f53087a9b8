"""What a sampled loop claims to miss a circle by is the response of that loop, solved in samples."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from crossbody.cases.library import delta_tracking

NEAR = 0.02
"""Part by which the claim, of first order in the period, may be off: of periods of a thousandth of the loop's times."""


def missed(p: dict[str, float], delay: int) -> float:
    """Return by how much a point of x'' = u misses a circle, m: what z = exp(i w T) makes of one step of the loop.

    u = r'' + kp e + kd (r' - (x_k - x_k-1)/T) + ki I, held over a period, some of them late.
    """
    w, T, R = 2.0 * math.pi * p["frequency"], p["period"], p["radius"]
    z = cmath.exp(1j * w * T)
    moves = 0.5 * T * T * (z + 1.0) / (z - 1.0) ** 2 * z**-delay  # x of a command of 1
    errors = p["kp"] + p["ki"] * T * z / (z - 1.0)
    rates = p["kd"] * (1.0 - 1.0 / z) / T
    given = R * (-w * w + errors + p["kd"] * 1j * w)
    x = moves * given / (1.0 + moves * (errors + rates))
    return abs(R - x)


@pytest.mark.parametrize("seed", range(12))
def test_the_lag_that_is_claimed_is_that_of_the_sampled_loop(seed: int) -> None:
    draw = np.random.default_rng(seed)
    pole, delay = draw.uniform(5.0, 15.0), int(draw.integers(0, 4))
    p = {
        "radius": draw.uniform(0.01, 0.1), "frequency": draw.uniform(0.5, 2.0), "period": 1e-3 / pole / (1 + delay),
        "kp": 3.0 * pole**2, "kd": 3.0 * pole, "ki": pole**3,
    }  # fmt: skip
    found = delta_tracking._lag({**p, "delay": delay})
    assert found == pytest.approx(missed(p, delay), rel=NEAR)
