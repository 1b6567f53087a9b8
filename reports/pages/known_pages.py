"""What pages draw and say of made-up motions and rows, of which no two numbers are alike: none can stand for another.

What is drawn is decoded and looked up by the titles of axes with their units, and by engine; what must be there follows
from the made-up numbers by arithmetic that is written out here. Where something stands on a page is not asked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np

from crossbody.reports.judging.asked import Found
from crossbody.reports.pages import known_figures, known_playback, known_solids, known_texts
from crossbody.reports.pages.made_up_traces import Said

SHOWN, ROUNDED = 2e-4, 1e-6
"""Part of a number that a logarithmic axis does not show, and of the largest that single precision does not."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return figure, number as it is drawn, least and most, and which number, where another one is drawn."""
    modules = (known_figures, known_playback, known_solids, known_texts)
    return tuple(found for module in modules for name, ask in module.KINDS.items() for found in asked(name, ask))


def asked(name: str, ask: Callable[[], Iterator[Said]]) -> Iterator[Found]:
    """Yield what a figure draws that is another number than it must be."""
    try:
        for what, drawn, wanted in ask():
            if (differs := _differs(drawn, wanted)) is not None:
                is_, must = differs
                yield name, is_, (must, must), f"{what} of made-up numbers"
    except Exception as error:  # a figure that cannot be made or looked up is none
        yield name, np.nan, (np.nan, np.nan), f"made-up numbers ({type(error).__name__}: {error})"


def _differs(drawn: Any, wanted: Any) -> tuple[float, float] | None:
    """Return the number that differs most, and what it must be; how many there are, if that does."""
    if isinstance(wanted, str) or (isinstance(wanted, tuple) and wanted and isinstance(wanted[0], (str, tuple))):
        return None if drawn == wanted else (np.nan, np.nan)
    mine, right = (np.atleast_1d(np.asarray(one, dtype=np.float64)).ravel() for one in (drawn, wanted))
    if len(mine) != len(right):
        return float(len(mine)), float(len(right))
    off = np.abs(mine - right) - SHOWN * np.abs(right) - ROUNDED * np.max(np.abs(right), initial=0.0)
    off[(mine == right) | (np.isnan(mine) & np.isnan(right))] = -np.inf
    off[np.isnan(off)] = np.inf
    if not len(off) or off.max() <= 0.0:
        return None
    worst = int(np.argmax(off))
    return float(mine[worst]), float(right[worst])
