"""Roots as those of scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from crossbody.cases.brent import brent

KINDS = {
    "polynomial": lambda c, x: c[0] + x * (c[1] + x * (c[2] + x * c[3])),
    "kinked": lambda c, x: c[0] + c[1] * x + 10.0 * c[2] * abs(x - c[3]),
    "flat": lambda c, x: (x - c[0]) ** 9 + 1e-12 * c[1],
    "step": lambda c, x: (1.0 if x > c[0] else -1e-3) * (1.0 + c[1] ** 2),
    "zero at an end": lambda c, x: x * (x - 3.0),
}


@pytest.mark.parametrize("kind", KINDS)
def test_roots_and_the_way_to_them_are_those_of_scipy(kind: str) -> None:
    rng, found = np.random.default_rng(5), 0
    for xtol, rtol in ((1e-300, 8.9e-16), (1e-6, 1e-9)):
        for _ in range(400):
            c, (a, b) = rng.normal(size=4), rng.uniform(-2.0, 2.0, 2)
            if kind == "zero at an end":
                a, b = rng.permutation([0.0, rng.uniform(0.1, 2.0)])
            ways: list[list[float]] = [[], []]

            def noted(x: float, way: list[float], c: np.ndarray = c) -> float:
                way.append(x)
                return float(KINDS[kind](c, x))

            if noted(a, []) * noted(b, []) > 0.0:
                continue
            found += 1
            theirs = brentq(noted, float(a), float(b), (ways[0],), xtol, rtol)
            own = brent(lambda x, way=ways[1], noted=noted: noted(x, way), float(a), float(b), xtol, rtol)
            assert own == theirs
            assert ways[1] == ways[0]
    assert found > 50
