"""Rows of up to 200 balls, touching and apart."""

from __future__ import annotations

from crossbody.reports.suites._axis import Levels, Linear, Whole
from crossbody.reports.suites._contract import Family, Suite
from crossbody.reports.suites._scenes import lifted

SUITE = Suite(
    families=(
        Family(
            case="newtons_cradle", variant="sliders", scene=lifted, axes={"n": Whole(2, 200)}, time_limit=4.0, share=4,
            grid={"gap": Levels((0.0, 1e-3)), "collisions": Levels(("sequential", "simultaneous"))},
        ),
        Family(
            case="newtons_cradle", variant="sliders", scene=lifted,
            axes={"n": Whole(2, 12), "zeta": Linear(0.0, 1.0)}, grid={"gap": Levels((0.0, 1e-3))},
            time_limit=4.0, share=8,
        ),
        Family(
            case="newtons_cradle", variant="sliders", axes={"n": Whole(2, 60), "zeta": Linear(0.0, 0.5)},
            fixed={"collisions": "resolved", "gap": 5e-3}, time_limit=4.0,
        ),
    ),
    runs=8,
)  # fmt: skip
