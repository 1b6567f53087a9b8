"""Sticks that contradict each other where no set of modes is met by all rows: what that makes of the motion.

The normal rows move a contact along its surface though it sticks. If friction lets it slide there, that is a motion
which no set of modes describes; if it jams once it does, forces would press it further in, and there is none: Painleve.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference.cache import compiled
from crossbody.reference.core.friction import has_friction, is_dry
from crossbody.reference.core.jams import determinant
from crossbody.reference.core.layout import SLIP, STICK, Model, Work
from crossbody.reference.core.mode_search import judge
from crossbody.reference.core.mode_set import evaluate_set, first_row, keep, off_stick, put, put_back


@compiled
def strays_into_jam(s: Any, m: Model, w: Work, most: float) -> int:
    """The contact that sticks and strays most, and by more than `most`, if it jams once it slides that way; else -1.

    The set is evaluated, and stays as it is.
    """
    found = -1
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and not is_dry(m, i) and w.state[i] == STICK and off_stick(s, m, w, i) > most:
            found, most = int(i), off_stick(s, m, w, i)
    if found < 0:
        return found
    keep(s, w)
    for c in range(first_row(m, w, found), first_row(m, w, found) + m.tangents[found]):
        w.way[w.idx[c]] = w.excess[c] / most
    put(m, w, found, SLIP)
    evaluate_set(s, m, w)
    jams = determinant(s, m, w, w.listed[found]) <= 0.0
    put_back(s, m, w)
    judge(s, m, w)
    return found if jams else -1
