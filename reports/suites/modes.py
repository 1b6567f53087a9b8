"""Boxes that land on any corner of a slab on two supports: switches in every order, and cycles of modes."""

from __future__ import annotations

from crossbody.reports.suites._axis import Axis, Linear, Log
from crossbody.reports.suites._contract import Family, Suite

_FALL: dict[str, Axis] = {
    "drop": Log(1e-5, 1e-1), "tilt": Linear(-0.6, 0.6), "spin": Linear(-5.0, 5.0), "speed_x": Linear(-1.0, 1.0),
    "speed_y": Linear(-2.0, 0.0), "mass": Log(1e-1, 1e1), "slab_tilt": Linear(-0.05, 0.05),
}  # fmt: skip
_RATIOS: dict[str, Axis] = {"zeta3": Linear(0.0, 2.0), "zeta4": Linear(0.0, 2.0), "zeta5": Linear(0.0, 2.0)}

SUITE = Suite(
    families=(
        Family(
            case="red_body", variant="resolved", axes={**_FALL, **_RATIOS, "b0": Log(1e3, 1e8)}, second=20,
            finishes=False,
        ),
        Family(case="red_body", variant="frozen", axes={**_FALL, **_RATIOS}, finishes=False),
    ),
    runs=120,
)  # fmt: skip
