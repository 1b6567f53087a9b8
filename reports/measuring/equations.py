"""The reference's equations of a case, for what is recomputed from a run's own states, and held against its modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, CaseUnsupported, Trajectory
from crossbody.cases.remembered import remembered
from crossbody.engines.equations import system_of

if TYPE_CHECKING:
    from crossbody.reference import System, Violation

SAMPLES = 400


@remembered(4)
def equations(case: Case) -> System | None:
    """The mechanism with the law of its rows; None where the reference has none."""
    try:
        return system_of(case)
    except CaseUnsupported:
        return None


def finite(run: Trajectory) -> bool:
    """Whether every recorded state is a number, so that equations can be asked about it."""
    return bool(np.isfinite(run.q).all() and np.isfinite(run.v).all())


def spread(run: Trajectory, among: NDArray[np.bool_] | None = None) -> NDArray[np.intp]:
    """Indices of at most `SAMPLES` samples, evenly spread; of those that are true in `among` (n,), if it is given."""
    some = np.arange(len(run.t)) if among is None else np.flatnonzero(among)
    return some[:: -(-len(some) // SAMPLES) or 1]


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
