"""How what an importer has made of a file differs from what it says, and what it is measured by."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Gap:
    """A difference.

    Attributes:
        size: part of the largest entry.
        where: joint, body or shape, and what of it.
        value, expected: there.
        part: name of the part alone; empty for the whole.
        key: which of `NUMBERS`, where it is one.
        lacks: whether the importer has nothing there.
        unseen: whether nobody can look there: `where` says why.
    """

    size: float
    where: str = ""
    value: float = math.nan
    expected: float = math.nan
    part: str = ""
    key: str = ""
    lacks: bool = True
    unseen: bool = False


def lacks(answer: Mapping[str, Any], key: str) -> bool:
    """Return whether an importer has no such quantity, or does not show it."""
    return key in answer["hidden"] or key in answer["unseen"]


def reach(states: Sequence[Any]) -> float:
    """Return how far the places of bodies reach, m."""
    return max((abs(x) for state in states for p, _ in state["frames"].values() for x in p), default=0.0) or 1.0


def apart(x: float, y: float) -> float:
    """Difference of two numbers over the larger; 1 where one of them alone is infinite."""
    if x == y:
        return 0.0
    return abs(x - y) / max(abs(x), abs(y)) if math.isfinite(x) and math.isfinite(y) else 1.0
