"""Bodies on a line as a symbolic vector system: Drake evaluates the case's memoryless law without Python."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.symbolic import Expression, Variable, if_then_else
from pydrake.symbolic import max as larger
from pydrake.systems.primitives import SymbolicVectorSystem

from crossbody.engines._line import Line


def system(scene: Line) -> Any:
    """X = (q, v), x' = (v, M^-1 H^T lam - g), lam as in `Line.memoryless`."""
    n = len(scene.masses)
    q, v = ([Variable(f"{name}{i}") for i in range(n)] for name in "qv")
    push = [Expression(0.0) for _ in range(n)]
    for row, (left, right) in enumerate(scene.pairs):
        lam = _multiplier(scene, row, q, v)
        push[right] = push[right] + lam
        if left >= 0:
            push[left] = push[left] - lam
    rates = [push[i] / float(scene.masses[i]) - scene.gravity for i in range(n)]
    dynamics = np.array([*(Expression(x) for x in v), *rates])
    return SymbolicVectorSystem(state=np.array([*q, *v]), dynamics=dynamics)


def _multiplier(scene: Line, row: int, q: list[Any], v: list[Any]) -> Any:
    left, right = scene.pairs[row]
    h = q[right] - q[left] + scene.gap if left >= 0 else 1.0 * q[right]
    hd = v[right] - v[left] if left >= 0 else 1.0 * v[right]
    a0, a1, a2, m = (float(a[row]) for a in (scene.a0, scene.a1, scene.a2, scene.reduced))
    lam = m * (scene.presses - a1 * hd - a0 * h - a2 * h * h * h)
    return if_then_else(h > 0.0, Expression(0.0), larger(lam, Expression(0.0))) if scene.unilateral[row] else lam
