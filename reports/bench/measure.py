"""Run time against error over ladders of tolerances and steps (docs/explanation/verdicts.md).

Models are built and warmed before the clock; the runs are interleaved, one round after another,
so that a slow minute of the machine falls on all of them. Every row has two times: the run
itself, as the engine's adapter clocks it, and the whole call from Python, whose excess is the
cost of the call and of the trajectory that it builds.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, CrossbodyError, Trajectory
from crossbody.engines.equations import answering
from crossbody.reports.bench.errors import PARTS, Truths, between, errors, known_to
from crossbody.reports.bench.ladder import Effort, Ladder
from crossbody.reports.bench.order import orders
from crossbody.reports.bench.scenes import labelled
from crossbody.reports.judging.covered import followed_if_covered
from crossbody.reports.judging.reach import BUDGET
from crossbody.reports.judging.run_verdicts import crash
from crossbody.reports.measuring.truth import Truth
from crossbody.reports.runs import watch
from crossbody.reports.runs.choice import Pick, of_case
from crossbody.reports.runs.jobs import of_start

COLUMNS = (
    "case", "engine", "profile", "against", "tier", "known_to", "knob", "setting", "error", *PARTS, "touches",
    "error_between", "honesty", "median_ms", "iqr_ms", "call_ms", "native_ms", "control_ms", "interpreted",
    "cores", "repeats", "steps", "outcome", "promised",
)  # fmt: skip


NATIVE = 3  # runs of an engine's own loop, the shortest of which counts


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
    between: float
    interpreted: str
    crashed: str = ""
    inner: list[float] = field(default_factory=list)
    call: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    control: list[float] = field(default_factory=list)

    def note(self, run: Trajectory, took: float, cores: float) -> None:
        """One timed run: its own clock, the whole call, s, and processor time over wall time."""
        self.inner.append(run.wall_s or took)
        self.call.append(took)
        self.cpu.append(cores)
        self.control.append(run.control_s)


def _truths(case: Case) -> Truths:
    """Return the truths of a case; of a scene as far as it is followed, of which its label tells."""
    if (known := followed_if_covered(case, BUDGET)) is None:
        return Truths(case)
    cut = {"t_end": known.case.t_end} if known.part < 1.0 else {}
    return Truths(labelled(known.case, cut), replace(known, case=labelled(known.case, cut)))


def _rungs(
    truths: Truths, picks: Sequence[Pick], effort: Effort, tell: Callable[[str], None], limit: float
) -> Iterator[Rung]:
    case = truths.case
    for pick in (of_case(one, case) for one in picks):
        label = f"{case.label}: {pick.engine}:{pick.profile}"
        tell(label)
        watch.limited(label, limit)
        if not pick.skipped and not watch.lost(label):
            with suppress(CaseUnsupported), answering(case):
                yield from _climbed(case, pick, effort, truths)


def _climbed(case: Case, pick: Pick, effort: Effort, truths: Truths) -> Iterator[Rung]:
    """The rungs of one engine, up to the one that takes too long."""
    engine = engines.load(pick.engine)
    promised = float(engine.orders.get(pick.profile, math.nan))
    python = engine.interpreted_in(pick.profile)
    rungs = Ladder(case, pick, effort)
    for knob, setting, run in rungs:
        began = time.perf_counter()
        first, crashed = _first(case, pick, run)
        took = time.perf_counter() - began
        rungs.climbed(took, first.steps)
        against, truth = truths.of(run)
        off = errors(truth, first, case)
        shown = between(case, pick, run, first, truth) if math.isfinite(off["error"]) else math.inf
        rung = Rung(pick, against, truth, knob, setting, run, first, off, promised, shown, python, crashed)
        if took > effort.slow or crashed:
            rung.note(first, took, 1.0)
        yield rung


def _first(case: Case, pick: Pick, run: Any) -> tuple[Trajectory, str]:
    """The warm-up of a rung, and what it threw: the lines of the others are measured all the same."""
    try:
        return run.run(), ""
    except CrossbodyError:  # wrong use of ours
        raise
    except (Exception, SystemExit) as error:
        crashed = crash(error)
        return of_start(case, crashed), crashed


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
    case: Case,
    picks: Sequence[Pick],
    effort: Effort | int = 5,
    tell: Callable[[str], None] = lambda _: None,
    limit: float = watch.LIMIT,
) -> pd.DataFrame:
    """Time every rung of every engine.

    Args:
        case: the scene.
        picks: engines and profiles; what is not installed or does not know the mechanism has no row.
        effort: how much is measured, or the number of repeats.
        tell: is told what is being done, once an engine.
        limit: time after which an engine that has not come back is ended with its process, s;
            from the command line.

    Raises:
        CaseUnsupported: for a file whose motion leaves what its model covers.

    Returns:
        One row a rung, columns `COLUMNS`; errors and honesty (error over tolerance) are ratios, event times in s;
        error_between is the position's on one grid for all, interpreted what of a run is Python, and native_ms the time
        of the engine's own loop over the same steps without that, and without a controller in Python, whose part of
        the median is control_ms;
        cores is processor time over wall time: 1 for one thread.
    """
    effort = Effort(repeats=effort) if isinstance(effort, int) else effort
    truths = _truths(case)
    rungs = list(_rungs(truths, picks, effort, tell, limit))
    watch.unlimited()  # all have come back once
    _rounds(rungs, effort)
    return pd.DataFrame([row_of(truths.case, rung) for rung in rungs], columns=list(COLUMNS))


def row_of(case: Case, rung: Rung) -> dict[str, Any]:
    """Return a row of the table of a rung that was timed."""
    low, median, high = (1e3 * float(x) for x in np.percentile(rung.inner, (25, 50, 75)))
    return {
        "case": case.label, "engine": rung.pick.engine, "profile": rung.pick.profile, "against": rung.against,
        "tier": rung.truth.tier.value[0], "known_to": known_to(case, rung.truth), "knob": rung.knob,
        "setting": rung.setting, **rung.errors,
        "error_between": rung.between,
        "honesty": rung.errors["error"] / rung.setting if rung.knob == "rtol" else math.nan,
        "median_ms": median, "iqr_ms": high - low if len(rung.inner) > 1 else math.nan,
        "call_ms": 1e3 * float(np.median(rung.call)),
        "native_ms": math.nan if rung.crashed else 1e3 * min(rung.run.native() for _ in range(NATIVE)),
        "control_ms": 1e3 * float(np.median(rung.control)),
        "interpreted": rung.interpreted,
        "cores": float(np.median(rung.cpu)), "repeats": len(rung.call), "steps": rung.first.steps,
        "outcome": f"crashed: {rung.crashed}" if rung.crashed else rung.first.outcome.value,
        "promised": rung.promised,
    }  # fmt: skip


def joined(tables: Sequence[pd.DataFrame]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """All timings, and the observed order of each engine with what it says."""
    filled = [table for table in tables if len(table)]
    rows = pd.concat(filled, ignore_index=True) if filled else pd.DataFrame(columns=list(COLUMNS))
    return rows, orders(rows)
