"""Which of several touching balls are struck first, and which at all, in engines that know impacts alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases, engines

pytest.importorskip("pinocchio")


def struck(masses: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Velocities after elastic impacts of balls in a row that touch, the most approaching neighbours first."""
    v = v.copy()
    for _ in range(10_000):
        rates = np.diff(v)
        i = int(np.argmin(rates))
        if rates[i] >= -1e-12 * np.abs(v).max():
            return v
        m1, m2 = masses[i : i + 2]
        p = -2.0 * rates[i] / (1.0 / m1 + 1.0 / m2)
        v[i], v[i + 1] = v[i] - p / m1, v[i + 1] + p / m2
    raise AssertionError("impacts without an end")


@pytest.mark.parametrize("seed", range(12))
def test_the_fastest_are_struck_first_and_the_slowest_too(seed: int) -> None:
    rng = np.random.default_rng([seed, 15])
    masses = np.round(10.0 ** rng.uniform(-0.5, 0.5, 4), 3)
    rates = -(10.0 ** rng.uniform(-4.0, 0.0, 3)) if seed % 2 else -rng.uniform(0.5, 1.0, 3)
    v = np.cumsum([0.3, *rates])
    case = cases.load("newtons_cradle", "sliders", n=4, masses=",".join(map(str, masses)), t_end=1e-3)
    run = engines.load("pinocchio").prepare(replace(case, v0=v), "impulse").run()
    assert run.outcome.ok, run.message
    np.testing.assert_allclose(run.v[-1], struck(masses, v), rtol=1e-6, atol=1e-9)
