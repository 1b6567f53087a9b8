"""Steps that an engine took against those that its setting asks for, counted by nobody but its record.

A run with the step dt takes t_end/dt of them, rounded up, and one more for each instant at which a step is cut: where
an event is located, an input changes, or a controller is asked. Fewer are longer than what was asked for, more are
shorter, and either changes errors of a few per cent by as much as the step is off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from crossbody.cases import Case, Outcome, Trajectory, Value
from crossbody.cases.arrays import distinct
from crossbody.engines import Run

GRID = 1e-6
"""Part of a step by which an instant may be off its grid, and a step longer than it is."""
FIRST, FAR = 8, 100
"""How many steps are looked at before a run is begun, and how many times as many are no such steps."""
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


def runaway(case: Case, settings: Mapping[str, Any], prepare: Callable[[Case, Mapping[str, Value]], Run]) -> str:
    """Return why a run is not begun: its first steps are far shorter than asked for; nothing where they are not.

    All of them would take as many times longer, up to the limit of time.

    Args:
        case: what is run.
        settings: of the run; nothing is asked where it has no `dt`, or no `max_steps` to end what takes too many.
        prepare: prepares a run of a case, with these settings beside those that were asked for.
    """
    dt = float(settings.get("dt", 0.0))
    if not 0.0 < FIRST * dt < case.t_end or "max_steps" not in settings:
        return ""
    most = min(FAR * FIRST, int(settings["max_steps"]))
    run = prepare(replace(case, t_end=FIRST * dt), {"dt": dt, "max_steps": most}).run()
    if run.outcome is not Outcome.STEP_LIMIT or run.steps < FAR * FIRST or len(run.events) + len(run.switches) >= FIRST:
        return ""
    end = float(run.t[-1]) if len(run.t) else 0.0
    return (
        f"It took {run.steps} steps for its first {end:.3g} s, which are {end / dt:.3g} of its setting dt = {dt:g} s."
    )


def _cuts(case: Case, end: float) -> int:
    """Return at how many instants before the end, s, what acts on a case changes."""
    times = [] if case.inputs is None else [case.inputs.times]
    times += [] if case.control is None else [case.control.instants(end)]
    times += [] if case.force is None else [np.array(case.force.breaks, dtype=np.float64)]
    return len(distinct(*times)) if times else 0
