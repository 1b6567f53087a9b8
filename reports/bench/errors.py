"""How far a timed run is from the truth of the equations that its engine follows."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from crossbody import engines
from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.scene_contacts import frictional
from crossbody.reports import metrics
from crossbody.reports.judging.reach import Followed
from crossbody.reports.judging.truth import law_of, truth_of
from crossbody.reports.measuring.cubics import coordinates, step_of
from crossbody.reports.measuring.truth import Truth
from crossbody.reports.runs.choice import Pick

GRID = 2001  # instants at which all engines are compared alike

PARTS = {
    "error_q": "position", "error_v": "velocity", "error_impulse": "lam_impulse",
    "error_energy": "energy_drift", "error_times": "event_times",
}  # fmt: skip


class Truths:
    """The truth of the equations that an engine follows, each worked out once.

    An engine without ballistic memory converges, but to another motion than the case's: judged
    against that, its error has a floor whatever the step. So its run time is shown over its
    distance to what it does converge to.
    """

    def __init__(self, case: Case, known: Followed | None = None) -> None:
        self.case = case
        self.own = truth_of(case, known)
        self.known: dict[str, Truth] = {}

    def of(self, run: Any) -> tuple[str, Truth]:
        """In words whose truth, and the truth."""
        if (followed := self._followed(run)) is None:
            return "the case", self.own
        name = f"{followed.fsm}, {followed.collisions}"
        if name not in self.known:
            self.known[name] = law_of(followed) or self.own
        return name, self.known[name]

    def _followed(self, run: Any) -> Case | None:
        case, followed = self.case, run.follows
        rubs = case.scene is not None and frictional(case.scene)  # contacts that slide have one machine alone
        if followed is None and not rubs and run.settings.get("law") == "memoryless" and case.law.unilateral.any():
            followed = replace(case, fsm="memoryless", collisions="resolved", closed_form=None)
        same = followed is None or (followed.fsm, followed.collisions) == (case.fsm, case.collisions)
        return None if same else followed


def errors(truth: Truth, run: Trajectory, case: Case) -> dict[str, float]:
    """Every part, the touches too many, and `error`: the larger of position and event times over the horizon.

    A run that misses a touch, or has one too many, has no finite error, but in scenes whose bodies may stand on
    many contacts, which soft ones open and close by less than matters. Where nothing can touch none is missed.
    """
    touches = _measured("touch_count", truth, run, case) if run.outcome.ok else math.nan
    if not run.outcome.ok or (abs(touches) > 0.0 and not case.general):
        return dict.fromkeys(("error", *PARTS), math.inf) | {"touches": touches}
    parts = {part: _measured(name, truth, run, case) for part, name in PARTS.items()}
    # Where nothing touches there are no times, without a position there is no error.
    apart, times = parts["error_q"], parts["error_times"] / case.t_end
    error = math.inf if math.isnan(apart) else max(apart, 0.0 if math.isnan(times) else times)
    return {"error": error, **parts, "touches": touches}


def between(case: Case, pick: Pick, run: Any, steps: Trajectory, truth: Truth) -> float:
    """Error of the position on one grid for all engines: what a user sees between steps.

    Where an engine can be asked for instants it is asked for these; else a cubic through places
    and rates of its steps stands for what lies between them.
    """
    grid = np.linspace(0.0, case.t_end, GRID)
    if "samples" in run.settings:
        own = {name: run.settings[name] for name in ("rtol", "ledger") if name in run.settings}
        found: Trajectory = engines.load(pick.engine).prepare(case, pick.profile, samples=grid, **own).run()
    else:
        found = hermite(steps, grid)
    return _measured("position", truth, found, case) if found.outcome.ok else math.inf


def hermite(run: Trajectory, grid: Floats) -> Trajectory:
    """A run on a grid, by cubics through q and v of its steps; where v are not the rates of q, by straight lines.

    An instant that stands twice ends one cubic and begins another.
    """
    last = step_of(run.t, grid)
    return replace(
        run, t=grid, q=coordinates(run, grid), v=run.v[last], gap=run.gap[last], lam=run.lam[last],
        energy=run.energy[last], mode=run.mode[last], ledger=None,
    )  # fmt: skip


def _measured(metric: str, truth: Truth, run: Trajectory, case: Case) -> float:
    """The metric's value, NaN where it has none."""
    value = metrics.load(metric).measure(truth, run, case)
    return math.nan if value is None else float(value)


def known_to(case: Case, truth: Truth) -> float:
    """How far two integrators' truth can be trusted: their difference, as in `error`; 0 for a closed form."""
    if case.closed_form is not None:
        return 0.0
    times = truth.agreement.get("event_times", 0.0) / case.t_end
    return float(max(truth.agreement.get("position", 0.0), times))
