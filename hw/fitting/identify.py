"""Identify parameters of a model from a log: bounded least squares over windows, others judge it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from crossbody.cases import InvalidValue, SceneError, Value, arguments
from crossbody.cases.arrays import Floats
from crossbody.cases.entry_points import checked_arguments
from crossbody.hw import models
from crossbody.hw.fitting.derivative import DELAY, Exact
from crossbody.hw.fitting.difference import Differences
from crossbody.hw.fitting.fit import Fit
from crossbody.hw.fitting.judged import Search, judged, unjudged
from crossbody.hw.fitting.search import Deadline, TimeOver, search
from crossbody.hw.models.contract import Model
from crossbody.hw.reading.log import Log
from crossbody.hw.windows.window import Window, windows

LONGEST_DELAY = 0.1  # bound on an identified delay, s
BUDGET = 300.0  # time for a search, s
MOST_DERIVATIVES = 20_000_000
"""Derivatives by starts that "auto" lets be unknowns: 160 MB, and several times that in the search."""


@checked_arguments
def identify(
    log: Log | Sequence[Log], model: str | Model, free: Sequence[str], *,
    parameters: Mapping[str, Value] | None = None, restart: float | None = None,
    horizon: float | None = None, starts: str = "auto", hold: int = 2, stride: int = 1,
    bounds: Mapping[str, tuple[float, float]] | None = None, engine: str = "",
    delay: float = 0.0, budget: float = BUDGET, time_limit: float = math.inf,
) -> Fit:  # fmt: skip
    """Fit parameters to a log.

    The residuals are those of the measured coordinates in every window; windows i with i % hold =
    hold - 1 are held out.

    Args:
        log: what was recorded; several are taken as windows of their own.
        model: its name in `hw.models`, or itself.
        free: names of its parameters; "delay" is that of the measured coordinates.
        parameters: where not the model's defaults: the start of the search, and what is kept.
        restart: time between restarts, s; the model's usual one if not given; 0 for one window a log.
        horizon: length of a window, s; up to the next restart if not given.
        starts: "free": the start of each window is an unknown too; "measured": it is the measured
            state, whose noise no interval counts; "auto": free wherever derivatives are exact and
            the unknowns are not too many.
        hold: every hold-th window is held out of the fit; 0 for none.
        stride: of so many samples one is compared (neighbours that tell the same need not all be).
        bounds: name -> lowest and highest value, inside those of the model.
        engine: what runs a model whose contacts open: E or E:PROFILE.
        delay: of the measured coordinates beyond what the column map says, s; a free one is beyond this.
        budget: time that the search may take, s; the best so far is what it then gives, with its
            intervals and the outcome "unconverged".
        time_limit: time that all of it may take, s: looked at before every run of a window, in
            the search and when its end is judged; the outcome is then "stopped", with the best so
            far and no intervals.

    Raises:
        UnknownName: for a model or parameter that does not exist.
        InvalidValue: for numbers outside their ranges.
        SceneError: if the log lacks what the model needs, or no window is left to fit.
    """
    chosen = models.chosen(model)
    numbers = chosen.numbers(parameters)
    hold, stride = arguments.whole("hold", hold, 0), arguments.whole("stride", stride)
    if not time_limit > 0.0:
        raise InvalidValue(f"time_limit is {time_limit!r} s; it must be above 0.")
    deadline = Deadline(time_limit)
    _check(chosen, free, starts, hold, stride, budget)
    logs = [log] if isinstance(log, Log) else log
    cut = [window for one in logs for window in windows(one, chosen, restart, delay, horizon)]
    held = [i for i in range(len(cut)) if hold and i % hold == hold - 1]
    if not (fitted := [i for i in range(len(cut)) if i not in held]):
        raise SceneError("No window is left to fit; hold out fewer, or restart more often.")
    kind: Any = Exact if chosen.places and not engine else Differences
    more = (engine,) if kind is Differences else ()
    joint = starts == "free" or (starts == "auto" and kind is Exact and _bearable([cut[i] for i in fitted], stride))
    problem = kind(chosen, numbers, free, [cut[i] for i in fitted], joint, stride, *more)
    limits = _limits(chosen, free, bounds or {}, len(problem.first()))
    x0 = np.clip(problem.first(), *limits)
    sides = [
        kind(chosen, numbers, free, [cut[i] for i in part], False, stride, *more) if part else None
        for part in (fitted, held)
    ]
    for part in (problem, *sides):
        if part is not None:
            part.deadline = deadline
    found = search(problem, limits, lambda x: _sizes(x, *limits), len(free), budget)
    ended = Search(
        model=chosen,
        numbers=numbers,
        free=tuple(free),
        problem=problem,
        x0=x0,
        found=found,
        limits=limits,
        sizes=_sizes(found.x, *limits),
        sides=tuple(sides),
        fitted=tuple(fitted),
        held=tuple(held),
    )
    try:
        deadline.check()
        return judged(ended)
    except TimeOver:
        return unjudged(ended, time_limit)


def _check(model: Model, free: Sequence[str], starts: str, hold: int, stride: int, budget: float) -> None:
    model.numbers({name: model.parameters[name].default for name in free if name in model.parameters})
    if not free or len(set(free)) < len(free):
        raise InvalidValue("Name at least one free parameter, and none twice.")
    if unknown := [name for name in free if name != DELAY and name not in model.parameters]:
        model.numbers(dict.fromkeys(unknown, 0.0))
    if starts not in ("auto", "measured", "free") or hold < 0 or hold == 1 or stride < 1:
        raise InvalidValue("starts is auto, measured or free, hold is 0 or at least 2, stride at least 1.")
    if not 0.0 < budget < math.inf:
        raise InvalidValue(f"budget is {budget!r} s; it must be above 0 and finite.")


def _bearable(cut: Sequence[Window], stride: int) -> bool:
    """Whether the derivatives by all starts of these windows are few enough to be kept at once."""
    k = cut[0].y.shape[1]
    rows = k * sum(-(-len(window.t) // stride) for window in cut)
    return bool(2 * k * len(cut) * rows <= MOST_DERIVATIVES)


def _limits(
    model: Model, free: Sequence[str], given: Mapping[str, tuple[float, float]], size: int
) -> tuple[Floats, Floats]:
    """Bounds of every unknown (P,); starts have none."""
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    for i, name in enumerate(free):
        own = (-LONGEST_DELAY, LONGEST_DELAY)
        if name != DELAY:
            own = (model.parameters[name].low, model.parameters[name].high)
        a, b = given.get(name, own)
        if not own[0] <= a < b <= own[1]:
            raise InvalidValue(f"Bounds of {name} are {a:g} and {b:g}; valid: within {own[0]:g} and {own[1]:g}.")
        low[i], high[i] = a, b
    return low, high


def _sizes(x: Floats, low: Floats, high: Floats) -> Floats:
    """Typical size of every unknown: its value, or a thousandth of a finite range, or 1."""
    span = high - low
    small = np.where(np.isfinite(span) & (span < 1e2), 1e-3 * span, 1e-3)
    return np.where(np.abs(x) > 1e-12, np.abs(x), small)
