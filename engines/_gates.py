"""Rows under discrete variables (`crossbody.cases.gates`), compiled, as one run has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numba import types

from crossbody.cases import Switch
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Force
from crossbody.cases.gates import CHANGED, LOST, SEEN, START, TOUCHED, Gates
from crossbody.engines._acting import kernel
from crossbody.engines._log import Modes

_V, _M, _B, _I = types.float64[::1], types.float64[:, ::1], types.int8[::1], types.int64
_SIGNATURES = {
    "rows": types.void(_V, _V, _V, _V, _M, _V), "guards": types.void(_V, _V, _V),
    "switch": _I(_V, _V, _B, _I),
}  # fmt: skip

ALL_AT_ONCE = "The rows that can be touched depend on the positions of bodies: no state has all of them active."


class Gated:
    """The rows and the discrete variables of one run.

    Attributes:
        nc, nv: numbers of rows and of velocities.
        watched: number of the guards.
        numbers: constants and discrete variables, as they are now.
        lost: whether the motion has ended, as a switch says.
        kept: the discrete variables of every instant that was recorded.
    """

    def __init__(self, gates: Gates, nc: int, nv: int) -> None:
        self.gates, self.nc, self.nv, self.watched = gates, nc, nv, gates.count
        self.numbers, self.lost, self.kept = gates.numbers.copy(), False, list[Floats]()
        self.tail = slice(gates.discrete[0], None)
        self._rows, self._guards, self._switch = (
            kernel(getattr(gates, name), signature) for name, signature in _SIGNATURES.items()
        )

    def force(self, force: Force) -> Force:
        """Return a force of the same case that reads the discrete variables."""
        return replace(force, numbers=self.numbers)

    def at(self, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        """Return h (nc,), H (nc, nv) and H' v (nc,)."""
        h, H, drift = np.empty(self.nc), np.empty((self.nc, self.nv)), np.empty(self.nc)
        self._rows(_own(q), _own(v), self.numbers, h, H, drift)
        return h, H, drift

    def gradients(self, q: Floats) -> tuple[Floats, Floats]:
        """Return h and H."""
        h, H, _ = self.at(q, np.zeros(self.nv))
        return h, H

    def gradient_of(self, q: Floats, rows: Any) -> tuple[Floats, Floats]:
        """Return h and H of some rows."""
        h, H = self.gradients(q)
        return h[rows], H[rows]

    def keep(self) -> None:
        """Keep the discrete variables of an instant that is recorded."""
        self.kept.append(self.numbers[self.tail].copy())

    def recorded(self, q: Floats) -> Floats:
        """Return h (m, nc) of the recorded positions (m, nq)."""
        now, found = self.numbers[self.tail].copy(), np.empty((len(q), self.nc))
        for i, (one, then) in enumerate(zip(q, self.kept, strict=True)):
            self.numbers[self.tail] = then
            found[i] = self.gradients(one)[0]
        self.numbers[self.tail] = now
        return found

    def discrete(self) -> tuple[int, ...]:
        """Return the discrete variables that are told."""
        return tuple(int(self.numbers[i]) for i in self.gates.discrete)

    def switches(self, t: float, before: Sequence[int]) -> list[Switch]:
        """Return what has changed since, at t, s."""
        pairs = enumerate(zip(before, self.discrete(), strict=True))
        return [Switch(t=t, variable=i, before=b, after=a) for i, (b, a) in pairs if a != b]

    def begin(self, q: Floats) -> None:
        """Forget what was, and find the discrete variables of a start at q, where nothing touches."""
        self.numbers[:], self.lost = self.gates.numbers, False
        self.kept.clear()
        self._apply(q, (0,) * self.nc, START)

    def watch(self, q: Floats, out: Floats) -> None:
        """Fill out (watched,) with what is positive until something has to change."""
        self._guards(q, self.numbers, out)

    def through(self, _fired: frozenset[int]) -> bool:
        """Whether a step went through something that lies on neither side of it: these are located there."""
        return False

    def turn(self, q: Floats, modes: Modes, fired: frozenset[int]) -> Modes:
        """Let guards change what they do; the modes of all rows then."""
        for which in sorted(fired):
            modes, _ = self._apply(q, modes, which)
        return modes

    def hold(self, q: Floats, modes: Modes) -> bool:
        """Tell that rows have modes; whether that changes what acts."""
        return self._apply(q, modes, TOUCHED)[1]

    def seen(self, q: Floats, modes: Modes) -> None:
        """Tell where a motion is whose events nobody locates, and which rows push."""
        self._apply(q, modes, SEEN)

    def _apply(self, q: Floats, modes: Modes, fired: int) -> tuple[Modes, bool]:
        after = np.array(modes, dtype=np.int8)
        found = self._switch(_own(q), self.numbers, after, fired)
        self.lost |= found == LOST
        return self.shared(after.tolist()), found == CHANGED

    def shared(self, modes: Sequence[int]) -> Modes:
        """Return modes in which every row that follows another has that one's."""
        return tuple(mode if lead < 0 else modes[lead] for mode, lead in zip(modes, self.gates.follows, strict=True))


def _own(x: Floats) -> Floats:
    """Return an array that compiled code takes: a case's own may only be read."""
    return x if x.flags.writeable else x.copy()
