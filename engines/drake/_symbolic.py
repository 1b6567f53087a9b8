"""Bodies on a line as a symbolic vector system: Drake evaluates the case's memoryless law without Python."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.symbolic import Expression, Variable, if_then_else
from pydrake.symbolic import max as larger
from pydrake.systems.primitives import SymbolicVectorSystem

from crossbody.cases.arrays import Floats
from crossbody.engines._line import Line


def system(scene: Line) -> Any:
    """X = (q, v), x' = (v, M^-1 H^T lam - g), lam as in `Line.memoryless`."""
    n = len(scene.masses)
    q, v = ([Variable(f"{name}{i}") for i in range(n)] for name in "qv")
    lam = [_multiplier(scene, row, q, v) for row in range(len(scene.H))]
    push = [_sum(column, lam) for column in scene.H.T]
    rates = [push[i] / float(scene.masses[i]) - scene.gravity for i in range(n)]
    dynamics = np.array([*(Expression(x) for x in v), *rates])
    return SymbolicVectorSystem(state=np.array([*q, *v]), dynamics=dynamics)


def _sum(coefficients: Floats, parts: list[Any]) -> Any:
    return sum((c * part for c, part in zip(coefficients.tolist(), parts, strict=True) if c), Expression(0.0))


def _multiplier(scene: Line, row: int, q: list[Any], v: list[Any]) -> Any:
    h, hd = _sum(scene.H[row], q) + float(scene.h0[row]), _sum(scene.H[row], v)
    a0, a1, a2, m, w = (float(a[row]) for a in (scene.a0, scene.a1, scene.a2, scene.reduced, scene.presses))
    lam = m * (w - a1 * hd - a0 * h - a2 * h * h * h)
    return if_then_else(h > 0.0, Expression(0.0), larger(lam, Expression(0.0))) if scene.unilateral[row] else lam
