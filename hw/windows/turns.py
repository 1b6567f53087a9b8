"""Coordinates that are rotations: three components of a rotation vector are one turn, and turns do not subtract.

A rotation vector jumps by 2 pi where its angle passes pi, so differences of components say up to
2 pi where the cube itself is hardly off. The difference of two turns is the logarithm of the
relative rotation, at most pi long.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from crossbody.cases.arrays import Floats


def difference(y: Floats, yhat: Floats, turns: Sequence[int] = ()) -> Floats:
    """Measured less predicted (n, k); of turns log(R(y) R(yhat)^-1), rad, in the axes of the world.

    yhat is NaN where there is no prediction; a turn is the first of the columns of its rotation
    vector.
    """
    found: Floats = y - yhat
    for i in turns:
        part = slice(i, i + 3)
        good = np.all(np.isfinite(y[:, part]) & np.isfinite(yhat[:, part]), axis=1)
        found[good, part] = _log(Rotation.from_rotvec(y[good, part]), Rotation.from_rotvec(yhat[good, part]))
    return found


def deviation(y: Floats, turns: Sequence[int] = ()) -> Floats:
    """Coordinates as they are (n, k); turns as their difference to the mean turn."""
    if not len(turns):
        return y
    found = y.copy()
    for i in turns:
        turned = Rotation.from_rotvec(y[:, i : i + 3])
        found[:, i : i + 3] = _log(turned, turned.mean())
    return found


def increments(y: Floats, turns: Sequence[int] = ()) -> Floats:
    """Change from each sample to the next (n - 1, k), of turns in the axes of the world."""
    return difference(y[1:], y[:-1], turns)


def way(y: Floats, turns: Sequence[int] = ()) -> Floats:
    """Coordinates as they are (n, k); turns as what the body has turned about its own axes since the first sample.

    Its rate is the angular velocity in the axes of the body.
    """
    if not len(turns):
        return y
    found = y.copy()
    for i in turns:
        turned = Rotation.from_rotvec(y[:, i : i + 3])
        steps = (turned[:-1].inv() * turned[1:]).as_rotvec() if len(y) > 1 else np.zeros((0, 3))
        found[:, i : i + 3] = np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))
    return found


def advanced(y: Floats, yd: Floats, delay: Floats, turns: Sequence[int] = ()) -> Floats:
    """One state (k,) a little later, by its rates; turns by their angular velocity in body axes."""
    found = y + yd * delay
    for i in turns:
        part = slice(i, i + 3)
        found[part] = (Rotation.from_rotvec(y[part]) * Rotation.from_rotvec(yd[part] * delay[part])).as_rotvec()
    return found


def _log(one: Rotation, other: Rotation) -> Floats:
    if not len(one):
        return np.zeros((0, 3))
    return (one * other.inv()).as_rotvec()
