"""The root of a function between two places: Brent, Algorithms for Minimization Without Derivatives (1973), chapter 4.

The same as `scipy.optimize.brentq` to the last bit; to import that takes longer than a run does.
"""

from __future__ import annotations

import math
from collections.abc import Callable

TRIALS = 100


def brent(function: Callable[[float], float], a: float, b: float, xtol: float, rtol: float) -> float:
    """Return where a function is zero between a and b, by interpolation that falls back on halving.

    Args:
        function: of different signs at a and b, or zero at one of them.
        a: one end.
        b: the other.
        xtol: how far off the root may be.
        rtol: likewise, in units of the root.
    """
    last, here, f_last, f_here = a, b, function(a), function(b)
    if f_last == 0.0:
        return last
    other, f_other, before, step = 0.0, 0.0, 0.0, 0.0  # the end on the other side, and the last two steps
    for _ in range(TRIALS):
        if f_last != 0.0 and f_here != 0.0 and math.copysign(1.0, f_last) != math.copysign(1.0, f_here):
            other, f_other, before, step = last, f_last, here - last, here - last
        if abs(f_other) < abs(f_here):
            last, here, other = here, other, here
            f_last, f_here, f_other = f_here, f_other, f_here
        known, half = 0.5 * (xtol + rtol * abs(here)), 0.5 * (other - here)
        if f_here == 0.0 or abs(half) < known:
            break
        tried = math.inf
        if abs(before) > known and abs(f_here) < abs(f_last):
            tried = _interpolated(last, here, other, f_last, f_here, f_other)
        taken = 2.0 * abs(tried) < min(abs(before), 3.0 * abs(half) - known)
        before, step = (step, tried) if taken else (half, half)
        last, f_last = here, f_here
        here += step if abs(step) > known else math.copysign(known, half)
        f_here = function(here)
    return here


def _interpolated(last: float, here: float, other: float, f_last: float, f_here: float, f_other: float) -> float:
    """Return the step to the root of the line, or of the inverse parabola, through two or three places."""
    if last == other:
        return -f_here * (here - last) / (f_here - f_last)
    to_last, to_other = (f_last - f_here) / (last - here), (f_other - f_here) / (other - here)
    return -f_here * (f_other * to_other - f_last * to_last) / (to_other * to_last * (f_other - f_last))
