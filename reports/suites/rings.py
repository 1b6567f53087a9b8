"""Mazes of up to 50 rings, locked and free, rolling and frictionless, from any angle."""

from __future__ import annotations

import math

from crossbody.reports.suites._axis import Axis, Levels, Linear, Log, Whole
from crossbody.reports.suites._contract import Family, Suite

_ANY: dict[str, Axis] = {"angle": Linear(-0.6, 0.6), "theta": Linear(0.0, 2.0 * math.pi), "rings": Whole(1, 50)}

SUITE = Suite(
    families=(
        Family(
            case="ball_maze", variant="inside", axes=_ANY, fixed={"t_end": 0.5, "ring": 0}, second=20,
            grid={"rolling": Levels((True, False))},
        ),
        Family(
            case="ball_maze", variant="outside", axes=_ANY, fixed={"t_end": 0.5, "ring": 0}, second=20,
            grid={"rolling": Levels((True, False))},
        ),
        Family(
            case="ball_maze", variant="free", axes={**_ANY, "maze_inertia": Log(1e-5, 1e3)}, second=20,
            fixed={"t_end": 0.5},
        ),
        Family(
            case="ball_maze", variant="balanced", fixed={"t_end": 1.0}, finishes=False,
            axes={"angle": Linear(-0.4, 0.4), "wn": Log(5.0, 200.0), "pole": Log(1.0, 20.0)},
        ),
    ),
    runs=30,
)  # fmt: skip
