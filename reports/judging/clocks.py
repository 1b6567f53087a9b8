"""Times that a run reports against the clock around it, which no engine reads: never in seconds, always in parts.

The time of a run is part of what passes while it is asked for, and all but what starts and ends it. A clock that is
read before the steps, or behind them, shows next to none of that, and less than any computer takes for so many steps.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

from crossbody.cases import Trajectory

PART = 1e-3
"""Part of what passes around a run below which its time is not that of its steps: what it makes of its record takes
no thousand times as long."""
STEP = 2e-8
"""Time that no step takes, s: a hundred cycles of a processor."""
READ = 1e-6
"""What two readings of one clock are apart, s."""
CORES, TICK = os.cpu_count() or 1, 0.02
"""Processors, and the longest tick of a clock that tells their time, s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """What was seen of a run from outside.

    Attributes:
        run: the run of an engine's own steps, whose time is the one that is reported.
        around_s: what passed around it, s.
        compiled_s: part of that in which code was compiled, s.
        cpu_s: time of all processors in it, s, by which the cost of other runs is told; 0 where nobody looked.
    """

    run: Trajectory
    around_s: float
    compiled_s: float
    cpu_s: float = 0.0


def mistimed(clock: Clock, shown: Trajectory, took_s: float) -> Iterator[tuple[float, str]]:
    """Yield times of a run that are not those that passed, s, with what is wrong.

    Args:
        clock: around the run of its own steps.
        shown: the motion that is judged, with the times that are reported.
        took_s: what all of that engine took, s, compilation aside.
    """
    own = clock.run
    if (shown.wall_s, shown.control_s, shown.steps) != (own.wall_s, own.control_s, own.steps):
        yield shown.wall_s, f"The run of its own steps, {own.steps}, took {own.wall_s:.3g} s."
    if not own.wall_s <= clock.around_s + READ:
        yield own.wall_s, f"{clock.around_s:.3g} s passed around the run."
    least = max(PART * (clock.around_s - clock.compiled_s), STEP * own.steps)
    if 0.0 < own.wall_s < least:  # 0 is no time, of one's own engine
        yield own.wall_s, f"{clock.around_s:.3g} s passed around the run, which took {own.steps} steps."
    if not 0.0 <= clock.cpu_s <= CORES * (clock.around_s + TICK):
        yield clock.cpu_s, f"{CORES} processors had {clock.around_s:.3g} s each."
    if not 0.0 <= own.control_s <= own.wall_s:
        yield own.control_s, f"A controller took more than the whole run, {own.wall_s:.3g} s, or less than none."
    if not took_s >= clock.around_s - clock.compiled_s - READ:
        yield took_s, f"In all it took less than its run, {clock.around_s:.3g} s."
