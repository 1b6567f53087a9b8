"""When forces act that a run tells, against what velocities gained over its steps.

An engine that calls the force of a step that ends one of the step that begins tells impulses a step late, and another
power of friction: sums over samples do not show it. But M dv - dt f is what forces gave over a step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from crossbody.cases import Acts, Case, Trajectory
from crossbody.reports.measuring.momenta import of_cut_steps, unexplained, unseen

FAR = 0.25
"""Part of half of a change of forces from which on momenta are not explained; of a wrong rule it is 1 or 2."""
NEARER = 0.25
"""Part of what a rule leaves unexplained that another must, to be the right one."""
COARSE = 0.4
"""Part that trapezoids of steps may leave where samples are told to show both sides of every jump."""
SUMS = ("lam_impulse", "lam_impulse_path", "friction_impulse", "friction_work")
"""Metrics that add up forces over samples."""
SEEN = 1e-6
"""Part of impulses to which sums must see them to be judged: to that limits hold."""
LIGHT = 1e-6
"""Part of all that moves below which forces do not change."""
SAID = {
    Acts.AT: "at the instants of its samples, both sides of every jump told", Acts.GRID: "at the instants of a grid",
    Acts.BEFORE: "over the steps that end at its samples", Acts.BEHIND: "over the steps that begin at its samples",
}  # fmt: skip


def misacting(case: Case, settings: Mapping[str, Any], run: Trajectory) -> Iterator[tuple[float, str]]:
    """Yield which part of half of the changes of forces is unexplained where they do not act when a run says, and why.

    Args:
        case: what was run.
        settings: of the run; one with a step `dt` tells its own steps.
        run: with forces that change.
    """
    yield from _cut(case, run)
    found = unexplained(run, case)
    if found is None or not found.size > LIGHT:
        return
    own = found.middle[Acts.AT if run.acts == Acts.GRID else run.acts]
    rule, least = min(found.middle.items(), key=lambda pair: pair[1])
    said = f"Its forces are said to act {SAID[run.acts]}, which leaves"
    if own > FAR and least < NEARER * own:
        yield (
            own,
            f"{said} {own:.3g} of what they change by in half a step unexplained by velocities; {rule}: {least:.3g}.",
        )
    elif run.acts == Acts.AT and "dt" in settings and found.whole[Acts.AT] > COARSE:
        yield found.whole[Acts.AT], f"{said} {found.whole[Acts.AT]:.3g} of the largest of their changes unexplained."


def _cut(case: Case, run: Trajectory) -> Iterator[tuple[float, str]]:
    """Yield by what forces are too small that are impulses over whole steps, where their own are cut, and why."""
    for by, times in zip(*(of_cut_steps(run, case, 1.0 - FAR) or ((), ())), strict=True):
        if abs(by - times) < NEARER * (times - 1.0):
            yield (
                1.0 - 1.0 / by,
                f"Forces of a step that is cut to 1/{times:.3g} are 1/{by:.3g} of what velocities gain.",
            )
            return


def uncertain(case: Case, run: Trajectory) -> Mapping[str, str]:
    """Return which sums of forces samples do not tell, and why: those of a grid between whose instants forces jump.

    A step of Runge-Kutta's method takes forces inside of it that no sample shows.
    """
    if run.acts != Acts.GRID or not np.isfinite(run.lam).all() or not (part := unseen(run, case)) > SEEN:
        return {}
    most = f"up to {part:.2g} of what velocities gained by them" if math.isfinite(part) else "nothing tells how much"
    return dict.fromkeys(SUMS, f"Its forces jump between samples: sums by trapezoids leave out, or add, {most}.")
