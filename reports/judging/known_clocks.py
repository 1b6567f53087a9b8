"""What is said of times that are wrong, and what runs cost whose times are seen from outside.

Two clocks that are mixed give a number of another origin: what one shows at the start, taken from what another shows at
the end. No part of what passes is so long or so short.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np

from crossbody.cases import Outcome, Trajectory
from crossbody.engines.contract import Run
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.clocks import CORES, TICK, Clock, mistimed
from crossbody.reports.judging.reach import estimated

SPIN, PART = 2e-3, 0.25
"""For how long a run counts, s, and what part of another one it is."""
AROUND, TOOK, STEPS = 2.0, 3.0, 1000
"""Of a run: what passed around it, and what all took, s; and its steps."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return which time, number, least and most, and of what, where it is another or a wrong one is not told."""
    return (*_untold(), *_cost())


def _motion(wall_s: float, control_s: float = 0.0) -> Trajectory:
    none = np.zeros((1, 0))
    return Trajectory(
        t=np.zeros(1), q=none, v=none, gap=none, lam=none, energy=np.zeros((1, 2)), mode=none.astype(np.int8),
        wall_s=wall_s, control_s=control_s, steps=STEPS, outcome=Outcome.FINISHED,
    )  # fmt: skip


def _untold() -> Iterator[Found]:
    """Yield times that are wrong and not told, and right ones that are."""
    own = _motion(1.0, 0.5)
    right = Clock(run=own, around_s=AROUND, compiled_s=0.5, cpu_s=1.9)
    asked = {
        "as they passed": (right, own, TOOK, False), "of another run": (right, _motion(1.5, 0.5), TOOK, True),
        "longer than what passed around it": _of(right, wall_s=2.0 * AROUND),
        "next to nothing": _of(right, wall_s=1e-5, control_s=0.0),
        "of a controller that takes more": _of(right, control_s=1.5),
        "of a controller that takes less than none": _of(right, control_s=-0.1),
        "of processors by another clock": (replace(right, cpu_s=perf_counter() + 1e4), own, TOOK, True),
        "of processors before a run": (replace(right, cpu_s=-1.0), own, TOOK, True),
        "in all less than the run": (right, own, 1.0, True),
    }  # fmt: skip
    for what, (clock, shown, took, told) in asked.items():
        if (found := len(list(mistimed(clock, shown, took)))) != told:
            yield "time", float(found), (float(told), float(told)), f"times {what}"


def _of(clock: Clock, **times: float) -> tuple[Clock, Trajectory, float, bool]:
    """Return a clock around a run that has other times, which is shown."""
    run = replace(clock.run, **times)  # type: ignore[arg-type]
    return replace(clock, run=run), run, TOOK, True


@dataclass
class _Spins(Run):
    """A run that counts for a while."""

    engine: str = "none"
    profile: str = "none"
    settings: Mapping[str, Any] = field(default_factory=dict)

    def run(self) -> Trajectory:
        """Count."""
        end = perf_counter() + SPIN
        while perf_counter() < end:
            pass
        return _motion(SPIN)

    def audit(self) -> Mapping[str, Any]:
        """Return nothing."""
        return {}


def _cost() -> Iterator[Found]:
    """Yield what a run is said to cost by its first part, if that is more than processors had, or nothing."""
    began = perf_counter()
    cost, steps = estimated(lambda **_: _Spins(), PART, math.inf)
    most = CORES * (perf_counter() - began + TICK) / PART
    if not 0.0 <= cost <= most or steps != STEPS:
        yield "cost", cost, (0.0, most), "a run that counts"
