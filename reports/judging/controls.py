"""The judge judged, in every run: known faults must come out as large as they are, and outside.

A number that is within says something only if it could have been outside. So every case measures the faults of
`crossbody.reports.judging.planted` as it measures an engine, and whatever does not see one is outside itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any

import numpy as np

from crossbody.cases import Case, CaseUnsupported, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.between import between
from crossbody.engines.contract import QUANTITIES
from crossbody.reports import metrics
from crossbody.reports.judging.audit import answered_once, audit, rounded, states
from crossbody.reports.judging.planted import faults
from crossbody.reports.judging.planting import Range
from crossbody.reports.judging.truth import agreement
from crossbody.reports.measuring.impulse import told
from crossbody.reports.measuring.truth import Truth, taken

SAME = 1e-12
"""Part of the horizon by which instants are the same."""
OWN = 0.5
"""Part of what must come out that the motion may be off by without a fault: beyond, nothing is told."""

HELD = {"position", "event_times"}
"""By which the sources of a truth must be held against each other: else a fault in one of them passes."""

Blind = tuple[str, float, Range, str]
"""Metric, its number, least and most that it must be, and the fault that it does not see."""


def unseen(case: Case, truth: Truth, outside: Callable[[str, float], bool]) -> Iterator[Blind]:
    """Yield the first fault of each metric that it does not see as it must, or that is not outside.

    Args:
        case: with its metrics.
        truth: up to where it is trusted. What errors grow by, and metrics leave room for, is left out: the motion is
            known exactly here.
        outside: whether a number of a metric, off by a fault, is judged as outside wherever it is judged.
    """
    run = _whole(truth.trajectory)
    if not all(np.isfinite(getattr(run, name)).all() for name in ("t", "q", "v", "gap", "lam", "energy")):
        return
    known, every = replace(truth, trajectory=run, at=recorded(run), grows=1.0), metrics.of(case)
    held = _held(known, run, case)
    plain: dict[tuple[str, int], float | None] = {}
    blind: set[str] = set()
    for control in faults(case, run):
        for name, (least, most) in control.sees.items():
            without = control.plain or run
            if (at := (name, id(without))) not in plain:
                plain[at] = _measured(every[name], known, without, case)
            own = abs(plain[at] or 0.0)
            if name in blind or plain[at] is None or not own <= max(OWN * least, most - least):
                continue
            value = None if name in HELD - held else _measured(every[name], known, control.run, case)
            found = np.nan if value is None else abs(value)
            if not least - own <= found <= most + own or (control.wrong and not outside(name, found)):
                blind.add(name)
                yield name, found, (least, most), control.fault


def _whole(run: Trajectory) -> Trajectory:
    """Return a motion in which rows that follow from others carry nothing, as these carry what they would."""
    known = told(run)
    return run if known is None or known.all() else replace(run, lam=np.where(known, run.lam, 0.0))


def _held(truth: Truth, run: Trajectory, case: Case) -> Set[str]:
    """Return by what the sources of a truth are held against each other; all where a metric of these throws."""
    try:
        return agreement(truth, run, case).keys()
    except (Exception, SystemExit):
        return HELD


def _measured(metric: metrics.Metric, truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Return a number; None where its metric throws, which is a row of every run already."""
    try:
        return metric.measure(truth, run, case)
    except (Exception, SystemExit):
        return None


MORE = 1e-6
"""Part by which the parameters and functions of an engine are off: far more than rounding."""
OF_POSITIONS = ("M", "H")
"""Functions of the audit that velocities do not change."""


def unheard(case: Case) -> Iterator[Blind]:
    """Yield what the parity audit does not see where everything is off by a part in a million, or is not shown."""
    from crossbody import engines

    if "reference" not in engines.names():
        return
    try:
        theirs = answered_once(engines.load("reference").prepare(case, "compiled").audit())
    except CaseUnsupported:
        return
    at = states(case, theirs)
    asked = [key for key in QUANTITIES if key in theirs and _something(key, theirs, case, at)]
    large, small = (
        {row.quantity: row for row in audit({key: _times(theirs[key], by) for key in asked}, theirs, case, at=at)}
        for by in (1.0 + MORE, 1.0 - MORE)
    )
    missing = {row.quantity: row for row in audit({}, theirs, case, at=at)}
    for key in asked:
        for found, (least, most), fault in (
            (large, (0.5 * MORE, 2.0 * MORE), f"{key} {MORE:g} too large"),
            (small, (0.5 * MORE, 2.0 * MORE), f"{key} {MORE:g} too small"),
            (missing, (np.inf, np.inf), f"{key} not shown"),
        ):
            if key not in found or found[key].ok or not least <= found[key].difference <= most:
                yield "audit", found[key].difference if key in found else np.nan, (least, most), fault


def _times(value: Any, by: float) -> Any:
    """Return a value or a function times a factor."""
    if isinstance(value, Mapping):
        return {name: _times(one, by) for name, one in value.items()}
    if callable(value):
        return lambda *at: _times(value(*at), by)
    return by * np.asarray(value, dtype=np.float64)


def _something(key: str, theirs: Mapping[str, Any], case: Case, at: Sequence[tuple[Floats, Floats]]) -> bool:
    """Whether a value, or a function at the start, is other than 0 somewhere, and than rounding."""
    least = rounded(key, theirs, at) if key == "bias" else 0.0
    return _more(key, theirs[key], case, least)


def _more(key: str, value: Any, case: Case, least: float) -> bool:
    if isinstance(value, Mapping):
        return any(_more(key, one, case, least) for one in value.values())
    if callable(value):
        value = value(case.q0) if key in OF_POSITIONS else value(case.q0, case.v0)
    numbers = np.asarray(value, dtype=np.float64)
    return bool(np.isfinite(numbers).all() and np.any(np.abs(numbers) > least))


def recorded(run: Trajectory) -> Callable[[Floats], Trajectory]:
    """Return a motion as a function of time that gives its own samples where it is asked for the first of them."""
    other = between(run)

    def at(times: Floats) -> Trajectory:
        first = slice(None, len(times))
        same = len(times) <= len(run.t) and np.allclose(times, run.t[first], rtol=0.0, atol=SAME * max(1.0, run.t[-1]))
        return taken(run, first) if same else other(times)

    return at
