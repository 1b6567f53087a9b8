"""Balls on a line without gravity: q_i = displacement from its place, h_i = gap + q_(i+1) - q_i.

Parameters p = (gap m, masses kg (n,)). Every row touches two coordinates: its cost does not depend on n.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.mechanisms.cradle.scene import masses
from crossbody.reference import System, kernels
from crossbody.reference.kinds import Array, Floats, Index

if TYPE_CHECKING:
    from crossbody.cases import Law


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """M = diag(m), f = 0."""
    for i in range(len(q)):
        M[i, 0] = p[1 + i]
        f[i] = 0.0


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """Distance of neighbours."""
    for i in range(len(h)):
        h[i] = p[0] + (q[i + 1] - q[i])
        hd[i] = v[i + 1] - v[i]


@kernels.rows
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """H_i = (-1, 1) on balls i and i + 1, H' v = 0."""
    for j in range(na):
        i = idx[j]
        H[j, i] = -1.0
        H[j, i + 1] = 1.0
        h[j] = p[0] + (q[i + 1] - q[i])
        Hdv[j] = 0.0


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """T = sum m v^2 / 2, V = 0."""
    e[0] = 0.0
    e[1] = 0.0
    for i in range(len(q)):
        e[0] += 0.5 * p[1 + i] * v[i] * v[i]


KERNELS: dict[str, Any] = {"dynamics": dynamics, "gaps": gaps, "rows": rows, "energy": energy}


def neighbours(n: int) -> Index:
    """The coordinates that each row may touch (n - 1, 2): its two balls."""
    first = np.arange(n - 1)
    return np.column_stack([first, first + 2])


def build(parameters: Mapping[str, Any], law: Law) -> System:
    """The mechanism of a case.

    Args:
        parameters: of the case; it needs n, gap, m, and masses, kg.
        law: of the n - 1 rows.
    """
    n = int(parameters["n"])
    return System(
        n=n, parameters=np.concatenate([[float(parameters["gap"])], masses(parameters)]),
        a0=law.a0, a1=law.a1, a2=law.a2, b0=law.b0, b1=law.b1, unilateral=law.unilateral, span=neighbours(n),
        mass_block=1, constant_mass=True, affine=True, **KERNELS,
    )  # fmt: skip


def check_start(parameters: Mapping[str, Any], q0: Floats, v0: Floats) -> None:
    """Raise SceneError if neighbours overlap."""
    h = float(parameters["gap"]) + np.diff(q0)
    if np.any(h < 0.0):
        i = int(np.argmin(h))
        raise SceneError(
            f"sliders: balls {i} and {i + 1} overlap by {-h[i]:g} m at the start; gaps must be at least 0."
        )


def listed(p: Floats) -> dict[str, Any]:
    """What the parity audit lists side by side, read back from the parameter array."""
    return {"masses": p[1:].copy(), "gravity": 0.0}
