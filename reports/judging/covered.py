"""Whether a file's model covers its motion, found at its start and by cheap runs first."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import Case, CaseUnsupported, Outcome, Trajectory
from crossbody.cases.files.case import rubbing
from crossbody.reference import ahead
from crossbody.reports.judging.reach import COARSE, Followed, followed, motion

if TYPE_CHECKING:
    from crossbody.cases.files.contacts import Meeting

LOOSE = 100.0
"""Tolerance of a second run, in units of that of the first, which tells how far their motion is known."""
SAME = 1e-3  # part of the time at which shapes meet by which two runs may be apart that know when


def followed_if_covered(case: Case, budget: float) -> Followed | None:
    """Return a scene as far as it is followed within a budget, s, by what covers its motion.

    None for what is followed to its end at any price: a case that is no scene, or has a closed form.

    Raises:
        CaseUnsupported: for a file whose motion leaves what its model covers: nothing could be judged.
    """
    if not case.general or case.closed_form is not None:
        return None
    reached = followed(covered(case, budget), budget)
    refuse_uncovered(reached.case, reached.motion)
    return reached


def refuse_uncovered(case: Case, motion: Trajectory) -> None:
    """Refuse a file that its motion contradicts.

    Raises:
        CaseUnsupported: if it does.
    """
    if case.file and motion.outcome is Outcome.INCONSISTENT:
        raise CaseUnsupported(f"{case.label}: {motion.message}")


def covered(case: Case, budget: float) -> Case:
    """Return a file's case, with the friction of its contacts where its motion comes to one; other cases as they are.

    Engines without friction run what never comes to any.

    Raises:
        CaseUnsupported: if shapes of the file surely meet whose contacts no row stands for:
            nothing could be judged.
    """
    if not case.file:
        return case
    if (rubs := rubbing(case)) is not None:
        ahead.ask("friction")
    met = _met(case, COARSE, budget)
    if met is not None and rubs is not None:
        case, met = rubs, _met(rubs, COARSE, budget)
    if met is None:
        return case
    again = _met(case, LOOSE * COARSE, budget) if met.t > 0.0 else met
    if again is not None and abs(again.t - met.t) <= SAME * met.t:
        raise CaseUnsupported(f"{case.label}: {met.told}")
    return case


def _met(case: Case, rtol: float, budget: float) -> Meeting | None:
    """Return where shapes meet that have no row: at the start, or else on the motion at a tolerance."""
    from crossbody.cases.files.contacts import meeting  # which cases that are no file do without

    if (first := meeting(case, np.zeros(1), case.q0[None], case.v0[None])) is not None:
        return first
    run = motion(case, rtol, time_limit=budget)
    return meeting(case, run.t, run.q, run.v)
