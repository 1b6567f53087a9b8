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

BUDGET = 5.0  # time that the tightest run of a scene may take, s; its truth is about ten such runs
COARSE, LEAST, MANY = 1e-9, 50, 20
"""A scene is followed so tightly as takes up to so many times the steps of a coarse run, or of
the least that counts: of a method of order 8 the tightest takes 3 times as many, unless rounding
is what its errors are made of."""
LADDER = (1.0, 10.0, 100.0, 1000.0)  # tolerances that are tried, in units of `Case.tight`
BOUNDED = 3  # the first so many of them are left for the next where they take too many steps
SHORTER = 0.1
"""Each is left for the next, too, where a run that its budget ends gets less far than this part
of the coarse one: where stiff contacts slide steps are of low order, and a hundred times as many
for four digits more."""
FEW, FEWEST, MORE, AMPLE = 4, 200, 2, 1.5
"""Steps that tell what one of an engine costs; how many a run takes at least, with those that
choose its method; by how much more are tried next; and how much more than may be paid for before
a run counts as too dear."""
SHORT = {
    Outcome.TIME_LIMIT: "more takes longer than --budget allows",
    Outcome.PAINLEVE: "rigid bodies with dry friction have no motion beyond this instant (Painleve)",
}
"""Ends of the tightest run up to which a motion is compared all the same, and why not further."""
BEFORE = 1e-6  # part of the time that such a run got to by which its horizon is shorter at least
SEARCHED = 4096
"""Sets of modes of contacts with friction, of which a truth tries all to see whether a second motion keeps the law: of
six contacts that stand; 256 of four take 5 ms an instant."""
SHORTEST = 1e-3
"""Part of its horizon to which a motion is cut at most: one that gets no further stands still."""


@dataclass(frozen=True, slots=True)
class Followed:
    """A case as far as it is followed.

    Attributes:
        case: with the tightest tolerance that rounding leaves it, and the horizon that was reached.
        motion: at that tolerance.
        part: of the horizon that was asked for.
        why: no further; empty if to the horizon.
    """

    case: Case
    motion: Trajectory
    part: float = 1.0
    why: str = ""


def followed(case: Case, budget: float | None = None) -> Followed:
    """Return a case with the tightest tolerance that rounding leaves it, up to where its motion gets.

    Args:
        case: the scene.
        budget: time that a run may take, s; the horizon ends where it does, or the law. None: the
            horizon stays.
    """
    if not case.general:
        return Followed(case, tight(case))
    bound = {} if budget is None else {"time_limit": budget}
    coarse = motion(case, COARSE, **bound)
    most = {"max_steps": MANY * max(coarse.steps, LEAST)}
    cut = case if budget is None else cut_short(case, coarse)
    for k, times in enumerate(LADDER):
        tried = replace(cut, tight=times * case.tight)
        found = tight(tried, **bound, **(most if k < BOUNDED else {}))
        stuck = found.outcome is Outcome.TIME_LIMIT and found.t[-1] < SHORTER * coarse.t[-1]
        if found.outcome is not Outcome.STEP_LIMIT and not stuck:
            break
    last = tried if budget is None else cut_short(tried, found)
    ended = coarse if last is tried else found
    if last is not tried:
        found = tight(last)
    return Followed(last, found, last.t_end / case.t_end, SHORT[ended.outcome] if last.t_end < case.t_end else "")


def cut_short(case: Case, run: Trajectory) -> Case:
    """Return a case whose horizon, of two digits, ends before a run did by `SHORT`; else as it is."""
    reached = (1.0 - BEFORE) * float(run.t[-1]) if len(run.t) else 0.0
    if run.outcome not in SHORT or reached < SHORTEST * case.t_end:
        return case
    digit = 10.0 ** (math.floor(math.log10(reached)) - 1)
    t_end = float(f"{math.floor(reached / digit) * digit:.2g}")
    told = {"t_end": t_end} if "t_end" in case.parameters else {}
    return replace(case, t_end=t_end, parameters={**case.parameters, **told})


def tight(case: Case, **bound: Any) -> Trajectory:
    """The compiled integrator at the case's tightest tolerance; what it meets that has no rows is seen."""
    from crossbody.engines import load

    searched = {"most_sets": SEARCHED} if case.general else {}
    return load("reference").prepare(case, "compiled", rtol=case.tight, **searched, **bound).run()


def motion(case: Case, rtol: float, **settings: Any) -> Trajectory:
    """A run of the reference whose shapes nobody looks at: those of the truth's own run are seen."""
    from crossbody.engines import load

    prepared: Any = load("reference").prepare(case, "compiled", rtol=rtol, **settings)
    found: Trajectory = prepared.motion()
    return found


def estimated(prepare: Callable[..., Run], part: float, most: float) -> tuple[float, int]:
    """Return about what a run takes of one processor, s, without that of choosing its method, and its first steps.

    Args:
        prepare: prepares the first part of the run, with settings.
        part: of the horizon.
        most: beyond it the first part is not run either, or not to its end: what it takes is then
            at least this.
    """
    prepared = prepare()
    if "max_steps" not in prepared.settings:
        cost, found = _timed(prepared)
        return cost / part, found.steps
    one = {"method": "Adams"} if "method" in prepared.settings else {}
    cost, found = _timed(prepare(max_steps=FEW, **one))
    each, steps = cost / max(found.steps, 1), FEWEST
    if each * FEWEST > most:
        return each * FEWEST, found.steps
    while True:
        cost, found = _timed(prepare(max_steps=min(steps, prepared.settings["max_steps"])))
        ended = found.outcome is not Outcome.STEP_LIMIT or steps >= prepared.settings["max_steps"]
        if ended or cost > AMPLE * part * most:
            return cost / part, found.steps
        steps *= MORE


def _timed(run: Run) -> tuple[float, Trajectory]:
    began = process_time()
    found = run.run()
    used, tried = (found.counts.get(name, 0) for name in ("rhs", "tried"))
    return (process_time() - began) * (used / max(used + tried, 1) if tried else 1.0), found
