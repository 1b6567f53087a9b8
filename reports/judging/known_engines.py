"""What an engine must make of its settings, of a motion in closed form: asked once of each.

A mass on a cubic spring that is always on is back after a period that is known. What is asked for a tighter tolerance
takes more steps and comes nearer: a setting that does not reach an integrator changes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, Outcome, Trajectory, Value
from crossbody.cases.case import Law
from crossbody.reports.judging.asked import Found, rows_of
from crossbody.reports.judging.known_steps import period

SPRING = (5.0, 20.0, 1.0)
"""a0, 1/s^2, and a2, 1/(m s)^2, of a cubic spring, and from where it is let go, m."""
LOOSE, TIGHT = 1e-5, 1e-12
MORE, OFF = 1.3, 10.0
"""Of these tolerances: by what factor steps become more at least, of any order up to 60, and how many times the tighter
one each step may add to the error."""
OF_METHODS, FEW = ("method", "scheme"), 7
"""Settings of integrators whose choices are methods, and steps of a run that must not get far."""
OTHERS = ("as_is",)  # profiles of files alone


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where an engine's answer is another one.

    Args:
        name: of one of crossbody's own engines, which is installed.
    """
    return asked_of(name, _tolerances, _settings)


def asked_of(name: str, *asks: Callable[[engines.Engine, str], Iterator[Found]]) -> tuple[Found, ...]:
    """Return what of an engine's profiles is another answer, as `wrong` does; one that fails has no number."""
    own = engines.load(name)

    def failed(why: str) -> Found:
        return name, math.nan, (0.0, 0.0), f"a motion in closed form, which ends in {why}"

    profiles = [profile for profile in own.profiles if profile not in OTHERS]
    return tuple(found for profile in profiles for ask in asks for found in rows_of(partial(ask, own, profile), failed))


def run_of(engine: engines.Engine, profile: str, case: Case, **asked: Value) -> Trajectory | None:
    """Return a motion with those of the settings that a profile has; None of a case that it cannot do, or with none."""
    try:
        offered = engine.offered(case, profile)
        given = {key: value for key, value in asked.items() if key in offered}
        return engine.prepare(case, profile, **given).run() if given else None
    except CaseUnsupported:
        return None


def _spring() -> Case:
    """Return a mass on a cubic spring, up to where it is back."""
    a0, a2, q0 = SPRING
    row = Law(a0=np.array([a0]), a1=np.zeros(1), a2=np.array([a2]), unilateral=np.zeros(1, dtype=bool))
    return replace(
        cases.load("bouncing_ball", "linear"), law=row, q0=np.array([q0]), v0=np.zeros(1), t_end=period(a0, a2, q0),
        closed_form=None, claims=(), limits=(), chaos=None, consistent=False,
    )  # fmt: skip


def _tolerances(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask for the spring's way back at two tolerances; where a profile has none, or no such spring, for nothing."""
    loose, tight = (run_of(engine, profile, _spring(), rtol=rtol) for rtol in (LOOSE, TIGHT))
    if loose is None or tight is None:
        return
    name, told = f"{engine.name}:{profile}", f"a cubic spring at rtol = {TIGHT:g}"
    if not tight.steps >= MORE * loose.steps:
        yield f"{name} (steps)", float(tight.steps), (MORE * loose.steps, math.inf), told
    back = float(np.hypot(tight.q[-1, 0] / SPRING[2] - 1.0, tight.v[-1, 0] / SPRING[2]))
    if not back <= (most := OFF * TIGHT * tight.steps):
        yield name, back, (0.0, most), told


def _settings(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask for a run of few steps, which must end there, and for those of other methods, which must be others."""
    name = f"{engine.name}:{profile}"
    for case in (_spring(), cases.load("bouncing_ball", "linear")):
        if (run := run_of(engine, profile, case, max_steps=FEW)) is None:
            continue
        if run.outcome is not Outcome.STEP_LIMIT or not run.steps <= FEW + 1:
            yield f"{name} (max_steps)", float(run.steps), (0.0, FEW + 1), f"a run of {FEW} steps"
        for setting in set(OF_METHODS) & set(engine.offered(case, profile)):
            choices = engine.offered(case, profile)[setting].choices
            runs = [run_of(engine, profile, case, rtol=LOOSE, **{setting: choice}) for choice in choices]
            different = len({(one.steps, float(one.q[-1, 0])) for one in runs if one is not None})
            if different < len(choices):
                yield f"{name} ({setting})", float(different), (len(choices), math.inf), "methods that differ"
        return
