"""Planar pendulums side by side: q_i = angle of string i, counter-clockwise from hanging.

Ball i is a point mass at c_i = (i D + L sin q_i, -L cos q_i) with a circle of radius r around it,
D = 2 r + gap the distance of the pivots. With a = (q_i + q_(i+1))/2, b = (q_(i+1) - q_i)/2:

    |d|^2 = |c_(i+1) - c_i|^2 = D^2 + X          X = 4 L sin b (D cos a + L sin b)
    h = |d| - 2 r = (gap (4 r + gap) + X) / (|d| + 2 r)        no digits are lost where balls hang side by side

Parameters p = (L m, gravity m/s^2, r m, gap m, masses kg (n,)). Every row touches two coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.mechanisms.cradle.scene import masses
from crossbody.reference import System, kernels
from crossbody.reference.kinds import Array, Floats, Index
from crossbody.reference.systems.sliders import neighbours

if TYPE_CHECKING:
    from crossbody.cases import Law

NAMES = ("length", "gravity", "radius", "gap")


@kernels.helper
def _between(q0: Any, q1: Any, p: Array) -> tuple[Any, Any, Any, Any]:
    """Gap h and distance |d| of two neighbours, and the derivatives of h by the two angles: of |d|^2 over 2 |d|."""
    L, r, gap = p[0], p[2], p[3]
    D, a, b = 2.0 * r + gap, 0.5 * (q0 + q1), 0.5 * (q1 - q0)
    sin_a, cos_a, sin_b, cos_b = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
    X = 4.0 * L * sin_b * (D * cos_a + L * sin_b)
    d = np.sqrt(D * D + X)
    turn = 2.0 * L * sin_b * cos_b
    left, right = cos_a * cos_b + sin_a * sin_b, cos_a * cos_b - sin_a * sin_b  # cos q0, cos q1
    return (gap * (4.0 * r + gap) + X) / (d + 2.0 * r), d, -L * (D * left + turn) / d, L * (D * right + turn) / d


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """M = diag(m L^2), f = -m g L sin q."""
    L = p[0]
    for i in range(len(q)):
        M[i, 0] = p[4 + i] * L * L
        f[i] = -p[4 + i] * p[1] * L * np.sin(q[i])


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """Distance of neighbouring circles."""
    for i in range(len(h)):
        h[i], _, left, right = _between(q[i], q[i + 1], p)
        hd[i] = left * v[i] + right * v[i + 1]


@kernels.rows
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """H' v = (|d|^2'' / 2 - h'^2) / |d| at constant v."""
    L, D = p[0], 2.0 * p[2] + p[3]
    for j in range(na):
        i = idx[j]
        q0, q1, v0, v1 = q[i], q[i + 1], v[i], v[i + 1]
        h[j], d, left, right = _between(q0, q1, p)
        H[j, i] = left
        H[j, i + 1] = right
        bend = D * (np.sin(q0) * v0 * v0 - np.sin(q1) * v1 * v1) + L * np.cos(q1 - q0) * (v1 - v0) * (v1 - v0)
        rate = left * v0 + right * v1
        Hdv[j] = (L * bend - rate * rate) / d


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """T = sum m L^2 q'^2 / 2, V = sum m g L (1 - cos q)."""
    L = p[0]
    e[0] = 0.0
    e[1] = 0.0
    for i in range(len(q)):
        half = np.sin(0.5 * q[i])
        e[0] += 0.5 * p[4 + i] * L * L * v[i] * v[i]
        e[1] += 2.0 * p[4 + i] * p[1] * L * half * half


KERNELS: dict[str, Any] = {"dynamics": dynamics, "gaps": gaps, "rows": rows, "energy": energy}


def build(parameters: Mapping[str, Any], law: Law) -> System:
    """The mechanism of a case.

    Args:
        parameters: of the case; it needs n, length, m, gravity, m/s^2, radius and gap, m, and masses, kg.
        law: of the n - 1 rows.
    """
    n = int(parameters["n"])
    return System(
        n=n, parameters=np.concatenate([[float(parameters[name]) for name in NAMES], masses(parameters)]),
        a0=law.a0, a1=law.a1, a2=law.a2, b0=law.b0, b1=law.b1, unilateral=law.unilateral, span=neighbours(n),
        mass_block=1, constant_mass=True, **KERNELS,
    )  # fmt: skip


def check_start(parameters: Mapping[str, Any], q0: Floats, v0: Floats) -> None:
    """Raise SceneError if neighbouring circles overlap."""
    L, _, r, gap = (float(parameters[name]) for name in NAMES)
    x, y = np.arange(len(q0)) * (2.0 * r + gap) + L * np.sin(q0), -L * np.cos(q0)
    h = np.hypot(np.diff(x), np.diff(y)) - 2.0 * r
    if np.any(h < -1e-12 * r):
        i = int(np.argmin(h))
        raise SceneError(
            f"pendulums: balls {i} and {i + 1} overlap by {-h[i]:g} m at the start; gaps must be at least 0."
        )


def listed(p: Floats) -> dict[str, Any]:
    """What the parity audit lists side by side, read back from the parameter array."""
    return {"masses": p[4:].copy(), "gravity": float(p[1])}
