"""Metrics that are no modules: those that a case brings along, and the functions of a module that holds several."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from crossbody.cases import Case, Trajectory
from crossbody.cases.case import CaseMetric
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.placed import largest, placed
from crossbody.reports.measuring.truth import Truth


@dataclass(slots=True)
class OfModule:
    """A function (truth, run, case) of a module that holds several metrics."""

    measure: Callable[[Truth, Trajectory, Case], float | None]
    UNIT: str
    NEEDS: str
    CLAIMED: bool = False


class OfCase:
    """A metric that a case brings along."""

    def __init__(self, own: CaseMetric) -> None:
        self.own, self.UNIT, self.CLAIMED = own, own.unit, not own.always

    def measure(self, truth: Truth, run: Trajectory, case: Case) -> float | None:
        """Return the number, or None where the run cannot tell."""
        own = self.own
        if own.number is not None:
            return own.number(run, case)
        if own.signal is not None:
            if (values := own.signal(run, case)) is None:
                return None
            inside, exact = aligned(truth, run, case)
            theirs = own.signal(exact, case)
            if theirs is None:
                return None
            off = np.abs(values[inside] - theirs)
            return largest(off.reshape(len(off), -1).max(axis=1, initial=0.0), run.t[inside], [("", own.unit)])
        assert own.instants is not None
        expected, found = own.instants(truth.trajectory, case), own.instants(run, case)
        if len(expected) == 0 or len(expected) != len(found):
            return None
        off = np.abs(found - expected)
        at = int(np.argmax(off))
        return placed(float(off[at]), "instant", float(off[at]), "s", float(expected[at]))
