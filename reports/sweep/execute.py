"""From a spec to one row of the table, whatever happens on the way."""

from __future__ import annotations

import json
import math
import time
import traceback
import warnings
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody import cases, engines
from crossbody.cases import Case, CrossbodyError, EngineUnavailable, Outcome, Trajectory, UnknownName
from crossbody.reports.judging.covered import covered
from crossbody.reports.judging.verdict import Word
from crossbody.reports.sweep.bounds import Overdue, bounded, killed, overheard
from crossbody.reports.sweep.measure import SECOND_RTOL, Asked, Error, error, instants, residual
from crossbody.reports.sweep.spec import Spec

RTOL = 1e-9  # of the reference, if nothing is said
ACCOUNT = 10.0
"""The energy account may leave so many times the limit of the error open: it adds up all steps' errors."""
AFFORD = 1_000
"""The independent integrator is asked for every run of at most so many steps, and gets as much time as a
run may take: it takes some ten times the steps. Where that is not enough the energy account alone judges."""
REFUSED, SKIPPED, EXCEPTION, CRASHED = "refused", "skipped", "exception", "crashed"
"""Ends of a run that never began, or that should not be: the words beside those of `Outcome`."""

COLUMNS = {
    "index": "int64", "suite": "str", "draw": "int64", "case": "str", "variant": "str",
    "parameters": "str", "engine": "str", "profile": "str", "settings": "str", "rung": "int64",
    "seed": "int64", "outcome": "str", "t": "float64", "steps": "int64", "events": "int64",
    "tier": "str", "error": "float64", "until": "float64", "residual": "float64",
    "limit": "float64", "verdict": "str", "why": "str", "command": "str",
}  # fmt: skip
TIMES = ("index", "wall_ms")


@dataclass(slots=True)
class Tried:
    """What is known of a run when it is over."""

    outcome: str = ""
    message: str = ""
    run: Trajectory | None = None
    case: Case | None = None
    settings: Mapping[str, float] | None = None
    wall_s: float = 0.0
    broken: str = ""


def execute(spec: Spec, alone: bool = False) -> dict[str, Any]:
    """Run one spec within its bounds, and judge it.

    A process that does nothing else has its output watched, and may be ended if it hangs.
    """
    heard: list[str] = []
    with ExitStack() as stack:
        said = stack.enter_context(warnings.catch_warnings(record=True))
        warnings.simplefilter("always")
        if alone:
            stack.enter_context(killed(spec.time_limit))
            stack.enter_context(overheard(heard))
        tried = _try(spec)
        found = _error(spec, tried)
    heard += [f"{each.category.__name__}: {each.message}" for each in said]
    return row(spec, tried, found, heard)


def _try(spec: Spec) -> Tried:
    """Build, prepare and run; every end is a value."""
    tried = Tried()
    try:
        tried.case = covered(cases.load(spec.case, spec.variant, **spec.parameters), spec.time_limit)
        prepared, tried.settings = _prepared(spec, tried.case)
        began = time.perf_counter()
        with bounded(2.0 * spec.time_limit):
            tried.run = prepared.run()
        tried.wall_s = time.perf_counter() - began
        tried.outcome, tried.message = tried.run.outcome.value, tried.run.message
    except Overdue:
        tried.outcome, tried.message = Outcome.TIME_LIMIT.value, Outcome.TIME_LIMIT.advice
    except EngineUnavailable as error:
        tried.outcome, tried.message = SKIPPED, str(error)
    except cases.CaseUnsupported as error:
        tried.outcome, tried.message = SKIPPED, str(error)
    except CrossbodyError as error:
        tried.outcome, tried.message = REFUSED, str(error)
    except (Exception, SystemExit) as error:  # a stress run has a row for whatever an engine throws, and goes on
        tried.outcome, tried.message = EXCEPTION, f"{type(error).__name__}: {error}"
        tried.broken = "".join(traceback.format_tb(error.__traceback__)[-2:]).strip()
    return tried


def _prepared(spec: Spec, case: Case) -> tuple[Any, dict[str, float]]:
    """The run, and those of the asked settings that its engine knows."""
    engine = engines.load(spec.engine)
    wanted: dict[str, Any] = {**spec.knobs, "max_steps": spec.max_steps}
    bounds: dict[str, Any] = {"time_limit": spec.time_limit}
    if spec.engine == "reference":
        bounds["samples"] = instants(case.t_end)
    while True:
        try:
            run = engine.prepare(case, spec.profile, **wanted, **bounds)
            return run, {k: v for k, v in wanted.items() if k != "max_steps"}
        except UnknownName as error:
            if error.name not in wanted and error.name not in bounds:
                raise
            wanted.pop(error.name, None)
            bounds.pop(error.name, None)


def _error(spec: Spec, tried: Tried) -> Error:
    """Against the best truth that is at hand; nothing for a run that did not finish."""
    run, case = tried.run, tried.case
    if run is None or case is None or not run.outcome.ok or tried.broken or unsound(run, case, spec.engine):
        return Error()
    second = None
    if spec.second:
        second = (10 * spec.max_steps, 3.0 * spec.time_limit)
    elif spec.afford and run.steps <= AFFORD:
        second = (100 * AFFORD, spec.time_limit)
    asked = Asked(limit=limit(spec, tried.settings), near=lambda: _beside(spec, case, tried.settings), second=second)
    try:
        return error(case, run, asked)
    except (Exception, SystemExit) as fault:  # a truth that cannot be worked out is a finding as well
        tried.broken = "".join(traceback.format_tb(fault.__traceback__)[-2:]).strip()
        tried.message = f"measuring: {type(fault).__name__}: {fault}"
        return Error()


def limit(spec: Spec, settings: Mapping[str, float] | None) -> float:
    """Largest error of the reference, in proportion to a tolerance coarser than its default."""
    return spec.limit * max(1.0, _rtol(settings) / RTOL)


def _rtol(settings: Mapping[str, float] | None) -> float:
    return float((settings or {}).get("rtol", RTOL))


def _beside(spec: Spec, case: Case, settings: Mapping[str, float] | None) -> Case:
    """The scene with every number moved up or down by the run's tolerance, or the truth's if coarser."""
    apart = max(_rtol(settings), 0.0 if case.closed_form is not None else SECOND_RTOL)
    signs = np.random.default_rng(spec.seed)
    near: dict[str, cases.Value] = {
        name: value * (1.0 + apart * float(signs.choice((-1.0, 1.0)))) if isinstance(value, float) else value
        for name, value in spec.parameters.items()
    }
    if "t_end" in case.parameters:
        near["t_end"] = case.t_end
    if case.file:  # what the motion has decided
        near["friction"] = case.parameters["friction"]
    return cases.load(spec.case, spec.variant, **near)


def unsound(run: Trajectory, case: Case, engine: str) -> str:
    """What is wrong with a run that says that it finished, in one sentence; empty if nothing."""
    if not run.outcome.ok:
        return ""
    if not len(run.t) or not math.isclose(float(run.t[-1]), case.t_end, rel_tol=1e-9):
        return f"says finished at t = {float(run.t[-1]) if len(run.t) else math.nan:g} s of {case.t_end:g} s"
    names = ("t", "q", "v", "gap", "energy", *(("lam",) if engine == "reference" else ()))
    bad = [name for name in names if not np.isfinite(getattr(run, name)).all()]
    return f"says finished, but {', '.join(bad)} is not finite" if bad else ""


def row(spec: Spec, tried: Tried, error: Error, heard: list[str]) -> dict[str, Any]:
    """The row of a run."""
    run, case = tried.run, tried.case
    settings = dict(tried.settings or {})
    most = limit(spec, settings)
    open_ = residual(run) if run is not None and run.outcome.ok else math.nan
    faults = [f"leaked: {' '.join(text.split())[:300]}" for text in heard]
    if run is not None and case is not None:
        faults += [text for text in (unsound(run, case, spec.engine),) if text]
    if tried.broken:
        faults.append(tried.message)
    verdict, why = _verdict(spec, tried, error, most, open_, faults)
    return {
        "index": spec.index, "suite": spec.suite, "draw": spec.draw, "case": spec.case,
        "variant": spec.variant, "parameters": json.dumps(dict(spec.parameters)), "engine": spec.engine,
        "profile": spec.profile, "settings": json.dumps(settings), "rung": spec.rung, "seed": spec.seed,
        "outcome": tried.outcome, "t": float(run.t[-1]) if run is not None and len(run.t) else math.nan,
        "steps": run.steps if run is not None else 0,
        "events": len(run.events) if run is not None else 0, "tier": error.tier, "error": error.value,
        "until": error.until, "residual": open_, "limit": most, "verdict": verdict.value, "why": why,
        "command": spec.command(settings), "wall_ms": 1e3 * tried.wall_s,
    }  # fmt: skip


def _verdict(spec: Spec, tried: Tried, error: Error, most: float, open_: float, faults: list[str]) -> tuple[Word, str]:
    """Dishonest ends are outside for everybody, inaccuracy for the reference; an engine's is but shown."""
    if faults:
        return Word.OUTSIDE, "; ".join(faults)
    if tried.outcome in (SKIPPED, REFUSED):
        return Word.SKIPPED, tried.message
    reference = spec.engine == "reference"
    if tried.outcome != Outcome.FINISHED:
        return (Word.OUTSIDE if reference and spec.finishes else Word.INFO), tried.message[:500]
    if reference and error.value > most:
        return Word.OUTSIDE, error.why or f"error {error.value:.2e}"
    if reference and open_ > ACCOUNT * most:
        return Word.OUTSIDE, f"the energy account leaves {open_:.2e} open"
    if reference and error.tier and not math.isnan(error.value):
        return Word.WITHIN, error.why
    return (Word.LEDGER if reference and not math.isnan(open_) else Word.INFO), error.why


def crashed(spec: Spec, why: str) -> dict[str, Any]:
    """The row of a run that took its process with it."""
    tried = Tried(outcome=CRASHED, message=why, broken="process")
    return row(spec, tried, Error(), [])
