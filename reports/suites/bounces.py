"""Up to 1e5 bounces of one ball in a run."""

from __future__ import annotations

import math

import numpy as np

from crossbody.reports.suites._axis import Log
from crossbody.reports.suites._contract import TIGHT, Drawn, Family, Suite
from crossbody.reports.suites._scenes import numbers

GRAVITY = 9.81


def _long(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """A horizon of so many flights of the first bounce."""
    bounces, height, a0 = numbers(drawn, "bounces", "height", "a0")
    flight = 2.0 * math.sqrt(2.0 * height / GRAVITY) + math.pi / math.sqrt(a0)
    return {"height": height, "a0": a0, "a1": 0.0, "gravity": GRAVITY, "t_end": bounces * flight}


SUITE = Suite(
    families=(
        Family(
            case="bouncing_ball", variant="linear", scene=_long, ladder=TIGHT, max_steps=2_000_000, time_limit=60.0,
            axes={"bounces": Log(1e1, 1e5), "height": Log(1e-2, 1e1), "a0": Log(1e6, 1e12)},
        ),
    ),
    engines=("reference:compiled",),
    runs=1,
)  # fmt: skip
