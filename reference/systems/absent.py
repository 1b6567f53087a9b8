"""Kernels that stand in where a mechanism has none of its own."""

from __future__ import annotations

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kinds import Array, Bytes, Floats, Index


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """No rows."""


@kernels.rows
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """No rows."""


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """Energy unknown."""
    e[0] = np.nan
    e[1] = np.nan


@kernels.power
def power(t: float, q: Array, v: Array, u: Array, p: Array, e: Array) -> None:
    """No inputs that work, no damping."""
    e[0] = 0.0
    e[1] = 0.0


@kernels.solve
def solve(
    t: float, q: Floats, v: Floats, u: Floats, p: Floats, w: Floats, law: Floats, idx: Index, na: int,
    vd: Floats, lam: Floats, hd: Floats,
) -> int:  # fmt: skip
    """Never called."""
    return 1


@kernels.control
def control(t: float, q: Floats, v: Floats, u: Floats, s: Floats, p: Floats) -> None:
    """Never called."""


@kernels.watch
def watch(t: float, q: Floats, v: Floats, p: Floats, g: Floats) -> None:
    """Nothing to watch."""


@kernels.switch
def switch(t: float, q: Floats, v: Floats, p: Floats, mode: Bytes, fired: int) -> int:
    """Never called."""
    return 0


@kernels.velocity
def velocity(t: float, q: Array, v: Array, p: Array, qd: Array) -> None:
    """Positions change by v itself."""
    for i in range(len(v)):
        qd[i] = v[i]
