"""Whether states of a case in its own coordinates and in those of its scene are the same ones.

Engines run the scene of a form, and are judged in the case's coordinates. So there and back must lead to where it
began, in positions and rates, and rates must be those of the positions that they come with.
"""

from __future__ import annotations

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.reports.judging.audit import AuditRow, difference

STATES, SEED, NEAR = 4, 20250311, 0.1
"""Of states near the start, and by which part of a coordinate, or m or rad, they are off it."""
STEP = 1e-5
"""Time over which a motion is looked at, s."""
ROUNDED, SMOOTH = 1e-10, 1e-6
"""Part of the largest number by which sums in another order, and differences of positions, are off."""


def form_of_case(case: Case) -> tuple[AuditRow, ...]:
    """Return rows for the parity audit of a case with a form: there and back, and rates; none of another."""
    if case.form is None:
        return ()
    form, draw = case.form(case, True, False), np.random.default_rng(SEED)
    start = form.case.q0
    q = start + NEAR * np.maximum(np.abs(start), NEAR) * draw.normal(size=(STATES, len(start)))
    v = draw.normal(size=(STATES, len(form.case.v0)))
    if case.quaternions or form.case.quaternions or q.shape != v.shape:
        return ()
    theirs = form.to_case(q, v)
    back = form.to_scene(*theirs)
    moved = (form.to_case(q + STEP * v, v)[0] - form.to_case(q - STEP * v, v)[0]) / (2.0 * STEP)
    return (
        _row("positions of the form", back[0], q, ROUNDED), _row("rates of the form", back[1], v, ROUNDED),
        _row("rates of the case", theirs[1], moved, SMOOTH),
    )  # fmt: skip


def _row(quantity: str, mine: Floats, theirs: Floats, within: float) -> AuditRow:
    said = f"{STATES} states"
    return AuditRow(quantity=quantity, mine=said, theirs=said, difference=difference(mine, theirs), tolerance=within)
