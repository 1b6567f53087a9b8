"""Recorded modes against those that follow from the recorded events: an identity at every sample."""

from __future__ import annotations

import numpy as np

from crossbody.cases import Case, Event, Mode, Trajectory
from crossbody.cases.arrays import Bytes, Floats
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Number of samples in a mode that no event left, and of events that do not follow on the one before.

    At the instant of an event a sample may stand before or behind it. Rows that open begin FREE; those
    that follow another have no events, and its mode at every sample. None without rows and where modes are not known.
    """
    if not run.mode.size or (run.mode < 0).any():
        return None
    system = equations(case)
    led = np.full(run.mode.shape[1], -1) if system is None else np.asarray(system.follows)
    first = np.where(case.law.unilateral, Mode.FREE, Mode.BILATERAL)
    own, led_by = np.flatnonzero(led < 0).tolist(), led[led >= 0]
    unlike = np.sum(run.mode[:, led >= 0] != run.mode[:, led_by])
    return float(unlike + sum(_broken(run.t, run.mode[:, i], first[i], run.transitions(i)) for i in own))


def _broken(t: Floats, mode: Bytes, first: int, events: tuple[Event, ...]) -> int:
    """Count those of one row, whose mode before everything is `first`."""
    left = np.array([first, *(event.after for event in events)])
    at = np.array([event.t for event in events])
    since, until = (np.searchsorted(at, t, side=side) for side in ("left", "right"))
    known = np.zeros(len(t), dtype=bool)
    for k in range(len(left)):
        known |= (since <= k) & (k <= until) & (mode == left[k])
    before = np.array([event.before for event in events])
    return int(np.sum(~known) + np.sum(before != left[:-1]) + np.sum(np.diff(at) < 0.0))
