"""The physics as the reference's kernels return it, for the parity audit (docs/explanation/verdicts.md)."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._scene import masses
from crossbody.reference import System

DEPENDENT = 1e6
"""Condition of H M^-1 H^T beyond which rounding parts two engines' multipliers by over 1e-9."""


def audit(system: System, q0: Floats, v0: Floats) -> dict[str, Any]:
    """Constants, start, and functions at zero input: M (n, n), bias (n,) = -f, H (nc, n), lam (nc,) N, gap (nc,) m.

    Constants and lam are those of rows just entered, with the fast constants where a row has two
    sets. lam has every row active; NaN where the rows are dependent.
    """
    law = np.where(system.beta[:, :1] > 0.0, system.beta, system.alpha)

    def M(q: Floats) -> Floats:
        return system.mass_matrix(q)

    def bias(q: Floats, v: Floats) -> Floats:
        return -system.terms(q, v)[1]

    def H(q: Floats) -> Floats:
        return system.constraint(q)[0]

    def gap(q: Floats) -> Floats:
        return system.gap(q)[0]

    def lam(q: Floats, v: Floats) -> Floats:
        if system.nc > len(v):
            return np.full(system.nc, np.nan)
        mass, f, rows, h, Hdv = (part[0] for part in system.equations_along([0.0], q[None], v[None]))
        a0, a1, a2 = law.T
        inverse = np.linalg.solve(mass, np.column_stack([rows.T, f]))
        push = rows @ inverse[:, -1] + Hdv + a1 * (rows @ v) + a0 * h + a2 * h**3
        G = rows @ inverse[:, :-1]
        # Both bounds of one joint are dependent up to rounding, never exactly; a system without rows has no condition.
        if system.nc and np.linalg.cond(G) > DEPENDENT:
            return np.full(system.nc, np.nan)
        return np.asarray(np.linalg.solve(G, -push))

    constants = dict(zip(("a0", "a1", "a2"), law.T, strict=True))
    return {"constants": constants, "q0": q0, "v0": v0, "M": M, "bias": bias, "H": H, "lam": lam, "gap": gap}


def listed(scene: Scene) -> dict[str, Any]:
    """Return masses, kg, and gravity, m/s^2, of a scene."""
    return {"masses": masses(scene), "gravity": float(np.linalg.norm(scene.gravity))}
