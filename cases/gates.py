"""Rows that a case has beside those of its scene, and discrete variables that say which of them can be touched.

Everything is written in the Python that numba compiles, keeps nothing, and reads and writes one
array of numbers: the constants first, then what is discrete. A `Case.force` of the same case gets
that array too, so that a controller's mode may be one of the variables.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats

START, TOUCHED, SEEN = -1, -2, -3
"""What a switch is told in the place of a guard: the state where a motion starts; modes that have
changed; a state that an engine looks at between two of its steps, which locates nothing."""
UNCHANGED, CHANGED, LOST = range(3)  # what it answers; LOST ends the motion


@dataclass(frozen=True, slots=True, kw_only=True)
class Gates:
    """Rows under discrete variables.

    Attributes:
        rows: (q (nq,), v (nv,), numbers, h (nc,), H (nc, nv), Hdv (nc,)) writes gaps, their
            derivatives and H' v; of a row that cannot be touched a gap far away and zeros.
        guards: (q, numbers, g (guards,)) writes what is positive until the discrete variables change.
        switch: (q, numbers, modes (nc,), fired) changes numbers and modes at an instant at which
            a guard fell to zero, or for one of the reasons above; what a contact does on one row
            it may hand to another.
        numbers: constants, then the discrete variables, as they are before `START`.
        count: of the guards.
        discrete: which of the numbers `Trajectory.switches` counts, in the order of `Case.discrete`.
        follows (nc,): the row whose mode each one shares; -1 for none.
        lost: what to say where a switch answers LOST.
    """

    rows: Callable[[Floats, Floats, Floats, Floats, Floats, Floats], None]
    guards: Callable[[Floats, Floats, Floats], None]
    switch: Callable[[Floats, Floats, NDArray[np.int8], int], int]
    numbers: Floats
    count: int
    discrete: tuple[int, ...]
    follows: tuple[int, ...]
    lost: str = ""
