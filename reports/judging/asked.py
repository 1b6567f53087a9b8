"""What modules of known answers share: whoever asks may fail, and has then said a number that is another one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TypeVar

from crossbody.reports.judging.planting import Range

Row = TypeVar("Row")
Found = tuple[str, float, Range, str]
"""Which number, as it is, least and most, and of what."""
Asked = tuple[str, str, float, float]
"""Which number, of what, as it is and as it must be."""
Within = tuple[str, str, float, float, float]
"""The same, and by how much it may be off."""


def rows_of(ask: Callable[[], Iterable[Row]], failed: Callable[[str], Row]) -> list[Row]:
    """Return what is asked; where that ends in an exception, the row that `failed` makes of its words alone."""
    try:
        return list(ask())
    except Exception as error:  # what ends so says no number
        return [failed(f"{type(error).__name__}: {error}")]


def unlike(kinds: Iterable[Callable[[], Iterable[Within]]], name: str, ends: str) -> tuple[Found, ...]:
    """Return the numbers that are others than they must be, each by what it may be off.

    Args:
        kinds: who asks.
        name: of the number that one who fails has said.
        ends: of what that is, before the reason.
    """
    return tuple(
        (name_, value, (wanted - within, wanted + within), what)
        for kind in kinds
        for name_, what, value, wanted, within in rows_of(kind, lambda why: (name, f"{ends} {why}", math.nan, 0.0, 0.0))
        if not abs(value - wanted) <= within
    )


def unlike_by(
    kinds: Iterable[Callable[[], Iterable[Asked]]], name: str, ends: str, part: float, least: float
) -> tuple[Found, ...]:
    """Return the same of numbers that may be off by a part of what they must be, and of the least size that counts."""
    return tuple(
        (name_, value, (wanted, wanted), what)
        for kind in kinds
        for name_, what, value, wanted in rows_of(kind, lambda why: (name, f"{ends} {why}", math.nan, 0.0))
        if not abs(value - wanted) <= part * max(abs(wanted), least)
    )
