"""Differences of a function at several widths, and whether they admit what is claimed for its derivative.

A value counts as wrong only if no width admits it, nor, near a kink, the differences of one side alone.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from crossbody.reference.kinds import Floats

WIDTHS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # of differences, in units of the coordinates
AGREE = 1e-6  # part of the terms by which a difference may be off, beside what its widths tell


def differs(
    function: Callable[[Floats], Floats], q: Floats, d: Floats, claimed: Floats, terms: Floats, size: Floats,
    slopes: Callable[[Floats], Floats] | None = None,
) -> NDArray[np.bool_]:  # fmt: skip
    """Whether no difference of a function (m,) of q along d admits what is claimed for its derivative.

    Args:
        function: of the positions.
        q: positions (n,).
        d: direction (n,).
        claimed: derivatives (m,) along it.
        terms: sizes (m,) of the terms that the derivatives are made of.
        size: those of the function itself.
        slopes: what is claimed (m,) at other positions. A kink nearer than the least width shows in it:
            no difference admits what is right there, but one lies between what is claimed on both sides.
    """
    here, wrong, last = function(q), np.ones(len(claimed), dtype=bool), None
    for width in WIDTHS:
        ahead, behind = function(q + width * d), function(q - width * d)
        middle = (ahead - behind) / (2.0 * width)
        noise = 32.0 * np.finfo(float).eps * (np.abs(here) + size + np.abs(ahead)) / width
        bound = AGREE * (terms + np.abs(middle)) + noise
        spread = np.zeros(len(claimed)) if last is None else np.minimum(np.abs(middle - last), AGREE**0.5 * terms)
        wrong &= ~(np.abs(middle - claimed) <= bound + spread)
        if width == WIDTHS[-1]:
            if slopes is not None and np.any(wrong):
                sides = np.array([slopes(q - width * d), claimed, slopes(q + width * d)])
                wrong &= ~((sides.min(axis=0) - bound <= middle) & (middle <= sides.max(axis=0) + bound))
            jump = np.abs(2.0 * here - ahead - behind) / width
            kinked = jump > AGREE * (terms + np.abs(middle)) + noise
            for side in ((ahead - here) / width, (here - behind) / width):
                near = np.minimum(1e-3 * (terms + np.abs(side)), 0.1 * jump)
                wrong &= ~(kinked & (np.abs(side - claimed) <= near + noise + 10.0 * width * size))
        if last is not None:  # the limit that differences of second order tend to
            error = (middle - last) / ((WIDTHS[0] / WIDTHS[1]) ** 2 - 1.0)
            wrong &= ~(np.abs(middle + error - claimed) <= 2.0 * np.abs(error) * AGREE**0.25 + noise)
        last = middle
        wrong &= np.isfinite(middle)  # a state so far out that sums overflow tells nothing
        if not np.any(wrong):
            break
    return wrong


def closest(function: Callable[[Floats], Floats], q: Floats, d: Floats, claimed: Floats) -> Floats:
    """Return the central difference that comes closest to what is claimed: it is shown to the user."""
    found = np.array([(function(q + width * d) - function(q - width * d)) / (2.0 * width) for width in WIDTHS])
    best = np.argmin(np.abs(found - claimed), axis=0)
    nearest: Floats = np.take_along_axis(found, best[None], axis=0)[0]
    return nearest
