"""Gaps at the recorded events of rows, over the distance moved in one step: zero where events are located.

It holds a run against itself, so that it judges engines that follow another law as well.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crossbody.cases import Case, Event, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import AT_REST, CLOSED, LIGHT
from crossbody.reference import System
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.friction import rubbing
from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
SAME = 1e-12  # part of the horizon within which two instants are one
JOINS = 1e-6  # gap, m or rad (relative to positions above 1), that tolerances leave to one that touches beside another


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |gap| of rows that touch, at touches and at the end of BALLISTIC, over the row's longest way between samples.

    Where a row lets go its multiplier over its own longest way counts as well, and of both the smaller:
    laws without memory let go at the surface whatever pushes there. So does, of a contact that sticks, how
    far its friction is below its bound: where it reaches that, and would jam, its multiplier jumps to zero.
    Left out are those at whose instant something else happens, by which a multiplier may jump through zero,
    and a start in contact: touches of a row that was at or below its surface until then. Only what is beyond
    the errors of a row at its surface counts; where one touch is located another may join that is as near as
    positions are known. None without rows that touch, and where gaps depend on discrete variables; NaN where
    an event has no instant.
    """
    system = equations(case)
    if not case.law.touches.any() or len(run.t) < 2 or (system is not None and system.jumps):
        return None
    near, light = AT_REST * _size(run.q), LIGHT * _size(run.lam)
    alone, found = _alone(run, case, system), [0.0]
    located = {
        event.t for event in run.events
        if _touches(event) and _ways(run.t, run.gap[:, event.contact], event.t, near) == 0.0
    }  # fmt: skip
    for event in run.events:
        row = event.contact
        if not case.law.touches[row] or event.t <= run.t[0]:
            continue
        if _touches(event) and np.all(run.gap[run.t < event.t, row] <= near):
            continue
        joins = _touches(event) and event.t in located
        gap = _ways(run.t, run.gap[:, row], event.t, JOINS * _size(run.q) if joins else near)
        if _at_surface(event) or np.isnan(gap):
            found.append(gap)
        elif gap > 0.0 and event.before in CLOSED and event.after not in CLOSED and alone(event.t):
            push = _ways(run.t, run.lam[:, row], event.t, light)
            found.append(0.0 if np.isnan(push) else min(gap, push, _below_bound(run, case, event)))
    return float(np.max(found))


def _size(signal: Floats) -> float:
    """Return the largest value, and at least 1."""
    return max(1.0, float(np.nanmax(np.abs(signal), initial=0.0)))


def _touches(event: Event) -> bool:
    return event.before == Mode.FREE and event.after in CLOSED


def _at_surface(event: Event) -> bool:
    """Whether the law lets an event happen nowhere but at h = 0."""
    return _touches(event) or (event.before, event.after) == (Mode.BALLISTIC, Mode.FREE)


def _alone(run: Trajectory, case: Case, system: System | None) -> Callable[[float], bool]:
    """Return whether nothing but one event happens at an instant: no other row, no switch, no change of an input."""
    same, events = SAME * case.t_end, np.sort([event.t for event in run.events])
    given = [inputs.times for inputs in (case.inputs, run.inputs) if inputs is not None]
    others = np.sort(np.concatenate([[switch.t for switch in run.switches], *given]))
    tick = system.tick if system is not None and system.control is not None else 0.0

    def count(instants: Floats, t: float) -> int:
        return int(np.diff(np.searchsorted(instants, (t - same, t + same)))[0])

    def alone(t: float) -> bool:
        ticks = tick > 0.0 and abs(t - tick * round(t / tick)) <= same
        return count(events, t) <= 1 and count(others, t) == 0 and not ticks

    return alone


def _below_bound(run: Trajectory, case: Case, event: Event) -> float:
    """How far friction of a contact that sticks is below its bound where it lets go, over its longest way; else inf."""
    rubs = rubbing(run, case) if event.before == Mode.STICK else None
    if rubs is None:
        return np.inf
    k = int(np.searchsorted(rubs.rows, event.contact))
    below = rubs.mu[k] * rubs.normal[:, k] - np.linalg.norm(rubs.force[:, k], axis=-1)
    return _ways(run.t, below, event.t, LIGHT * _size(run.lam))


def _ways(t: Floats, signal: Floats, instant: float, nothing: float) -> float:
    """Size of a signal (n,) at an instant beyond `nothing`, over its longest way between samples.

    It is read by a straight line where no sample stands, and before what happens there where two do.
    """
    i = int(np.searchsorted(t, instant, side="left"))
    there = float(signal[i]) if i < len(t) and t[i] == instant else float(np.interp(instant, t, signal))
    way = float(np.max(np.abs(np.diff(signal))))
    return 0.0 if abs(there) <= nothing else (abs(there) - nothing) / max(way, nothing)
