"""Observed order of convergence against the promised one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

FLOOR = 1e-13  # errors below this are rounding: no order is fitted there
EXACT = 1e-11
"""Where no error is above this there is nothing left to converge: closed forms, straight lines."""
NEAR = 10.0
"""Errors within this factor of the smallest are near its floor (rounding, another law)."""
SLACK = 0.5
"""How far below its promise an order may be seen: events at random places in a step scatter the errors."""
CONVERGES = 0.5
STAYS, GROWS, LAST, GROWN = 0.8, 0.6, 3, 1.1
"""Part of the largest of the last errors before the finest by which that is at least smaller where a run converges, and
where its errors have begun to grow again, by so many times the least."""
COLUMNS = ["case", "engine", "profile", "knob", "order", "promised", "says"]


def observed_order(settings: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log error against log setting where the error is finite and above rounding; NaN below three points."""
    x, y = np.asarray(settings, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    good = np.isfinite(x) & np.isfinite(y) & (y > FLOOR)
    if good.sum() < 3:
        return math.nan
    return float(np.polyfit(np.log(x[good]), np.log(y[good]), 1)[0])


def before_floor(settings: Sequence[float], errors: Sequence[float]) -> float:
    """The order where the error is still well above the smallest reached, NaN below three such points."""
    y = np.asarray(errors, dtype=np.float64)
    finite = y[np.isfinite(y)]
    if not len(finite):
        return math.nan
    above = np.where(y > NEAR * max(float(finite.min()), FLOOR), y, math.nan)
    return observed_order(settings, above.tolist())


def orders(rows: pd.DataFrame) -> pd.DataFrame:
    """One row an engine and profile on a case: observed and promised order, and what to think of it."""
    found = []
    for (case, engine, profile, knob), group in rows.groupby(["case", "engine", "profile", "knob"], sort=False):
        settings, errors = group["setting"].to_list(), group["error"].to_list()
        order, promised = observed_order(settings, errors), float(group["promised"].iloc[0])
        early = before_floor(settings, errors)
        best = order if math.isnan(early) else max(order, early)
        found.append(
            {"case": case, "engine": engine, "profile": profile, "knob": knob, "order": best, "promised": promised,
             "says": "exact at every setting" if all(x <= EXACT for x in errors)
             else stays(str(knob), settings, errors, _known(group)) or says(best, promised)}
        )  # fmt: skip
    return pd.DataFrame(found, columns=COLUMNS)


def stays(knob: str, settings: Sequence[float], errors: Sequence[float], known: float) -> str:
    """Say where errors that are no rounding, nor what the truth is known to, do not fall any further; else nothing.

    The least of them may be one at which two parts of an error cancel: it is no floor, the finest is near it.
    """
    x, y = _falling(settings, errors)
    if len(y) <= LAST or y[-1] <= max(EXACT, NEAR * known):
        return ""
    least, before = int(np.argmin(y)), float(y[-1 - LAST : -1].max())
    grows = len(y) - least > 2 and bool((np.diff(y[least:]) > 0.0).all())
    if y[-1] <= (GROWS if grows else STAYS) * before:
        return ""
    order = before_floor(settings, errors)
    above = "" if math.isnan(order) else f"of order {order:.2g} above a floor of its own, "
    end = "grows again" if grows and y[-1] > GROWN * y[least] else "does not fall"
    at = x[least] if end == "grows again" else x[-LAST]
    return f"does not converge to the truth of the case: {above}its error {end} below {knob} = {at:g}, near {y[-1]:.2g}"


def _falling(settings: Sequence[float], errors: Sequence[float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Settings (n,) and errors (n,) that are finite, the coarsest first."""
    pairs = sorted(((x, y) for x, y in zip(settings, errors, strict=True) if math.isfinite(y)), reverse=True)
    x, y = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
    return x, y


def _known(rows: pd.DataFrame) -> float:
    return float(rows["known_to"].max()) if "known_to" in rows else 0.0


def says(order: float, promised: float) -> str:
    """What an observed order says beside the promised one (NaN where nothing is promised)."""
    if math.isnan(order):
        return "fewer than three runs have a finite error above rounding"
    if order <= CONVERGES:
        return "does not converge to the truth of the case"
    if order < promised - SLACK:
        return f"converges, but not with the promised order {promised:g}"
    return "converges"
