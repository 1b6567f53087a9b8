"""Steps that an engine took against those that its setting asks for, counted by nobody but its record.

A run with the step dt takes t_end/dt of them, rounded up, and one more for each instant at which a step is cut: where
an event is located, an input changes, or a controller is asked. Fewer are longer than what was asked for, more are
shorter, and either changes errors of a few per cent by as much as the step is off.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import distinct

GRID = 1e-6
"""Part of a step by which an instant may be off its grid, and a step longer than it is."""
IDLE = 0.01
"""Part of all steps that may be cut where something is located that then changes nothing, and is no event."""


def miscounted(case: Case, settings: Mapping[str, Any], run: Trajectory) -> Iterator[tuple[float, float, str]]:
    """Yield numbers of steps that are not those of a run's setting `dt`, each with what it must be, and why.

    Args:
        case: what was run: its inputs and its controller cut steps.
        settings: of the run; without `dt` there is nothing to count.
        run: of the engine's own steps; one that did not finish, or that tells no steps, says nothing.
    """
    dt = float(settings.get("dt", 0.0))
    if not (run.outcome.ok and dt > 0.0 and run.steps > 0):
        return
    end = float(run.t[-1])
    least = max(1, math.ceil(end / dt - GRID))
    most = math.ceil((1.0 + IDLE) * end / dt + GRID) + len(run.events) + len(run.switches) + _cuts(case, end)
    if not least <= run.steps <= most:
        wanted = least if run.steps < least else most
        yield run.steps, wanted, f"{end:.6g} s are {least} steps of {dt:.6g} s, and {most - least} instants cut some."
    longest = float(np.max(np.diff(run.t), initial=0.0))
    if len(run.t) > run.steps and longest > (1.0 + GRID) * dt:
        yield end / longest, least, f"A step takes {longest:.6g} s, the setting dt is {dt:.6g} s."


def _cuts(case: Case, end: float) -> int:
    """Return at how many instants before the end, s, what acts on a case changes."""
    times = [] if case.inputs is None else [case.inputs.times]
    times += [] if case.control is None else [case.control.instants(end)]
    times += [] if case.force is None else [np.array(case.force.breaks, dtype=np.float64)]
    return len(distinct(*times)) if times else 0
