"""How a run ended: every end is a value, with a sentence of advice."""

from __future__ import annotations

from enum import StrEnum


class Outcome(StrEnum):
    """How a run ended. Only `FINISHED` reached its horizon."""

    FINISHED = "finished"
    STEP_LIMIT = "step_limit"
    TIME_LIMIT = "time_limit"
    STEP_TOO_SMALL = "step_too_small"
    DIVERGED = "diverged"
    NOT_FINITE = "not_finite"
    ILL_POSED = "ill_posed"
    MODE_CYCLE = "mode_cycle"
    LOST = "lost"
    INCONSISTENT = "inconsistent"
    INTERRUPTED = "interrupted"
    PAINLEVE = "painleve"
    NO_CONSISTENT_MODES = "no_consistent_modes"

    @property
    def advice(self) -> str:
        """What the user can do about it, in one sentence."""
        return _ADVICE[self]

    @property
    def ok(self) -> bool:
        """Whether the run reached its horizon."""
        return self is Outcome.FINISHED


_ADVICE = {
    Outcome.FINISHED: "The run reached its horizon.",
    Outcome.STEP_LIMIT: "Raise max_steps, loosen the tolerance, or check whether events accumulate (Zeno).",
    Outcome.TIME_LIMIT: "Raise the time limit, or loosen the tolerance.",
    Outcome.STEP_TOO_SMALL: "The step fell below the resolution of time: loosen the tolerance or lower the stiffness.",
    Outcome.DIVERGED: "The motion left every sensible bound: take a smaller step, or check signs and constants.",
    Outcome.NOT_FINITE: "A kernel or controller returned NaN or infinity: look at the state named with this outcome.",
    Outcome.ILL_POSED: "The active rows or the mass matrix lost rank: the multipliers are not unique here.",
    Outcome.MODE_CYCLE: "The contacts named with this outcome switch for ever at one instant: their laws contradict.",
    Outcome.LOST: "The motion left the region in which its controller holds: start closer, or change the controller.",
    Outcome.INCONSISTENT: "The results contradict the model, in the quantity that is named with this outcome.",
    Outcome.PAINLEVE: "A force at a sliding contact would press it further in (Painleve): rigid bodies have no motion.",
    Outcome.NO_CONSISTENT_MODES: "No set of sticking and sliding contacts is consistent with the resulting forces.",
    Outcome.INTERRUPTED: "The run was interrupted; what was computed until then is kept.",
}
