"""Observed order of convergence against the promised one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

FLOOR = 1e-13  # errors below this are rounding: no order is fitted there
EXACT = 1e-11
"""Where no error is above this there is nothing left to converge: closed forms, straight lines."""
NEAR = 10.0
"""Errors within this factor of the smallest are near its floor (rounding, another law)."""
SLACK = 0.5
"""How far below its promise an order may be seen: events at random places in a step scatter the errors."""
CONVERGES = 0.5
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
             "says": "exact at every setting" if all(x <= EXACT for x in errors) else says(best, promised)}
        )  # fmt: skip
    return pd.DataFrame(found, columns=COLUMNS)


def says(order: float, promised: float) -> str:
    """What an observed order says beside the promised one (NaN where nothing is promised)."""
    if math.isnan(order):
        return "too few points above rounding"
    if order <= CONVERGES:
        return "does not converge to the truth of the case"
    if order < promised - SLACK:
        return f"converges, but not with the promised order {promised:g}"
    return "converges"
