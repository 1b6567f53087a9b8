"""Tolerances from 1e-3 to 1e-12 and steps from 1e-2 to 1e-5 s on every case with contacts."""

from __future__ import annotations

from crossbody.reports.suites._axis import Levels, Linear
from crossbody.reports.suites._contract import Family, Ladder, Suite

LADDER = Ladder(rtol=(1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12),
                dt=(1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5))  # fmt: skip

SUITE = Suite(
    families=(
        Family(
            case="bouncing_ball", variant="linear", ladder=LADDER, fixed={"t_end": 1.0},
            axes={"height": Linear(0.01, 0.5)}, grid={"a0": Levels((1e2, 1e4, 1e6))},
        ),
        Family(
            case="bouncing_ball", variant="listing", ladder=LADDER, fixed={"t_end": 2.0}, second=10,
            axes={"height": Linear(0.5, 2.0)},
        ),
        Family(
            case="newtons_cradle", variant="sliders", ladder=LADDER, second=10,
            fixed={"collisions": "resolved", "n": 3}, axes={"gap": Linear(1e-4, 3e-3)},
        ),
        Family(
            case="newtons_cradle", variant="pendulums", ladder=LADDER, fixed={"t_end": 1.0, "n": 3}, second=10,
            axes={"angle": Linear(-0.8, -0.1)},
        ),
        Family(
            case="red_body", variant="resolved", ladder=LADDER, axes={"drop": Linear(5e-3, 2e-2)}, second=10,
        ),
        Family(
            case="ball_maze", variant="inside", ladder=LADDER, fixed={"t_end": 1.0}, axes={"angle": Linear(1e-3, 0.5)},
            second=10,
        ),
        Family(
            case="delta_impulse", variant="light", ladder=LADDER, fixed={"t_end": 0.5}, axes={"jx": Linear(0.0, 0.06)},
            second=10,
        ),
    ),
    runs=70,
)  # fmt: skip
