"""Passes that just touch or just do not: a pendulum whose far end of the swing is where its neighbour hangs."""

from __future__ import annotations

import math

import numpy as np

from crossbody.reports.suites._axis import Levels, Linear
from crossbody.reports.suites._contract import TIGHT, Drawn, Family, Suite
from crossbody.reports.suites._scenes import numbers

RADIUS, LENGTH = 0.025, 0.25


def _passing(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """The gap at rest for which the swing ends `off` metres before (positive) or behind the touch.

    Centres at rest stand D apart; the ball at the end of its swing stands (L sin A, L (1 - cos A)) from its own rest,
    and touches where (D - L sin A)^2 + L^2 (1 - cos A)^2 = 4 r^2.
    """
    swing, off = numbers(drawn, "swing", "off")
    across, up = LENGTH * math.sin(swing), LENGTH * (1.0 - math.cos(swing))
    apart = across + math.sqrt(4.0 * RADIUS**2 - up * up)
    return {"n": 2, "angle": -swing, "gap": apart - 2.0 * RADIUS + off}


def _near() -> Levels:
    sizes = [10.0**k for k in range(-12, -2)]
    return Levels((*(-size for size in sizes), *sizes))


# The speed at a touch is the square root of how deep the pass would be, and an error of the swing comes out as one of
# its square root. At passes closer than the tolerance even whether they touch is open: the motions diverge there.
SUITE = Suite(
    families=(
        Family(
            case="newtons_cradle", variant="pendulums", scene=_passing, second=10, ladder=TIGHT,
            fixed={"radius": RADIUS, "length": LENGTH, "t_end": 1.5},
            axes={"swing": Linear(0.05, 0.6)}, grid={"off": _near()},
        ),
    ),
    runs=150,
)  # fmt: skip
