"""What an event-driven run asks of a mechanism's rows and of the machine that switches them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from numpy.typing import NDArray

from crossbody.cases import Event, Mode
from crossbody.cases._arrays import Floats
from crossbody.engines._log import Modes

WATCHED = 2
"""Functions watched for every row."""
ACTIVE = (Mode.CONTACT, Mode.BILATERAL)
"""Modes in which a row carries a multiplier."""
Fired = frozenset[tuple[int, int]]
"""(row, which of its watched functions) that reached zero at this instant."""


class Rows(Protocol):
    """The mechanism, row by row.

    Attributes:
        nc: number of rows.
        unilateral: which of them a machine may switch.
    """

    nc: int
    unilateral: Sequence[bool]

    def gaps(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gap, m, and its rate, m/s, of every row (nc,)."""
        ...

    def accelerate(self, q: Floats, v: Floats, active: Sequence[int]) -> tuple[Floats, Floats]:
        """Acceleration (nv,) and multipliers (nc,), 0 where not active."""
        ...

    def gap_acceleration(self, q: Floats, v: Floats, vd: Floats) -> Floats:
        """H'' = H v' + H' v of every row (nc,), m/s^2."""
        ...


@dataclass(frozen=True, slots=True)
class Settled:
    """What a machine made of an instant.

    Attributes:
        modes: modes behind the instant.
        v (nv,): velocities behind it (those before it, unless something was struck).
        passed: every transition as (row, before, after), in order.
        cycle: whether the modes repeated: they never settle.
    """

    modes: Modes
    v: Floats
    passed: tuple[tuple[int, int, int], ...]
    cycle: bool = False

    def events(self, t: float) -> list[Event]:
        """The transitions as events at time t, s."""
        return [Event(t=t, contact=i, before=Mode(b), after=Mode(a)) for i, b, a in self.passed]


class Machine(Protocol):
    """Switches the rows of a mechanism."""

    rows: Rows

    def watch(self, q: Floats, v: Floats, modes: Modes, out: NDArray[Any]) -> None:
        """Fill out (nc * WATCHED,) with functions whose zeros are where the machine must look."""
        ...

    def settle(self, q: Floats, v: Floats, modes: Modes, fired: Fired = ...) -> Settled:
        """Switch until nothing changes (event iteration). `fired` says which guards hold though round-off hides it."""
        ...


def first_modes(rows: Rows) -> Modes:
    """Every switched row FREE, every other BILATERAL."""
    return tuple(int(Mode.FREE if u else Mode.BILATERAL) for u in rows.unilateral)


def active(modes: Modes) -> tuple[int, ...]:
    """The rows that carry a multiplier."""
    return tuple(i for i, mode in enumerate(modes) if mode in ACTIVE)
