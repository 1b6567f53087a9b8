"""What modules of known answers share: whoever asks may fail, and has then said a number that is another one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

Row = TypeVar("Row")


def rows_of(ask: Callable[[], Iterable[Row]], failed: Callable[[str], Row]) -> list[Row]:
    """Return what is asked; where that ends in an exception, the row that `failed` makes of its words alone."""
    try:
        return list(ask())
    except Exception as error:  # what ends so says no number
        return [failed(f"{type(error).__name__}: {error}")]
