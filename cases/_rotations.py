"""Rotations as quaternions, w first, inside of positions: q and -q are the same one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crossbody.cases._arrays import Floats


def normalised(q: Floats, quaternions: Sequence[int]) -> Floats:
    """Return positions (..., nq) with quaternions of length 1; one that is zero becomes NaN.

    Args:
        q: positions.
        quaternions: first index in q of each.
    """
    found = np.array(q, dtype=np.float64)
    for at in quaternions:
        with np.errstate(invalid="ignore", divide="ignore"):
            found[..., at : at + 4] /= np.linalg.norm(found[..., at : at + 4], axis=-1, keepdims=True)
    return found


def turned(q: Floats, rest: Floats) -> Floats:
    """Return the rotation vectors (..., 3), rad, in body axes, that lead from quaternions `rest` to q (..., 4)."""
    a, b = rest[..., :1], -rest[..., 1:]
    e, f = q[..., :1], q[..., 1:]
    w, x = a * e - np.sum(b * f, axis=-1, keepdims=True), a * f + e * b + np.cross(b, f)
    sine = np.linalg.norm(x, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, np.abs(w))
    scale = np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 2.0)
    vector: Floats = np.where(w < 0.0, -1.0, 1.0) * scale * x
    return vector


def differences(q: Floats, other: Floats, quaternions: Sequence[int]) -> Floats:
    """Return |q - other| (n, nq); in the first entry of a quaternion the angle between both, rad, and 0 in the others.

    Args:
        q: positions (n, nq).
        other: positions (n, nq).
        quaternions: first index in q of each.
    """
    found: Floats = np.abs(q - other)
    for at in quaternions:
        entries = slice(at, at + 4)
        found[:, at] = np.linalg.norm(turned(q[:, entries], other[:, entries]), axis=1)
        found[:, at + 1 : at + 4] = 0.0
    return found
