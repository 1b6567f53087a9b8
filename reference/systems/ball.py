"""A ball above a floor: q = height of its lowest point, h = q.

Parameters p = (mass kg, gravity m/s^2).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from crossbody.reference import System, kernels
from crossbody.reference.kinds import Array, Floats, Index

if TYPE_CHECKING:
    from crossbody.cases import Law


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
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
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


def build(parameters: Mapping[str, Any], law: Law) -> System:
    """The mechanism of a case.

    Args:
        parameters: of the case; it needs mass, kg, and gravity, m/s^2.
        law: of the one row.
    """
    return System(
        n=1, parameters={name: float(parameters[name]) for name in ("mass", "gravity")}, a0=law.a0,
        a1=law.a1, a2=law.a2, unilateral=law.unilateral, constant_mass=True, affine=True, **KERNELS,
    )  # fmt: skip


def listed(p: Floats) -> dict[str, Any]:
    """What the parity audit lists side by side, read back from the parameter array."""
    return {"masses": p[:1].copy(), "gravity": float(p[1])}
