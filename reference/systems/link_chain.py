"""A planar chain of links hung from a fixed pivot, in maximal coordinates: every joint is two constraint rows.

q = (x_1, z_1, th_1, x_2, z_2, th_2, ...): centre of mass of each link (z up) and its angle from
the upright vertical, so that it hangs at pi. With e = (sin th, cos th) along the link, a from its
pivot to its centre and L to the next pivot,

    h_i = c_i - a_i e_i - (c_(i-1) + (L_(i-1) - a_(i-1)) e_(i-1))          rows 2 i and 2 i + 1; the first hangs at 0

Joint i brakes the relative rate w = th_i' - th_(i-1)' by k_i w + s_i w/sqrt(w^2 + w_s^2): viscous
friction, and Coulomb's smoothed over w_s (nothing sticks: well below w_s it is viscous with s_i/w_s).
Parameters p = (gravity m/s^2, w_s rad/s, then for each link m kg, a m, L m, I kg m^2, k N m s, s N m).
Inputs u: a torque on each joint, N m, which turns its link forward and the link before it backward.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from crossbody.cases import SceneError
from crossbody.reference import System, kernels
from crossbody.reference.kinds import Array, Floats, Index

if TYPE_CHECKING:
    from crossbody.cases import Law

SHARED = ("gravity", "slip")
LINK = ("m", "a", "L", "I", "k", "s")
_FIRST, _SIZE = len(SHARED), len(LINK)


@kernels.helper
def _brake(p: Array, o: int, w: Any) -> Any:
    """Torque that joint takes from its relative rate w; o is where its link stands in p."""
    return (p[o + 4] + p[o + 5] / np.sqrt(w * w + p[1] * p[1])) * w


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """M = diag(m, m, I), f = (0, -m g, torques of the two joints)."""
    n = len(q) // 3
    for i in range(n):
        o, k = _FIRST + _SIZE * i, 3 * i
        M[k, 0], M[k + 1, 0], M[k + 2, 0] = p[o], p[o], p[o + 3]
        f[k], f[k + 1], f[k + 2] = 0.0, -p[o] * p[0], 0.0
    for i in range(n):
        k = 3 * i + 2
        before = v[k - 3] if i > 0 else 0.0 * v[k]
        torque = u[i] - _brake(p, _FIRST + _SIZE * i, v[k] - before)
        f[k] += torque
        if i > 0:
            f[k - 3] -= torque


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """How far every joint is open, m, and how fast."""
    for i in range(len(q) // 3):
        o, k, r = _FIRST + _SIZE * i, 3 * i, 2 * i
        a, s, c, w = p[o + 1], np.sin(q[k + 2]), np.cos(q[k + 2]), v[k + 2]
        h[r], h[r + 1] = q[k] - a * s, q[k + 1] - a * c
        hd[r], hd[r + 1] = v[k] - a * c * w, v[k + 1] + a * s * w
        if i > 0:
            b, s, c, w = p[o - _SIZE + 2] - p[o - _SIZE + 1], np.sin(q[k - 1]), np.cos(q[k - 1]), v[k - 1]
            h[r], h[r + 1] = h[r] - q[k - 3] - b * s, h[r + 1] - q[k - 2] - b * c
            hd[r], hd[r + 1] = hd[r] - v[k - 3] - b * c * w, hd[r + 1] - v[k - 2] + b * s * w


@kernels.rows
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """Component r % 2 of joint r // 2; H' v = a e w^2 of the link and (L - a) e w^2 of the one before it."""
    H[:na] = 0.0
    for j in range(na):
        i, along_z = idx[j] // 2, idx[j] % 2 == 1
        o, k = _FIRST + _SIZE * i, 3 * i
        s, c = np.sin(q[k + 2]), np.cos(q[k + 2])
        e, slope = (c, -s) if along_z else (s, c)
        own = k + 1 if along_z else k
        H[j, own], H[j, k + 2] = 1.0, -p[o + 1] * slope
        h[j] = q[own] - p[o + 1] * e
        Hdv[j] = p[o + 1] * e * v[k + 2] * v[k + 2]
        if i > 0:
            b, s, c = p[o - _SIZE + 2] - p[o - _SIZE + 1], np.sin(q[k - 1]), np.cos(q[k - 1])
            e, slope = (c, -s) if along_z else (s, c)
            H[j, own - 3], H[j, k - 1] = -1.0, -b * slope
            h[j] -= q[own - 3] + b * e
            Hdv[j] += b * e * v[k - 1] * v[k - 1]


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """T = sum (m |c'|^2 + I th'^2)/2, V = sum m g z."""
    e[0] = 0.0 * q[0]
    e[1] = 0.0 * q[0]
    for i in range(len(q) // 3):
        o, k = _FIRST + _SIZE * i, 3 * i
        e[0] += 0.5 * (p[o] * (v[k] * v[k] + v[k + 1] * v[k + 1]) + p[o + 3] * v[k + 2] * v[k + 2])
        e[1] += p[o] * p[0] * q[k + 1]


@kernels.power
def power(t: float, q: Array, v: Array, u: Array, p: Array, e: Array) -> None:
    """Of the joints' torques, and what their friction takes."""
    e[0] = 0.0 * v[0]
    e[1] = 0.0 * v[0]
    for i in range(len(q) // 3):
        w = v[3 * i + 2] - (v[3 * i - 1] if i > 0 else 0.0 * v[0])
        e[0] += u[i] * w
        e[1] += w * _brake(p, _FIRST + _SIZE * i, w)


KERNELS: dict[str, Any] = {"dynamics": dynamics, "gaps": gaps, "rows": rows, "energy": energy, "power": power}


def names(links: int) -> tuple[str, ...]:
    """Names of the parameters in the order of p: gravity, slip, m1, a1, L1, I1, k1, s1, m2, ..."""
    return SHARED + tuple(f"{name}{i + 1}" for i in range(links) for name in LINK)


def build(parameters: Mapping[str, Any], law: Law) -> System:
    """The mechanism of a case.

    Args:
        parameters: of the case; it needs `links` and what `names` lists.
        law: of the two rows of every joint.

    Raises:
        SceneError: if the law has another number of rows.
    """
    n = int(parameters["links"])
    if len(law.a0) != 2 * n:
        raise SceneError(f"A chain of {n} links has {2 * n} rows; the law has {len(law.a0)}.")
    span = [[max(0, 3 * i - 3), 3 * i + 3] for i in range(n) for _ in range(2)]
    return System(
        n=3 * n, parameters={name: float(parameters[name]) for name in names(n)}, a0=law.a0,
        a1=law.a1, a2=law.a2, unilateral=law.unilateral, span=span, inputs=n, mass_block=1,
        constant_mass=True, **KERNELS,
    )  # fmt: skip


def place(parameters: Mapping[str, Any], th: Floats, w: Floats) -> tuple[Floats, Floats]:
    """Positions and velocities (..., 3 n) of a closed chain from its angles and rates (..., n)."""
    q, v = np.zeros((*th.shape[:-1], 3 * th.shape[-1])), np.zeros((*th.shape[:-1], 3 * th.shape[-1]))
    pivot, speed = np.zeros((*th.shape[:-1], 2)), np.zeros((*th.shape[:-1], 2))
    for i in range(th.shape[-1]):
        a, length = float(parameters[f"a{i + 1}"]), float(parameters[f"L{i + 1}"])
        e = np.stack([np.sin(th[..., i]), np.cos(th[..., i])], axis=-1)
        turned = np.stack([e[..., 1], -e[..., 0]], axis=-1) * w[..., i, None]
        q[..., 3 * i : 3 * i + 2], q[..., 3 * i + 2] = pivot + a * e, th[..., i]
        v[..., 3 * i : 3 * i + 2], v[..., 3 * i + 2] = speed + a * turned, w[..., i]
        pivot, speed = pivot + length * e, speed + length * turned
    return q, v


def listed(p: Floats) -> dict[str, Any]:
    """What the parity audit lists side by side, read back from the parameter array."""
    return {"masses": p[_FIRST::_SIZE].copy(), "gravity": float(p[0])}
