"""Up to 1e5 bounces of one ball in a run."""

from __future__ import annotations

import math

import numpy as np

from crossbody.reports.suites._axis import Log
from crossbody.reports.suites._contract import Drawn, Family, Ladder, Suite
from crossbody.reports.suites._scenes import numbers

GRAVITY = 9.81


def _long(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """A horizon of so many flights of the first bounce."""
    bounces, height, a0 = numbers(drawn, "bounces", "height", "a0")
    flight = 2.0 * math.sqrt(2.0 * height / GRAVITY) + math.pi / math.sqrt(a0)
    return {"height": height, "a0": a0, "a1": 0.0, "gravity": GRAVITY, "t_end": bounces * flight}


# Errors of a bounce add up: 1e5 of them ask for a tighter tolerance than one.
TIGHT = Ladder(rtol=(1e-12,), dt=(1e-4,))

SUITE = Suite(
    families=(
        Family(
            case="bouncing_ball", variant="linear", scene=_long, ladder=TIGHT, max_steps=2_000_000, time_limit=60.0,
            axes={"bounces": Log(1e1, 1e5), "height": Log(1e-2, 1e1), "a0": Log(1e6, 1e12)},
        ),
    ),
    engines=("reference:compiled",),
    runs=4,
)  # fmt: skip
