"""What a search found, judged: intervals, what the data do not see, halves that disagree, windows not fitted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Value
from crossbody.cases.arrays import Floats
from crossbody.hw.fitting.covariance import Scatter, scatter
from crossbody.hw.fitting.derivative import DELAY, Exact
from crossbody.hw.fitting.doubts import agreement, moves, profiles
from crossbody.hw.fitting.fit import CONVERGED, STOPPED, UNCONVERGED, Agreement, Estimate, Fit
from crossbody.hw.fitting.information import WEIGHT, in_words, information, unseen_by, weak
from crossbody.hw.fitting.search import Found
from crossbody.hw.models.contract import Model

TOGETHER = 0.999  # correlation from which on two parameters are told apart by nothing but noise
ERRORS = ("rmse", "end_median", "end_90")
EFFECTIVE = 4.0  # degrees of freedom below which a standard deviation is itself hardly known
MEASURED = "The windows start from measured states, whose noise the intervals do not include; {}."
COUNTED = 'with starts="free" they would'
NEVER = "if contacts open, initial states cannot be unknowns"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Search:
    """A search that has ended, with what it was asked.

    Attributes:
        model, numbers, free: what was searched: the model, all its parameters, and the names of
            the free ones.
        problem: residuals and derivatives of the fitted windows.
        x0, found: where it began and ended.
        limits, sizes: bounds and typical sizes of the unknowns.
        sides: problems of the fitted and of the held-out windows, all started as measured; None
            for no windows.
        fitted, held: their numbers.
    """

    model: Model
    numbers: Mapping[str, Value]
    free: tuple[str, ...]
    problem: Any
    x0: Floats
    found: Found
    limits: tuple[Floats, Floats]
    sizes: Floats
    sides: tuple[Any, ...]
    fitted: tuple[int, ...]
    held: tuple[int, ...]


def judged(search: Search) -> Fit:
    """The fit of a search."""
    problem, found, free, limits = search.problem, search.found, search.free, search.limits
    count, x = len(free), found.x
    J = problem.jacobian(x)
    null = unseen_by(information(J, search.sizes), count)
    loose = np.setdiff1d(np.arange(len(x)), found.kept)
    told = information(J[:, loose], search.sizes[loose])
    blind = np.ones(len(x), dtype=bool)
    blind[loose] = np.any(np.abs(told.null) > WEIGHT, axis=0) if len(told.null) else False
    own = np.flatnonzero(loose < count)
    spread = scatter(told.basis, told.weights[:, own], found.residual, problem.layout)
    open_ = np.any(null != 0.0, axis=0) if len(null) else np.zeros(count, dtype=bool)
    narrow = _narrow(search, dict(zip(loose[own].tolist(), spread.half.tolist(), strict=True)))
    flat = narrow | problem.flat(x)
    estimates = tuple(_estimates(search, spread, loose[own], blind, open_, flat))
    unseen = _unseen(search, null, spread, loose[own], blind)
    halves = agreement(
        -J, found.residual, problem.layout, x, search.sizes, free, [*found.kept, *np.flatnonzero(found.active)]
    )  # fmt: skip
    sizes = np.where(np.abs(x) > 1e-9 * np.abs(search.x0), search.sizes, np.maximum(search.sizes, np.abs(search.x0)))
    off = problem.checked(x, J, sizes[:count], limits[0])
    stds = {i: e.std for i, e in enumerate(estimates) if np.isfinite(e.std) and e.std > 0.0 and i in loose}
    risen = profiles(problem, x, J, search.sizes, stds, limits)
    before, after = (_errors(search.sides, y[:count]) for y in (search.x0, x))
    values = {name: float(x[i]) for i, name in enumerate(free) if name != DELAY}
    fit = Fit(
        model=search.model.name, estimates=estimates, correlation=_correlation(spread, loose[own], estimates),
        kept=tuple(free[i] for i in found.kept), unseen=tuple(unseen.values()), agreement=halves,
        parameters=dict(search.numbers) | values, delay=float(x[free.index(DELAY)]) if DELAY in free else 0.0,
        fitted=search.fitted, held=search.held, before=before, after=after,
        sensitivities=f"{problem.how}; central differences at the solution differ by {off:.1e} of their size",
        covariance=spread.how, warnings=(), evaluations=found.evaluations,
        outcome=CONVERGED if found.success else UNCONVERGED, message=found.message, left=_left(problem, found.residual),
        profile={free[i]: one for i, one in risen.items()},
    )  # fmt: skip
    about = [] if problem.starts else [MEASURED.format(COUNTED if isinstance(problem, Exact) else NEVER)]
    warnings = (*_warnings(fit, unseen, found, flat, off, problem.tolerance), *about)
    return replace(fit, warnings=warnings)


def _left(problem: Any, residual: Floats) -> tuple[tuple[Floats, Floats], ...]:
    """Times (m,) and residuals (m, k) of every fitted window."""
    owners = problem.layout.windows()
    return tuple(
        (window.t[at], residual[owners == j].reshape(problem.k, -1).T)
        for j, (window, at) in enumerate(zip(problem.cut, problem.grids, strict=True))
    )


def unjudged(search: Search, seconds: float) -> Fit:
    """The fit of a search that was stopped, or not judged in time: the best so far and nothing else."""
    found, free = search.found, search.free
    ended = "its search had converged and was not judged" if found.success else found.message
    message = f"Stopped at the time limit of {seconds:g} s: {ended}"
    estimates = tuple(
        Estimate(
            name=name, unit="s" if name == DELAY else search.model.parameters[name].unit,
            value=float(found.x[i]), std=np.inf, low=-np.inf, high=np.inf,
            start=float(search.x0[i]), identifiable=False, kept_low=-np.inf, kept_high=np.inf,
            freedom=0.0, bounds=(float(search.limits[0][i]), float(search.limits[1][i])),
        ) for i, name in enumerate(free)
    )  # fmt: skip
    values = {e.name: e.value for e in estimates if e.name != DELAY}
    nothing = dict.fromkeys(ERRORS, (np.nan, np.nan))
    return Fit(
        model=search.model.name, estimates=estimates, correlation=np.full((len(free), len(free)), np.nan),
        kept=(), unseen=(), agreement=(), parameters=dict(search.numbers) | values,
        delay=float(found.x[free.index(DELAY)]) if DELAY in free else 0.0, fitted=search.fitted,
        held=search.held, before=nothing, after=dict(nothing), sensitivities=search.problem.how,
        covariance="none: stopped", warnings=(f"{message} No interval and no error was found.",),
        evaluations=found.evaluations, outcome=STOPPED, message=message,
    )  # fmt: skip


def _estimates(
    search: Search, spread: Scatter, own: NDArray[np.int64], blind: NDArray[np.bool_],
    open_: NDArray[np.bool_], flat: Mapping[int, str],
) -> Iterator[Estimate]:  # fmt: skip
    """One estimate a parameter; `own` says which unknowns the scatter is of."""
    place = {int(i): j for j, i in enumerate(own)}
    for i, name in enumerate(search.free):
        value, j = float(search.found.x[i]), place.get(i)
        std, half, freedom = 0.0, 0.0, np.inf  # of one that was kept
        if j is not None:
            std, half, freedom = (float(part[j]) for part in (spread.std, spread.half, spread.freedom))
            half = np.inf if blind[i] else half
        wide = np.inf if open_[i] else half
        bounds = (float(search.limits[0][i]), float(search.limits[1][i]))
        yield Estimate(
            name=name, unit="s" if name == DELAY else search.model.parameters[name].unit,
            value=value, std=np.inf if np.isinf(wide) else std, low=value - wide,
            high=value + wide, start=float(search.x0[i]), bounds=bounds,
            identifiable=_identifiable(value, wide, bounds) and i not in flat,
            kept_low=value - half, kept_high=value + half, freedom=freedom,
        )  # fmt: skip


def _identifiable(value: float, half: float, bounds: tuple[float, float]) -> bool:
    """Whether an interval is finite, reaches no bound, and is not wider than the value itself.

    Where the bounds admit both signs there is no natural size but their span.
    """
    if not np.isfinite(half) or value - half <= bounds[0] or value + half >= bounds[1]:
        return False
    signed = bounds[0] < 0.0 < bounds[1]
    size = 0.5 * (bounds[1] - bounds[0]) if signed and np.isfinite(bounds[1] - bounds[0]) else abs(value)
    return bool(half < size)


def _narrow(search: Search, halves: Mapping[int, float]) -> dict[int, str]:
    """Parameters that free starts would move out of their intervals: index -> that in words."""
    problem, found, count = search.problem, search.found, len(search.free)
    if problem.starts or not isinstance(problem, Exact) or not found.success:
        return {}
    fixed = [*found.kept, *np.flatnonzero(found.active).tolist()]
    told = moves(problem, found.x[:count], search.sizes[:count], fixed)
    return {
        i: (
            f"its interval of +- {halves[i]:.2g} is from windows that start from measured states, and one step "
            f"towards free starts changes it by {move.by:+.2g}"
        )
        for i, move in told.items()
        if move.refuted and abs(move.by) > halves[i]
    }


def _unseen(
    search: Search, null: Floats, spread: Scatter, own: NDArray[np.int64], blind: NDArray[np.bool_]
) -> dict[str, str]:
    """Directions of several parameters that the data do not or hardly see: sentence -> combination."""
    names, found = search.free, {}
    kept = [names[i] for i in search.found.kept]
    for row in null:
        words = in_words(row, names)
        part = [n for n, weight in zip(names, row, strict=True) if weight != 0.0]
        fix = next((n for n in kept if n in part), part[0])
        one = (
            f"{words} have no effect on the data"
            if len(part) == 1
            else f"One combination has no effect on the data: {words}"
        )
        found[f"{one}. Fix one of them, for example {fix}." if len(part) > 1 else f"{one}: fix it."] = words
    seen = [j for j, i in enumerate(own) if not blind[i]]
    if len(seen) > 1 and np.all(spread.std[seen] > 0.0):
        at = own[seen]
        sizes = np.maximum(np.maximum(np.abs(search.found.x[at]), np.abs(search.x0[at])), 1e-300)
        sizes = np.where([names[i] == DELAY for i in at], search.limits[1][at], sizes)
        quantile = float(np.median(spread.half[seen] / spread.std[seen]))
        for row in weak(spread.covariance[np.ix_(seen, seen)], sizes, quantile):
            words = in_words(row, [names[i] for i in at])
            if np.sum(np.abs(row) > WEIGHT * np.max(np.abs(row))) > 1:
                found[
                    (
                        f"One combination has almost no effect on the data: {words} cannot be distinguished from "
                        "zero. Fix one of them."
                    )
                ] = words
    return found


def _correlation(spread: Scatter, own: NDArray[np.int64], estimates: Sequence[Estimate]) -> Floats:
    """Correlations (P, P) of the estimates that have a finite interval."""
    found = np.full((len(estimates), len(estimates)), np.nan)
    good = [j for j, i in enumerate(own) if np.isfinite(estimates[i].std) and spread.std[j] > 0.0]
    C = spread.covariance[np.ix_(good, good)]
    size = np.sqrt(np.diag(C))
    found[np.ix_(own[good], own[good])] = C / np.outer(size, size)
    return found


def _errors(sides: Sequence[Any], x: Floats) -> dict[str, tuple[float, float]]:
    """Errors on the fitted windows and on the held ones, all started as measured."""
    found: list[tuple[float, float, float]] = []
    for part in sides:
        if part is None:
            found.append((np.nan, np.nan, np.nan))
            continue
        r, owners = part.residual(x), part.layout.windows()
        last = [np.max(np.abs(r[owners == w].reshape(part.k, -1)[:, -1])) for w in np.unique(owners)]
        found.append(
            (float(np.sqrt(np.mean(r * r))), float(np.median(last)), float(np.percentile(last, 90.0)))
        )  # fmt: skip
    return {name: (found[0][i], found[1][i]) for i, name in enumerate(ERRORS)}


def _warnings(
    fit: Fit, unseen: Mapping[str, str], found: Found, flat: Mapping[int, str], off: float, tolerance: float
) -> Iterator[str]:
    yield from unseen
    if fit.kept:
        rest = [f"{e.name} = {e.value:.4g} [{e.kept_low:.4g}, {e.kept_high:.4g}]" for e in fit.estimates
                if e.name not in fit.kept and not np.isfinite(e.std)]  # fmt: skip
        yield f"With {', '.join(fit.kept)} kept at their initial values: {', '.join(rest) or 'nothing else is known'}."
    for i, e in enumerate(fit.estimates):
        yield from _about(e, i, fit, bool(found.active[i]), flat)
    yield from (_differ(one) for one in fit.agreement if not one.agrees)
    if fit.worse > 0.0:
        before, after = fit.before["rmse"][1], fit.after["rmse"][1]
        yield f"On held-out windows the rmse grew from {before:.4g} to {after:.4g}: worse than the start."
    if few := [e.name for e in fit.estimates if np.isfinite(e.std) and e.freedom < EFFECTIVE]:
        yield f"The intervals of {', '.join(few)} are based on few independent data; more windows would narrow them."
    if off > tolerance:
        yield f"Derivatives differ from central differences by {off:.1e}: judge the intervals by it."
    if not found.success:
        yield f"The search did not converge: {found.message}"


def _about(e: Estimate, i: int, fit: Fit, active: bool, flat: Mapping[int, str]) -> Iterator[str]:
    """What is to be said of one estimate."""
    reached = (e.low <= e.bounds[0], e.high >= e.bounds[1])
    bound = next((b for b, near in zip(e.bounds, reached, strict=True) if near), None)
    if i in flat:
        yield f"{e.name} is not identifiable: {flat[i]}."
    elif np.isfinite(e.std) and bound is not None:
        size = f"{e.value:.4g} [{e.low:.4g}, {e.high:.4g}]"
        yield f"{e.name} cannot be distinguished from its bound {bound:g} {e.unit}: {size}."
    elif active:
        yield f"{e.name} is at a bound, {e.value:.4g} {e.unit}."
    elif np.isfinite(e.std) and not e.identifiable:
        yield f"{e.name} is not identifiable: {e.value:.4g} +- {e.high - e.value:.2g} {e.unit}."
    for j in range(i):
        if abs(fit.correlation[i, j]) > TOGETHER:
            other = fit.estimates[j].name
            yield f"{e.name} and {other} can hardly be separated (correlation {fit.correlation[i, j]:+.4f})."


def _differ(one: Agreement) -> str:
    (a, b), (s, t) = one.values, one.stds
    return (
        f"{one.name} is not the same in both halves of the data: {a:.4g} +- {s:.2g} and {b:.4g} +- {t:.2g} "
        "(standard deviations). The model lacks an effect that changes it, which no interval covers."
    )
