"""How capsules lie to each other, and how cylinders stand, while they touch: held between instants that are located.

The rows of such a pair are others as it lies along and as it is crossed. While one of them is in
force the way holds; where the shapes come to lie the other way is an event, at which what touched
goes over to the places that are nearest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.engines._log import Modes
from crossbody.engines._machines import ACTIVE
from crossbody.engines.pinocchio._contacts import ContactRows

BACK = 1e-6
"""Part of what separates both ways by which shapes go on first: rounding turns none back."""


class Ways:
    """The ways of all pairs that may lie in two.

    Args:
        touching: the rows of contacts.
        first: number of the first of them among the rows of the mechanism.
        forget: of answers that were kept for rows as they were.

    Attributes:
        watched: number of functions that are watched, two a pair: until it lies the other way, and until
            it has turned through, inside one step, a way in which it did not seem to lie at the ends.
    """

    def __init__(self, touching: ContactRows, first: int, forget: Callable[[], None]) -> None:
        self.touching, self.first, self.forget = touching, first, forget
        self.turning = touching.contacts.turning
        self.watched = 2 * len(self.turning)
        self.sides: dict[int, float] = {}
        places = touching.contacts.rows
        self.rows = [[first + i for i, (k, _) in enumerate(places) if k == turned] for turned in self.turning]

    def begin(self, _q: Floats) -> None:
        """Hold none."""
        self.touching.along.clear()
        self.forget()

    def hold(self, q: Floats, modes: Modes) -> bool:
        """Hold the ways of pairs of which a row is in force, as they lie now if they were not."""
        along, before = self.touching.along, len(self.touching.along)
        wanted = [k for k, rows in zip(self.turning, self.rows, strict=True) if any(modes[i] for i in rows)]
        for k in [k for k in along if k not in wanted]:
            del along[k]
        if new := [k for k in wanted if k not in along]:
            parted, sides = self._parted(q, new)
            along.update({k: parted[k] <= 0.0 for k in new})
            self.sides.update({k: sides[k] for k in new})
        if new or len(along) != before:
            self.forget()
        return False

    def watch(self, q: Floats, out: Floats) -> None:
        """Fill out (watched,) with what is positive until a pair that is held lies the other way."""
        out[:] = 1.0
        if not (along := self.touching.along):
            return
        parted, sides = self._parted(q, list(along))
        for i, k in enumerate(self.turning):
            if k in along:
                out[2 * i] = BACK - parted[k] if along[k] else BACK + parted[k]
                out[2 * i + 1] = 1.0 if along[k] else sides[k] * np.sign(self.sides[k])

    def through(self, fired: frozenset[int]) -> bool:
        """Whether a step went through a way in which a pair lay on neither side of it."""
        return any(which % 2 for which in fired)

    def _parted(self, q: Floats, which: Sequence[int]) -> tuple[dict[int, float], dict[int, float]]:
        """Return of some pairs by how much they do not lie along, and to which side."""
        one, two = (dict(zip(which, part.tolist(), strict=True)) for part in self.touching.parted(q, which))
        return one, two

    def turn(self, q: Floats, modes: Modes, fired: frozenset[int]) -> Modes:
        """Let pairs lie the other way; the modes of all rows then."""
        after = list(modes)
        for i in {which // 2 for which in fired}:
            k, rows = self.turning[i], self.rows[i]
            self.touching.along[k] = not self.touching.along[k]
            self.sides[k] = self._parted(q, [k])[1][k]
            self.forget()
            carried = next((modes[row] for row in rows if modes[row] in ACTIVE), int(Mode.FREE))
            gaps = self.touching.heights(q)[np.subtract(rows, self.first)]
            for row in rows:
                after[row] = int(Mode.FREE)
            after[rows[int(np.argmin(gaps))]] = carried
        return tuple(after)
