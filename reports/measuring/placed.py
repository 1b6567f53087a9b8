"""Numbers that say of what they are: which coordinate, contact or energy is off, by how much in its unit, and when."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Coordinate
from crossbody.cases.arrays import Floats
from crossbody.cases.scene_contacts import turning

Named = Sequence[tuple[str, str]]
"""Names of signals, each with its unit."""


class Placed(float):
    """A number, and in a few words of what it is; none where there is nothing to say.

    Args:
        value: the number.
        where: which signal, by how much in its unit, and when.
    """

    where: str

    def __new__(cls, value: float, where: str = "") -> Placed:
        """Return the number with its words."""
        found = super().__new__(cls, value)
        found.where = where
        return found


def placed(value: float, what: str, off: float, unit: str, t: float) -> Placed:
    """Return a number with the words that say of what it is: `off` in its unit at an instant, s."""
    return Placed(value, f"{what} by {off:.2g} {unit} at {t:.3g} s".strip() if value else "")


def largest(off: Floats, t: Floats, named: Named, scale: Floats | float = 1.0) -> Placed:
    """Return the largest of what signals are off by, over what each is measured by; zero of none.

    Args:
        off: sizes (n, k), or (n,) of one signal.
        t: instants (n,), s.
        named: of each signal its name and unit.
        scale: what they are measured by (k,), or one number for all.
    """
    off = off[:, None] if off.ndim == 1 else off
    parts = off / scale
    if not parts.size:
        return Placed(0.0)
    i, j = map(int, np.unravel_index(np.argmax(parts), parts.shape))
    return placed(float(parts[i, j]), named[j][0], float(off[i, j]), named[j][1], float(t[i]))


def of_coordinates(named: Iterable[Coordinate], per: str = "") -> Named:
    """Return names and units of coordinates, or of rates with what they are `per`."""
    return [(one.name, f"{one.unit}{per}") for one in named]


def of_rows(case: Case, unit: str, of_turning: str, which: NDArray[np.bool_] | None = None) -> Named:
    """Return names of the rows of a case, or of some of them (nc,), with a unit: another one where gaps are angles."""
    turns = turning(case.scene) if case.scene is not None else ()
    chosen = range(len(case.contacts)) if which is None else np.flatnonzero(which).tolist()
    return [(case.contacts[k], of_turning if case.contacts[k] in turns else unit) for k in chosen]
