"""Run time against error over ladders of tolerances and steps (spec 5.4).

Models are built and warmed before the clock; the runs are interleaved, one round after another, so that a slow minute
of the machine falls on all of them. Every row has two times: the run itself, as the engine's adapter clocks it, and
the whole call from Python, whose excess is the cost of the call and of the trajectory that it builds.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, Trajectory
from crossbody.reports import metrics
from crossbody.reports.bench.order import observed_order, orders
from crossbody.reports.judging.truth import Truth, law_of, truth_of
from crossbody.reports.runs.jobs import Pick

__all__ = ["COLUMNS", "Effort", "bench", "joined", "observed_order"]

LADDERS = {
    "rtol": (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13),
    "dt": (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4),
}
PARTS = {
    "error_q": "position", "error_v": "velocity", "error_impulse": "lam_impulse", "error_energy": "energy_drift",
    "error_times": "event_times",
}  # fmt: skip
COLUMNS = (
    "case", "engine", "profile", "against", "tier", "known_to", "knob", "setting", "error", *PARTS, "honesty",
    "median_ms", "iqr_ms", "call_ms", "cores", "repeats", "steps", "outcome", "promised",
)  # fmt: skip
PATIENCE = 2.0
"""A rung may take this many times what was expected; its steps are bounded accordingly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is measured, and for how long.

    Attributes:
        repeats: timed runs of each rung.
        slow: a run longer than this is its own warm-up and not repeated, s.
        longest: a ladder ends before the rung that would take longer, s.
        climb: a ladder ends with the rung at which it has taken longer, s.
        rounds: no round of repeats begins after this, s.
        every: one rung in so many is taken.
    """

    repeats: int = 5
    slow: float = 0.5
    longest: float = 2.0
    climb: float = 10.0
    rounds: float = 20.0
    every: int = 1


@dataclass(slots=True)
class Rung:
    """One engine at one setting, prepared; its errors from the warm-up, its times as they come."""

    pick: Pick
    against: str
    truth: Truth
    knob: str
    setting: float
    run: Any
    first: Trajectory
    errors: dict[str, float]
    promised: float
    inner: list[float] = field(default_factory=list)
    call: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)

    def note(self, run: Trajectory, took: float, cores: float) -> None:
        """One timed run: its own clock, the whole call, s, and processor time over wall time."""
        self.inner.append(run.wall_s or took)
        self.call.append(took)
        self.cpu.append(cores)


@dataclass(slots=True)
class Ladder:
    """The settings of one engine on one case, from coarse to fine, each prepared when its turn comes."""

    case: Case
    pick: Pick
    effort: Effort
    took: list[float] = field(default_factory=list)
    steps: int = 0

    def __iter__(self) -> Iterator[tuple[str, float, Any]]:
        """(knob, setting, prepared run) of every rung; one without a knob for an engine that has none."""
        plain = engines.load(self.pick.engine).prepare(self.case, self.pick.profile)
        lean = {"ledger": False} if "ledger" in plain.settings else {}  # nobody asked for the account
        knob = next((name for name in LADDERS if name in plain.settings), "")
        if not knob:
            yield "", math.nan, plain
        for setting in LADDERS.get(knob, ())[:: self.effort.every]:
            if self._too_long():
                return
            if knob != "dt" or setting <= self.case.t_end:
                given = {knob: setting, **lean, **self._bound(plain)}
                yield knob, setting, engines.load(self.pick.engine).prepare(self.case, self.pick.profile, **given)

    def climbed(self, took: float, steps: int) -> None:
        """Tell what the rung cost: wall time, s, and steps."""
        self.took.append(took)
        self.steps = steps

    def _too_long(self) -> bool:
        if len(self.took) < 2:
            return bool(self.took) and self.took[-1] > self.effort.longest
        before, last = self.took[-2:]
        return last * max(1.0, last / before) > self.effort.longest or sum(self.took) > self.effort.climb

    def _bound(self, plain: Any) -> dict[str, int]:
        """As many steps as may be taken in the longest time, by what a step cost so far."""
        if not self.took or not self.steps or "max_steps" not in plain.settings:
            return {}
        most = PATIENCE * self.effort.longest * self.steps / self.took[-1]
        return {"max_steps": max(self.steps, min(int(most), int(plain.settings["max_steps"])))}


class _Truths:
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


def _errors(truth: Truth, run: Trajectory, case: Case) -> dict[str, float]:
    """Every part; and `error`, the larger of position and event times over the horizon, infinite for a failed run.

    A run that misses an event, or has one too many, has failed.
    """
    if not run.outcome.ok or metrics.load("touch_count").measure(truth, run, case) not in (0.0, None):
        return dict.fromkeys(("error", *PARTS), math.inf)
    values = {part: metrics.load(name).measure(truth, run, case) for part, name in PARTS.items()}
    found = {part: math.nan if value is None else value for part, value in values.items()}
    q, times = found["error_q"], found["error_times"] / case.t_end
    return {"error": math.inf if math.isnan(q) else max(q, 0.0 if math.isnan(times) else times), **found}


def _rungs(case: Case, picks: Sequence[Pick], effort: Effort, tell: Callable[[str], None]) -> Iterator[Rung]:
    truths = _Truths(case)
    for pick in picks:
        tell(f"{case.label}: {pick.engine}:{pick.profile}")
        if not pick.skipped:
            try:
                yield from _climbed(case, pick, effort, truths)
            except CaseUnsupported:
                continue


def _climbed(case: Case, pick: Pick, effort: Effort, truths: _Truths) -> Iterator[Rung]:
    """The rungs of one engine, up to the one that takes too long."""
    promised = float(getattr(engines.load(pick.engine), "orders", {}).get(pick.profile, math.nan))
    rungs = Ladder(case, pick, effort)
    for knob, setting, run in rungs:
        began = time.perf_counter()
        first = run.run()
        took = time.perf_counter() - began
        rungs.climbed(took, first.steps)
        against, truth = truths.of(run)
        rung = Rung(pick, against, truth, knob, setting, run, first, _errors(truth, first, case), promised)
        if took > effort.slow:
            rung.note(first, took, 1.0)
        yield rung


def _timed(rung: Rung) -> None:
    cpu, began = time.process_time(), time.perf_counter()
    run = rung.run.run()
    took = time.perf_counter() - began
    rung.note(run, took, (time.process_time() - cpu) / took)


def _rounds(rungs: Sequence[Rung], effort: Effort) -> None:
    """Time every rung that is not timed yet, in turns, again and again."""
    quick = [rung for rung in rungs if not rung.call]
    began = time.perf_counter()
    gc.collect()
    gc.disable()
    try:
        for i in range(effort.repeats):
            if i and time.perf_counter() - began > effort.rounds:
                return
            for rung in quick:
                _timed(rung)
    finally:
        gc.enable()


def bench(
    case: Case, picks: Sequence[Pick], effort: Effort | int = 5, tell: Callable[[str], None] = lambda _: None
) -> pd.DataFrame:
    """Time every rung of every engine.

    Args:
        case: the scene.
        picks: engines and profiles; what is not installed or does not know the mechanism has no row.
        effort: how much is measured, or the number of repeats.
        tell: is told what is being done, once an engine.

    Returns:
        One row a rung, columns `COLUMNS`; errors and honesty (error over tolerance) are ratios, event times in s;
        cores is processor time over wall time: 1 for one thread.
    """
    effort = Effort(repeats=effort) if isinstance(effort, int) else effort
    rungs = list(_rungs(case, picks, effort, tell))
    _rounds(rungs, effort)
    return pd.DataFrame([_row(case, rung) for rung in rungs], columns=list(COLUMNS))


def _row(case: Case, rung: Rung) -> dict[str, Any]:
    low, median, high = (1e3 * float(x) for x in np.percentile(rung.inner, (25, 50, 75)))
    return {
        "case": case.label, "engine": rung.pick.engine, "profile": rung.pick.profile, "against": rung.against,
        "tier": rung.truth.tier.value[0], "known_to": _known_to(case, rung.truth), "knob": rung.knob,
        "setting": rung.setting, **rung.errors,
        "honesty": rung.errors["error"] / rung.setting if rung.knob == "rtol" else math.nan,
        "median_ms": median, "iqr_ms": high - low, "call_ms": 1e3 * float(np.median(rung.call)),
        "cores": float(np.median(rung.cpu)), "repeats": len(rung.call), "steps": rung.first.steps,
        "outcome": rung.first.outcome.value, "promised": rung.promised,
    }  # fmt: skip


def _known_to(case: Case, truth: Truth) -> float:
    """How far a truth of two integrators can be trusted: their difference, as in the column `error`; else 0."""
    times = truth.agreement.get("event_times", 0.0) / case.t_end
    return float(max(truth.agreement.get("position", 0.0), times))


def joined(tables: Sequence[pd.DataFrame]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """All timings, and the observed order of each engine with what it says."""
    filled = [table for table in tables if len(table)]
    rows = pd.concat(filled, ignore_index=True) if filled else pd.DataFrame(columns=list(COLUMNS))
    return rows, orders(rows)
