"""Coordinates of the delta robot in a tree of hinges, and back, with rates (spec 3.8).

A tree turns each arm by hinge x (q1), hinge x (alpha, relative to the proximal link) and hinge z (gamma), with the
distal link along local y. With d = (s2 s3, c2, s2 c3) the direction of that link in the arm's frame,

    phi = q1 + alpha = atan2(d_z, d_y)     gamma = atan2(-d_x, hypot(d_y, d_z))
    d = (-sin gamma, cos gamma cos phi, cos gamma sin phi)

The chart of the tree ends at cos gamma = 0, that of the reference at sin q2 = 0. Arrays are (..., 9), arm by arm.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.engines.linear import Chart

Floats = NDArray[np.float64]


def _arms(x: Floats) -> Floats:
    return np.moveaxis(np.asarray(x, dtype=np.float64).reshape(*np.shape(x)[:-1], 3, 3), -1, 0)


def _joined(*parts: Floats) -> Floats:
    stacked = np.stack(parts, axis=-1)
    return stacked.reshape(*stacked.shape[:-2], 9)


def to_tree(q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Angles and rates of the tree from q and v of the reference."""
    (q1, q2, q3), (a, b, w) = _arms(q), _arms(v)
    c2, s2, c3, s3 = np.cos(q2), np.sin(q2), np.cos(q3), np.sin(q3)
    x, y, z = s2 * s3, c2, s2 * c3
    xd, yd, zd = c2 * s3 * b + s2 * c3 * w, -s2 * b, c2 * c3 * b - s2 * s3 * w
    across = np.hypot(y, z)
    phi, phid = np.arctan2(z, y), (y * zd - z * yd) / across**2
    return _joined(q1, phi - q1, np.arctan2(-x, across)), _joined(a, phid - a, -xd / across)


def from_tree(r: Floats, rd: Floats) -> tuple[Floats, Floats]:
    """Q and v of the reference from angles and rates of the tree; sin q_i2 > 0."""
    (q1, alpha, gamma), (a, alphad, gammad) = _arms(r), _arms(rd)
    d, dd, _ = _direction(q1 + alpha, gamma, a + alphad, gammad, 0.0, 0.0)
    s2 = np.hypot(d[0], d[2])
    q = _joined(q1, np.arctan2(s2, d[1]), np.arctan2(d[0], d[2]))
    return q, _joined(a, -dd[1] / s2, (d[2] * dd[0] - d[0] * dd[2]) / s2**2)


def accelerations(r: Floats, rd: Floats, rdd: Floats) -> Floats:
    """V' of the reference from the motion of the tree; linear in rdd."""
    (q1, alpha, gamma), (a, alphad, gammad), (ad, alphadd, gammadd) = _arms(r), _arms(rd), _arms(rdd)
    d, _, ddd = _direction(q1 + alpha, gamma, a + alphad, gammad, ad + alphadd, gammadd)
    _, v = from_tree(r, rd)
    _, b, w = _arms(v)
    s2, c2 = np.hypot(d[0], d[2]), d[1]
    bd = -(ddd[1] + c2 * b * b) / s2
    return _joined(ad, bd, (d[2] * ddd[0] - d[0] * ddd[2] - 2 * s2 * c2 * b * w) / s2**2)


def _direction(phi: Any, gamma: Any, phid: Any, gammad: Any, phidd: Any, gammadd: Any) -> Any:
    """D, d' and d'' of the distal link."""
    c, s, cg, sg = np.cos(phi), np.sin(phi), np.cos(gamma), np.sin(gamma)
    out, outd = cg, -sg * gammad
    outdd = -sg * gammadd - cg * gammad**2
    d = (-sg, out * c, out * s)
    dd = (-cg * gammad, outd * c - out * s * phid, outd * s + out * c * phid)
    turning, swing = outdd - out * phid**2, 2 * outd * phid + out * phidd
    return d, dd, (sg * gammad**2 - cg * gammadd, turning * c - swing * s, turning * s + swing * c)


def rate_matrix(r: Floats) -> Floats:
    """T (9, 9) of one pose r (9,): v = T r'."""
    columns = [from_tree(r, e)[1] for e in np.eye(9)]
    return np.column_stack(columns)


def linear(r: Floats) -> Chart:
    """The chart of small motions about one pose r (9,)."""
    T = rate_matrix(r)
    inverse: Floats = np.linalg.inv(T).astype(np.float64)
    return Chart(T=T, S=inverse)


def absolute(r: Floats, rd: Floats, M: Floats, bias: Floats, H: Floats) -> tuple[Floats, Floats, Floats]:
    """Mass matrix, bias and constraint Jacobian of the tree in the coordinates of the reference.

    M r'' + bias = force becomes T^-T M T^-1 v' + T^-T (bias - M T^-1 T' r') = T^-T force.

    Args:
        r: angles of the tree (9,).
        rd: its rates (9,).
        M: mass matrix (9, 9).
        bias: bias force (9,).
        H: constraint Jacobian (nc, 9).
    """
    inverse = np.linalg.inv(rate_matrix(r))
    drift = accelerations(r, rd, np.zeros(9))
    mass = inverse.T @ M @ inverse
    return mass, inverse.T @ bias - mass @ drift, H @ inverse
