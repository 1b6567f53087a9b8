"""Identify parameters of a model from a log: bounded least squares over windows, others held out to judge it by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from crossbody.cases import InvalidValue, SceneError, Value
from crossbody.hw import models
from crossbody.hw.fitting.derivative import DELAY, Exact
from crossbody.hw.fitting.difference import Differences
from crossbody.hw.fitting.fit import Estimate, Fit, Floats, Spread, spread
from crossbody.hw.models._contract import Model
from crossbody.hw.reading.log import Log
from crossbody.hw.replaying.windows import Window, windows

LONGEST_DELAY = 0.1
"""Bound on an identified delay, s."""
TOGETHER = 0.999
"""Correlation from which on two parameters are told apart by nothing but noise."""
CHECK = 1e-3
"""Relative difference of exact derivatives and central differences that is worth a warning."""


def identify(
    log: Log | Sequence[Log], model: str | Model, free: Sequence[str], *, parameters: Mapping[str, Value] | None = None,
    restart: float | None = None, horizon: float | None = None, starts: str = "measured", hold: int = 2,
    stride: int = 1, bounds: Mapping[str, tuple[float, float]] | None = None, engine: str = "",
) -> Fit:  # fmt: skip
    """Fit parameters to a log.

    The residuals are those of the measured coordinates in every window; windows i with i % hold = hold - 1 are held
    out.

    Args:
        log: what was recorded; several are taken as windows of their own.
        model: its name in `hw.models`, or itself.
        free: names of its parameters; "delay" is that of the measured coordinates.
        parameters: where not the model's defaults: the start of the search, and what is kept.
        restart: time between restarts, s; the model's usual one if not given; 0 for one window a log.
        horizon: length of a window, s; up to the next restart if not given.
        starts: "measured": each window starts at the measured state; "free": the starts are unknowns too.
        hold: every so manieth window is held out; 0 for none.
        stride: of so many samples one is compared (neighbours that tell the same need not all be).
        bounds: name -> lowest and highest value, inside those of the model.
        engine: what runs a model whose contacts open: E or E:PROFILE.

    Raises:
        UnknownName: for a model or parameter that does not exist.
        InvalidValue: for numbers outside their ranges.
        SceneError: if the log lacks what the model needs, or no window is left to fit.
    """
    chosen = models.load(model) if isinstance(model, str) else model
    numbers = chosen.numbers(parameters)
    _check(chosen, free, starts, hold, stride)
    logs = [log] if isinstance(log, Log) else list(log)
    cut = [window for one in logs for window in windows(one, chosen, restart, 0.0, horizon)]
    held = [i for i in range(len(cut)) if hold and i % hold == hold - 1]
    fitted = [i for i in range(len(cut)) if i not in held]
    if not fitted:
        raise SceneError("No window is left to fit; hold fewer out, or restart more often.")
    kind: Any = Exact if chosen.places and not engine else Differences
    more = (engine,) if kind is Differences else ()
    problem = kind(chosen, numbers, free, [cut[i] for i in fitted], starts == "free", stride, *more)
    low, high = _limits(chosen, free, bounds or {}, len(problem.first()))
    x0 = np.clip(problem.first(), low, high)
    found = least_squares(
        problem.residual, x0, jac=problem.jacobian, bounds=(low, high), x_scale=_sizes(x0, low, high), method="trf",
        xtol=problem.ftol, ftol=problem.ftol, gtol=1e-12, max_nfev=problem.most,
    )  # fmt: skip
    return _judged(chosen, numbers, free, problem, x0, found, (low, high), cut, (fitted, held), kind, stride, more)


def _check(model: Model, free: Sequence[str], starts: str, hold: int, stride: int) -> None:
    model.numbers({name: model.parameters[name].default for name in free if name in model.parameters})
    if not free or len(set(free)) < len(free):
        raise InvalidValue("Name at least one free parameter, and none twice.")
    unknown = [name for name in free if name != DELAY and name not in model.parameters]
    if unknown:
        model.numbers(dict.fromkeys(unknown, 0.0))
    if starts not in ("measured", "free") or hold < 0 or hold == 1 or stride < 1:
        raise InvalidValue("starts is measured or free, hold is 0 or at least 2, stride at least 1.")


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


def _judged(
    model: Model, numbers: Mapping[str, Value], free: Sequence[str], problem: Any, x0: Floats, found: Any,
    limits: tuple[Floats, Floats], cut: Sequence[Window], parts: tuple[list[int], list[int]], kind: Any, stride: int,
    more: tuple[str, ...],
) -> Fit:  # fmt: skip
    count, x = len(free), found.x
    J = problem.jacobian(x)
    wide = spread(J, found.fun, problem.owners(), _sizes(x, *limits))
    flat = problem.flat(x)
    estimates = tuple(_estimate(model, name, i, x, x0, wide, limits, i not in flat) for i, name in enumerate(free))
    sizes = _sizes(np.where(np.abs(x) > 1e-9 * np.abs(x0), x, x0), *limits)[:count]
    off = problem.checked(x, J, sizes, limits[0])
    sides = [
        kind(model, numbers, free, [cut[i] for i in part], False, stride, *more) if part else None for part in parts
    ]
    before, after = (_errors(sides, y[:count]) for y in (x0, x))
    values = {name: float(x[i]) for i, name in enumerate(free) if name != DELAY}
    return Fit(
        model=model.name, estimates=estimates, correlation=_correlation(wide, estimates),
        parameters=dict(numbers) | values, delay=float(x[free.index(DELAY)]) if DELAY in free else 0.0,
        fitted=tuple(parts[0]), held=tuple(parts[1]), before=before, after=after,
        sensitivities=f"{problem.how}; central differences at the solution differ by {off:.1e} of their size",
        covariance=wide.how, warnings=_warnings(estimates, wide, off, found, flat, problem.tolerance),
        evaluations=int(found.nfev), success=bool(found.success), message=str(found.message),
    )  # fmt: skip


def _estimate(
    model: Model, name: str, i: int, x: Floats, x0: Floats, wide: Spread, limits: tuple[Floats, Floats], steep: bool
) -> Estimate:
    unknown = bool(np.any(np.abs(wide.null[:, i]) > 1e-2)) if len(wide.null) else False
    std = np.inf if unknown else float(np.sqrt(max(wide.covariance[i, i], 0.0)))
    half = wide.quantile * std
    bounds = (float(limits[0][i]), float(limits[1][i]))
    span = bounds[1] - bounds[0]
    told = half < 0.5 * span and (half < max(abs(float(x[i])), 1e-300) or name == DELAY or x[i] - half <= bounds[0])
    return Estimate(
        name=name, unit="s" if name == DELAY else model.parameters[name].unit, value=float(x[i]), std=std,
        low=float(x[i]) - half, high=float(x[i]) + half, start=float(x0[i]), bounds=bounds,
        identifiable=bool(told and steep and np.isfinite(half)),
    )  # fmt: skip


def _correlation(wide: Spread, estimates: Sequence[Estimate]) -> Floats:
    count = len(estimates)
    C = wide.covariance[:count, :count]
    std = np.array([e.std for e in estimates])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(np.isfinite(np.outer(std, std)), C / np.outer(std, std), np.nan)


def _errors(sides: Sequence[Any], x: Floats) -> dict[str, tuple[float, float]]:
    """Errors on the fitted windows and on the held ones, all started as measured."""
    found: list[tuple[float, float, float]] = []
    for part in sides:
        if part is None:
            found.append((np.nan, np.nan, np.nan))
            continue
        r, owners = part.residual(x), part.owners()
        last = [np.max(np.abs(_ends(r[owners == w], part.k))) for w in np.unique(owners)]
        found.append(
            (float(np.sqrt(np.mean(r * r))), float(np.median(last)), float(np.percentile(last, 90.0)))
        )  # fmt: skip
    names = ("rmse", "end_median", "end_90")
    return {name: (found[0][i], found[1][i]) for i, name in enumerate(names)}


def _ends(r: Floats, k: int) -> Floats:
    """The last residual of every coordinate of one window."""
    return np.asarray(r.reshape(k, -1)[:, -1])


def _warnings(
    estimates: Sequence[Estimate], wide: Spread, off: float, found: Any, flat: Mapping[int, str], tolerance: float
) -> tuple[str, ...]:
    told = []
    count = len(estimates)
    for row in wide.null:
        part = [e.name for e, weight in zip(estimates, row[:count], strict=True) if abs(weight) > 1e-2]
        told.append(f"{', '.join(part)}: the data tell a combination of them only; keep one of them.")
    C = _correlation(wide, estimates)
    for i, e in enumerate(estimates):
        if i in flat:
            told.append(f"{e.name} is not identifiable: {flat[i]}.")
        elif np.isfinite(e.std) and not e.identifiable:
            told.append(f"{e.name} is not identifiable: {e.value:.4g} +- {e.high - e.value:.2g} {e.unit}.")
        if e.low <= e.bounds[0] <= 0.0 < e.high and e.identifiable:
            told.append(f"{e.name} cannot be told from its bound {e.bounds[0]:g} {e.unit}.")
        elif found.active_mask[i]:
            told.append(f"{e.name} stands at a bound, {e.value:.4g} {e.unit}.")
        told += [
            f"{e.name} and {estimates[j].name} can hardly be told apart (correlation {C[i, j]:+.4f})."
            for j in range(i) if abs(C[i, j]) > TOGETHER
        ]  # fmt: skip
    if off > tolerance:
        told.append(f"Derivatives differ from central differences by {off:.1e}: judge the intervals by it.")
    if not found.success:
        told.append(f"The search did not converge: {found.message}")
    return tuple(told)
