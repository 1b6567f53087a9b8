"""The reference's equations of a case, and one run of them without the warm-up that timing needs."""

from __future__ import annotations

from typing import Any

from crossbody.cases import Case, Trajectory
from crossbody.engines.equations import system_of
from crossbody.reference import simulate


def run_once(case: Case, solver: str, **options: Any) -> Trajectory:
    """One motion of a case by the reference.

    Args:
        case: the scene.
        solver: "compiled", "ida" or "cvode".
        options: of `reference.Options`.
    """
    given = case.inputs
    return simulate(
        system_of(case), case.q0, case.v0, case.t_end, solver=solver, fsm=case.fsm, collisions=case.collisions,
        inputs=None if given is None else (given.times, given.values), **options,
    )  # fmt: skip
