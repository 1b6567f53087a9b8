"""What an event-driven run asks of a mechanism's rows and of the machine that switches them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Event, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines._log import Modes

WATCHED = 3  # functions watched for every row; each is positive until it fires
ACTIVE = (Mode.CONTACT, Mode.COLLISION, Mode.BILATERAL)  # modes in which a row carries a multiplier
Fired = frozenset[tuple[int, int]]
"""(row, which of its watched functions) that reached zero at this instant."""
Passed = tuple[int, int, int, float]
"""One transition: row, mode before, mode after, impulse in N s (0 where lam is finite)."""


class Rows(Protocol):
    """The mechanism, row by row.

    Attributes:
        nc: number of rows.
        unilateral: which of them a machine may switch.
        follows: index of the row whose mode this one shares (a slip row follows its normal row); -1 for none.
        fast: which of them have constants of their own in COLLISION.
        near (nc,): gap, m, from which on nobody looks for the bottom of a dip.
    """

    nc: int
    unilateral: Sequence[bool]
    follows: Sequence[int]
    fast: Sequence[bool]
    near: Floats

    def gaps(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gap, m, and its rate, m/s, of every row (nc,)."""
        ...

    def accelerate(self, q: Floats, v: Floats, modes: Modes) -> tuple[Floats, Floats]:
        """Acceleration (nv,) and multipliers (nc,), 0 where not active."""
        ...

    def pressure(self, q: Floats, v: Floats, vd: Floats, rows: Sequence[int] | slice = ...) -> tuple[Floats, Floats]:
        """-(h'' + law) of rows (n,), or of all, at acceleration vd, and what rounding may make of it (n,), m/s^2.

        A row that is not active would push if it were, exactly where this is positive.
        """
        ...

    def delassus(self, q: Floats) -> Floats:
        """G = H M^-1 H^T (nc, nc)."""
        ...

    def elastic(self, q: Floats, v: Floats) -> Floats:
        """max(b1, sqrt(b0)) |h'| + b0 |h| of every row (nc,), m/s^2."""
        ...


def elastic_part(fast: Floats, h: Floats, hd: Floats) -> Floats:
    """What a COLLISION holds elastically (nc,), m/s^2, by b0 and b1 (2, nc); see `Rows.elastic`."""
    b0, b1 = fast
    part: Floats = np.maximum(b1, np.sqrt(b0)) * np.abs(hd) + b0 * np.abs(h)
    return part


@dataclass(frozen=True, slots=True)
class Settled:
    """What a machine made of an instant.

    Attributes:
        modes: modes behind the instant.
        v (nv,): velocities behind it (those before it, unless something was struck).
        passed: every transition, in order.
        cycle: whether the modes repeated: they never settle.
    """

    modes: Modes
    v: Floats
    passed: tuple[Passed, ...]
    cycle: bool = False

    def events(self, t: float) -> list[Event]:
        """The transitions as events at time t, s."""
        return [Event(t=t, contact=i, before=Mode(b), after=Mode(a), impulse=p) for i, b, a, p in self.passed]


class Machine(Protocol):
    """Switches the rows of a mechanism."""

    @property
    def rows(self) -> Rows:
        """The mechanism, row by row."""
        ...

    def watch(self, q: Floats, v: Floats, modes: Modes, out: NDArray[Any]) -> None:
        """Fill out (nc * WATCHED,) with functions that are positive until the machine must look."""
        ...

    def settle(self, q: Floats, v: Floats, modes: Modes, fired: Fired = ...) -> Settled:
        """Switch until nothing changes (event iteration). `fired` guards hold though round-off hides it."""
        ...


def first_modes(rows: Rows) -> Modes:
    """Every switched row FREE, and what follows one; every other BILATERAL."""
    opens = (u or leader >= 0 for u, leader in zip(rows.unilateral, rows.follows, strict=True))
    return tuple(int(Mode.FREE if one else Mode.BILATERAL) for one in opens)


def switched(rows: Rows) -> tuple[int, ...]:
    """The rows that a machine decides about: those that follow another are moved with it."""
    return tuple(i for i in range(rows.nc) if rows.unilateral[i] and rows.follows[i] < 0)


def shared(rows: Rows, modes: Sequence[int]) -> Modes:
    """The modes with every row that follows another in that one's mode."""
    return tuple(mode if leader < 0 else modes[leader] for mode, leader in zip(modes, rows.follows, strict=True))


def active(modes: Modes) -> tuple[int, ...]:
    """The rows that carry a multiplier."""
    return tuple(i for i, mode in enumerate(modes) if mode in ACTIVE)
