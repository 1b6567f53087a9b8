"""Gaps between neighbours from 0 to 0.1 m, from collisions that overlap to such that come one by one."""

from __future__ import annotations

from crossbody.reports.suites._axis import Levels, Linear, Log, Whole
from crossbody.reports.suites._contract import TIGHT, Family, Suite
from crossbody.reports.suites._scenes import lifted

# Balls that overlap leave at nearly the same speed, and when they meet again is known the worse for it.
SUITE = Suite(
    families=(
        Family(
            case="newtons_cradle", variant="sliders", scene=lifted,
            axes={"n": Whole(2, 10), "gap": Log(1e-9, 1e-1), "speed": Log(1e-3, 1e2)},
            grid={"collisions": Levels(("sequential", "simultaneous"))},
        ),
        Family(
            case="newtons_cradle", variant="sliders", scene=lifted, fixed={"collisions": "resolved"}, second=20,
            ladder=TIGHT,
            axes={"n": Whole(2, 7), "gap": Log(1e-9, 1e-1), "a0": Log(1e4, 1e8), "zeta": Linear(0.0, 1.0)},
        ),
        Family(
            case="newtons_cradle", variant="pendulums", scene=lifted, second=20, fixed={"t_end": 1.5},
            axes={"n": Whole(2, 5), "gap": Log(1e-6, 1e-1), "angle": Linear(-1.0, -0.01)},
        ),
    ),
    runs=160,
)  # fmt: skip
