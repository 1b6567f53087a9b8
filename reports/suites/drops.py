"""Drops under gravity on linear floors of any stiffness, damping, mass and speed: bounces, captures and rest."""

from __future__ import annotations

from crossbody.reports.suites._axis import Levels, Linear, Log
from crossbody.reports.suites._contract import TIGHT, Family, Suite
from crossbody.reports.suites._scenes import damped

# A hard floor that damps little is bounced on more often than any bound allows. A ball that hardly falls comes to rest
# 1e-10 m deep: a relative error of 1e-6 there asks for an absolute tolerance below the default 1e-12 m.
SUITE = Suite(
    families=(
        Family(
            case="bouncing_ball", variant="linear", scene=damped,
            axes={
                "a0": Log(1.0, 1e12), "zeta": Log(1e-3, 10.0), "mass": Log(1e-6, 1e6), "height": Log(1e-6, 1e1),
                "gravity": Log(1e-3, 1e3), "speed": Linear(-5.0, 5.0),
            },
            fixed={"t_end": 1.0}, max_steps=500_000, finishes=False,
        ),
        Family(
            case="bouncing_ball", variant="linear", scene=damped, ends=True, share=12, ladder=TIGHT,
            axes={"a0": Log(1.0, 1e12), "zeta": Linear(0.5, 10.0), "mass": Log(1e-6, 1e6), "speed": Log(1e-6, 1e3)},
            grid={"gravity": Levels((9.81,)), "height": Levels((0.0, 0.1))}, fixed={"t_end": 1.0},
        ),
        Family(
            case="bouncing_ball", variant="linear", scene=damped, fixed={"t_end": 0.5}, share=12,
            axes={"a0": Log(1.0, 1e12), "zeta": Linear(0.0, 2.0), "height": Linear(-0.1, 0.0), "speed": Linear(-1, 1)},
        ),
    ),
    runs=500,
)  # fmt: skip
