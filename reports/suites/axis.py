"""Axes of a suite: how one number of a scene is drawn, or which values it takes in turn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from crossbody.cases import InvalidValue

if TYPE_CHECKING:
    from crossbody.cases import Value


@dataclass(frozen=True)
class _Range:
    """A number between low and high."""

    low: float
    high: float

    def __post_init__(self) -> None:
        """Check the ends."""
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            what = f"{type(self).__name__}({self.low:g}, {self.high:g})"
            raise InvalidValue(f"{what} is empty; its low end must be finite and below its high end.")


class Linear(_Range):
    """A number between low and high, evenly."""

    def at(self, u: float) -> Value:
        """The value at u in [0, 1)."""
        return self.low + (self.high - self.low) * u


class Log(_Range):
    """A number between low and high, even in its logarithm."""

    def __post_init__(self) -> None:
        """Check the ends."""
        super().__post_init__()
        if self.low <= 0.0:
            raise InvalidValue(f"Log({self.low:g}, {self.high:g}) begins at or below 0; use Linear.")

    def at(self, u: float) -> Value:
        """The value at u in [0, 1)."""
        return float(self.low * (self.high / self.low) ** u)


@dataclass(frozen=True)
class Whole(_Range):
    """A whole number from low to high, both included."""

    low: int
    high: int

    def at(self, u: float) -> Value:
        """The value at u in [0, 1)."""
        return min(self.low + int(u * (self.high - self.low + 1)), self.high)


@dataclass(frozen=True, slots=True)
class Levels:
    """Given values; in a grid every one of them, in a draw each equally often."""

    values: tuple[Value, ...]

    def __post_init__(self) -> None:
        """Check that there are some, each once."""
        if not self.values or len(set(self.values)) != len(self.values):
            raise InvalidValue(f"Levels{self.values} must name at least one value, each once.")

    def at(self, u: float) -> Value:
        """The value at u in [0, 1)."""
        return self.values[min(int(u * len(self.values)), len(self.values) - 1)]


Axis = Linear | Log | Whole | Levels


def decades(first: int, last: int, per: int = 1) -> Levels:
    """10^first to 10^last, `per` values a decade."""
    return Levels(tuple(float(f"{10.0 ** (first + i / per):.12g}") for i in range((last - first) * per + 1)))
