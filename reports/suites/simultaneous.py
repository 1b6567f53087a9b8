"""Several contacts at one instant: touching rows of balls, and a box that lands on both corners."""

from __future__ import annotations

from crossbody.reports.suites._axis import Levels, Linear, Log, Whole
from crossbody.reports.suites._contract import TIGHT, Family, Suite
from crossbody.reports.suites._scenes import lifted, uneven

_RATIOS = {"zeta3": Linear(0.0, 2.0), "zeta4": Linear(0.0, 2.0)}

SUITE = Suite(
    families=(
        Family(
            case="newtons_cradle", variant="sliders", scene=uneven, fixed={"gap": 0.0},
            axes={"n": Whole(3, 6), "ratio": Log(1.0, 1e2)},
            grid={"collisions": Levels(("sequential", "simultaneous"))},
        ),
        Family(
            case="newtons_cradle", variant="sliders", scene=lifted, fixed={"collisions": "resolved", "gap": 0.0},
            axes={"n": Whole(3, 8), "a0": Log(1e4, 1e10), "zeta": Linear(0.0, 1.0)}, second=20,
        ),
        Family(
            case="red_body", variant="frozen", fixed={"tilt": 0.0, "spin": 0.0},
            axes={"drop": Log(1e-6, 1e-1), "mass": Log(1e-2, 1e2), **_RATIOS},
        ),
        Family(
            case="red_body", variant="resolved", fixed={"tilt": 0.0, "spin": 0.0}, second=20, ladder=TIGHT,
            axes={"drop": Log(1e-6, 1e-1), "mass": Log(1e-1, 1e1), **_RATIOS},
        ),
    ),
    runs=160,
)  # fmt: skip
