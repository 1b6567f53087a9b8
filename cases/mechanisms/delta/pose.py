"""Closed forms of the delta robot that its cases start from: pose, holding torque, kick.

Written here once more, as matrices: a case is plain data and knows no equations of the reference.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.errors import InvalidValue

Numbers = Mapping[str, float]


def rotations(p: Numbers) -> Floats:
    """Rz(0), Rz(-sign 120 deg), Rz(+sign 120 deg) (3, 3, 3)."""
    return _rotations(p["sign"])


@cache
def _rotations(sign: float) -> Floats:
    c, s = -0.5, sign * math.sqrt(0.75)
    turned = [[[c, k * s, 0.0], [-k * s, c, 0.0], [0.0, 0.0, 1.0]] for k in (1.0, -1.0)]
    return np.array([np.eye(3), *turned])


def pose(p: Numbers, z: Floats) -> Floats:
    """Angles (9,) that bring the flange to z (3,), m, with the elbows outward."""
    local = rotations(p).transpose(0, 2, 1) @ z
    faults = [f"arm {i} {fault}" for i, own in enumerate(local, 1) if (fault := _fault(p, own))]
    if faults:
        raise InvalidValue(f"The flange position {z.tolist()} m cannot be reached: {'; '.join(faults)}.")
    return np.concatenate([_arm(p, own) for own in local])


def _fault(p: Numbers, own: Floats) -> str:
    if abs(own[0]) > p["l2"]:
        return f"would have to reach {abs(own[0]):.6g} m sideways, more than l2 = {p['l2']:g} m"
    width = math.sqrt(p["l2"] ** 2 - own[0] ** 2)
    reach, low, high = math.hypot(own[1] - _offset(p), own[2]), abs(p["l1"] - width), p["l1"] + width
    return (
        "" if low <= reach <= high else f"would have to reach {reach:.6g} m, where it spans {low:.6g} to {high:.6g} m"
    )


def _offset(p: Numbers) -> float:
    return p["r_base"] - p["r_flange"]


def _arm(p: Numbers, own: Floats) -> Floats:
    """The elbow: circles of l1 about the hinge and of what l2 spans in the plane about the tip meet."""
    y, z = own[1] - _offset(p), own[2]
    square = y * y + z * z
    along = 0.5 * (1.0 + (p["l1"] ** 2 - p["l2"] ** 2 + own[0] ** 2) / square)
    aside = math.sqrt(max(p["l1"] ** 2 / square - along**2, 0.0))
    ey, ez = along * y + aside * z, along * z - aside * y
    return np.array([math.atan2(ez, ey), math.atan2(math.hypot(own[0], z - ez), y - ey), math.atan2(own[0], z - ez)])


def tips(p: Numbers, q: Floats) -> Floats:
    """Ends of the arms (..., 3, 3), m, of poses q (..., 9)."""
    a, b, c = np.moveaxis(q.reshape(*q.shape[:-1], 3, 3), -1, 0)
    x = p["l2"] * np.sin(b) * np.sin(c)
    y = _offset(p) + p["l1"] * np.cos(a) + p["l2"] * np.cos(b)
    z = p["l1"] * np.sin(a) + p["l2"] * np.sin(b) * np.cos(c)
    found: Floats = np.einsum("ijk,...ik->...ij", rotations(p), np.stack([x, y, z], axis=-1))
    return found


def flanges(p: Numbers, q: Floats) -> Floats:
    """Flange (n, 3), m, of poses q (n, 9): the mean of its arms' tips, a loop gap apart at most."""
    mean: Floats = tips(p, q).mean(axis=1)
    return mean


def symmetric_pose(p: Numbers, y: float) -> Floats:
    """Angles (9,) with all motors at y, rad, and the flange on the axis below the elbows."""
    aside = _offset(p) + p["l1"] * math.cos(y)
    if not abs(aside) < p["l2"]:
        raise InvalidValue(f"No symmetric pose at {y:g} rad: the elbows are {abs(aside):g} m off the axis.")
    return np.tile([y, math.acos(-aside / p["l2"]), 0.0], 3)


def tip_jacobians(p: Numbers, q: Floats) -> Floats:
    """Ri dpsi(q_i) of the three arms (3, 3, 3), m."""
    l1, l2, blocks = p["l1"], p["l2"], []
    for a, b, c in q.reshape(3, 3).tolist():
        (c1, c2, c3), (s1, s2, s3) = np.cos([a, b, c]).tolist(), np.sin([a, b, c]).tolist()
        rows = [[0.0, l2 * c2 * s3, l2 * s2 * c3], [-l1 * s1, -l2 * s2, 0.0], [l1 * c1, l2 * c2 * c3, -l2 * s2 * s3]]
        blocks.append(rows)
    return rotations(p) @ np.array(blocks)


def closure(p: Numbers, q: Floats) -> Floats:
    """H = dh/dq (6, 9)."""
    H, (a, b, c) = np.zeros((6, 9)), tip_jacobians(p, q)
    H[:3, :3], H[3:, :3], H[:3, 3:6], H[3:, 6:] = a, a, -b, -c
    return H


def gravity(p: Numbers, q: Floats) -> Floats:
    """DV/dq (9,), N m."""
    k1 = (p["m1"] / 2 + p["m2"] + p["m3"] / 3) * p["gravity"] * p["l1"]
    k2 = (p["m2"] / 2 + p["m3"] / 3) * p["gravity"] * p["l2"]
    a, b, c = q.reshape(3, 3).T
    return np.column_stack(
        [-k1 * np.cos(a), -k2 * np.cos(b) * np.cos(c), k2 * np.sin(b) * np.sin(c)]
    ).ravel()  # fmt: skip


def holding_torque(p: Numbers, q: Floats) -> Floats:
    """Motor torques (3,), N m, that hold a regular pose: [B H^T](tau; lam) = dV/dq."""
    known = np.hstack([np.eye(9)[:, ::3], closure(p, q).T])
    return np.asarray(np.linalg.solve(known, gravity(p, q)), dtype=np.float64)[:3]


def mass(p: Numbers, q: Floats) -> Floats:
    """M (9, 9), kg m^2."""
    third = p["m3"] / 3
    A = (p["m1"] / 3 + p["m2"] + third) * p["l1"] ** 2 + p["jm"]
    B, C = (p["m2"] / 2 + third) * p["l1"] * p["l2"], (p["m2"] / 3 + third) * p["l2"] ** 2
    M = np.zeros((9, 9))
    for i, (a, b, c) in enumerate(q.reshape(3, 3).tolist()):
        P = math.sin(a) * math.sin(b) + math.cos(a) * math.cos(b) * math.cos(c)
        Q = -math.cos(a) * math.sin(b) * math.sin(c)
        block = [[A, B * P, B * Q], [B * P, C, 0.0], [B * Q, 0.0, C * math.sin(b) ** 2]]
        M[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = block
    return M


def kicked(p: Numbers, q: Floats, impulse: Floats) -> Floats:
    """Velocities (9,) behind an impulse (3,), N s, on the flange at rest: M dv = Jv^T J + H^T L, H dv = 0."""
    H, push = closure(p, q), np.hstack(list(tip_jacobians(p, q))).T @ impulse / 3
    saddle = np.block([[mass(p, q), -H.T], [H, np.zeros((6, 6))]])
    return np.asarray(np.linalg.solve(saddle, np.concatenate([push, np.zeros(6)])), dtype=np.float64)[:9]


def elbow_angle(p: Numbers) -> float:
    """The motor angle y* at which the elbows coincide, rad: R + l1 cos y* = 0."""
    if _offset(p) > p["l1"]:
        raise InvalidValue(f"The elbows never meet: l1 = {p['l1']:g} m is less than {_offset(p):g} m.")
    return math.acos(-_offset(p) / p["l1"])


def swing_period(p: Numbers) -> float:
    """Period of small swings with the elbows together, s: w^2 = g (1.5 m2 + m3)/(l2 (m2 + m3))."""
    m2, m3 = p["m2"], p["m3"]
    return 2.0 * math.pi / math.sqrt(p["gravity"] * (1.5 * m2 + m3) / (p["l2"] * (m2 + m3)))


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
