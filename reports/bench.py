"""Run time against error over ladders of tolerances and steps (spec 5.4).

Models are built and warmed before the clock; the runs are interleaved, one round after another, so that a slow minute
of the machine falls on all of them.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, Trajectory
from crossbody.reports import metrics
from crossbody.reports.jobs import Pick
from crossbody.reports.truth import Truth, truth_of

LADDERS = {
    "rtol": (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12),
    "dt": (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4),
}
SLOW = 2.0  # a run longer than this, in seconds, is timed once
FLOOR = 1e-13  # errors below are rounding: no order is fitted there

COLUMNS = (
    "case", "engine", "profile", "against", "knob", "setting", "error", "honesty", "median_ms", "iqr_ms", "repeats",
    "steps", "outcome",
)  # fmt: skip


@dataclass(slots=True)
class Rung:
    """One engine at one setting, prepared; its error from the warm-up, its times as they come."""

    pick: Pick
    against: str
    knob: str
    setting: float
    run: Any
    first: Trajectory
    error: float
    times: list[float] = field(default_factory=list)


def ladder(case: Case, pick: Pick) -> Iterable[tuple[str, float, Any]]:
    """(knob, setting, prepared run) for every rung; one without a knob for an engine that has none."""
    engine = engines.load(pick.engine)
    plain = engine.prepare(case, pick.profile)
    knob = next((name for name in LADDERS if name in plain.settings), "")
    if not knob:
        yield "", math.nan, plain
    for setting in LADDERS.get(knob, ()):
        yield knob, setting, engine.prepare(case, pick.profile, **{knob: setting})


def _error(truth: Truth, run: Trajectory, case: Case) -> float:
    """Largest relative position error on matched arcs; infinite if an event is missing or the run did not finish."""
    if not run.outcome.ok or metrics.load("touch_count").measure(truth, run, case) != 0.0:
        return math.inf
    value = metrics.load("position").measure(truth, run, case)
    shift = metrics.load("event_times").measure(truth, run, case) or 0.0
    return math.inf if value is None else max(value, shift / case.t_end)


class _Truths:
    """The truth of the machine that an engine follows, each worked out once.

    An engine without ballistic memory converges, but to another motion than the case's: judged against that, its error
    has a floor whatever the step. So its run time is shown over its distance to what it does converge to.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.known: dict[str, Truth] = {}

    def of(self, machine: str) -> Truth:
        if machine not in self.known:
            same = machine == self.case.fsm
            self.known[machine] = truth_of(self.case if same else replace(self.case, fsm=machine, closed_form=None))
        return self.known[machine]


def _rungs(case: Case, picks: Sequence[Pick], tell: Callable[[str], None]) -> list[Rung]:
    truths, found = _Truths(case), []
    for pick in picks:
        tell(f"{case.label}: {pick.engine}:{pick.profile}")
        if pick.skipped:
            continue
        try:
            for knob, setting, run in ladder(case, pick):
                first = run.run()
                machine = str(run.settings.get("law", case.fsm))
                machine = machine if machine == "memoryless" else case.fsm
                error = _error(truths.of(machine), first, case)
                found.append(Rung(pick, machine, knob, setting, run, first, error))
        except CaseUnsupported:
            continue
    return found


def bench(
    case: Case, picks: Sequence[Pick], repeats: int, tell: Callable[[str], None] = lambda _: None
) -> pd.DataFrame:
    """Time every rung of every engine.

    Returns:
        One row a rung, columns `COLUMNS`; error and honesty (error over tolerance) are ratios.
    """
    rungs = _rungs(case, picks, tell)
    gc.collect()
    gc.disable()
    try:
        for _ in range(repeats):
            for rung in rungs:
                if not rung.times or rung.times[0] < SLOW:
                    start = time.perf_counter()
                    rung.run.run()
                    rung.times.append(time.perf_counter() - start)
    finally:
        gc.enable()
    return pd.DataFrame([_row(case, rung) for rung in rungs], columns=list(COLUMNS))


def _row(case: Case, rung: Rung) -> dict[str, Any]:
    low, median, high = (1e3 * float(x) for x in np.percentile(rung.times, (25, 50, 75)))
    return {
        "case": case.label, "engine": rung.pick.engine, "profile": rung.pick.profile, "against": rung.against,
        "knob": rung.knob, "setting": rung.setting, "error": rung.error,
        "honesty": rung.error / rung.setting if rung.knob == "rtol" else math.nan,
        "median_ms": median, "iqr_ms": high - low, "repeats": len(rung.times), "steps": rung.first.steps,
        "outcome": rung.first.outcome.value,
    }  # fmt: skip


def observed_order(settings: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log error against log setting where the error is finite and above rounding; NaN below three points."""
    x, y = np.asarray(settings, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    good = np.isfinite(x) & np.isfinite(y) & (y > FLOOR)
    if good.sum() < 3:
        return math.nan
    return float(np.polyfit(np.log(x[good]), np.log(y[good]), 1)[0])


def joined(tables: Sequence[pd.DataFrame]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """All timings, and the observed order of each engine with what it says."""
    rows = pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=list(COLUMNS))
    orders = []
    for (case, engine, profile, knob), group in rows.groupby(["case", "engine", "profile", "knob"], sort=False):
        order = observed_order(group["setting"].to_list(), group["error"].to_list())
        orders.append(
            {"case": case, "engine": engine, "profile": profile, "knob": knob, "order": order, "says": _says(order)}
        )
    return rows, pd.DataFrame(orders, columns=["case", "engine", "profile", "knob", "order", "says"])


def _says(order: float) -> str:
    if math.isnan(order):
        return "too few points above rounding"
    return "converges" if order > 0.5 else "does not converge to the truth of the case"
