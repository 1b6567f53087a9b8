"""Rotations as quaternions, w first, inside of positions: q and -q are the same one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crossbody.cases.arrays import Floats


def normalised(q: Floats, quaternions: Sequence[int]) -> Floats:
    """Return positions (..., nq) with quaternions of length 1; one that is zero becomes NaN.

    `quaternions` has the first index in q of each, here and in what follows.
    """
    found = np.array(q, dtype=np.float64)
    for at in quaternions:
        with np.errstate(invalid="ignore", divide="ignore"):
            found[..., at : at + 4] /= np.linalg.norm(found[..., at : at + 4], axis=-1, keepdims=True)
    return found


def turned(q: Floats, rest: Floats) -> Floats:
    """Return the rotation vectors (..., 3), rad, in body axes, from quaternions `rest` to q (..., 4)."""
    a, b = rest[..., :1], -rest[..., 1:]
    e, f = q[..., :1], q[..., 1:]
    w, x = a * e - np.sum(b * f, axis=-1, keepdims=True), a * f + e * b + np.cross(b, f)
    sine = np.linalg.norm(x, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, np.abs(w))
    scale = np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 2.0)
    return np.where(w < 0.0, -1.0, 1.0) * scale * x


def rates(q: Floats, v: Floats, quaternions: Sequence[int]) -> Floats:
    """Return q' (n, nq) of velocities (n, nv), for a quaternion the angular ones in body axes, rad/s."""
    parts, at, row = [], 0, 0
    for first in quaternions:
        parts.append(v[:, row : row + first - at])
        row += first - at
        w, x, turn = q[:, first : first + 1], q[:, first + 1 : first + 4], 0.5 * v[:, row : row + 3]
        parts += [-np.sum(x * turn, axis=1, keepdims=True), w * turn + np.cross(x, turn)]
        at, row = first + 4, row + 3
    return np.concatenate([*parts, v[:, row:]], axis=1)


def ways(q: Floats, quaternions: Sequence[int]) -> Floats:
    """Return what positions move by from each to the next (n - 1, nv), a quaternion's in body axes."""
    moved, parts, at = np.diff(q, axis=0), [], 0
    for first in quaternions:
        turn = q[:, first : first + 4]
        parts += [moved[:, at:first], turned(turn[1:], turn[:-1])]
        at = first + 4
    return np.concatenate([*parts, moved[:, at:]], axis=1)


def differences(q: Floats, other: Floats, quaternions: Sequence[int]) -> Floats:
    """Return |q - other| (n, nq); in the first entry of a quaternion the angle, rad, and 0 in the others."""
    return sizes(signed(q, other, quaternions), quaternions)


def signed(q: Floats, other: Floats, quaternions: Sequence[int]) -> Floats:
    """Return how positions are off others (n, nv), as velocities count: of a quaternion the rotation vector, rad."""
    parts, at = [], 0
    for first in quaternions:
        turn = slice(first, first + 4)
        parts += [q[:, at:first] - other[:, at:first], turned(q[:, turn], other[:, turn])]
        at = first + 4
    return np.concatenate([*parts, q[:, at:] - other[:, at:]], axis=1)


def drifts(off: Floats, v: Floats, other: Floats, quaternions: Sequence[int]) -> Floats:
    """Return the rates (n, nv) of what `signed` gives, from velocities v and those of the others (n, nv).

    Of a rotation vector they follow from both angular velocities in body axes (Bullo and Murray 1995, "Proportional
    derivative (PD) control on the Euclidean group").
    """
    found: Floats = v - other
    for i, first in enumerate(quaternions):
        turn = slice(first - i, first - i + 3)
        e, apart = off[:, turn], v[:, turn] - other[:, turn]
        half = 0.5 * np.linalg.norm(e, axis=1, keepdims=True)
        small = half < 1e-3
        safe = np.where(small, 1.0, half)
        bent = np.where(small, 1.0 / 12.0, 0.25 * (1.0 - safe / np.tan(safe)) / (safe * safe))
        found[:, turn] += 0.5 * np.cross(e, v[:, turn] + other[:, turn]) + bent * np.cross(e, np.cross(e, apart))
    return found


def sizes(off: Floats, quaternions: Sequence[int]) -> Floats:
    """Return the sizes (n, nq) of what `signed` gives (n, nv); in the first entry of a quaternion, 0 in the others."""
    parts, at = [], 0
    for i, first in enumerate(quaternions):
        turn = off[:, first - i : first - i + 3]
        angle = np.linalg.norm(turn, axis=1, keepdims=True)
        parts += [np.abs(off[:, at : first - i]), angle, np.zeros_like(turn)]
        at = first - i + 3
    found: Floats = np.concatenate([*parts, np.abs(off[:, at:])], axis=1)
    return found


def matrices(quaternions: Floats) -> Floats:
    """Return the rotations (..., 3, 3) of quaternions (..., 4), w first, of any length but 0."""
    q = np.asarray(quaternions)
    w, x, y, z = (q[..., k] for k in range(4))
    two = 2.0 / (w * w + x * x + y * y + z * z)
    X, Y, Z = two * x, two * y, two * z
    found: Floats = np.empty((*q.shape[:-1], 3, 3))
    found[..., 0, 0], found[..., 0, 1], found[..., 0, 2] = 1.0 - Y * y - Z * z, X * y - Z * w, X * z + Y * w
    found[..., 1, 0], found[..., 1, 1], found[..., 1, 2] = X * y + Z * w, 1.0 - X * x - Z * z, Y * z - X * w
    found[..., 2, 0], found[..., 2, 1], found[..., 2, 2] = X * z - Y * w, Y * z + X * w, 1.0 - X * x - Y * y
    return found
