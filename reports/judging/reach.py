"""How far a scene's motion is followed, and how tightly: as far as time and rounding allow."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time
from typing import TYPE_CHECKING, Any

from crossbody.cases import Case, Outcome, Trajectory

if TYPE_CHECKING:
    from crossbody.engines import Run

BUDGET = 5.0
"""Time that the tightest run of a scene may take, s; its truth is about ten such runs."""
COARSE, LEAST, MANY = 1e-9, 50, 20
"""A scene is followed so tightly as takes up to so many times the steps of a coarse run, or of the least that counts:
of a method of order 8 the tightest takes 3 times as many, unless rounding is what its errors are made of."""
LADDER = (1.0, 10.0)
"""Tolerances that are tried, in units of `Case.tight`; ten times the last is taken without."""
FEW, FEWEST = 4, 200
"""Steps that tell what one of an engine costs, and how many a run takes at least, with those that choose its method."""
SHORTEST = 1e-3
"""Part of its horizon to which a motion is cut at most: one that gets no further stands still at an instant."""


@dataclass(frozen=True, slots=True)
class Followed:
    """A case as far as it is followed.

    Attributes:
        case: with the tightest tolerance that rounding leaves it, and the horizon that was reached.
        motion: at that tolerance.
        part: of the horizon that was asked for.
    """

    case: Case
    motion: Trajectory
    part: float = 1.0


def followed(case: Case, budget: float = BUDGET) -> Followed:
    """Return a case with the tightest tolerance that rounding leaves it, up to where its motion gets in time.

    Stiff rows on small masses reach theirs before, and many contacts that switch often take long.

    Args:
        case: the scene.
        budget: time that a run may take, s.
    """
    if not case.general:
        return Followed(case, tight(case))
    coarse = _run(case, COARSE, time_limit=budget)
    most = MANY * max(coarse.steps, LEAST)
    cut = cut_short(case, coarse)
    for bound in (*({"max_steps": most, "times": times} for times in LADDER), {"times": 10.0 * LADDER[-1]}):
        times = bound.pop("times")
        tried = replace(cut, tight=times * case.tight)
        motion = tight(tried, time_limit=budget, **bound)
        if motion.outcome is not Outcome.STEP_LIMIT:
            break
    last = cut_short(tried, motion)
    if last is not tried:
        motion = tight(last)
    return Followed(last, motion, last.t_end / case.t_end)


def cut_short(case: Case, run: Trajectory) -> Case:
    """Return a case whose horizon ends where a run had to be ended, at two digits; as it is where it had not."""
    reached = float(run.t[-1]) if len(run.t) else 0.0
    if run.outcome is not Outcome.TIME_LIMIT or reached < SHORTEST * case.t_end:
        return case
    digit = 10.0 ** (math.floor(math.log10(reached)) - 1)
    t_end = float(f"{math.floor(reached / digit) * digit:.2g}")
    told = {"t_end": t_end} if "t_end" in case.parameters else {}
    return replace(case, t_end=t_end, parameters={**case.parameters, **told})


def tight(case: Case, **bound: Any) -> Trajectory:
    """The compiled integrator at the case's tightest tolerance; what it meets that has no rows is seen."""
    from crossbody.engines import load

    return load("reference").prepare(case, "compiled", rtol=case.tight, **bound).run()


def _run(case: Case, rtol: float, **bound: Any) -> Trajectory:
    """A run whose shapes nobody looks at: those of the truth's own run are seen."""
    from crossbody.engines import load

    prepared: Any = load("reference").prepare(case, "compiled", rtol=rtol, **bound)
    found: Trajectory = prepared.motion()
    return found


def estimated(prepare: Callable[..., Run], part: float, most: float) -> tuple[float, int]:
    """Return about what a run takes of one processor, s, without that of choosing its method, and its first steps.

    Args:
        prepare: prepares the first part of the run, with settings.
        part: of the horizon.
        most: beyond it the first part is not run either.
    """
    prepared = prepare()
    if "max_steps" in prepared.settings:
        one = {"method": "Adams"} if "method" in prepared.settings else {}
        cost, steps = _timed(prepare(max_steps=FEW, **one))
        if cost / max(steps, 1) * FEWEST > most:
            return cost / max(steps, 1) * FEWEST, steps
    cost, steps = _timed(prepared)
    return cost / part, steps


def _timed(run: Run) -> tuple[float, int]:
    began = process_time()
    found = run.run()
    used, tried = (found.counts.get(name, 0) for name in ("rhs", "tried"))
    return (process_time() - began) * used / max(used + tried, 1) if tried else process_time() - began, found.steps
