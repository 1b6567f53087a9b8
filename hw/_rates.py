"""Rates and accelerations of sampled coordinates, by a polynomial through the samples around each instant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import InvalidValue

Floats = NDArray[np.float64]
HALF = 12
"""Samples on each side."""
DEGREE = 4


def rates_by_fit(t: Floats, y: Floats) -> Floats:
    """Rates (n, k) of samples y (n, k) at times t (n,); the times need not be equidistant."""
    return derivatives(t, y)[1]


def derivatives(t: Floats, y: Floats, half: int = HALF, degree: int = DEGREE) -> tuple[Floats, Floats, Floats, Floats]:
    """Smoothed value, rate and acceleration of samples, and how noise goes into the acceleration.

    A polynomial is fitted by least squares to 2 half + 1 samples around each (fewer at the ends, where it stands
    aside of the middle), at their own times (Savitzky and Golay 1964 for equidistant ones).

    Args:
        t: times (n,), s.
        y: samples (n, k).
        half: samples on each side.
        degree: of the polynomial.

    Returns:
        value, rate, acceleration (n, k), and gain (n, 3): standard deviations of the three for unit white noise.

    Raises:
        InvalidValue: if there are too few samples for the polynomial.
    """
    n, width = len(t), 2 * half + 1
    if n < width or width <= degree + 2:
        raise InvalidValue(f"{n} samples are too few for a polynomial of degree {degree} through {width} of them.")
    first = np.clip(np.arange(n) - half, 0, n - width)
    at = first[:, None] + np.arange(width)
    span = t[at[:, -1]] - t[at[:, 0]]
    x = (t[at] - t[:, None]) / span[:, None]
    powers = x[:, :, None] ** np.arange(degree + 1)
    weights = np.linalg.pinv(powers)[:, :3, :]
    found = np.einsum("nij,njk->nik", weights, y[at])
    scale = np.stack([np.ones(n), 1.0 / span, 2.0 / span**2], axis=1)
    gain: Floats = np.linalg.norm(weights, axis=2) * scale
    value, rate, acceleration = (found * scale[:, :, None]).transpose(1, 0, 2)
    return value, rate, acceleration, gain
