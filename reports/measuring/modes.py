"""Whether a finished motion stands in the modes that its equations ask for: the third look beside two integrators."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from crossbody.cases import Case, CaseUnsupported, Trajectory

if TYPE_CHECKING:
    from crossbody.reference import Violation


def violated(case: Case, run: Trajectory, rtol: float) -> tuple[Violation, ...] | None:
    """Modes of a motion of the level machine that do not hold, as `crossbody.reference.recheck` finds them.

    Args:
        case: what moved.
        run: the motion, with its modes.
        rtol: relative tolerance with which it was computed.

    Returns:
        None where this cannot be told: another machine, a run without modes, no equations of the mechanism.
    """
    from crossbody.engines import load, names
    from crossbody.reference import recheck

    if case.fsm != "level" or not len(run.t) or (run.mode < 0).any() or "reference" not in names():
        return None
    try:
        prepared: Any = load("reference").prepare(case, "compiled")
    except CaseUnsupported:
        return None
    acted = case.inputs if case.control is None else run.inputs
    inputs = None if acted is None else (acted.times, acted.values)
    return recheck(prepared.system, run, rtol=rtol, inputs=inputs, collisions=case.collisions)
