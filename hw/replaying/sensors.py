"""What stands between a quantity and its record: delay, a first-order lag, counts; and the way back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from crossbody.cases import InvalidValue
from crossbody.cases.arrays import Floats, frozen
from crossbody.cases.entry_points import checked_arguments, checked_fields


@checked_fields
@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A sensor: y = ks/(s + ks) of the quantity a delay ago, rounded to counts.

    Attributes:
        delay: s.
        rate: ks, 1/s; 0 for none.
        quantum: one count; 0 for none.
    """

    delay: float = 0.0
    rate: float = 0.0
    quantum: float = 0.0

    def __post_init__(self) -> None:
        """Check signs."""
        for name in ("rate", "quantum"):
            if not getattr(self, name) >= 0.0:
                raise InvalidValue(f"Sensor: {name} is {getattr(self, name)!r}; it must be at least 0.")

    def read(self, t: Floats, x: Floats, xd: Floats | None = None) -> Floats:
        """What it shows of x (n, k) at times t (n,), s.

        Between samples x is cubic where its rate xd is given, else it holds.
        """
        seen = x if self.delay == 0.0 else _earlier(t, x, xd, self.delay)
        seen = lagged(t, seen, self.rate, held=xd is None) if self.rate else seen
        return self.quantum * np.rint(seen / self.quantum) if self.quantum else seen


def _earlier(t: Floats, x: Floats, xd: Floats | None, delay: float) -> Floats:
    at = np.clip(t - delay, t[0], t[-1])
    if xd is None:
        return np.asarray(x[np.searchsorted(t, at, side="right") - 1])
    return np.asarray(CubicHermiteSpline(t, x, xd)(at))


def lagged(t: Floats, x: Floats, rate: float, *, held: bool = True) -> Floats:
    """Y' = ks (x - y) from y = x at the start, exact for x that holds or is linear between samples."""
    y = np.empty_like(x)
    y[0] = x[0]
    for k in range(len(t) - 1):
        step = rate * (t[k + 1] - t[k])
        c = math.exp(-step)
        y[k + 1] = c * y[k] + (1.0 - c) * x[k]
        if not held:
            y[k + 1] += (x[k + 1] - x[k]) * (1.0 - (1.0 - c) / step)
    return y


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Unlagged:
    """What a sensor with a lag felt.

    Attributes:
        t (n - 1,): s.
        force (n - 1, k): from each time to the next.
        std (n - 1, k): its standard deviation.
    """

    t: Floats
    force: Floats
    std: Floats


@checked_arguments
def unlagged(t: Floats, y: Floats, rate: float, noise: float, quantum: float = 0.0) -> Unlagged:
    """Undo a first-order lag: x_k = (y_(k+1) - c y_k)/(1 - c), c = e^(-ks (t_(k+1) - t_k)), for x that holds.

    The noise of a reading comes out sqrt(1 + c^2)/(1 - c) times as large, correlated by -c/(1 +
    c^2) with the next.

    Args:
        t: times (n,), s.
        y: readings (n, k).
        rate: ks, 1/s, above 0.
        noise: standard deviation of a reading.
        quantum: one count of a reading, whose rounding counts as noise of quantum/sqrt(12).

    Raises:
        InvalidValue: for a rate or a noise outside its range.
    """
    if not (0.0 < rate < math.inf and noise >= 0.0 and quantum >= 0.0):
        raise InvalidValue(f"rate is {rate!r} 1/s, noise {noise!r}, quantum {quantum!r}; valid: above 0, at least 0.")
    t, y = frozen("unlagged", "t", t, (None,)), frozen("unlagged", "y", y, (None, None))
    if len(t) != len(y) or len(t) < 2:
        raise InvalidValue(f"{len(t)} times and {len(y)} readings: both must have the same number, at least two.")
    c = np.exp(-rate * np.diff(t))[:, None]
    force = (y[1:] - c * y[:-1]) / (1.0 - c)
    each = math.hypot(noise, quantum / math.sqrt(12.0))
    return Unlagged(t=t[:-1], force=force, std=np.broadcast_to(each * np.sqrt(1.0 + c * c) / (1.0 - c), force.shape))
