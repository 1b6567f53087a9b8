"""A ball above a floor (spec 2.1): q = height of its lowest point, h = q.

Parameters p = (mass kg, gravity m/s^2).
"""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels
from crossbody.reference._kinds import Array, Index


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """M = m, f = -m g."""
    M[0, 0] = p[0]
    f[0] = -p[0] * p[1]


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """The gap is the height h = q."""
    h[0] = q[0]
    hd[0] = v[0]


@kernels.rows
def rows(
    t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array
) -> None:
    """H = 1, H' v = 0."""
    for j in range(na):
        H[j, 0] = 1.0
        h[j] = q[0]
        Hdv[j] = 0.0


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """T = m v^2 / 2, V = m g q."""
    e[0] = 0.5 * p[0] * v[0] * v[0]
    e[1] = p[0] * p[1] * q[0]


KERNELS: dict[str, Any] = {"dynamics": dynamics, "gaps": gaps, "rows": rows, "energy": energy}
