"""Speeds of impact from 1e-6 to 1e3 m/s, with and without gravity, around the speed below which nothing leaves."""

from __future__ import annotations

import math

import numpy as np

from crossbody.cases import closed_forms as cf
from crossbody.reports.suites._axis import Levels, Linear, Log
from crossbody.reports.suites._contract import TIGHT, Drawn, Family, Suite
from crossbody.reports.suites._scenes import damped, numbers


def _threshold(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """A speed as a multiple of the threshold speed."""
    a0, zeta, near = numbers(drawn, "a0", "zeta", "near")
    a1 = 2.0 * zeta * math.sqrt(a0)
    return {"a0": a0, "a1": a1, "speed": near * cf.threshold_speed(a0, a1, 9.81)}


# At 1e-6 m/s the default absolute tolerance of 1e-12 is a millionth of all there is. A hard floor that damps little is
# bounced on at such speeds more often than the bound on steps allows.
SUITE = Suite(
    families=(
        Family(
            case="bouncing_ball", variant="linear", scene=damped, fixed={"height": 0.0, "t_end": 0.5}, ladder=TIGHT,
            finishes=False,
            axes={"speed": Log(1e-6, 1e3), "a0": Log(1.0, 1e12), "zeta": Linear(0.05, 2.0)},
            grid={"gravity": Levels((0.0, 9.81))},
        ),
        Family(
            case="bouncing_ball", variant="linear", scene=_threshold, fixed={"height": 0.0, "t_end": 0.5},
            ladder=TIGHT,
            axes={"a0": Log(1e2, 1e10), "zeta": Linear(0.0, 2.0)},
            grid={"near": Levels((0.5, 0.9, 0.99, 1.0 - 1e-6, 1.0 + 1e-6, 1.01, 1.1, 2.0))},
        ),
        Family(
            case="newtons_cradle", variant="sliders", fixed={"n": 2, "collisions": "resolved"}, second=10,
            ladder=TIGHT,
            axes={"speed": Log(1e-6, 1e3), "a0": Log(1.0, 1e12), "zeta": Linear(0.0, 2.0)},
        ),
    ),
    runs=560,
)  # fmt: skip
