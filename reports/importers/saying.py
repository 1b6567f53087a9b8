"""Numbers, orientations and files as robot files say them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats


def numbers_of(text: str) -> Floats:
    """Return the numbers of an attribute."""
    return np.array([float(word) for word in text.split()])


def said(values: Any) -> str:
    """Return numbers as an attribute has them, with all their digits."""
    return " ".join(f"{float(value):.17g}" for value in np.atleast_1d(values))


def quaternion(R: Floats) -> Floats:
    """Return the quaternion (w first, w >= 0) of a rotation, by its largest part."""
    K = np.array([
        [np.trace(R), R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
        [0.0, 2 * R[0, 0] - np.trace(R), R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
        [0.0, 0.0, 2 * R[1, 1] - np.trace(R), R[1, 2] + R[2, 1]],
        [0.0, 0.0, 0.0, 2 * R[2, 2] - np.trace(R)],
    ])  # fmt: skip
    found: Floats = np.linalg.eigh(K + np.triu(K, 1).T)[1][:, -1]
    return found if found[0] >= 0.0 else -found


def beside(out: Path, path: Path, name: str) -> str:
    """Return how a file calls what another calls so from where that stands."""
    return os.path.relpath(path.resolve().parent / name, out.resolve().parent)
