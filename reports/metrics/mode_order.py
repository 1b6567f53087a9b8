"""How many of the red body's mode changes come in the order of the presentation, before anything else does."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases.mechanisms.red_body.order import stages_in_order

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = True


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Left corner collides, is in contact, right one collides, left one is let go, right one is: 5 if all; else fewer.

    None where the case is another, or where the engine has no notion of mode.
    """
    if case.mechanism != "red_body" or (run.mode < 0).all():
        return None
    return float(stages_in_order(run.events))
