"""Recorded modes against those that follow from the recorded events, and events against the law's: an identity."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from crossbody.cases import Case, Event, Mode, Trajectory
from crossbody.cases.arrays import Bytes, Floats
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
PUSHES = frozenset({Mode.CONTACT, Mode.COLLISION, Mode.STICK, Mode.SLIP})
FOLLOW: Mapping[Mode, frozenset[Mode]] = MappingProxyType({
    Mode.FREE: PUSHES | {Mode.BALLISTIC},  # a start below the surface that does not push
    Mode.BALLISTIC: PUSHES | {Mode.FREE},
    Mode.CONTACT: frozenset({Mode.FREE, Mode.BALLISTIC}),
    Mode.COLLISION: frozenset({Mode.FREE, Mode.CONTACT, Mode.COLLISION_SEPARATION}),
    Mode.COLLISION_SEPARATION: frozenset({Mode.FREE, Mode.COLLISION}),
    Mode.STICK: frozenset({Mode.FREE, Mode.BALLISTIC, Mode.SLIP}),
    Mode.SLIP: frozenset({Mode.FREE, Mode.BALLISTIC, Mode.STICK, Mode.SLIP}),  # the other way, where friction is dry
    Mode.BILATERAL: frozenset(),
})  # fmt: skip
"""Which modes follow on which (docs/explanation/model.md)."""


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Number of samples in a mode that no event left, and of events that do not follow on the one before, or ever.

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
    odd = np.sum(before != left[:-1]) + np.sum(np.diff(at) < 0.0)
    return int(np.sum(~known) + odd) + sum(not _follows(events, k) for k in range(len(events)))


def _follows(events: tuple[Event, ...], k: int) -> bool:
    """Whether a law leads from one mode to the other: a collision in no time from any, and to any that is none."""
    event, beside = events[k], {e.t for e in events[max(k - 1, 0) : k + 2] if e is not events[k]}
    sudden = bool(event.impulse) or event.t in beside
    before, after = event.before, event.after
    if sudden and Mode.COLLISION in (before, after):
        return before != after
    return after in FOLLOW[before] or (bool(event.impulse) and before == after == Mode.FREE)
