"""Poses of the delta robot up to the edge of what it reaches, and singular ones on the way."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases import CrossbodyError
from crossbody.cases.loading import module
from crossbody.cases.mechanisms.delta.pose import pose
from crossbody.reports.suites._axis import Linear, Log
from crossbody.reports.suites._contract import Drawn, Family, Suite
from crossbody.reports.suites._scenes import numbers

_ROBOT: dict[str, Any] = {name: p.default for name, p in module("delta_free").PARAMETERS.items()}


def _reachable(z: np.ndarray[Any, Any]) -> bool:
    try:
        pose(_ROBOT, z)
    except CrossbodyError:
        return False
    return True


def _edge(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """From (0, 0, 0.5) in a direction to the edge of the workspace, less a part `off` of the way."""
    azimuth, elevation, off = numbers(drawn, "azimuth", "elevation", "off")
    level = np.cos(elevation)
    e = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    start, low, high = np.array([0.0, 0.0, 0.5]), 0.0, 1.5
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _reachable(start + middle * e) else (low, middle)
    x, y, z = start + (1.0 - off) * low * e
    return {"x": float(x), "y": float(y), "z": float(z)}


SUITE = Suite(
    families=(
        Family(
            case="delta_free", variant="light", scene=_edge, fixed={"t_end": 0.3}, second=10, finishes=False,
            axes={"azimuth": Linear(0.0, 2.0 * np.pi), "elevation": Linear(-1.5, 1.5), "off": Log(1e-9, 1.0)},
        ),
        Family(
            case="delta_free", variant="light", fixed={"t_end": 1.0}, second=10, finishes=False,
            axes={"x": Linear(-0.4, 0.4), "y": Linear(-0.4, 0.4), "z": Linear(0.1, 0.9)},
        ),
    ),
    runs=80,
)  # fmt: skip
