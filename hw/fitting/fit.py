"""What an identification finds: values, 95 % intervals, what the data cannot tell, held-out windows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from crossbody.cases.arrays import Floats

CONVERGED, UNCONVERGED, STOPPED = "converged", "unconverged", "stopped"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """One identified parameter.

    Attributes:
        name, unit: which one.
        value: the estimate.
        std: its standard deviation; infinite where the data do not tell it.
        low, high: 95 % interval.
        start: where the search began.
        bounds: of the search.
        identifiable: whether the interval is finite, reaches no bound, and tells the value from 0
            where 0 is a bound.
        kept_low, kept_high: the interval if the parameters of `Fit.kept` have the values they
            were kept at; the same as low and high where none was kept.
        freedom: degrees of freedom that the standard deviation is known with.
    """

    name: str
    unit: str
    value: float
    std: float
    low: float
    high: float
    start: float
    bounds: tuple[float, float]
    identifiable: bool
    kept_low: float
    kept_high: float
    freedom: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """One parameter as the first and the second half of the fitted data tell it, to first order about the estimate.

    Attributes:
        name: which one.
        values: of the two halves.
        stds: their standard deviations.
        probability: of a difference at least as large if both halves have the same true value.
        agrees: whether that is not below 1 %, shared among all parameters.
    """

    name: str
    values: tuple[float, float]
    stds: tuple[float, float]
    probability: float
    agrees: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """An identification.

    Attributes:
        model: of what.
        estimates: one a free parameter.
        correlation (P, P): of the estimates; NaN where one has no finite interval.
        kept: parameters that the search kept at their start, because the data see a combination
            of them alone.
        unseen: those combinations, and those that are seen worse than the parameters are large, in words.
        agreement: of the halves of the data, one a parameter that both halves tell.
        parameters: every parameter of the model, the identified ones in place.
        delay: the identified one, s: beyond what the map says and what was given.
        fitted, held: numbers of the windows that were fitted and of those that were not.
        before, after: error -> (on fitted windows, on held ones) with the parameters at the start and the
            estimates: "rmse", and median and 90th percentile of the largest error at the end of a window.
        sensitivities: how derivatives were taken, and how far central differences at the solution
            are from them.
        covariance: how the intervals were found.
        warnings: what the data cannot tell, and what does not fit.
        evaluations: runs of all windows.
        outcome: "converged"; "unconverged" where the search ended before that, with intervals about where
            it ended; or "stopped" at the time limit: the best so far, without intervals and errors.
        message: of the search.
        left: of every fitted window its times (m,), s, and what the fit leaves in it (m, k): measured less
            predicted, from the start that was fitted. The intervals come from these.
        profile: parameter -> values about its estimate, and the cost at each over that at the estimate.
    """

    model: str
    estimates: tuple[Estimate, ...]
    correlation: Floats
    kept: tuple[str, ...]
    unseen: tuple[str, ...]
    agreement: tuple[Agreement, ...]
    parameters: Mapping[str, float | int | str | bool]
    delay: float
    fitted: tuple[int, ...]
    held: tuple[int, ...]
    before: Mapping[str, tuple[float, float]]
    after: Mapping[str, tuple[float, float]]
    sensitivities: str
    covariance: str
    warnings: tuple[str, ...]
    evaluations: int
    outcome: str
    message: str
    left: tuple[tuple[Floats, Floats], ...] = ()
    profile: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)

    @property
    def success(self) -> bool:
        """Whether the search converged and was judged; what the estimates are worth, `worse` tells."""
        return self.outcome == CONVERGED

    def __getitem__(self, name: str) -> Estimate:
        """One estimate by its name."""
        return next(e for e in self.estimates if e.name == name)

    @property
    def worse(self) -> float:
        """By how much the rmse on held-out windows grew, %; 0 if it did not, NaN if none were held out."""
        before, after = self.before["rmse"][1], self.after["rmse"][1]
        if math.isnan(before):
            return math.nan
        if not math.isfinite(after):
            return math.inf
        return max(0.0, 100.0 * (after / before - 1.0)) if before > 0.0 else (math.inf if after > 0.0 else 0.0)
