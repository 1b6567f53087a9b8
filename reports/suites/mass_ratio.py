"""Rows of balls with mass ratios of up to 1e12, collisions in no time and in real time."""

from __future__ import annotations

from crossbody.reports.suites._axis import Levels, Linear, Log, Whole
from crossbody.reports.suites._contract import Family, Suite
from crossbody.reports.suites._scenes import uneven

_RULES = {"collisions": Levels(("sequential", "simultaneous")), "gap": Levels((0.0, 1e-3))}

# A light ball between heavy ones collides pi sqrt(ratio) / 2 times: three and more balls stop at a ratio of 1e6.
SUITE = Suite(
    families=(
        Family(
            case="newtons_cradle", variant="sliders", scene=uneven, grid=_RULES, fixed={"n": 2},
            axes={"ratio": Log(1.0, 1e12), "speed": Log(1e-6, 1e3)},
        ),
        Family(
            case="newtons_cradle", variant="sliders", scene=uneven, grid=_RULES,
            axes={"n": Whole(3, 4), "ratio": Log(1.0, 1e6), "speed": Log(1e-6, 1e3)},
        ),
        Family(
            case="newtons_cradle", variant="sliders", scene=uneven, fixed={"n": 2, "collisions": "resolved"}, second=10,
            axes={"ratio": Log(1.0, 1e12), "a0": Log(1e2, 1e10), "zeta": Linear(0.0, 2.0)},
        ),
    ),
    runs=200,
)  # fmt: skip
