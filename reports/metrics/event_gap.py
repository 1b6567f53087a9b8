"""Gaps where rows touch, or come free from below, by the recorded events, in ways of one step: zero where located.

It holds a run against itself, so that it judges engines that follow another law as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import Mode
from crossbody.reports.metrics._contacts import AT_REST, CLOSED
from crossbody.reports.metrics._equations import equations

if TYPE_CHECKING:
    from crossbody.cases import Case, Event, Trajectory
    from crossbody.cases.arrays import Floats
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |gap| of unilateral rows at touches and at the end of BALLISTIC, over the row's longest way between samples.

    Only what is beyond the errors of a row at its surface counts. A start in contact is left out. None without rows
    that open, and where gaps depend on discrete variables; NaN where an event has no instant.
    """
    system = equations(case)
    if not case.law.unilateral.any() or len(run.t) < 2 or (system is not None and system.jumps):
        return None
    way = np.max(np.abs(np.diff(run.gap, axis=0)), axis=0)
    near = AT_REST * max(1.0, float(np.max(np.abs(run.q))))
    found = [0.0]
    for event in run.events:
        row = event.contact
        if case.law.unilateral[row] and _at_surface(event) and not event.t <= run.t[0]:
            gap = abs(_at(run.t, run.gap[:, row], event.t))
            found.append(0.0 if gap <= near else (gap - near) / max(float(way[row]), near))
    return float(np.max(found))


def _at_surface(event: Event) -> bool:
    """Whether the law lets an event happen nowhere but at h = 0."""
    touches = event.before == Mode.FREE and event.after in CLOSED
    return touches or (event.before, event.after) == (Mode.BALLISTIC, Mode.FREE)


def _at(t: Floats, signal: Floats, instant: float) -> float:
    """Value of a signal (n,) at an instant, by a straight line where no sample stands."""
    i = int(np.searchsorted(t, instant, side="left"))
    return float(signal[i]) if i < len(t) and t[i] == instant else float(np.interp(instant, t, signal))
