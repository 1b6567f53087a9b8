"""Floors with a cubic term up to 1e12 1/(m^2 s^2), held against an independent integrator."""

from __future__ import annotations

from crossbody.reports.suites._axis import Linear, Log
from crossbody.reports.suites._contract import Family, Suite
from crossbody.reports.suites._scenes import damped

SUITE = Suite(
    families=(
        Family(
            case="bouncing_ball", variant="listing", scene=damped, second=5, fixed={"t_end": 2.0},
            axes={
                "a0": Log(1.0, 1e8), "zeta": Log(1e-2, 10.0), "a2": Log(1.0, 1e12), "mass": Log(1e-6, 1e6),
                "height": Log(1e-3, 1e1), "speed": Linear(0.0, 5.0),
            },
        ),
    ),
    runs=120,
)  # fmt: skip
