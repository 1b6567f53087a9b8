"""What metrics must say of forces that act over steps: of pulses that a grid is too coarse to see.

Every run asks. A pulse of a force is over between two samples of an engine that steps in time, which tells its impulse
as the mean of the step in which it acts: (J / T) pi / 2 sin(pi (t - t_0) / T) has the impulse J, whatever its length T.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Acts, Event, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports import metrics
from crossbody.reports.judging.asked import Asked, Found, unlike_by
from crossbody.reports.judging.made_up import case_of
from crossbody.reports.measuring.truth import from_run

PULSES, LENGTH, END = ((0.112, 0.7), (0.523, 0.4), (0.834, 0.1)), 3e-3, 1.0
"""When pulses begin, s, and their impulses, N s; how long each lasts, s, and the horizon."""
TOTAL = sum(size for _, size in PULSES)
FINE, COARSE = 201, 101
"""Samples of the truth in each pulse, and of an engine in all."""
MORE, NEAR = 0.02, 1e-6
"""Part by which an engine's impulses are larger, and part by which a number may be off."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return metric, number, least and most, and motion, of what is another number than it must be."""
    return unlike_by((_asked,), "lam_impulse", "pulses, which end in", NEAR, 1.0)


def pulses() -> Trajectory:
    """Return the truth: a row that is pushed in pulses, told from both sides of each."""
    inside = [np.linspace(t, t + LENGTH, FINE) for t, _ in PULSES]
    edges = [np.array([t, t + LENGTH]) for t, _ in PULSES]
    t = np.sort(np.concatenate([np.linspace(0.0, END, 51), *inside, *edges]))
    lam, on = np.zeros(len(t)), np.zeros(len(t), dtype=bool)
    for begin, size in PULSES:
        first, last = np.searchsorted(t, begin, side="right") - 1, np.searchsorted(t, begin + LENGTH)
        on[first : last + 1] = True
        part = (t[first : last + 1] - begin) / LENGTH
        lam[first : last + 1] = 0.5 * np.pi * size / LENGTH * np.sin(np.pi * part)
    return _row(t, lam, on, [begin for begin, _ in PULSES])


def held(acts: Acts, more: float = 1.0) -> Trajectory:
    """Return an engine's: each pulse is the mean of a step, times a factor."""
    t = np.linspace(0.0, END, COARSE)
    lam = np.zeros(COARSE)
    for begin, size in PULSES:
        step = int(np.searchsorted(t, begin))  # at its end
        lam[step - (acts == Acts.BEHIND)] = more * size / (t[step] - t[step - 1])
    return replace(_row(t, lam, lam > 0.0), acts=acts)


def struck(more: float) -> Trajectory:
    """Return an engine's whose pulses take no time."""
    t = np.sort(np.concatenate([np.linspace(0.0, END, COARSE), [t for t, _ in PULSES]]))
    blows = tuple(
        Event(t=t, contact=0, before=Mode.FREE, after=Mode.COLLISION, impulse=more * size) for t, size in PULSES
    )
    return replace(_row(t, np.zeros(len(t)), np.zeros(len(t), dtype=bool)), events=blows)


def _row(t: Floats, lam: Floats, on: NDArray[np.bool_], begun: Sequence[float] = ()) -> Trajectory:
    """Return a motion of one row, with touches of `LENGTH` that have begun at some instants, s."""
    column, events = np.linspace(0.0, 1.0, len(t))[:, None], []
    for begin in begun:
        events += [
            Event(t=begin, contact=0, before=Mode.FREE, after=Mode.CONTACT),
            Event(t=begin + LENGTH, contact=0, before=Mode.CONTACT, after=Mode.FREE),
        ]
    return Trajectory(
        t=t, q=column, v=column, gap=column, lam=lam[:, None], energy=np.hstack([column, column]),
        mode=np.where(on, Mode.CONTACT, Mode.FREE)[:, None].astype(np.int8), events=tuple(events),
    )  # fmt: skip


def _asked() -> Iterator[Asked]:
    truth, case = from_run(pulses(), Tier.A, "made up"), case_of(("m",), (True,), 1)
    runs = {
        "means of the step that ends": held(Acts.BEFORE, 1.0 + MORE), "collisions": struck(1.0 + MORE),
        "means of the step that begins": held(Acts.BEHIND, 1.0 + MORE), "right means": held(Acts.BEHIND),
    }  # fmt: skip
    for said, run in runs.items():
        wanted = 0.0 if said == "right means" else MORE
        for name in ("lam_impulse", "lam_impulse_path"):
            found = metrics.load(name).measure(truth, run, case)
            yield name, said, np.nan if found is None else float(found), wanted
    late = replace(runs["right means"], acts=Acts.BEFORE)  # each impulse comes a step early
    found = metrics.load("lam_impulse_path").measure(truth, late, case)
    yield "lam_impulse_path", "means of another step", np.nan if found is None else float(found), PULSES[0][1] / TOTAL
