"""Closed forms of a block between two soft fingers with tactile feedback, both pads in contact.

With both contacts held the pads move with the block, m' = mb + 2 mp. In the Laplace variable s

    Kc = 2 (kp + cp s)    Z = m' s^2 + bt s    Zn = mb s^2 + bt s    T = Kc/(Kc + Z)    Sn = ks/(s + ks)
    PID = kd s^2 + kp' s + ki      D = s^3 + PID        (D = (s + 7)^3 with the default gains)
    N = -( PID (k/s) Sn Zn + s Z/mf )/D
    Xb/U = (T/s)/(1 - T N)      block velocity/U = s Xb/U      (lam_L - lam_R)/U = Zn Xb/U

for a velocity U of both fingers against the flange (checked against the state space).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases.arrays import Floats

Numbers = Mapping[str, float]
Complex = NDArray[np.complex128]


def responses(p: Numbers, omega: ArrayLike) -> tuple[Complex, Complex]:
    """Frequency responses at omega (m,), rad/s, from the velocity of the fingers.

    Args:
        p: kp, cp, bt, k, ks, gain_p, gain_d, gain_i, flange_mass, pad_mass, block_mass, SI.
        omega: angular frequencies, rad/s, above 0.

    Returns:
        To the difference of the contact forces lam_L - lam_R, N/(m/s); to the velocity of the block, 1.
    """
    s = 1j * np.asarray(omega, dtype=np.float64)
    flexible = 2.0 * (p["kp"] + p["cp"] * s)
    together = (p["block_mass"] + 2.0 * p["pad_mass"]) * s * s + p["bt"] * s
    alone = p["block_mass"] * s * s + p["bt"] * s
    loop = p["gain_d"] * s * s + p["gain_p"] * s + p["gain_i"]
    sensor = p["ks"] / (s + p["ks"])
    flange = -(loop * (p["k"] / s) * sensor * alone + s * together / p["flange_mass"]) / (s**3 + loop)
    share = flexible / (flexible + together)
    block = share / s / (1.0 - share * flange)
    return alone * block, s * block


def final_position(p: Numbers) -> float:
    """Where flange and block come to rest, m: offset k bt/(1 + k bt).

    From the invariant x_ref + k (mb b' + bt (b - b0)) + k (y_R - y_L)/ks with equal forces at the end.
    """
    product = p["k"] * p["bt"]
    return p["offset"] * product / (1.0 + product)


def held_force(p: Numbers) -> float:
    """Contact force on each side once the block rests, N: the pad's stiffness times the interference."""
    return p["kp"] * p["squeeze"]


def grasp(p: Numbers, x: float = 0.0) -> tuple[Floats, Floats]:
    """The equilibrium with the block held at x, m: q (8,) and v (8,) of the mechanism `soft_contact`.

    Both sensors read the held force; flange, block and reference are at x.
    """
    half, force = 0.5 * p["width"], held_force(p)
    q, v = np.zeros(8), np.zeros(8)
    q[:4] = x, x - half, x + half, x
    v[5], v[6] = force, force
    return q, v


def touching(p: Numbers, x: float = 0.0) -> tuple[Floats, Floats]:
    """An equilibrium with the right pad alone against the block, at zero force: the approach's mode set."""
    q, v = grasp(p, x)
    q[1] -= 0.01
    v[5] = v[6] = 0.0
    return q, v
