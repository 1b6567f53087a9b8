"""Coordinates of the delta robot in a tree of hinges, and back, with rates.

A tree turns each arm by hinge x (q1), hinge x (alpha, relative to the proximal link) and hinge z
(gamma), with the distal link along local y. With d = (s2 s3, c2, s2 c3) the direction of that
link in the arm's frame,

    phi = q1 + alpha = atan2(d_z, d_y)     gamma = atan2(-d_x, hypot(d_y, d_z))
    d = (-sin gamma, cos gamma cos phi, cos gamma sin phi)

The chart of the tree ends at cos gamma = 0, that of the case at sin q2 = 0. Arrays are (..., 9), arm by arm.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats


def _arms(x: Floats) -> Floats:
    return np.moveaxis(np.asarray(x, dtype=np.float64).reshape(*np.shape(x)[:-1], 3, 3), -1, 0)


def _joined(*parts: Floats) -> Floats:
    stacked = np.stack(parts, axis=-1)
    return stacked.reshape(*stacked.shape[:-2], 9)


def to_tree(q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Return angles and rates of the tree from q and v of the case."""
    (q1, q2, q3), (a, b, w) = _arms(q), _arms(v)
    c2, s2, c3, s3 = np.cos(q2), np.sin(q2), np.cos(q3), np.sin(q3)
    x, y, z = s2 * s3, c2, s2 * c3
    xd, yd, zd = c2 * s3 * b + s2 * c3 * w, -s2 * b, c2 * c3 * b - s2 * s3 * w
    across = np.hypot(y, z)
    phi, phid = np.arctan2(z, y), (y * zd - z * yd) / across**2
    return _joined(q1, phi - q1, np.arctan2(-x, across)), _joined(a, phid - a, -xd / across)


def from_tree(r: Floats, rd: Floats) -> tuple[Floats, Floats]:
    """Return q and v of the case from angles and rates of the tree; sin q_i2 > 0."""
    (q1, alpha, gamma), (a, alphad, gammad) = _arms(r), _arms(rd)
    d, dd, _ = _direction(q1 + alpha, gamma, a + alphad, gammad)
    s2 = np.hypot(d[0], d[2])
    q = _joined(q1, np.arctan2(s2, d[1]), np.arctan2(d[0], d[2]))
    return q, _joined(a, -dd[1] / s2, (d[2] * dd[0] - d[0] * dd[2]) / s2**2)


def bend(r: Floats, rd: Floats) -> Floats:
    """Return v' (9,) of the case while the rates of the tree do not change."""
    (q1, alpha, gamma), (a, alphad, gammad) = _arms(r), _arms(rd)
    d, _, ddd = _direction(q1 + alpha, gamma, a + alphad, gammad)
    _, b, w = _arms(from_tree(r, rd)[1])
    s2, c2 = np.hypot(d[0], d[2]), d[1]
    bd = -(ddd[1] + c2 * b * b) / s2
    return _joined(np.zeros_like(bd), bd, (d[2] * ddd[0] - d[0] * ddd[2] - 2 * s2 * c2 * b * w) / s2**2)


def _direction(phi: Any, gamma: Any, phid: Any, gammad: Any) -> Any:
    """Return d, d' and d'' of the distal link at steady rates."""
    c, s, cg, sg = np.cos(phi), np.sin(phi), np.cos(gamma), np.sin(gamma)
    outd = -sg * gammad
    d = (-sg, cg * c, cg * s)
    dd = (-cg * gammad, outd * c - cg * s * phid, outd * s + cg * c * phid)
    turning, swing = -cg * (gammad**2 + phid**2), 2 * outd * phid
    return d, dd, (sg * gammad**2, turning * c - swing * s, turning * s + swing * c)
