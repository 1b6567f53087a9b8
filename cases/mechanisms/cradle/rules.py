"""What comes out of Newton's cradle under each collision rule, by name.

    sequential     one collision after another: the truth of the case
    simultaneous   all at once, as a complementarity problem
    block          each half as one rigid body; it keeps energy and momentum, so that neither check sees it
    linear, hertz  compliant chains, by direct integration (elastic balls only)
    memoryless     the contact law on all overlapping pairs together, by direct integration

An engine's answer laid beside them says which rule it follows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.cradle import chains
from crossbody.cases.mechanisms.cradle.motion import Motion
from crossbody.cases.mechanisms.cradle.scene import Row

LARGEST = 20  # balls up to which chains are integrated directly


def sequential(row: Row) -> Floats:
    """Speeds behind one collision after another (n,), m/s; exact."""
    return Motion(row, "sequential").final


def simultaneous(row: Row) -> Floats:
    """Speeds if all collide at once, as if touching (n,), m/s; exact. Equal masses: (2 - n)/n, 2/n, ..."""
    return Motion(replace(row, gap=0.0), "simultaneous").final


def block(row: Row) -> Floats:
    """Speeds if the balls that strike are one body and those that are struck another (n,), m/s; exact."""
    k, m = row.lifted, row.masses
    a, b = float(m[:k].sum()), float(m[k:].sum())
    v = row.speed * a / (a + b)
    apart = row.e * row.speed
    return np.where(np.arange(row.n) < k, v - apart * b / (a + b), v + apart * a / (a + b))


RULES: dict[str, Callable[[Row], Floats]] = {
    "sequential": sequential,
    "simultaneous": simultaneous,
    "block": block,
    "linear": chains.linear,
    "hertz": chains.hertz,
    "memoryless": chains.memoryless,
}
_INTEGRATED = ("linear", "hertz", "memoryless")
_ELASTIC = ("linear", "hertz")


def answer(name: str, row: Row) -> Floats | None:
    """Speeds under one of `RULES` (n,), m/s; None where it has no answer."""
    if (name in _INTEGRATED and row.n > LARGEST) or (name in _ELASTIC and row.zeta > 0.0):
        return None
    return _cached(name, row.masses.tobytes(), row.lifted, row.speed, row.gap, row.a0, row.zeta)


@cache
def _cached(name: str, masses: bytes, lifted: int, speed: float, gap: float, a0: float, zeta: float) -> Floats | None:
    row = Row(masses=np.frombuffer(masses), lifted=lifted, speed=speed, gap=gap, a0=a0, zeta=zeta)
    found = RULES[name](row)
    found.setflags(write=False)
    return found if np.all(np.isfinite(found)) else None
