"""A block between two soft fingers on one horizontal axis, with tactile feedback.

q = (x flange, pL, pR faces of the pads, b block, I, SL, SR, Z). The last four carry the
controller and the sensors:

    I = INT (x_ref - x), so I' = e is the error and x_ref = I' + x;  I'' = k (y_R - y_L) - x'
    SL' = s_L, SR' = s_R of `_soft_fingers`;  Z' = z, the shift of the fingers, and z' = u + probe sin(probe_rate t)

so that every equation keeps the form M v' = f + H^T lam; the positions SL, SR, Z themselves act
on nothing. The flange obeys mf x'' = mf (ki I + kp e + kd (share x_ref' - x')) - fL - fR, the
block mb b'' = lam_L - lam_R - bt b'. Parameters p are those of `PARAMETERS`; input u = velocity
of the fingers, m/s. Kinetic energy is that of the four bodies; the pads' springs are tied to the
moving jaws, so their work counts as the inputs'.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from crossbody.reference import System, kernels
from crossbody.reference.kinds import Array, Floats, Index
from crossbody.reference.systems import _soft_fingers as _fingers
from crossbody.reference.systems._soft_fingers import BLOCK_MASS, BT, KS, PAD_MASS, K, half_width, pads, pid, readings

if TYPE_CHECKING:
    from crossbody.cases import Law

PARAMETERS = (*_fingers.NAMES, "flange_mass", "rate_share", "probe", "probe_rate")
COORDINATES = ("x", "pL", "pR", "b", "I", "SL", "SR", "Z")
_FLANGE, _SHARE, _PROBE, _RATE = range(_fingers.SIZE, len(PARAMETERS))


@kernels.helper
def _shift(t: float, u: Array, p: Array) -> Any:
    """Velocity of the fingers on the flange, m/s."""
    return u[0] + p[_PROBE] * np.sin(p[_RATE] * t)


@kernels.helper
def _forces(t: float, q: Array, v: Array, u: Array, p: Array) -> Any:
    """Forces of the fingers on their pads, and of the position loop on the flange, N; rate of the error, m/s."""
    left, right = pads(t, p, 0, q[0] + v[7], v[0] + _shift(t, u, p), q[1], v[1], q[2], v[2])
    yL, yR = readings(p, 0, v[5], v[6], v[1], v[2])
    wanted = p[K] * (yR - yL)
    drive = p[_FLANGE] * pid(p, 0, q[4], v[4], p[_SHARE] * wanted - v[0])
    return left, right, drive, wanted - v[0]


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """M = diag(mf, mp, mp, mb, 1, 1, 1, 1)."""
    left, right, drive, rate = _forces(t, q, v, u, p)
    yL, yR = readings(p, 0, v[5], v[6], v[1], v[2])
    M[:, 0] = 1.0
    M[0, 0], M[1, 0], M[2, 0], M[3, 0] = p[_FLANGE], p[PAD_MASS], p[PAD_MASS], p[BLOCK_MASS]
    f[0], f[1], f[2], f[3] = drive - left - right, left, right, -p[BT] * v[3]
    f[4] = rate
    f[5], f[6] = p[KS] * (left - yL), p[KS] * (-right - yR)
    f[7] = _shift(t, u, p)


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """Left and right face of the block against the pads."""
    half = half_width(p, 0)
    h[0], hd[0] = q[3] - half - q[1], v[3] - v[1]
    h[1], hd[1] = q[2] - q[3] - half, v[2] - v[3]


@kernels.rows
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """H of (pL, pR, b) is (-1, 0, 1) and (0, 1, -1)."""
    half = half_width(p, 0)
    H[:na] = 0.0
    for j in range(na):
        pad, sign = (1, 1.0) if idx[j] == 0 else (2, -1.0)
        H[j, pad], H[j, 3] = -sign, sign
        h[j] = sign * (q[3] - q[pad]) - half
        Hdv[j] = 0.0


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """Kinetic energy of flange, pads and block."""
    e[0] = 0.5 * (p[_FLANGE] * v[0] * v[0] + p[PAD_MASS] * (v[1] * v[1] + v[2] * v[2]) + p[BLOCK_MASS] * v[3] * v[3])
    e[1] = 0.0


@kernels.power
def power(t: float, q: Array, v: Array, u: Array, p: Array, e: Array) -> None:
    """Of the position loop and of the fingers on flange and pads; and of the friction on the table."""
    left, right, drive, _ = _forces(t, q, v, u, p)
    e[0] = drive * v[0] + left * (v[1] - v[0]) + right * (v[2] - v[0])
    e[1] = p[BT] * v[3] * v[3]


KERNELS: dict[str, Any] = {"dynamics": dynamics, "gaps": gaps, "rows": rows, "energy": energy, "power": power}


def build(parameters: Mapping[str, Any], law: Law) -> System:
    """The mechanism of a case.

    Args:
        parameters: of the case, with the names of `PARAMETERS`, and kstar for k.
        law: of the two rows.
    """
    return System(
        n=len(COORDINATES), parameters=_fingers.values(parameters, PARAMETERS), a0=law.a0, a1=law.a1,
        a2=law.a2, unilateral=law.unilateral, mass_block=1, inputs=1, constant_mass=True, **KERNELS,
    )  # fmt: skip


def listed(p: Floats) -> dict[str, Any]:
    """What the parity audit lists: masses of flange, pads and block, kg, from the parameter array."""
    return {"masses": np.array([p[_FLANGE], p[PAD_MASS], p[PAD_MASS], p[BLOCK_MASS]]), "gravity": 0.0}
