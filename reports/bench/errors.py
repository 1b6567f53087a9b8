"""How far a timed run is from the truth of the equations that its engine follows."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from crossbody.cases import Case, Trajectory
from crossbody.reports import metrics
from crossbody.reports.judging.truth import Truth, law_of, truth_of

PARTS = {
    "error_q": "position", "error_v": "velocity", "error_impulse": "lam_impulse", "error_energy": "energy_drift",
    "error_times": "event_times",
}  # fmt: skip


class Truths:
    """The truth of the equations that an engine follows, each worked out once.

    An engine without ballistic memory converges, but to another motion than the case's: judged against that, its error
    has a floor whatever the step. So its run time is shown over its distance to what it does converge to.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.own = truth_of(case)
        self.known: dict[str, Truth] = {}

    def of(self, run: Any) -> tuple[str, Truth]:
        """In words whose truth, and the truth."""
        followed = self._followed(run)
        if followed is None:
            return "the case", self.own
        name = f"{followed.fsm}, {followed.collisions}"
        if name not in self.known:
            self.known[name] = law_of(followed) or self.own
        return name, self.known[name]

    def _followed(self, run: Any) -> Case | None:
        case, followed = self.case, getattr(run, "follows", None)
        if followed is None and run.settings.get("law") == "memoryless" and case.law.unilateral.any():
            followed = replace(case, fsm="memoryless", collisions="resolved", closed_form=None)
        same = followed is None or (followed.fsm, followed.collisions) == (case.fsm, case.collisions)
        return None if same else followed


def errors(truth: Truth, run: Trajectory, case: Case) -> dict[str, float]:
    """Every part, the touches too many, and `error`: the larger of position and event times over the horizon.

    A run that misses an event, or has one too many, has failed: its errors are infinite.
    """
    touches = _measured("touch_count", truth, run, case) if run.outcome.ok else math.nan
    if not run.outcome.ok or touches:
        return dict.fromkeys(("error", *PARTS), math.inf) | {"touches": touches}
    parts = {part: _measured(name, truth, run, case) for part, name in PARTS.items()}
    return {"error": _larger(parts["error_q"], parts["error_times"] / case.t_end), **parts, "touches": 0.0}


def _measured(metric: str, truth: Truth, run: Trajectory, case: Case) -> float:
    """The metric's value, NaN where it has none."""
    value = metrics.load(metric).measure(truth, run, case)
    return math.nan if value is None else float(value)


def _larger(position: float, times: float) -> float:
    """The larger of two errors; where nothing touches there are no times, without a position there is no error."""
    return math.inf if math.isnan(position) else max(position, 0.0 if math.isnan(times) else times)


def known_to(case: Case, truth: Truth) -> float:
    """How far a truth of two integrators can be trusted: their difference, as in `error`; 0 for a closed form."""
    if case.closed_form is not None:
        return 0.0
    times = truth.agreement.get("event_times", 0.0) / case.t_end
    return float(max(truth.agreement.get("position", 0.0), times))
